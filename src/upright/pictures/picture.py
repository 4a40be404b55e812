"""Draws the cart-pole in pixels, for windows, videos and the environments alike.

Positions and the pole's length are drawn to one scale, which fits the track and the upright pole
into the picture; the cart has a fixed size. A pale second pole shows what the agent measured. Noise
is too small to be visible there, so the gauge at the top shows both angles enlarged.
"""

import math
import os
from collections.abc import Sequence
from functools import lru_cache
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from upright.core.parameters import Parameters, State
from upright.errors import UprightError, require_module
from upright.pictures.scene import NOT_FINITE, Scene

if TYPE_CHECKING:
    import pygame

WIDTH, HEIGHT = 640, 352
"""Size of a picture [pixels]; multiples of 16, which video codecs prefer."""
PAPER, INK, FAINT = "#ffffff", "#3d4654", "#dde2e9"
LIMIT, LIMIT_FAINT = "#b02a5b", "#f3dbe4"
CART, POLE, GHOST, FORCE = "#1f6fb4", "#d1701f", "#f1c8a5", "#2a8f4f"

FINER = 2
"""Pictures are drawn this many times larger and then shrunk, which smooths all edges."""
TRACK_Y, HINGE_Y = 284, 246
"""Heights of the track's surface and of the hinge, measured from the top [pixels]."""
MARGIN, ROOM_ABOVE = 70, 66
"""Margins beside the position limits, and above the upright pole [pixels]."""
CART_WIDTH, CART_HEIGHT, WHEEL = 64, 26, 7
POLE_WIDTH = 8
ARROW = 46
"""Length of the arrow that shows the plant's usual push [pixels]."""
GAUGE_X, GAUGE_Y, GAUGE_HALF = 500, 28, 100
"""The gauge: its middle, its height, and half its length, which is the angle limit [pixels]."""

Point = tuple[float, float]


def picture(parameters: Parameters, scene: Scene) -> np.ndarray:
    """Return the picture of a scene. It needs no display.

    Parameters
    ----------
    parameters
        Parameters of the plant; its limits and the pole's length determine the scale.
    scene
        What is shown. A state that is not finite is replaced by a message. A cart that is outside
        the picture is drawn at its edge.

    Returns
    -------
    np.ndarray
        Shape (HEIGHT, WIDTH, 3), uint8: red, green and blue, row by row from the top.

    Raises
    ------
    UprightError
        If pygame-ce is missing.
    """
    pygame = _pygame()
    canvas = _Canvas(pygame, _backdrop(parameters).copy())
    canvas.write(scene.caption, (24, GAUGE_Y), 24, align=0)
    if scene.is_finite:
        _draw_world(canvas, parameters, scene)
        _draw_gauge(canvas, parameters, scene)
    else:
        canvas.write(NOT_FINITE, (WIDTH / 2, HEIGHT / 2), 28)
    shrunk = pygame.transform.smoothscale(canvas.surface, (WIDTH, HEIGHT))
    pixels = np.frombuffer(pygame.image.tobytes(shrunk, "RGB"), np.uint8)
    return pixels.reshape(HEIGHT, WIDTH, 3).copy()


def _pygame() -> ModuleType:
    """Return pygame, without its greeting and with its fonts ready, which is enough off screen."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    pygame: ModuleType = require_module("pygame", "drawing needs pygame-ce", "video")
    if not getattr(pygame, "IS_CE", False):
        raise UprightError(
            "drawing needs pygame-ce, but pygame is installed; uninstall pygame first"
        )
    pygame.font.init()
    return pygame


class _Canvas:
    """A surface FINER times larger than the picture, with coordinates in the picture's pixels."""

    def __init__(self, pygame: ModuleType, surface: "pygame.Surface") -> None:
        self.pygame, self.surface = pygame, surface

    def polygon(self, colour: str, points: Sequence[Point]) -> None:
        fine = [(FINER * x, FINER * y) for x, y in points]
        self.pygame.draw.polygon(self.surface, colour, fine)

    def disc(self, colour: str, centre: Point, radius: float) -> None:
        fine = (FINER * centre[0], FINER * centre[1])
        self.pygame.draw.circle(self.surface, colour, fine, FINER * radius)

    def box(self, colour: str, middle: Point, width: float, height: float, round_: float) -> None:
        left, top = middle[0] - width / 2, middle[1] - height / 2
        fine = [FINER * size for size in (left, top, width, height)]
        self.pygame.draw.rect(self.surface, colour, fine, border_radius=round(FINER * round_))

    def rod(self, colour: str, start: Point, end: Point, width: float) -> None:
        """Draw a thick line with rounded ends."""
        length = math.dist(start, end) or 1.0
        across = (end[1] - start[1]) * width / 2 / length, (start[0] - end[0]) * width / 2 / length
        corners = [
            (point[0] + side * across[0], point[1] + side * across[1])
            for point, side in ((start, 1), (end, 1), (end, -1), (start, -1))
        ]
        self.polygon(colour, corners)
        self.disc(colour, start, width / 2)
        self.disc(colour, end, width / 2)

    def write(self, text: str, place: Point, size: int, align: float = 0.5) -> None:
        """Write a line of text with the fraction `align` of its width to the left of `place`."""
        letters = [_letter(letter, FINER * size) for letter in text]
        x = FINER * place[0] - align * sum(letter.get_width() for letter in letters)
        for letter in letters:
            self.surface.blit(letter, (x, FINER * place[1] - letter.get_height() / 2))
            x += letter.get_width()


@lru_cache(256)
def _letter(letter: str, size: int) -> "pygame.Surface":
    """Return a letter in pygame's own font.

    Letters are cached, not the font: loading the font for each picture would double the time that a
    picture takes, and a font becomes invalid when another part of the program quits pygame.
    """
    return _pygame().font.Font(None, size).render(letter, True, INK)  # type: ignore[no-any-return]


def _scale(parameters: Parameters) -> float:
    """Return the scale [pixels/m]."""
    return min(
        (WIDTH / 2 - MARGIN) / parameters.position_limit,
        (HINGE_Y - ROOM_ABOVE) / (2 * parameters.half_length),
    )


@lru_cache(16)
def _backdrop(parameters: Parameters) -> "pygame.Surface":
    """Return what never moves: the track with its limits and metres, and the gauge's scale."""
    pygame = _pygame()
    canvas = _Canvas(pygame, pygame.Surface((FINER * WIDTH, FINER * HEIGHT), depth=32))
    canvas.surface.fill(PAPER)
    scale, limit = _scale(parameters), parameters.position_limit
    canvas.rod(FAINT, (0, TRACK_Y + 2), (WIDTH, TRACK_Y + 2), 4)
    left, right = WIDTH / 2 - limit * scale, WIDTH / 2 + limit * scale
    canvas.rod(INK, (left, TRACK_Y + 2), (right, TRACK_Y + 2), 4)
    for x in (left, right):
        canvas.rod(LIMIT, (x, TRACK_Y - 12), (x, TRACK_Y + 2), 5)
    step = _tick(60 / scale)
    count = math.floor((WIDTH / 2 - 10) / scale / step)
    for number in range(-count, count + 1):
        x = WIDTH / 2 + number * step * scale
        canvas.rod(INK, (x, TRACK_Y + 10), (x, TRACK_Y + 16), 1.5)
        unit = " m" if number == 0 else ""
        canvas.write(f"{number * step:g}{unit}".replace("-", "−"), (x, TRACK_Y + 30), 19)
    _draw_gauge_scale(canvas, parameters)
    return canvas.surface


def _tick(at_least: float) -> float:
    """Return the smallest of …, 0.1, 0.2, 0.5, 1, 2, 5, 10, … that is at least this number."""
    power = 10.0 ** math.floor(math.log10(at_least))
    return next(power * factor for factor in (1, 2, 5, 10) if power * factor >= at_least)


def _draw_gauge_scale(canvas: _Canvas, parameters: Parameters) -> None:
    ends = (GAUGE_X - GAUGE_HALF, GAUGE_Y), (GAUGE_X + GAUGE_HALF, GAUGE_Y)
    canvas.rod(FAINT, *ends, 4)
    degrees = math.degrees(parameters.angle_limit)
    for part, colour in ((-1, LIMIT), (0, INK), (1, LIMIT)):
        x = GAUGE_X + part * GAUGE_HALF
        canvas.rod(colour, (x, GAUGE_Y - 4), (x, GAUGE_Y + 4), 2)
        canvas.write(f"{part * degrees:.3g}°".replace("-", "−"), (x, GAUGE_Y + 24), 19)


def _draw_gauge(canvas: _Canvas, parameters: Parameters, scene: Scene) -> None:
    """Mark the true angle above the scale, and the one that the agent measured below it."""
    for state, colour, rise in ((scene.state, POLE, -14), (scene.mismeasured, GHOST, 14)):
        if state is not None:
            part = state.theta / parameters.angle_limit
            x = GAUGE_X + GAUGE_HALF * max(-1.15, min(part, 1.15))
            base = GAUGE_Y + rise
            canvas.polygon(colour, [(x, GAUGE_Y), (x - 6, base), (x + 6, base)])


def _draw_world(canvas: _Canvas, parameters: Parameters, scene: Scene) -> None:
    """Draw the angle limits, the cart, the measured pole, the true pole, and the push."""
    hinge = _hinge(parameters, scene.state)
    for side in (-1, 1):
        end = _tip(parameters, hinge, side * parameters.angle_limit)
        canvas.rod(LIMIT_FAINT, hinge, end, 2)
    x = hinge[0]
    for wheel in (x - 0.3 * CART_WIDTH, x + 0.3 * CART_WIDTH):
        canvas.disc(INK, (wheel, TRACK_Y - WHEEL), WHEEL)
        canvas.disc(FAINT, (wheel, TRACK_Y - WHEEL), WHEEL / 3)
    middle = HINGE_Y + CART_HEIGHT / 2 - 4
    canvas.box(CART, (x, middle), CART_WIDTH, CART_HEIGHT, 6)
    if scene.mismeasured is not None:
        measured = _hinge(parameters, scene.mismeasured)
        tip = _tip(parameters, measured, scene.mismeasured.theta)
        canvas.rod(GHOST, measured, tip, POLE_WIDTH)
    canvas.rod(POLE, hinge, _tip(parameters, hinge, scene.state.theta), POLE_WIDTH)
    canvas.disc(INK, hinge, 0.7 * POLE_WIDTH)
    canvas.disc(PAPER, hinge, 0.25 * POLE_WIDTH)
    _draw_force(canvas, (x, middle), scene.force / parameters.force)


def _hinge(parameters: Parameters, state: State) -> Point:
    x = WIDTH / 2 + state.x * _scale(parameters)
    return max(0.0, min(x, float(WIDTH))), HINGE_Y


def _tip(parameters: Parameters, hinge: Point, angle: float) -> Point:
    """Return the upper end of a pole that leans by `angle` [rad]."""
    length = 2 * parameters.half_length * _scale(parameters)
    return hinge[0] + length * math.sin(angle), hinge[1] - length * math.cos(angle)


def _draw_force(canvas: _Canvas, middle: Point, part: float) -> None:
    """Draw an arrow from the cart's side; `part` is the force in units of the usual push."""
    if part == 0.0:
        return
    side, length = math.copysign(1.0, part), ARROW * min(abs(part), 2.0)
    start = middle[0] + side * (CART_WIDTH / 2 + 6)
    neck, y = start + side * (length - 10), middle[1]
    if length > 10:
        canvas.rod(FORCE, (start, y), (neck, y), 4)
    canvas.polygon(FORCE, [(neck, y - 7), (neck, y + 7), (neck + side * 12, y)])
