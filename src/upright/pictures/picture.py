"""Draws the cart-pole in pixels, for windows, videos and the environments alike.

Positions and the pole's length are drawn to one scale, which fits the track and the upright pole
into the picture; the cart has a fixed size. A pale second pole shows what the agent measured. Noise
is too small to be visible there, so the gauge at the top shows both angles enlarged.

A picture is laid out in units, which are pixels at the usual size. At other sizes the whole drawing
is scaled, its fonts and lines included; where the proportions differ, the track gets longer or the
room above the pole higher.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from upright.core.parameters import Parameters, State
from upright.pictures.canvas import Canvas, Point, load_pygame
from upright.pictures.chart import CHART_ROOM, draw_chart
from upright.pictures.colours import (
    CART,
    FAINT,
    FALLEN,
    FORCE,
    GHOST,
    INK,
    LIMIT,
    LIMIT_FAINT,
    MUTED,
    PAPER,
    POLE,
    TRACK,
)
from upright.pictures.scene import NOT_FINITE, Scene
from upright.pictures.size import SIZE, Size

WIDTH, HEIGHT = SIZE
"""The usual size of a picture [pixels]."""

MARGIN, ROOM_ABOVE, ROOM_BELOW = 70, 66, 68
"""Room beside the position limits, above the upright pole, and below the track."""
EDGE = 24
"""Room beside text."""
TITLE_Y, DETAIL_Y, NOTE_Y = 26, 47, 13
"""Heights of the title and the line below it, from the top; of the last line, from the bottom."""
HINGE_RISE = 38
"""Height of the hinge above the track."""
CART_WIDTH, CART_HEIGHT, WHEEL = 64, 26, 7
POLE_WIDTH = 8
ARROW = 46
"""Length of the arrow that shows the plant's usual push."""
GAUGE_RIGHT, GAUGE_Y, GAUGE_HALF = 140, 28, 100
"""The gauge: its middle, from the right, its height, and half its length, the angle limit."""


class Layout(NamedTuple):
    """Where things are in a picture [units]."""

    parameters: Parameters
    size: Size
    has_chart: bool
    """Whether there is a strip chart at the bottom."""

    @property
    def unit(self) -> float:
        """Size of a unit [pixels]."""
        return min(self.size.width / WIDTH, self.size.height / HEIGHT)

    @property
    def width(self) -> float:
        """Width of the picture."""
        return self.size.width / self.unit

    @property
    def height(self) -> float:
        """Height of the picture."""
        return self.size.height / self.unit

    @property
    def track_y(self) -> float:
        """Height of the track's surface, from the top."""
        return self.height - ROOM_BELOW - (CHART_ROOM if self.has_chart else 0)

    @property
    def hinge_y(self) -> float:
        """Height of the hinge, from the top."""
        return self.track_y - HINGE_RISE

    @property
    def gauge_x(self) -> float:
        """Middle of the gauge."""
        return self.width - GAUGE_RIGHT

    @property
    def metre(self) -> float:
        """Length of a metre."""
        return min(
            (self.width / 2 - MARGIN) / self.parameters.position_limit,
            (self.hinge_y - ROOM_ABOVE) / (2 * self.parameters.half_length),
        )

    @property
    def pole(self) -> float:
        """Length of the pole."""
        return 2 * self.parameters.half_length * self.metre

    def hinge(self, state: State) -> Point:
        """Return the place of the hinge; that of a cart beyond the picture is at its edge."""
        x = self.width / 2 + state.x * self.metre
        return max(0.0, min(x, self.width)), self.hinge_y

    def tip(self, hinge: Point, angle: float) -> Point:
        """Return the upper end of a pole that leans by `angle` [rad]."""
        return hinge[0] + self.pole * math.sin(angle), hinge[1] - self.pole * math.cos(angle)


def picture(parameters: Parameters, scene: Scene, size: Size = SIZE) -> np.ndarray:
    """Return the picture of a scene. It needs no display.

    Parameters
    ----------
    parameters
        Parameters of the plant; its limits and the pole's length determine the scale.
    scene
        What is shown. A state that is not finite is replaced by a message. A cart that is outside
        the picture is drawn at its edge.
    size
        Size of the picture.

    Returns
    -------
    np.ndarray
        Shape (height, width, 3), uint8: red, green and blue, row by row from the top.

    Raises
    ------
    UprightError
        If pygame-ce is missing.
    """
    load_pygame()  # raises if it is missing, even if no new letter is needed
    layout = Layout(parameters, size, scene.history is not None)
    canvas = Canvas(_backdrop(layout).copy(), layout.unit)
    if scene.history is not None:
        draw_chart(canvas, scene.history, layout.width, layout.height, scene.ending)
    if scene.is_finite:
        _draw_world(canvas, layout, scene)
        _draw_gauge(canvas, layout, scene)
    else:
        middle = layout.width / 2, layout.hinge_y - layout.pole / 2
        canvas.write(NOT_FINITE, middle, 18, INK, align=0.5)
    _write_lines(canvas, layout, scene)
    return canvas.pixels


@lru_cache(8)
def _backdrop(layout: Layout) -> np.ndarray:
    """Return what never moves: the track with its limits and metres, and the gauge's scale."""
    pixels = np.empty((layout.size.height, layout.size.width, 3), np.uint8)
    pixels[:] = [int(PAPER[i : i + 2], 16) for i in (1, 3, 5)]
    canvas = Canvas(pixels, layout.unit)
    middle, limit = layout.width / 2, layout.parameters.position_limit * layout.metre
    y = layout.track_y + 2
    canvas.rod(FAINT, (0, y), (layout.width, y), 4)
    canvas.rod(TRACK, (middle - limit, y), (middle + limit, y), 4)
    for x in (middle - limit, middle + limit):
        canvas.rod(LIMIT, (x, y - 16), (x, y), 5)
    step = _tick(60 / layout.metre)
    count = math.floor((middle - 10) / layout.metre / step)
    for number in range(-count, count + 1):
        x = middle + number * step * layout.metre
        canvas.rod(MUTED, (x, y + 7), (x, y + 11), 1.2)
        label = f"{number * step:g}".replace("-", "−") + (" m" if number == 0 else "")
        canvas.write(label, (x, y + 21), 11, MUTED, align=0.5)
    _draw_gauge_scale(canvas, layout)
    return pixels


def _tick(at_least: float) -> float:
    """Return the smallest of …, 0.1, 0.2, 0.5, 1, 2, 5, 10, … that is at least this number."""
    power = 10.0 ** math.floor(math.log10(at_least))
    return next(power * factor for factor in (1, 2, 5, 10) if power * factor >= at_least)


def _draw_gauge_scale(canvas: Canvas, layout: Layout) -> None:
    middle = layout.gauge_x
    canvas.rod(FAINT, (middle - GAUGE_HALF, GAUGE_Y), (middle + GAUGE_HALF, GAUGE_Y), 4)
    degrees = math.degrees(layout.parameters.angle_limit)
    for part, colour in ((-1, LIMIT), (0, MUTED), (1, LIMIT)):
        x = middle + part * GAUGE_HALF
        canvas.rod(colour, (x, GAUGE_Y - 4), (x, GAUGE_Y + 4), 2)
        label = f"{part * degrees:.3g}°".replace("-", "−")
        canvas.write(label, (x, GAUGE_Y + 20), 11, MUTED, align=0.5)


def _draw_gauge(canvas: Canvas, layout: Layout, scene: Scene) -> None:
    """Mark the true angle above the scale, and the one that the agent measured below it."""
    for state, colour, rise in ((scene.state, POLE, -14), (scene.mismeasured, GHOST, 14)):
        if state is not None:
            part = state.theta / layout.parameters.angle_limit
            x = layout.gauge_x + GAUGE_HALF * max(-1.15, min(part, 1.15))
            base = GAUGE_Y + rise
            canvas.polygon(colour, [(x, GAUGE_Y), (x - 6, base), (x + 6, base)])


def _draw_world(canvas: Canvas, layout: Layout, scene: Scene) -> None:
    """Draw the last fall, the angle limits, the cart, the measured pole, the pole, and the push."""
    hinge = layout.hinge(scene.state)
    _draw_wedge(canvas, layout, hinge)
    if scene.last_fall is not None and all(map(math.isfinite, scene.last_fall)):
        _draw_last_fall(canvas, layout, scene.last_fall)
    x = hinge[0]
    for wheel in (x - 0.3 * CART_WIDTH, x + 0.3 * CART_WIDTH):
        canvas.disc(INK, (wheel, layout.track_y - WHEEL), WHEEL)
        canvas.disc(FAINT, (wheel, layout.track_y - WHEEL), WHEEL / 3)
    middle = x, layout.hinge_y + CART_HEIGHT / 2 - 4
    canvas.box(CART, middle, CART_WIDTH, CART_HEIGHT, 6)
    if scene.mismeasured is not None:
        measured = layout.hinge(scene.mismeasured)
        tip = layout.tip(measured, scene.mismeasured.theta)
        canvas.rod(GHOST, measured, tip, POLE_WIDTH)
    canvas.rod(POLE, hinge, layout.tip(hinge, scene.state.theta), POLE_WIDTH)
    canvas.disc(INK, hinge, 0.7 * POLE_WIDTH)
    canvas.disc(PAPER, hinge, 0.25 * POLE_WIDTH)
    _draw_force(canvas, middle, scene.force / abs(layout.parameters.force))


def _draw_wedge(canvas: Canvas, layout: Layout, hinge: Point) -> None:
    """Draw the wedge between the angle limits, in which the pole has to stay."""
    limit, reach = layout.parameters.angle_limit, layout.pole + 8
    if limit < math.pi / 2:
        canvas.wedge(LIMIT_FAINT, hinge, reach, limit, 0.5)
    for side in (-1, 1):
        end = (
            hinge[0] + side * reach * math.sin(limit),
            hinge[1] - reach * math.cos(limit),
        )
        canvas.rod(LIMIT_FAINT, hinge, end, 1.6)


def _draw_last_fall(canvas: Canvas, layout: Layout, state: State) -> None:
    hinge = layout.hinge(state)
    middle = hinge[0], layout.hinge_y + CART_HEIGHT / 2 - 4
    canvas.box(FALLEN, middle, CART_WIDTH, CART_HEIGHT, 6)
    for wheel in (hinge[0] - 0.3 * CART_WIDTH, hinge[0] + 0.3 * CART_WIDTH):
        canvas.disc(FALLEN, (wheel, layout.track_y - WHEEL), WHEEL)
    canvas.rod(FALLEN, hinge, layout.tip(hinge, state.theta), POLE_WIDTH)


def _draw_force(canvas: Canvas, middle: Point, part: float) -> None:
    """Draw an arrow from the cart's side; `part` is the force in units of the usual push."""
    if part == 0.0:
        return
    side, length = math.copysign(1.0, part), ARROW * min(abs(part), 2.0)
    start = middle[0] + side * (CART_WIDTH / 2 + 6)
    neck, y = start + side * (length - 10), middle[1]
    if length > 10:
        canvas.rod(FORCE, (start, y), (neck, y), 4)
    canvas.polygon(FORCE, [(neck, y - 7), (neck, y + 7), (neck + side * 12, y)])


def _write_lines(canvas: Canvas, layout: Layout, scene: Scene) -> None:
    """Write the title, what is below it, and the line at the bottom."""
    room = layout.gauge_x - GAUGE_HALF - 2 * EDGE
    title = _shortened(canvas, scene.caption, 16, room)
    canvas.write(title, (EDGE, TITLE_Y), 16, INK, bold=True)
    end = canvas.write(scene.detail, (EDGE, DETAIL_Y), 12, MUTED)
    if scene.ending:
        colour = FORCE if scene.ending == "balanced" else LIMIT
        start = end + 10 if scene.detail else EDGE
        width = canvas.width_of(scene.ending, 11, bold=True) + 14
        canvas.box(colour, (start + width / 2, DETAIL_Y), width, 17, 8.5)
        middle = start + width / 2, DETAIL_Y
        canvas.write(scene.ending, middle, 11, PAPER, align=0.5, bold=True)
    y = layout.height - NOTE_Y
    canvas.write(scene.note, (EDGE, y), 11, INK, bold=True)
    canvas.write(scene.hint, (layout.width - EDGE, y), 11, MUTED, align=1)


def _shortened(canvas: Canvas, text: str, size: float, room: float) -> str:
    """Return a bold line of text, with its beginning left out if there is no room for all of it.

    The end of a title is what changes: the number of the trial.
    """
    while len(text) > 2 and canvas.width_of(text, size, bold=True) > room:
        text = f"…{text[2:]}" if text.startswith("…") else f"…{text[1:]}"
    return text
