"""Draws shapes and text into an array of pixels, with edges smooth at every size.

A pixel's share of a shape's colour follows from its distance to the shape's edge, so that shapes
stay crisp at any scale and move by fractions of a pixel. Only letters come from pygame.
"""

import math
import os
from collections.abc import Sequence
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import numpy as np

from upright.errors import UprightError, require_module

Point = tuple[float, float]


def load_pygame() -> ModuleType:
    """Return pygame, without its greeting and with its fonts ready, which is enough off screen.

    Raises
    ------
    UprightError
        If pygame-ce is missing.
    """
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    pygame: ModuleType = require_module("pygame", "drawing needs pygame-ce", "video")
    if not getattr(pygame, "IS_CE", False):
        raise UprightError(
            "drawing needs pygame-ce, but pygame is installed; uninstall pygame first"
        )
    pygame.font.init()
    return pygame


class Canvas:
    """Pixels that are drawn on.

    Parameters
    ----------
    pixels
        Shape (height, width, 3), uint8: red, green and blue, row by row from the top; changed.
    scale
        Number of pixels in a unit of all coordinates and sizes, which are measured from the top
        left corner.
    """

    def __init__(self, pixels: np.ndarray, scale: float) -> None:
        self.pixels, self.scale = pixels, scale

    def rod(self, colour: str, start: Point, end: Point, width: float, opacity: float = 1) -> None:
        """Draw a thick line with rounded ends."""
        (ax, ay), (bx, by) = self._fine(start, end)
        radius = self.scale * width / 2
        place = self._place(
            min(ax, bx) - radius, min(ay, by) - radius, max(ax, bx) + radius, max(ay, by) + radius
        )
        x, y = _centres(place)
        along_x, along_y = bx - ax, by - ay
        squared = along_x**2 + along_y**2 or 1.0
        part = np.clip(((x - ax) * along_x + (y - ay) * along_y) / squared, 0.0, 1.0)
        distance = np.hypot(x - ax - part * along_x, y - ay - part * along_y) - radius
        self._blend(colour, place, distance, opacity)

    def disc(self, colour: str, centre: Point, radius: float, opacity: float = 1) -> None:
        """Draw a filled circle."""
        self.rod(colour, centre, centre, 2 * radius, opacity)

    def box(
        self,
        colour: str,
        middle: Point,
        width: float,
        height: float,
        radius: float,
        opacity: float = 1,
    ) -> None:
        """Draw a filled rectangle with rounded corners."""
        ((middle_x, middle_y),) = self._fine(middle)
        half_x, half_y = self.scale * width / 2, self.scale * height / 2
        radius *= self.scale
        place = self._place(
            middle_x - half_x, middle_y - half_y, middle_x + half_x, middle_y + half_y
        )
        x, y = _centres(place)
        beside = np.abs(x - middle_x) - (half_x - radius)
        above = np.abs(y - middle_y) - (half_y - radius)
        outside = np.hypot(np.maximum(beside, 0), np.maximum(above, 0))
        distance = outside + np.minimum(np.maximum(beside, above), 0) - radius
        self._blend(colour, place, distance, opacity)

    def polygon(self, colour: str, corners: Sequence[Point], opacity: float = 1) -> None:
        """Draw a filled convex polygon, whose corners may be given in either direction."""
        fine = self._fine(*corners)
        xs, ys = [x for x, _ in fine], [y for _, y in fine]
        place = self._place(min(xs), min(ys), max(xs), max(ys))
        self._blend(colour, place, _beyond_edges(fine, *_centres(place)), opacity)

    def wedge(
        self, colour: str, apex: Point, radius: float, half_angle: float, opacity: float = 1
    ) -> None:
        """Draw a sector of a disc that opens upward, by less than a right angle to each side."""
        ((x0, y0),) = self._fine(apex)
        radius *= self.scale
        sine, cosine = math.sin(half_angle), math.cos(half_angle)
        place = self._place(x0 - radius * sine, y0 - radius, x0 + radius * sine, y0)
        x, y = _centres(place)
        sides = np.abs(x - x0) * cosine - (y0 - y) * sine
        distance = np.maximum(sides, np.hypot(x - x0, y - y0) - radius)
        self._blend(colour, place, distance, opacity)

    def columns(self, colour: str, left: float, bottom: float, tops: np.ndarray) -> None:
        """Draw columns of pixels side by side, each from its top [units] down to the bottom."""
        ((x, y),) = self._fine((left, bottom))
        tops = self.scale * tops
        first = round(x)
        place = self._place(first + 1, float(tops.min(initial=y)), first + len(tops) - 1, y)
        columns, rows = _centres(place)
        shown = tops[(columns[0] - 0.5).astype(int) - first]
        self._blend(colour, place, np.maximum(shown - rows, rows - y), 1)

    def write(
        self,
        text: str,
        place: Point,
        size: float,
        colour: str,
        *,
        align: float = 0,
        bold: bool = False,
    ) -> float:
        """Write a line of text around a height, and return where it ends.

        Parameters
        ----------
        text
            The line.
        place
            Its place; `align` of its width is to the left of it.
        size
            Height of the font.
        colour
            Colour of the letters.
        align
            0 to begin at `place`, 0.5 to centre there, 1 to end there.
        bold
            Whether the font is bold.

        Returns
        -------
        float
            The horizontal end of the text.
        """
        line = _line(text, round(self.scale * size), bold)
        height, width = line.shape
        left = round(self.scale * place[0] - align * width)
        top = round(self.scale * place[1] - height / 2)
        bounds = self._place(left + 1, top + 1, left + width - 1, top + height - 1)
        x0, y0, x1, y1 = bounds
        self._cover(colour, bounds, line[y0 - top : y1 - top, x0 - left : x1 - left])
        return float(left + width) / self.scale

    def width_of(self, text: str, size: float, *, bold: bool = False) -> float:
        """Return how wide a line of text is."""
        return float(_line(text, round(self.scale * size), bold).shape[1]) / self.scale

    def _fine(self, *points: Point) -> list[Point]:
        """Return points in pixels."""
        return [(self.scale * x, self.scale * y) for x, y in points]

    def _place(self, left: float, top: float, right: float, bottom: float) -> tuple[int, ...]:
        """Return the pixels that a shape may touch, within the picture: x and y, from and to."""
        height, width, _ = self.pixels.shape
        x0, x1 = max(0, math.floor(left) - 1), min(width, math.ceil(right) + 1)
        y0, y1 = max(0, math.floor(top) - 1), min(height, math.ceil(bottom) + 1)
        return min(x0, width), min(y0, height), max(x0, x1), max(y0, y1)

    def _blend(
        self, colour: str, place: tuple[int, ...], distance: np.ndarray, opacity: float
    ) -> None:
        """Colour the pixels by their distance from the edge, which is negative inside."""
        self._cover(colour, place, np.clip(0.5 - distance, 0.0, 1.0) * np.float32(opacity))

    def _cover(self, colour: str, place: tuple[int, ...], share: np.ndarray) -> None:
        x0, y0, x1, y1 = place
        below = self.pixels[y0:y1, x0:x1]
        if below.size:
            below[:] = below + (_rgb(colour) - below) * share[..., None] + np.float32(0.5)


def _centres(place: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return the centres of pixels: x, shape (1, width), and y, shape (height, 1), float32."""
    x0, y0, x1, y1 = place
    x = np.arange(x0, x1, dtype=np.float32) + np.float32(0.5)
    y = np.arange(y0, y1, dtype=np.float32) + np.float32(0.5)
    return x[None, :], y[:, None]


def _beyond_edges(corners: Sequence[Point], x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return how far points lie beyond the edges of a convex polygon; negative inside."""
    pairs = list(zip(corners, [*corners[1:], corners[0]], strict=True))
    area = sum(ax * by - bx * ay for (ax, ay), (bx, by) in pairs)
    turn = math.copysign(1.0, area)
    beyond = np.full((1, 1), -np.inf, np.float32)
    for (ax, ay), (bx, by) in pairs:
        length = math.dist((ax, ay), (bx, by)) or 1.0
        normal_x, normal_y = turn * (by - ay) / length, turn * (ax - bx) / length
        beyond = np.maximum(beyond, (x - ax) * normal_x + (y - ay) * normal_y)
    return beyond


@lru_cache(64)
def _rgb(colour: str) -> np.ndarray:
    """Return a colour such as "#1f6fb4" as three numbers."""
    return np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)], np.float32)


@lru_cache(256)
def _line(text: str, size: int, bold: bool) -> np.ndarray:
    """Return how much of each pixel a line of text covers, shape (height, width), float32."""
    letters = [_letter(letter, size, bold) for letter in text or " "]
    height = max(len(letter) for letter in letters)  # some reach further down
    return np.hstack([np.pad(each, ((0, height - len(each)), (0, 0))) for each in letters])


@lru_cache(1024)
def _letter(letter: str, size: int, bold: bool) -> np.ndarray:
    """Return how much of each pixel a letter covers, shape (height, width), float32, 0 to 1.

    Letters are cached, not the font: loading the font for each picture would take longer than the
    picture, and a font becomes invalid when another part of the program quits pygame.
    """
    pygame = load_pygame()
    font = pygame.font.Font(_font_file(bold), max(size, 4))
    alpha = pygame.surfarray.array_alpha(font.render(letter, True, "white"))
    return np.ascontiguousarray(alpha.T, np.float32) / np.float32(255)


def _font_file(bold: bool) -> str | None:
    """Return the file of matplotlib's own font, or None for pygame's if that is elsewhere."""
    place = find_spec("matplotlib")
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    file = Path(place.origin or "").parent / "mpl-data/fonts/ttf" / name if place else None
    return str(file) if file and file.is_file() else None
