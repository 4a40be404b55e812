"""Distributions of trials: how many runs succeeded within how many trials."""

from collections.abc import Sequence
from itertools import product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from upright.core.trials import Result
from upright.plants.equations import EQUATIONS
from upright.reports.names import (
    agent_name,
    case_names,
    noise_name,
    noise_rank,
    shared_task_name,
    task_name,
)
from upright.reports.plots.style import (
    AGENT_COLOURS,
    MUTED,
    Learned,
    Look,
    entitle,
    looks,
    number_axis,
    panels,
    place_legend,
    shared_title,
    styled,
)
from upright.reports.published import REPORT, SI_AND_WANG, SOURCES, Source
from upright.studies.case import Case
from upright.studies.intervals import wilson_interval

PUBLISHED_LINES = {REPORT: ":", SI_AND_WANG: "-."}
"""Sources whose published means are drawn, with the line of each."""
LEFT = 0.8
"""Where the axis of trials begins, so that successes in the first trial are seen."""
BANDS = 6
"""Largest number of curves in a panel that have an interval each; of more, none could be read."""
GAP = 0.085
"""Smallest distance between two labels at the ends of curves, as a fraction of a small axis."""


@styled()
def plot_trials(learned: Learned) -> Figure:
    """Draw, for each task, the fraction of runs that succeeded within a number of trials.

    Areas are 95 % intervals of the fraction (Wilson 1927), each for one number of trials; panels
    with more than six curves have none. Where
    runs failed, the curve ends below 1, with the fraction in numbers. Published means are drawn
    where the task is the published one.
    """
    cases = [case for case, _ in learned]
    tasks = sorted(dict.fromkeys(case.spec for case in cases), key=lambda t: noise_rank(t.noise))
    figure, grid, empty = panels(len(tasks), 2.1, "trials", "runs that have succeeded")
    shared = shared_task_name(tasks)
    last = max(_last_trial(case, results) for case, results in learned)
    drawn = list(zip(learned, case_names(cases), looks(cases), strict=True))
    entries: dict[str, Line2D] = {}
    for axes, task in zip(grid, tasks, strict=True):
        own = [(*pair, name, look) for pair, name, look in drawn if pair[0].spec == task]
        for _, results, name, look in own:
            line = _draw_distribution(axes, results, look, last, len(own) <= BANDS)
            entries.setdefault(name, line)
        gap = GAP if len(tasks) > 1 else GAP / 1.5  # a panel by itself is higher
        _label_ends(axes, [(results, look) for _, results, _, look in own], gap)
        title = noise_name(task.noise)
        entitle(axes, title[0].upper() + title[1:], [] if shared else [task_name(task)])
        axes.set(xscale="log", xlim=(LEFT, 1.25 * last), ylim=(-0.02, 1.04))
        axes.set_yticks([0, 0.25, 0.5, 0.75, 1], ["0", "25 %", "50 %", "75 %", "100 %"])
        number_axis(axes.xaxis, 1, last, logarithmic=True, most=6)
    for axes, task in zip(grid, tasks, strict=True):  # last, to be last in the legend
        entries |= _draw_published(axes, [case for case in cases if case.spec == task])
    shared_title(figure, "trials to success" if shared else "", shared)
    place_legend(figure, empty, list(entries.values()), list(entries))
    return figure


def _last_trial(case: Case, results: Sequence[Result]) -> int:
    """Return up to which trial there is something to see of a case."""
    failed = any(not result.success for result in results)
    return case.spec.trials if failed else max((result.trials for result in results), default=1)


def distribution(results: Sequence[Result]) -> tuple[np.ndarray, np.ndarray]:
    """Return after which trials runs succeeded, ascending, and how many had done so by then."""
    trials = [result.trials for result in results if result.success]
    at, counts = np.unique(np.array(trials, np.int64), return_counts=True)
    return at, np.cumsum(counts)


def _draw_distribution(
    axes: Axes, results: Sequence[Result], look: Look, last: int, with_band: bool
) -> Line2D:
    at, counts = distribution(results)
    trials = np.array([LEFT / 2, *at, 2 * last])
    counts = np.array([0, *counts, counts[-1] if len(counts) else 0])
    # With no success and with only successes, nothing lies below and above.
    low, high = np.array([wilson_interval(int(each), len(results)) for each in counts]).T
    if with_band:
        axes.fill_between(trials, low, high, step="post", color=look.colour, alpha=0.13, lw=0)
    (line,) = axes.step(
        trials, counts / len(results), where="post", color=look.colour, ls=look.line, lw=1.6
    )
    return line


def _label_ends(axes: Axes, ends: Sequence[tuple[Sequence[Result], Look]], gap: float) -> None:
    """Write the success rate beside the end of each curve that ends below 1."""
    rates = [(float(np.mean([r.success for r in results])), look) for results, look in ends]
    below = sorted(((rate, look) for rate, look in rates if rate < 1), key=lambda end: end[0])
    heights = spread([rate for rate, _ in below], gap)
    for (rate, look), height in zip(below, heights, strict=True):
        place = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
        text = f"{100 * rate:.3g} %"
        axes.annotate(text, (1, height), (2, 0), **place, color=look.colour, va="center", size=8)  # type: ignore[arg-type]


def spread(values: Sequence[float], gap: float) -> list[float]:
    """Move ascending values between 0 and 1 apart to a smallest distance, no further than needed.

    Examples
    --------
    >>> spread([0.1, 0.5, 0.5], 0.25), spread([0.75, 1.0], 0.5)
    ([0.1, 0.375, 0.625], [0.5, 1.0])
    """
    groups: list[list[float]] = []  # of values that touch, which share their middle
    for value in values:
        groups.append([value])
        while len(groups) > 1 and _first(groups[-1], gap) < _last(groups[-2], gap) + gap:
            groups[-2:] = [groups[-2] + groups[-1]]
    return [_first(group, gap) + number * gap for group in groups for number in range(len(group))]


def _first(group: Sequence[float], gap: float) -> float:
    length = (len(group) - 1) * gap
    return max(0.0, min(sum(group) / len(group) - length / 2, 1 - length))


def _last(group: Sequence[float], gap: float) -> float:
    return _first(group, gap) + (len(group) - 1) * gap


def _draw_published(axes: Axes, cases: Sequence[Case]) -> dict[str, Line2D]:
    """Draw the published means to compare the cases with, and return an entry for each."""
    entries: dict[str, Line2D] = {}
    for source, case in product(SOURCES, cases):
        mean = _published_mean(source, case)
        of = f", {agent_name(case.agent)}" if source.agent else ""
        label = f"{source.name}{of} (mean)"
        if source.name in PUBLISHED_LINES and mean is not None and label not in entries:
            colour = AGENT_COLOURS[case.agent] if source.agent else MUTED
            line = PUBLISHED_LINES[source.name]
            entries[label] = axes.axvline(mean, color=colour, linestyle=line, lw=1.2)
    return entries


def _published_mean(source: Source, case: Case) -> float | None:
    """Return the published mean to compare a case with; None if its rule or task is another one."""
    comparable = case.plant == EQUATIONS and source.agent in (None, case.agent)
    return source.figure(case.spec) if comparable else None
