"""Draws the chart below the cart-pole: a bar for each trial so far, on a logarithmic scale."""

import math
from collections.abc import Callable

import numpy as np

from upright.pictures.canvas import Canvas
from upright.pictures.colours import FAINT, FORCE, LIMIT, MUTED, PAST, POLE
from upright.pictures.scene import History

CHART_ROOM = 52
"""Height that the chart takes."""
LEFT, RIGHT, BOTTOM, BARS = 24, 66, 28, 42
"""Its room on the left, right (for labels) and below, and the height of the tallest bar."""
WIDEST, NARROWEST = 16.0, 2.0
"""Widest and narrowest bar, with its gap."""


def draw_chart(canvas: Canvas, history: History, width: float, height: float, ending: str) -> None:
    """Draw the trials so far at the bottom of a picture.

    If there are too many trials, each bar is the longest of several in a row.

    Parameters
    ----------
    canvas
        The picture.
    history
        The trials.
    width, height
        Size of the picture [units].
    ending
        How the last trial ended; empty while it goes on.
    """
    bottom, right = height - BOTTOM, width - RIGHT
    top_steps = max(history.success, 10)

    def level(steps: float) -> float:
        return bottom - BARS * math.log1p(steps) / math.log1p(top_steps)

    _draw_levels(canvas, right, top_steps, level)
    lengths = np.append(history.lengths, history.present) if history.present else history.lengths
    if not len(lengths):
        return
    bars = _grouped(lengths, int((right - LEFT) / NARROWEST))
    slot = min(WIDEST, (right - LEFT) / len(bars))
    tops = bottom - BARS * np.log1p(bars) / math.log1p(top_steps)
    past = len(bars) - (history.present > 0)
    _draw_bars(canvas, PAST, LEFT, bottom, tops[:past], slot)
    colour = {"balanced": FORCE, "fallen": LIMIT}.get(ending, POLE)
    _draw_bars(canvas, colour, LEFT + slot * past, bottom, tops[past:], slot)


def _draw_levels(
    canvas: Canvas, right: float, top_steps: int, level: Callable[[float], float]
) -> None:
    """Draw a line at each power of ten and at the longest trial, some with their number."""
    canvas.rod(FAINT, (LEFT, level(0)), (right, level(0)), 1)
    powers = [10**power for power in range(1, 10) if 10**power < top_steps / 2]
    for number in powers:
        canvas.rod(FAINT, (LEFT, level(number)), (right, level(number)), 0.7)
    canvas.rod(FAINT, (LEFT, level(top_steps)), (right, level(top_steps)), 0.7)
    labelled = {top_steps: f"{top_steps:,}", 0: "steps, log"}
    for number in reversed(powers):
        if all(abs(level(number) - level(other)) >= 11 for other in labelled):
            labelled[number] = f"{number:,}"
    for number, label in labelled.items():
        canvas.write(label, (right + 6, level(number)), 9, MUTED)


def _draw_bars(
    canvas: Canvas, colour: str, left: float, bottom: float, tops: np.ndarray, slot: float
) -> None:
    """Draw bars side by side, with gaps where there is room for them."""
    if not len(tops):
        return
    pixels = round(canvas.scale * slot * len(tops))
    place = (np.arange(pixels) + 0.5) / canvas.scale / slot
    bars = np.minimum(place.astype(int), len(tops) - 1)
    in_gap = (place - bars > 0.75) if slot >= 4 else np.zeros(pixels, bool)
    canvas.columns(colour, left, bottom, np.where(in_gap, bottom + 1, tops[bars]))


def _grouped(lengths: np.ndarray, most: int) -> np.ndarray:
    """Return the longest trial of each group of as many in a row as leave `most` bars at most."""
    size = -(-len(lengths) // most)
    return np.maximum.reduceat(lengths, np.arange(0, len(lengths), size))
