"""Draws the cart-pole in characters."""

import math

from upright.core.parameters import Parameters
from upright.pictures.scene import NOT_FINITE, Scene
from upright.support.terminal import printable

COLUMNS, ROWS = 61, 4
"""Width of the track and height of the pole in text [characters]."""


def text_picture(parameters: Parameters, scene: Scene) -> str:
    """Return the picture of a scene in a few lines of text, with the numbers below it.

    The pole's lean is exaggerated: at the angle limit the pole is a diagonal. Signs that the output
    of this process cannot show are replaced.
    """
    if not scene.is_finite:
        return f"{scene.caption}\n{NOT_FINITE}"
    state = scene.state
    column = round((COLUMNS - 1) / 2 * (1 + _within_one(state.x / parameters.position_limit)))
    lean = _within_one(state.theta / parameters.angle_limit)
    mark = "/" if lean > 0.25 else "\\" if lean < -0.25 else "|"
    pole = [" " * (ROWS + column + round(row * lean)) + mark for row in range(ROWS, 0, -1)]
    track = " " * ROWS + "─" * column + "█" + "─" * (COLUMNS - 1 - column)
    limit = f"{parameters.position_limit:g} m"
    ends = " " * ROWS + f"-{limit}{'0':^{COLUMNS - 2 * len(limit) - 1}}{limit}"
    numbers = (
        f"cart {state.x:+.2f} m, {state.x_dot:+.2f} m/s; "
        f"pole {math.degrees(state.theta):+.1f}°, {math.degrees(state.theta_dot):+.0f}°/s; "
        f"force {scene.force:+.1f} N"
    )
    return printable("\n".join([scene.caption, *pole, track, ends, numbers]))


def _within_one(value: float) -> float:
    return max(-1.0, min(value, 1.0))
