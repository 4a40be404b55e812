"""Studies: many runs of many cases, on all cores, stored as they end."""

import multiprocessing
from collections.abc import Callable, Iterable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from dataclasses import replace
from os import cpu_count
from pathlib import Path
from queue import SimpleQueue
from types import NoneType
from typing import Any

import numpy as np

from upright.agents import is_custom
from upright.core.compiled import is_compiled
from upright.core.conditions import RUNS
from upright.core.trials import Result
from upright.errors import AgentError, PlantError, UprightError, require, require_all, require_kind
from upright.plants.custom import CustomPlant
from upright.plants.equations import EQUATIONS
from upright.studies import matlab_twin
from upright.studies.case import Case
from upright.studies.definitions import is_in_main, pack, receive, unpack
from upright.studies.repeatability import doubt_about, warn_if_doubtful
from upright.studies.run import make_run
from upright.studies.store import Store
from upright.support.interrupts import hold_interrupts, let_interrupts_through
from upright.support.processes import process_pool


def _job(case: Case, seed: int, run: int, stop: np.ndarray | None) -> Result | None:
    unpack()
    # `case.key` was computed in the parent process; this one may have imported changed code.
    if not (is_in_main(case.agent) or is_in_main(case.plant.name)) and _has_changed(case):
        raise UprightError(f"{_changeable(case)}; its source changed after it was imported")
    return make_run(case, seed, run, stop=stop)[1]


def _doubt(case: Case) -> str:
    unpack()
    return doubt_about(case)


def _changeable(case: Case) -> str:
    """Return what of a case may change while a study goes on, in words."""
    agent, plant = f"agent is {case.agent!r}", f"plant is {case.plant.name!r}"
    if case.plant == EQUATIONS:
        return agent
    return f"{agent} and {plant}" if is_custom(case.agent) else plant


def _has_changed(case: Case) -> bool:
    """Whether the code that determines its runs is no longer that of its key."""
    return replace(case).key != case.key


def study(
    cases: Iterable[Case],
    runs: int = RUNS,
    seed: int = 0,
    store: Store | None = None,
    on_result: Callable[[Case, Result], None] = lambda _case, _result: None,
    executor: Executor | None = None,
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
        Where finished runs are looked up and stored. Without a store, they are only returned.
    on_result
        Called with each result as its run finishes.
    executor
        Where to run. By default there is one thread per core, which is enough for compiled runs; or
        one process per core if an agent or a plant is plain Python, which uses one core at a time.
        Runs of the MATLAB twin have their own processes.

    Returns
    -------
    dict
        The results of each case, runs 0 to `runs` - 1, whether from the store or made now.

    Raises
    ------
    UprightError
        If `runs` or `seed` is not a whole number in its range, custom code was defined anew since
        its case was made, or MATLAB or Octave is needed but missing.
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
    cases = require_all("cases", cases, Case, "a list of what make_case returns")
    require_kind("store", store, (Store, NoneType), "a Store")
    if store is None:
        with Store() as memory:
            return study(cases, runs, seed, memory, on_result, executor)
    for case in cases:
        if (is_custom(case.agent) or case.plant != EQUATIONS) and _has_changed(case):
            raise UprightError(f"{_changeable(case)}; it changed after its case was made")
    store.recover()
    missing = {case: sorted(set(range(runs)) - store.finished(case.key, seed)) for case in cases}
    ours = {case: numbers for case, numbers in missing.items() if case.language == "Python"}
    twins = {case.twin_job(seed, missing[case]): case for case in missing if case not in ours}

    def keep(case: Case, result: Result) -> None:
        store.add(case.key, seed, result)
        on_result(case, result)

    with hold_interrupts():
        _study_here(ours, seed, keep, executor)
        with closing(matlab_twin.make_runs(job for job in twins if job.runs)) as ended:
            for job, result in ended:
                keep(twins[job], result)
    return {case: store.results(case.key, seed, runs) for case in cases}


def _study_here(
    missing: dict[Case, list[int]],
    seed: int,
    keep: Callable[[Case, Result], None],
    executor: Executor | None,
) -> None:
    """Make the missing runs of this package's agents."""
    stop = np.zeros(1, np.bool_)
    others = set(multiprocessing.active_children())
    workers = executor or _workers(list(missing))
    futures: dict[Future[Any], Case] = {}
    ended: SimpleQueue[Future[Any]] = SimpleQueue()
    doubts: set[Future[Any]] = set()
    custom = {case.settings: case for case in missing if missing[case] and is_custom(case.agent)}

    def submit(work: Callable[..., Any], case: Case, *arguments: Any) -> Future[Any]:
        future = workers.submit(work, case, *arguments)
        futures[future] = case
        future.add_done_callback(ended.put)
        return future

    try:
        for case in custom.values():
            doubts.add(submit(_doubt, case))
        for case, numbers in missing.items():
            for run in numbers:
                with let_interrupts_through():
                    pass  # submitting very many runs takes time
                submit(_job, case, seed, run, stop)
        for _ in range(len(futures)):
            with let_interrupts_through():
                future = ended.get()
            if future in doubts:
                warn_if_doubtful(future.result())
                continue
            result, case = future.result(), futures[future]
            assert result is not None, "only an interrupt stops a run"
            keep(case, result)
    except BaseException as error:
        stop[0] = True  # threads see it; runs in another executor's processes end by themselves
        processes = set(multiprocessing.active_children()) - others if executor is None else set()
        for process in processes:
            process.terminate()
        if not processes:  # else the pool itself ends them, and complains of those cancelled
            for future in futures:
                future.cancel()
        if isinstance(error, BrokenProcessPool) and any(map(_is_custom, missing)):
            raise _ended(list(missing)) from error
        raise
    finally:
        if executor is None:
            workers.shutdown(wait=False)


def _is_custom(case: Case) -> bool:
    """Whether code of a case is custom, so that it may have ended its process."""
    return is_custom(case.agent) or isinstance(case.plant, CustomPlant)


def _ended(cases: list[Case]) -> UprightError:
    """Return the error about a process that ended without one, for want of knowing why."""
    agents = sorted({case.agent for case in cases if is_custom(case.agent)})
    plants = sorted({case.plant.name for case in cases if isinstance(case.plant, CustomPlant)})
    kind, names = (AgentError, agents) if agents else (PlantError, plants)
    return kind(
        f"{kind.owner} is {' or '.join(map(repr, names))}; the process of its run ended without "
        f"an error: the {kind.owner} ended it, crashed in a library, or had no memory left"
    )


def _workers(cases: list[Case]) -> Executor:
    """Return an executor with one thread per core, or processes if custom code is plain Python.

    If only one such plant exists, there is a single worker.
    """
    if any(case.plant.alone for case in cases):
        return ThreadPoolExecutor(1)
    agents = {case.settings for case in cases if is_custom(case.agent)}
    plants = {case.plant for case in cases if isinstance(case.plant, CustomPlant)}
    if all(is_compiled(settings.agent(np.random.default_rng(0))) for settings in agents) and all(
        plant.is_compiled() for plant in plants
    ):
        return ThreadPoolExecutor(cpu_count())
    names = {case.agent for case in cases}, {case.plant.name for case in cases}
    return process_pool(receive, pack(*map(sorted, names)))


def check_study(runs: int, seed: int) -> None:
    """Raise UprightError unless a study can have this many runs and this seed."""
    require("runs", runs, 1, 10**6, whole=True)
    require("seed", seed, 0, 2**63 - 1, whole=True)


def stored(path: Path | str) -> list[tuple[Case, int, list[Result]]]:
    """Return the contents of a store file: each case with a seed and the results of its runs.

    Raises
    ------
    UprightError
        If the file is missing or not a store.
    """
    with Store(path, must_exist=True) as store:
        return [(store.case(key), seed, store.results(key, seed)) for _, key, seed in store.cases()]
