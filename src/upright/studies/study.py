"""Studies: many runs of many cases, on all cores or many machines, stored as they end."""

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import closing
from itertools import chain, islice
from pathlib import Path
from types import NoneType
from typing import Any

import numpy as np

from upright.agents import is_custom
from upright.core.conditions import RUNS
from upright.core.trials import Result
from upright.errors import AgentError, PlantError, UprightError, require, require_all, require_kind
from upright.plants.custom import CustomPlant
from upright.studies import matlab_twin
from upright.studies.case import Case
from upright.studies.custom import changeable, has_changed
from upright.studies.definitions import is_in_main, unpack
from upright.studies.executors import AnyExecutor, Workers, is_elsewhere, workers_for
from upright.studies.recorded_environment import present_environment
from upright.studies.repeatability import doubt_about, warn_if_doubtful
from upright.studies.run import make_run
from upright.studies.store import Store
from upright.support.interrupts import hold_interrupts, let_interrupts_through

WHOLE = (1, 1)
"""The one part of a study that is not shared."""
MOST_RUNS = 10**6
"""The most runs of a case that a study can have."""
Job = tuple[Case, int]
"""A run to be made: its case and its number."""


def study(
    cases: Iterable[Case],
    runs: int = RUNS,
    seed: int = 0,
    store: Store | Path | str | None = None,
    on_result: Callable[[Case, Result], None] = lambda _case, _result: None,
    executor: AnyExecutor = None,
    part: tuple[int, int] = WHOLE,
) -> dict[Case, list[Result]]:
    """Make the runs that are not in the store yet, and store each as it ends.

    Parameters
    ----------
    cases
        What to run.
    runs
        Number of runs of each case, which are numbered from 0.
    seed
        Seed of the study. Run k of a case draws the same random numbers whatever the executor, the
        order, or the runs made earlier.
    store
        Where finished runs are looked up and stored: a store, or the path of its file. Without it,
        they are only returned.
    on_result
        Called with each result as its run finishes.
    executor
        Where to run: "threads" or "processes" of this machine, the address of a dask scheduler,
        such as "tcp://127.0.0.1:8786" (see docs/scale.md), or a `concurrent.futures.Executor`. By
        default there is one thread per core, which is enough for compiled runs; or one process per
        core if an agent or a plant is plain Python, which uses one core at a time. Runs of the
        MATLAB twin have their own processes.
    part
        Which part of the runs to make, and of how many: ``(2, 5)`` is the second of five, whose
        stores together hold what the whole study has.

    Returns
    -------
    dict
        The results of each case, runs 0 to `runs` - 1, whether from the store or made now; of a
        part, those that are there.

    Raises
    ------
    UprightError
        If `runs` or `seed` is not a whole number in its range, custom code was defined anew since
        its case was made, MATLAB or Octave is needed but missing, a worker of the cluster has
        another version of the package, or the scheduler is not there.
    AgentError, PlantError
        If a custom agent or plant fails; the runs that have ended are in the store.
    KeyboardInterrupt
        If interrupted; the runs that have ended are in the store.

    Examples
    --------
    >>> cases = [upright.make_case(agent, steps=300) for agent in ("reinforce", "random-search")]
    >>> results = upright.study(cases, runs=10)
    >>> [len(results[case]) for case in cases]
    [10, 10]
    """
    check_study(runs, seed)
    check_part(part)
    cases = require_all("cases", cases, Case, "a list of what make_case returns")
    require_kind("store", store, (Store, Path, str, NoneType), "a Store, or the path of its file")
    if not isinstance(store, Store):
        with Store(store) as opened:
            return study(cases, runs, seed, opened, on_result, executor, part)
    make_missing_runs(cases, runs, seed, store, on_result, executor, part)
    return {case: store.results(case.key, seed, runs) for case in cases}


def make_missing_runs(
    cases: Sequence[Case],
    runs: int,
    seed: int,
    store: Store,
    on_result: Callable[[Case, Result], None] = lambda _case, _result: None,
    executor: AnyExecutor = None,
    part: tuple[int, int] = WHOLE,
) -> None:
    """Do what `study` does, and leave the results in the store: the memory stays the same.

    Parameters and errors are those of `study`.
    """
    for case in cases:
        if has_changed(case):
            raise UprightError(f"{changeable(case)}; it changed after its case was made")
    store.recover()
    numbers = runs_of_part(cases, runs, part)

    def missing(case: Case) -> Iterator[int]:
        finished = store.finished(case.key, seed)
        return (run for run in numbers[case] if run not in finished)

    wanted = {case: len(n) - count_finished(case, n, seed, store) for case, n in numbers.items()}
    ours = {case: n for case, n in wanted.items() if n and case.language == "Python"}
    theirs = [case for case, n in wanted.items() if n and case not in ours]
    if theirs and is_elsewhere(executor):
        raise UprightError("language is 'MATLAB'; a cluster has only runs of Python")
    twins = {case.twin_job(seed, missing(case)): case for case in theirs}

    def keep(found: Sequence[tuple[Case, Result]], environment: str | None = None) -> None:
        store.add_several(((case.key, result) for case, result in found), seed, environment)
        for case, result in found:
            on_result(case, result)

    with hold_interrupts():
        if ours:
            jobs = ((case, run) for case in ours for run in missing(case))
            with workers_for([*ours], executor) as workers:
                _study_here([*ours], jobs, sum(ours.values()), seed, keep, workers)
        with closing(matlab_twin.make_runs(twins)) as ended:
            for job, result in ended:
                keep([(twins[job], result)])


def count_finished(case: Case, numbers: range, seed: int, store: Store) -> int:
    """Return how many of the runs of a case with these numbers are in the store."""
    return sum(run in numbers for run in store.finished(case.key, seed))


def runs_of_part(cases: Iterable[Case], runs: int, part: tuple[int, int]) -> dict[Case, range]:
    """Return the numbers of the runs of each case that a part of a study makes.

    The runs of all cases are dealt to the parts in turn, so that no part has two more than another,
    and each has about as many of every case.

    Parameters
    ----------
    cases
        The cases.
    runs
        Number of runs of each.
    part
        Number of the part, from 1, and number of parts.
    """
    number, parts = part
    return {
        case: range((number - 1 - place * runs) % parts, runs, parts)
        for place, case in enumerate(dict.fromkeys(cases))
    }


def _study_here(
    cases: list[Case],
    jobs: Iterator[Job],
    remaining: int,
    seed: int,
    keep: Callable[[Sequence[tuple[Case, Result]], str], None],
    workers: Workers,
) -> None:
    """Make runs of this package's agents.

    Parameters
    ----------
    cases
        Those of the runs.
    jobs, remaining
        The runs, which may be too many for a list, and their number.
    seed
        Seed of the study.
    keep
        Called with the cases and results of a piece of work, and the environment of these runs.
    workers
        What makes the runs.
    """
    futures: dict[Any, list[Job] | None] = {}  # None for a doubt
    back: deque[Job] = deque()
    size = 1
    custom = {case.settings: case for case in cases if is_custom(case.agent)}
    try:
        for case in custom.values():
            futures[workers.submit(_doubt, [case], case)] = None
        while futures or remaining:
            while remaining and len(futures) < workers.window():
                with let_interrupts_through():
                    pass  # submitting very many runs takes time
                fair = -(-remaining // workers.window())  # the last runs keep all workers busy
                piece = [*islice(chain(_drained(back), jobs), min(size, fair, workers.most))]
                remaining -= len(piece)
                if not piece:  # another process has made them
                    remaining = 0
                    break
                involved = {case for case, _ in piece}
                how = (seed, workers.stop, workers.budget)
                futures[workers.submit(_make_runs, involved, piece, *how)] = piece
            with let_interrupts_through():
                future = workers.next_ended()
            found, asked = workers.result(future), futures.pop(future)
            if asked is None:
                warn_if_doubtful(found)
                continue
            results, environment = found
            keep([*zip((case for case, _ in asked), results, strict=False)], environment)
            rest = asked[len(results) :]
            back.extend(rest)
            remaining += len(rest)
            size = len(results) if rest else max(size, min(2 * len(results), workers.most))
    except BaseException as error:
        workers.abandon(futures)
        if isinstance(error, BrokenExecutor):
            raise _ended(cases) from error
        raise


def _drained(jobs: deque[Job]) -> Iterator[Job]:
    while jobs:
        yield jobs.popleft()


def _make_runs(
    jobs: list[Job], seed: int, stop: np.ndarray | None, budget: float
) -> tuple[list[Result], str]:
    """Make runs one after the other: the first, and others until the budget is spent [s].

    The environment of this process, which may be on another machine, is returned with the results.

    A run that fails is left to a piece of work that begins with it, which raises the error: so the
    runs before it are kept.
    """
    until = time.monotonic() + budget
    results = [_make_one(*jobs[0], seed, stop)]
    for case, run in jobs[1:]:
        if time.monotonic() > until:
            break
        try:
            results.append(_make_one(case, run, seed, stop))
        except Exception:
            break
    return results, present_environment()


def _make_one(case: Case, run: int, seed: int, stop: np.ndarray | None) -> Result:
    unpack()
    # `case.key` was computed in the parent process; this one may have imported changed code.
    if not (is_in_main(case.agent) or is_in_main(case.plant.name)) and has_changed(case):
        raise UprightError(f"{changeable(case)}; its source changed after it was imported")
    result = make_run(case, seed, run, stop=stop)[1]
    assert result is not None, "only an interrupt stops a run"
    return result


def _doubt(case: Case) -> str:
    unpack()
    return doubt_about(case)


def _ended(cases: list[Case]) -> UprightError:
    """Return the error about a process that ended without one, for want of knowing why."""
    agents = sorted({case.agent for case in cases if is_custom(case.agent)})
    plants = sorted({case.plant.name for case in cases if isinstance(case.plant, CustomPlant)})
    if not agents and not plants:
        return UprightError(
            "the process of a run ended without an error: it was killed, crashed in a library, or "
            "had no memory left"
        )
    kind, names = (AgentError, agents) if agents else (PlantError, plants)
    return kind(
        f"{kind.owner} is {' or '.join(map(repr, names))}; the process of its run ended without "
        f"an error: the {kind.owner} ended it, crashed in a library, or had no memory left"
    )


def check_study(runs: int, seed: int) -> None:
    """Raise UprightError unless a study can have this many runs and this seed."""
    require("runs", runs, 1, MOST_RUNS, whole=True)
    require("seed", seed, 0, 2**63 - 1, whole=True)


def check_part(part: tuple[int, int]) -> None:
    """Raise UprightError unless this is one of several parts of a study."""
    require_kind("part", part, tuple, "a tuple of its number and the number of parts, as (2, 5)")
    number, parts = part if len(part) == 2 else (0, 0)
    require("parts", parts, 1, 10**6, whole=True)
    require("part", number, 1, parts, whole=True)


def stored(path: Path | str) -> list[tuple[Case, int, list[Result]]]:
    """Return the contents of a store file: each case with a seed and the results of its runs.

    Raises
    ------
    UprightError
        If the file is missing or not a store.
    """
    with Store(path, must_exist=True) as store:
        return [(store.case(key), seed, store.results(key, seed)) for _, key, seed in store.cases()]
