"""Learning curves: how long each trial of a run, or of the runs of a study, lasted."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from upright.core.trials import Result
from upright.reports.names import case_names, noise_name, shared_task_name, task_name
from upright.reports.plots.style import (
    AGENT_COLOURS,
    CUSTOM_COLOURS,
    INK,
    MUTED,
    Learned,
    Look,
    entitle,
    looks,
    number_axis,
    panels,
    place_legend,
    shade,
    shared_title,
    styled,
    whole,
)
from upright.studies.case import Case
from upright.support.words import count

FEW_TRIALS, MANY_TRIALS = 3, 40
"""A run of at most FEW_TRIALS is drawn as bars, one of more than MANY_TRIALS with its median."""
FEW_RUNS = 5
"""Up to this many runs of a study are drawn one by one, too."""
WIDE = 50
"""Studies with longer runs have a logarithmic axis of trials."""
POINTS = 1_000
"""Largest number of points of a running median."""
BLOCK = 2**22
"""Numbers that quartiles are taken of at once: 32 MB."""
RUG = 1.6
"""Height of the marks of successes, in multiples of the steps of a success."""
SUCCESS: dict[str, Any] = {"color": MUTED, "linestyle": (0, (4, 2)), "lw": 1, "zorder": 1.5}
"""Line of the steps of a success."""


@styled()
def plot_curve(
    lengths: np.ndarray, steps: int, title: str, subtitle: str = "", agent: str = ""
) -> Figure:
    """Draw the learning curve of one run: how long each trial lasted.

    Up to three trials are bars. Of more than 40, each is a pale point, and a line is their running
    median.

    Parameters
    ----------
    lengths
        Steps of each trial, in order.
    steps
        N: steps of a success.
    title, subtitle
        Lines above the picture.
    agent
        Name of the agent, which has its colour; custom ones, and none, have one colour.
    """
    colour = AGENT_COLOURS.get(agent, CUSTOM_COLOURS[0])
    figure = Figure((6.4, 3.9), layout="constrained")
    axes = figure.subplots()
    trials = len(lengths)
    outcome = "" if lengths[-1] >= steps else f"no success in {count(trials, 'trial')}"
    entitle(axes, title, ["; ".join(filter(None, (subtitle, outcome)))])
    axes.set(xlabel="trial", ylabel="steps balanced")
    margin = 0.5 if trials <= MANY_TRIALS else 0.02 * trials
    axes.set_xlim(1 - margin, trials + margin)
    number_axis(axes.xaxis, 1, trials, logarithmic=False)
    axes.grid(visible=False, axis="x")
    if trials <= FEW_TRIALS:
        _draw_bars(axes, lengths, steps, colour)
    else:
        _steps_axis(axes, int(lengths.min()), steps)
        _draw_run(axes, lengths, steps, colour)
    return figure


def running_median(lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Return the running median of a run's trials.

    Returns
    -------
    tuple
        Numbers of trials, counted from 1; the median around each; and how many trials it is of: a
        twentieth of the run, and fewer towards its ends, because it is centred.
    """
    last = len(lengths) - 1
    half = len(lengths) // 40
    centres = np.unique(np.linspace(0, last, min(last + 1, POINTS)).round().astype(int))
    reach = np.minimum(half, np.minimum(centres, last - centres))
    ends = zip(centres - reach, centres + reach + 1, strict=True)
    medians = np.array([np.median(lengths[low:high]) for low, high in ends])
    return centres + 1, medians, 2 * half + 1


def _draw_bars(axes: Axes, lengths: np.ndarray, steps: int, colour: str) -> None:
    """Draw a few trials as bars, which start at zero and hence need a linear axis."""
    colours = [colour if length >= steps else shade(colour, 0.5) for length in lengths]
    bars = axes.bar(np.arange(1, len(lengths) + 1), lengths, width=0.3, color=colours)
    axes.bar_label(bars, [whole(length) for length in lengths], padding=2, fontsize=9, zorder=4)
    axes.set(xlim=(0, len(lengths) + 1), ylim=(0, 1.2 * steps))
    axes.yaxis.set_major_locator(MaxNLocator(6, integer=True, steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_formatter(FuncFormatter(whole))
    _mark_success(axes, steps)


def _draw_run(axes: Axes, lengths: np.ndarray, steps: int, colour: str) -> None:
    trials = np.arange(1, len(lengths) + 1)
    if len(lengths) <= MANY_TRIALS:
        axes.plot(trials, lengths, "o-", color=colour, markersize=4, label="trial")
    else:
        raster = len(lengths) > POINTS  # so many points would make a vector file huge
        pale = shade(colour, 0.6)
        axes.plot(trials, lengths, ".", color=pale, ms=3, rasterized=raster, label="trial")
        centres, medians, window = running_median(lengths)
        axes.plot(centres, medians, color=colour, label=f"median of {window:,} trials")
        axes.figure.legend(loc="outside lower center", ncols=2)
    succeeded = lengths[-1] >= steps
    mark, size = ("*", 13) if succeeded else ("X", 8)
    axes.plot(trials[-1], lengths[-1], mark, color=colour if succeeded else INK, ms=size, zorder=4)
    _mark_success(axes, steps)


def _mark_success(axes: Axes, steps: int) -> None:
    """Draw the number of steps that a trial must last."""
    axes.axhline(steps, **SUCCESS)
    place = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
    text = f"success: {count(steps, 'step')}"
    axes.annotate(text, (0.01, steps), (0, 3), **place, color=MUTED, fontsize=8.5)  # type: ignore[arg-type]


def _steps_axis(axes: Axes, shortest: int, steps: int) -> None:
    low = max(0.8, min(shortest / 1.6, steps / 100))
    axes.set(yscale="log", ylim=(low, 2.4 * steps))
    number_axis(axes.yaxis, low, steps, logarithmic=True)


@styled()
def plot_curves(learned: Learned) -> Figure:
    """Draw the learning curves of studies: the median run, and the middle half of the runs.

    A run that has succeeded counts with N steps in all later trials; it is marked by a tick where
    it succeeded. All panels have the same axes.
    """
    cases = [case for case, _ in learned]
    runs = [result for _, results in learned for result in results]
    longest = max(result.trials for result in runs)
    shortest = min(int(result.lengths.min()) for result in runs)
    figure, grid, empty = panels(len(cases), 2.5, "trial", "steps balanced")
    noises = {noise_name(case.spec.noise) for case in cases}
    shared = shared_task_name(case.spec for case in cases)
    for axes, (case, results), name, look in zip(
        grid, learned, case_names(cases), looks(cases), strict=True
    ):
        title = name if len(noises) == 1 else f"{name}, {noise_name(case.spec.noise)}"
        failed = sum(not result.success for result in results)
        outcome = f"{count(len(results), 'run')}, {failed or 'none'} failed"
        entitle(axes, title, [outcome] if shared else [outcome, task_name(case.spec)])
        _draw_study(axes, case, results, look)
    wide = longest > WIDE
    axes = grid[0]
    _steps_axis(axes, shortest, max(case.spec.steps for case in cases))
    if wide:
        axes.set(xscale="log", xlim=(0.8, 1.25 * longest))
    else:
        axes.set_xlim(0.5, longest + 0.5)
    number_axis(axes.xaxis, 1, longest, logarithmic=wide, most=6)
    entries = {
        label: handle
        for axes in reversed(grid)
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    place_legend(figure, empty, list(entries.values()), list(entries))
    shared_title(figure, "learning curves", *(noises if len(noises) == 1 else ()), shared)
    return figure


def quartiles(results: Sequence[Result], steps: int) -> np.ndarray:
    """Return the lower quartile, the median and the upper quartile of the runs in each trial.

    Returns
    -------
    ndarray
        Shape (3, trials of the longest run). A run that has succeeded counts with N steps later.
    """
    longest = max(result.trials for result in results)
    at_once = max(1, BLOCK // len(results))
    blocks = [
        _quartiles(results, steps, first, min(first + at_once, longest))
        for first in range(0, longest, at_once)
    ]
    return np.concatenate(blocks, axis=1)


def _quartiles(results: Sequence[Result], steps: int, first: int, end: int) -> np.ndarray:
    """Return the quartiles in the trials from `first` to before `end`."""
    filled = np.full((len(results), end - first), np.nan)
    for row, result in zip(filled, results, strict=True):
        lengths = result.lengths[first:end]
        row[: len(lengths)] = lengths
        row[len(lengths) :] = steps if result.success else np.nan
    return np.asarray(np.nanquantile(filled, (0.25, 0.5, 0.75), axis=0))


def _draw_study(axes: Axes, case: Case, results: Sequence[Result], look: Look) -> None:
    low, median, high = quartiles(results, case.spec.steps)
    trials = np.arange(1, len(median) + 1)
    if 1 < len(results) <= FEW_RUNS:
        _draw_single_runs(axes, results, shade(look.colour, 0.5))
    if len(results) > 1:
        label = "middle half of the runs"
        axes.fill_between(trials, low, high, color=look.colour, alpha=0.22, lw=0, label=label)
    if len(trials) == 1:  # a line of one point would not be seen
        axes.bar(trials, median, width=0.3, color=look.colour)
    marker = "o" if len(trials) <= FEW_TRIALS else None
    axes.plot(trials, median, color=look.colour, lw=1.5, marker=marker, ms=4, label="median run")
    _mark_ends(axes, results, case.spec.steps)
    success = f"success: {count(case.spec.steps, 'step')}"
    axes.axhline(case.spec.steps, **SUCCESS, label=success)


def _draw_single_runs(axes: Axes, results: Sequence[Result], colour: str) -> None:
    for number, result in enumerate(results):
        label = "single runs" if number == 0 else None
        trials = np.arange(1, result.trials + 1)
        axes.plot(trials, result.lengths, ".-", color=colour, lw=0.8, ms=3, label=label)


def _mark_ends(axes: Axes, results: Sequence[Result], steps: int) -> None:
    """Mark where runs succeeded, above the steps of a success, and where runs failed."""
    at = [result.trials for result in results if result.success]
    if at:
        look: dict[str, Any] = {"color": INK, "ms": 5, "mew": 0.6, "alpha": 0.5}
        axes.plot(at, np.full(len(at), RUG * steps), "|", **look, label="success of a run")
    ends = [(result.trials, result.lengths[-1]) for result in results if not result.success]
    if ends:
        axes.plot(*zip(*ends, strict=True), "x", color=INK, ms=4, mew=0.8, label="failed run")
