"""Sweeps: how many trials learners need, and how often they succeed, over a number of the task."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedFormatter, FixedLocator, NullFormatter
from matplotlib.transforms import ScaledTranslation

from upright.errors import UprightError
from upright.reports.names import case_names, noise_name, task_name
from upright.reports.plots.style import (
    MUTED,
    WIDTH,
    Learned,
    Look,
    entitle,
    looks,
    number_axis,
    place_legend,
    shared_title,
    styled,
)
from upright.reports.statistics import Row, summarise
from upright.reports.sweeps import HOW, choose_swept, heading, sizes, swept
from upright.support.words import count

LOWEST, LEAST_TOP = 0.8, 10
"""Where the axis of trials begins, so that successes in the first trial are seen; and where it ends
if there are no more trials than this."""
APART = 2.5
"""Distance between the marks of two learners at the same value [points]."""
MARK: dict[str, Any] = {"marker": "o", "ms": 4.5, "mew": 1.2}
MARGIN = 0.06
"""Space beside the first and the last value, as a fraction of the axis."""
BESIDE = 0.8
"""Width of what stands beside a panel [inch]."""
DIGIT = 0.075
"""Width of a digit below an axis [inch]."""


class Place(NamedTuple):
    """What the tasks of a pair of panels have in common, in words."""

    noise: str
    others: str
    """The other numbers that tasks differ in."""
    rest: str
    """All else that is not usual."""


class Curve(NamedTuple):
    """What one learner did on tasks that differ in one number alone."""

    name: str
    look: Look
    values: list[float]
    """That number, ascending."""
    rows: list[Row]
    """The statistics of the runs at each."""


@styled()
def plot_sweep(learned: Learned, parameter: str | None = None) -> Figure:
    """Draw the mean trials and the success rate of studies over a parameter of the plant.

    Means are over the successful runs, as in tables: where runs failed, the mark is hollow, and the
    panel below shows how many. Lines at the marks are 95 % intervals. Tasks that differ in anything
    else have panels of their own.

    Parameters
    ----------
    learned
        Cases with the results of their runs.
    parameter
        Name of the parameter; it can be left out if the tasks differ in no other.

    Raises
    ------
    UprightError
        If the tasks do not differ in it.
    """
    name = choose_swept([case.spec for case, _ in learned], parameter)
    tasks = _curves(learned, name)
    if not tasks:
        raise UprightError(f"no task has runs at several values of {name}; {HOW}")
    every = [curve for curves in tasks.values() for curve in curves]
    highest = max([LEAST_TOP, *(row.ci95[1] for curve in every for row in curve.rows if row.ci95)])
    rests = {place.rest for place in tasks}
    columns = 2 if len(tasks) == 4 else min(len(tasks), 3)
    figure, pairs, empty = _panels(len(tasks), columns, heading(name))
    for (upper, lower), (place, curves) in zip(pairs, tasks.items(), strict=True):
        lines = [place.rest if len(rests) > 1 else "", place.others, _runs(curves)]
        entitle(upper, place.noise[0].upper() + place.noise[1:], lines, BESIDE * columns)
        _draw(upper, lower, curves)
        upper.set(yscale="log", ylim=(LOWEST, 1.25 * highest))
        number_axis(upper.yaxis, 1, highest, logarithmic=True)
        lower.set_ylim(-0.12, 1.12)
        lower.set_yticks([0, 0.5, 1], ["0", "50 %", "100 %"])
        _value_axis(upper, lower, curves, figure.get_figwidth() / columns - BESIDE)
    shared = rests.pop() if len(rests) == 1 else ""
    shared_title(figure, f"trials to success over {name}", shared)
    entries = _entries(every)
    place_legend(figure, empty, list(entries.values()), list(entries))
    return figure


def _curves(learned: Learned, name: str) -> dict[Place, list[Curve]]:
    """Return the curves of each task that has several values of a number."""
    cases = [case for case, _ in learned]
    names = swept(case.spec for case in cases)
    found: dict[Place, dict[str, Curve]] = {}
    for (case, results), label, look in zip(learned, case_names(cases), looks(cases), strict=True):
        numbers = sizes(case.spec)
        others = ", ".join(f"{other}={numbers[other]:g}" for other in names if other != name)
        place = Place(noise_name(case.spec.noise), others, task_name(case.spec, apart=names))
        curve = found.setdefault(place, {}).setdefault(label, Curve(label, look, [], []))
        curve.values.append(numbers[name])
        curve.rows.append(summarise(case, 0, results))
    return {
        place: [_ascending(curve) for curve in curves.values()]
        for place, curves in found.items()
        if len({value for curve in curves.values() for value in curve.values}) > 1
    }


def _ascending(curve: Curve) -> Curve:
    order = np.argsort(curve.values)
    return curve._replace(
        values=[curve.values[place] for place in order], rows=[curve.rows[place] for place in order]
    )


Pair = tuple[Axes, Axes]
"""Panels of one task: trials, and successes below."""


def _panels(tasks: int, columns: int, across: str) -> tuple[Figure, list[Pair], list[Axes]]:
    """Return a figure, the panels of each task, and the empty places after them."""
    rows = -(-tasks // columns)
    width, height = (6.4, 4.4) if columns == 1 else (WIDTH, 3.6)
    figure = Figure((width, height * rows + 0.3), layout="constrained")
    grid = figure.subplots(2 * rows, columns, squeeze=False, height_ratios=[3, 1] * rows)
    places = list(zip(grid[::2].ravel(), grid[1::2].ravel(), strict=True))
    for number, (upper, lower) in enumerate(places):
        upper.tick_params(labelbottom=False)
        lower.set_xlabel(across)
        if number % columns == 0:
            upper.set_ylabel("mean trials to success")
            lower.set_ylabel("success")
    empty = places[tasks:]
    for axes in (axes for pair in empty for axes in pair):
        axes.axis("off")
    return figure, places[:tasks], [upper for upper, _ in empty]


def _runs(curves: Iterable[Curve]) -> str:
    """Return how many runs each mark stands for."""
    runs = [row.runs for curve in curves for row in curve.rows]
    few = "" if min(runs) == max(runs) else f"{min(runs):,} to "
    return f"{few}{count(max(runs), 'run')} each, with 95 % intervals"


def _draw(upper: Axes, lower: Axes, curves: Sequence[Curve]) -> None:
    """Draw curves into the panels of a task."""
    for number, curve in enumerate(curves):
        aside = (number - (len(curves) - 1) / 2) * APART
        means = [np.nan if row.mean_trials is None else row.mean_trials for row in curve.rows]
        _marks(upper, curve, aside, means, [row.ci95 or (np.nan, np.nan) for row in curve.rows])
        rates = [row.success_rate for row in curve.rows]
        _marks(lower, curve, aside, rates, [row.success_ci95 for row in curve.rows])


def _marks(
    axes: Axes,
    curve: Curve,
    aside: float,
    heights: Sequence[float],
    intervals: Sequence[tuple[float, float]],
) -> None:
    """Draw marks with their intervals, so far aside [points], and a line through them."""
    figure = axes.figure
    assert isinstance(figure, Figure)
    moved = axes.transData + ScaledTranslation(aside / 72, 0, figure.dpi_scale_trans)
    look: dict[str, Any] = {"color": curve.look.colour, "transform": moved}
    lows, highs = zip(*intervals, strict=True)
    axes.vlines(curve.values, lows, highs, lw=1.2, alpha=0.7, **look)
    axes.plot(curve.values, heights, ls=curve.look.line, lw=1.5, label=curve.name, **look)
    for value, height, row in zip(curve.values, heights, curve.rows, strict=True):
        face = curve.look.colour if row.successes == row.runs else "white"
        axes.plot(value, height, zorder=3, mfc=face, **MARK, **look)


def _value_axis(upper: Axes, lower: Axes, curves: Sequence[Curve], width: float) -> None:
    """Mark the values below the panels of a task, which are so wide [inch].

    The axis is logarithmic if that spreads them more evenly.
    """
    values = sorted({value for curve in curves for value in curve.values})
    is_log = is_geometric(values)
    places = np.log(values) if is_log else np.array(values)
    margin = MARGIN * (places[-1] - places[0])
    ends = np.array([places[0] - margin, places[-1] + margin])
    labels = plain_numbers(values)
    labelled = far_apart((width * (places - ends[0]) / np.ptp(ends)).tolist(), labels)
    others = [value for number, value in enumerate(values) if number not in labelled]
    for axes in (upper, lower):
        axes.set(xscale="log" if is_log else "linear", xlim=np.exp(ends) if is_log else ends)
        axes.xaxis.set_major_locator(FixedLocator([values[number] for number in labelled]))
        axes.xaxis.set_major_formatter(FixedFormatter([labels[number] for number in labelled]))
        axes.xaxis.set_minor_locator(FixedLocator(others))
        axes.xaxis.set_minor_formatter(NullFormatter())


def is_geometric(values: Sequence[float]) -> bool:
    """Whether ascending numbers lie more evenly on a logarithmic scale than on a linear one.

    Examples
    --------
    >>> is_geometric([0.25, 0.5, 1, 2]), is_geometric([0.25, 0.5, 0.75])
    (True, False)
    """

    def unevenness(places: np.ndarray) -> float:
        gaps = np.diff(places)
        return float(gaps.std() / gaps.mean())

    if len(values) < 3 or values[0] <= 0:
        return False
    return unevenness(np.log(values)) < unevenness(np.array(values))


def plain_numbers(values: Sequence[float]) -> list[str]:
    """Return numbers as people write them, with no more digits than tell them apart.

    Examples
    --------
    >>> plain_numbers([0.000002, 0.336487, 2, 1500]), plain_numbers([0.3361, 0.3364])
    (['0.000002', '0.336', '2', '1,500'], ['0.3361', '0.3364'])
    """
    for digits in range(3, 17):
        texts = [_plain_number(value, digits) for value in values]
        if len(set(texts)) == len(values):
            break
    return texts


def _plain_number(value: float, digits: int) -> str:
    if value == round(value):
        return f"{value:,.0f}"
    return np.format_float_positional(value, precision=digits, fractional=False, trim="-")


def far_apart(places: Sequence[float], labels: Sequence[str]) -> list[int]:
    """Return which labels can stand at ascending places [inch] of an axis and not touch.

    Examples
    --------
    >>> far_apart([0.0, 0.1, 1.0], ["0.25", "0.26", "0.5"])
    [0, 2]
    """
    chosen = [0]
    for number in range(1, len(places)):
        half = DIGIT * (len(labels[chosen[-1]]) + len(labels[number])) / 2
        if places[number] - places[chosen[-1]] >= half + DIGIT:
            chosen.append(number)
    return chosen


def _entries(curves: Iterable[Curve]) -> dict[str, Line2D]:
    """Return the entries of the legend: each learner once, and what hollow marks mean."""
    entries: dict[str, Line2D] = {}
    for curve in curves:
        colour, line = curve.look
        entries.setdefault(curve.name, Line2D([], [], color=colour, ls=line, **MARK))
    if any(row.successes < row.runs for curve in curves for row in curve.rows):
        entries["some runs failed"] = Line2D([], [], ls="", mfc="white", color=MUTED, **MARK)
    return entries
