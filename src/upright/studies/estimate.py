"""How far a study is, and what the rest of it will take: time and disk, from measured runs.

What is known of a case comes from its runs in the store; else from a few that are made for it, and
not kept; else from those of other cases.
"""

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from os import cpu_count
from threading import Timer
from typing import NamedTuple

import numpy as np

from upright.core.trials import Result
from upright.studies.case import Case
from upright.studies.outcomes import Outcomes, outcomes_of
from upright.studies.run import make_run
from upright.studies.store import Store
from upright.studies.study import WHOLE, count_finished, runs_of_part

PROBING = 3.0
"""How long runs may take that are made for an estimate, all of them together [s]."""
PROBED_STEPS = 100_000
"""Steps after which such a run counts as a success, whose remaining steps are not simulated."""
NOT_PROBED = ("gazebo", "ros2")
"""Plants that run elsewhere: to start them takes long, or they are real."""
ROW, LENGTH = 80, 4.6
"""Bytes of a run in a store, and of the length of a trial: measured over thousands of runs of 1, 5,
30 and 1,000 trials. A length has 4 bytes; the rest is unused space on SQLite's pages."""


class Measure(NamedTuple):
    """A quantity over some runs of a case."""

    mean: float
    """Its mean."""
    spread: float
    """Its standard deviation; of a single run, as large as it."""
    runs: int
    """Number of runs."""


class Standing(NamedTuple):
    """How far a case of a study is."""

    case: Case
    """The case."""
    wanted: range
    """Numbers of its runs in the study, or in a part of it."""
    finished: int
    """How many of these are in the store."""
    known: int
    """How many of all its runs in the study are, whatever their part; of them are told:"""
    successes: int
    """Number of successful runs."""
    mean_trials: float | None
    """Mean number of trials over the successful runs; None if there are none."""
    seconds: Measure | None
    """Computing time [s]; None if there are no runs."""
    bytes: Measure | None
    """Size in the store [bytes]; None if there are no runs."""

    @property
    def missing(self) -> int:
        """Number of runs that are to be made."""
        return len(self.wanted) - self.finished


class Estimate(NamedTuple):
    """What the missing runs of a study will take."""

    seconds: float
    """Time that is expected [s]."""
    low: float
    """Lower end of an interval of two standard deviations [s]."""
    high: float
    """Upper end of it [s]."""
    bytes: float
    """Disk that is expected [bytes]."""
    workers: int
    """Number of runs at once that this holds for."""
    is_least: bool
    """Whether a run took so long that it was stopped, so that it will take longer."""


def standings(
    cases: Iterable[Case], runs: int, seed: int, store: Store, part: tuple[int, int] = WHOLE
) -> list[Standing]:
    """Return how far each case of a study is, or of a part of it: see `study.study`."""
    return [
        Standing(
            case,
            numbers,
            count_finished(case, numbers, seed, store),
            *_summary(store.outcomes(case.key, seed, runs)),
        )
        for case, numbers in runs_of_part(cases, runs, part).items()
    ]


def _summary(
    outcomes: Outcomes,
) -> tuple[int, int, float | None, Measure | None, Measure | None]:
    """Return what a `Standing` tells of runs."""
    trials = outcomes.trials[outcomes.success]
    return (
        len(outcomes.run),
        len(trials),
        float(trials.mean()) if len(trials) else None,
        _measure(outcomes.seconds),
        _measure(ROW + LENGTH * outcomes.trials),
    )


def _measure(values: np.ndarray) -> Measure | None:
    if not len(values):
        return None
    mean = float(values.mean())
    return Measure(mean, float(values.std(ddof=1)) if len(values) > 1 else mean, len(values))


class Probe(NamedTuple):
    """How far cases are, with what was found by making runs that are not kept."""

    several: list[Standing]
    """The cases; those that were tried with a measured `seconds` and `bytes`."""
    tried: dict[Case, int]
    """How many runs were made of each case."""
    is_least: bool
    """Whether one of them took so long that it had to be stopped."""


def probe(several: Sequence[Standing], seed: int, seconds: float = PROBING) -> Probe:
    """Make some of the missing runs of cases that have none, one after another.

    Parameters
    ----------
    several
        How far each case is.
    seed
        Seed of the study.
    seconds
        How long all runs together may take [s], without compilation.

    Raises
    ------
    AgentError, PlantError
        If a custom agent or plant fails.
    """
    waiting = [
        each
        for each in several
        if each.missing and not each.known and each.case.plant.name not in NOT_PROBED
    ]
    # In an order in which even the first few are from everywhere in the study.
    places = sorted(range(len(waiting)), key=lambda place: place * (math.sqrt(5) - 1) / 2 % 1)
    jobs = (
        (waiting[place].case, waiting[place].wanted[turn])
        for turn in range(max((len(each.wanted) for each in waiting), default=0))
        for place in places
        if turn < len(waiting[place].wanted)
    )
    made: dict[Case, list[Result]] = {}
    left, is_least = seconds, False
    for case, run in jobs:
        result, spent, was_stopped = _probed(case, seed, run, left)
        is_least = was_stopped and spent > seconds / 3  # else there was no time for it
        if is_least or not was_stopped:
            made.setdefault(case, []).append(result)
        left -= spent
        if left <= 0.0 or was_stopped:
            break
    measured = {case: _summary(outcomes_of(results)) for case, results in made.items()}
    found = [
        each._replace(seconds=measured[each.case][3], bytes=measured[each.case][4])
        if each.case in measured
        else each
        for each in several
    ]
    return Probe(found, {case: len(results) for case, results in made.items()}, is_least)


def _probed(case: Case, seed: int, run: int, seconds: float) -> tuple[Result, float, bool]:
    """Make a run within some seconds; return its result, the time, and whether it was stopped."""
    spec = replace(case.spec, steps=min(case.spec.steps, PROBED_STEPS))
    make_run(replace(case, spec=replace(spec, steps=1, trials=1)), seed, run)  # compiles
    stop, lengths = np.zeros(1, np.bool_), np.zeros(spec.trials, np.int64)
    timer = Timer(seconds, stop.fill, [True])
    timer.start()
    began = time.perf_counter()
    try:
        result = make_run(replace(case, spec=spec), seed, run, lengths, stop)[1]
    finally:
        timer.cancel()
    spent = time.perf_counter() - began
    if result is None:
        return Result(run, False, lengths[lengths > 0], spent), spent, True
    made = int(result.lengths.sum())
    left = case.spec.steps - spec.steps if result.success else 0
    whole = result._replace(seconds=result.seconds * (made + left) / made)
    return whole, spent, False


def estimate(several: Sequence[Standing], *, is_least: bool = False) -> Estimate | None:
    """Return what the missing runs will take; None if nothing is known of any case.

    Runs of a case vary, and its mean is known the better the more runs there are; a case of which
    no run is known counts with the mean of those of its agent, or of all.

    Parameters
    ----------
    several
        How far each case is, perhaps with what `probe` found.
    is_least
        Whether a run was stopped of which that is known.
    """
    waiting = [each for each in several if each.missing]
    if waiting and not any(each.seconds for each in several):
        return None
    workers = 1 if any(each.case.plant.alone for each in waiting) else cpu_count() or 1
    mean, deviation = (value / workers for value in _sum(several, lambda each: each.seconds))
    size, _ = _sum(several, lambda each: each.bytes)
    size += sum(2 * len(each.case.key) for each in waiting if not each.known)  # and its index
    low, high = max(0.0, mean - 2 * deviation), mean + 2 * deviation
    return Estimate(mean, low, high, size, workers, is_least)


def _sum(
    several: Sequence[Standing], measure: Callable[[Standing], Measure | None]
) -> tuple[float, float]:
    """Return the expected sum over all missing runs, and its standard deviation."""
    known = [(each.case.agent, found) for each in several if (found := measure(each))]
    total, variance, shared = 0.0, 0.0, 0.0
    for each in several:
        count = each.missing
        if found := measure(each):
            total += count * found.mean
            variance += found.spread**2 * (count + count**2 / found.runs)
        elif count:
            alike = [found.mean for agent, found in known if agent == each.case.agent]
            others = _measure(np.array(alike or [found.mean for _, found in known]))
            assert others is not None, "something is known of some case"
            total += count * others.mean
            shared += count * others.spread  # these errors have one cause: they do not even out
    return total, math.sqrt(variance) + shared
