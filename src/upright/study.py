"""Studies: many runs of many cases, on all cores, written down as they end."""

import hashlib
import json
import multiprocessing
import time
from collections.abc import Callable, Iterable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import cache, cached_property
from os import cpu_count
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np

from upright import matlab, trials
from upright.agents import (
    AGENTS,
    MATLAB_AGENTS,
    Settings,
    is_outside,
    named_settings,
    restore_settings,
)
from upright.agents.outside import Outside, is_learner
from upright.compiled import explain, is_compiled, sources_hash
from upright.errors import UprightError, require, require_module, require_one_of
from upright.interrupts import hold_interrupts, let_interrupts_through
from upright.plants import PlantSettings, describe_plant, restore_plant
from upright.plants.equations import SETTINGS as EQUATIONS
from upright.processes import process_pool
from upright.published import STEPS, TRIALS
from upright.store import Result, Store
from upright.task import CONDITIONS, Task, draw_plant, make_task
from upright.trials import Plant

SHARED = tuple(
    f"agents/{name}.py" for name in ("agent", "outside", "boxes", "forms", "least_squares")
)
"""What agents share, besides the task."""
GYMNASIUM = ("env.py", "protocol.py")
"""What learners from outside that only know Gymnasium share, besides that."""
PLANT_STREAM = 3
"""Tells the random numbers that a body draws itself from those of its run."""
LANGUAGES = ("Python", "MATLAB")
"""In which a run can be made: this package, or its MATLAB twin."""


@dataclass(frozen=True)
class Case:
    """An agent with its settings on a task: everything that determines a run, save its seed."""

    agent: str
    """Name of the agent."""
    label: str
    """Name of its settings, for people."""
    settings: Settings
    """Its settings."""
    noise: str = "none"
    """Name of the noise case."""
    start: str = "random"
    """Name of the start."""
    steps: int = STEPS
    """N: a trial of this many steps is a success."""
    trials: int = TRIALS
    """A run is at most this many trials."""
    integrator: str = "euler"
    """Name of the integrator."""
    condition: str = "nominal"
    """Name of the condition."""
    language: str = "Python"
    """One of LANGUAGES."""
    plant: PlantSettings = EQUATIONS
    """The body, and how it is made."""

    def __post_init__(self) -> None:
        """Refuse a case that cannot be run."""
        require_one_of("language", self.language, LANGUAGES)
        outside = getattr(self.settings, "agent_name", "module:name")
        require_one_of("agent", self.agent, [*AGENTS, outside])
        self.task()
        if self.plant.name != "equations":
            require_one_of("integrator of other plants", self.integrator, ["euler"])
            require_one_of("language of other plants", self.language, ["Python"])
        if self.language == "MATLAB":
            require_one_of("agent of the MATLAB twin", self.agent, MATLAB_AGENTS)
            require_one_of("integrator of the MATLAB twin", self.integrator, ["euler"])
            require_one_of("condition of the MATLAB twin", self.condition, ["nominal"])

    @property
    def name(self) -> str:
        """Name of the agent, for people."""
        return named(self.agent, self.language, self.plant.name)

    def wanted(self, seed: int, runs: Iterable[int]) -> matlab.Wanted:
        """Return what the MATLAB twin must know to make runs of this case.

        Raises
        ------
        UprightError
            If its settings have no name.
        """
        if self.settings != named_settings(self.agent).get(self.label):
            raise UprightError(
                "settings are changed; the MATLAB twin takes default or as-published"
            )
        task = (self.noise, self.start, self.steps, self.trials)
        return matlab.Wanted(self.agent, self.label, *task, seed, tuple(runs))

    def task(self) -> Task:
        """Return the task in numbers; where every run has its own plant, with the nominal one."""
        return make_task(
            self.noise, self.start, self.steps, self.trials, self.integrator, self.condition
        )

    @cached_property
    def key(self) -> str:
        """Everything that determines a run save its seed, the rule's own code included, as JSON."""
        ours = self.language == "Python"
        rule = rule_version(self.agent) if ours else matlab.twin_version()
        values = asdict(self) | {"rule": rule, "plant": describe_plant(self.plant)}
        if version := self.plant.version():
            values["rule"] += f"-{version}"
        return json.dumps(values, sort_keys=True)


def named(agent: str, language: str, plant: str) -> str:
    """Return an agent's name, with the language and the plant where they are not the usual ones."""
    odd = [name for name in (language, plant) if name not in ("Python", "equations")]
    return f"{agent} ({', '.join(odd)})" if odd else agent


@cache
def rule_version(agent: str) -> str:
    """Return a digest of the code that determines what a run of this agent does.

    Of an agent from outside, that is the one file that it is written in.
    """
    task = ["elementary.py", "cartpole.py", "noise.py", "task.py", "trials.py", "study.py"]
    shared = [*task, *SHARED]
    if is_outside(agent):
        own = hashlib.sha256(Outside(agent).source().read_bytes()).hexdigest()[:12]
        return f"{sources_hash(*shared, *GYMNASIUM)}-{own}"
    return sources_hash(*shared, AGENTS[agent].removeprefix("upright.").replace(".", "/") + ".py")


def make_case(agent: str, label: str = "default", **task: Any) -> Case:
    """Return the case of an agent with its settings of this name.

    Raises
    ------
    UprightError
        If the agent or any name is unknown. An agent that knows only its default settings takes
        them whatever the name.
    """
    require_one_of("settings", label, ("default", "as-published"))
    settings = named_settings(agent)
    if is_outside(agent):
        rule_version(agent)  # now: the file may change once it is imported
    label = label if label in settings else "default"
    return Case(agent, label, settings[label], **task)


def random_numbers(seed: int, run: int) -> np.random.Generator:
    """Return the stream of random numbers that is this run's own."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(run,)))


def twister(number: int) -> np.random.Generator:
    """Return the Mersenne Twister (M. Matsumoto & T. Nishimura, 1998) with this 32-bit seed."""
    seeded: Any = np.random.RandomState(number).get_state(legacy=False)
    bits = np.random.MT19937()
    bits.state = seeded
    return np.random.Generator(bits)


def twister_numbers(seed: int, run: int) -> np.random.Generator:
    """Return the stream that the MATLAB twin draws in its run of number `run + 1`.

    It is what MATLAB's rand gives after rng(10⁶ seed + run + 1).

    Raises
    ------
    UprightError
        If MATLAB has no such stream.
    """
    matlab.check_seed(seed)
    return twister(10**6 * seed + run + 1)


def make_run_task(case: Case, seed: int, run: int) -> Task:
    """Return the task of one run, with the plant that is the run's own where they vary.

    All agents meet the same plant in the run of this number.
    """
    task = case.task()
    if CONDITIONS[case.condition].varies_plant:
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(run, 1)))
        task = task._replace(parameters=draw_plant(task.parameters, rng))
    return task


def make_plant(case: Case, seed: int, run: int, stop: np.ndarray) -> tuple[Plant, Task]:
    """Return the body of a run, and what of the run's task is left to the loop."""
    numbers = np.random.SeedSequence(seed, spawn_key=(run, PLANT_STREAM))
    own = int(numbers.generate_state(1)[0]) // 2  # a whole number that ROS 2 takes, too
    return case.plant.make(make_run_task(case, seed, run), case.noise, own, stop)


def choose_loop(case: Case, agent: Any, plant: Plant) -> Callable[..., int]:
    """Return the loop for an agent and a plant: compiled, or in Python if one of them is not.

    For a learner that only knows Gymnasium it is the learner's own.
    """
    if is_learner(agent):
        require_one_of("plant of learners that only know Gymnasium", case.plant.name, ["equations"])
        require_module("gymnasium", f"{case.agent} needs Gymnasium", "gymnasium")
        from upright.protocol import run_learner

        return run_learner
    if not is_compiled(agent):
        return trials.run
    if not is_compiled(plant):
        return trials.bound_run
    kind: Any = type(agent)
    return trials.outside_run(kind) if is_outside(case.agent) else trials.compiled_run


def make_run(
    case: Case,
    seed: int,
    run: int,
    lengths: np.ndarray | None = None,
    stop: np.ndarray | None = None,
    numbers: Callable[[int, int], np.random.Generator] | None = None,
    plant: Plant | None = None,
) -> tuple[Any, Result | None]:
    """Let a new agent learn.

    Parameters
    ----------
    lengths
        Where the length of each trial is written as it ends, shape (case.trials,), int64; for a
        thread that watches.
    stop
        Set its one element, a bool, to end the run before its next trial.
    numbers
        Where a run's random numbers come from: `twister_numbers`, or unless given
        `random_numbers`.
    plant
        The body, if it is there already and makes all noise itself.

    Returns
    -------
    tuple
        The agent as it is then, and the result; None in its place if the run was stopped.

    Raises
    ------
    UprightError
        If an agent from outside lacks a method or cannot be compiled, a learner from outside ends
        before its run, or the body fails.
    """
    rng = (numbers or random_numbers)(seed, run)
    agent, task = case.settings.agent(rng), make_run_task(case, seed, run)
    lengths = np.zeros(case.trials, np.int64) if lengths is None else lengths
    stop = np.zeros(1, np.bool_) if stop is None else stop
    if plant is None:
        plant, task = make_plant(case, seed, run, stop)
    with closing(plant):
        loop = choose_loop(case, agent, plant)
        if is_compiled(agent):
            _compile(case, agent, loop, plant, task)
        began = time.perf_counter()
        success = loop(agent, plant, task, rng, lengths, stop) > 0
        seconds = time.perf_counter() - began
    return agent, outcome(case, run, success, lengths, seconds)


def outcome(
    case: Case, run: int, success: bool, lengths: np.ndarray, seconds: float
) -> Result | None:
    """Return the result of a run whose trials had these lengths; None if it was stopped."""
    made = lengths[lengths > 0]
    stopped = not success and len(made) < case.trials
    return None if stopped else Result(run, success, made, seconds)


def _compile(case: Case, agent: Any, loop: Callable[..., int], plant: Plant, task: Task) -> None:
    """Have all machine code that a run needs, before its clock starts."""
    rng, stop = np.random.default_rng(0), np.zeros(1, np.bool_)
    try:
        loop(agent, plant, task._replace(trials=0), rng, np.zeros(0, np.int64), stop)
    except Exception as error:
        if not is_outside(case.agent):
            raise
        # No trial of the run was made, so whatever went wrong is the compilation.
        why = f"it cannot be compiled: {explain(error)}"
        raise UprightError(f"agent is {case.agent!r}; {why}") from error


def _job(case: Case, seed: int, run: int, stop: np.ndarray | None) -> Result | None:
    # `case.key` came with the case; a new process has imported the agent anew.
    if replace(case).key != case.key:
        raise UprightError(f"agent is {case.agent!r}; its source changed after it was imported")
    return make_run(case, seed, run, stop=stop)[1]


def study(
    cases: Iterable[Case],
    runs: int,
    seed: int,
    store: Store,
    on_result: Callable[[Case, Result], None] = lambda _case, _result: None,
    executor: Executor | None = None,
) -> None:
    """Make the runs that the store does not hold yet, and write each down as it ends.

    Parameters
    ----------
    cases
        What to run.
    runs
        How many runs of each case, numbered from 0.
    seed
        Of the study. Run k of a case draws the same random numbers whatever the executor, the
        order, or the runs made before.
    store
        Where finished runs are looked up and written.
    on_result
        Told of every run as it ends.
    executor
        Where to run. Unless given, every core has a thread, which is enough for compiled runs; or
        a process, if some agent is plain Python, which can use one core at a time. Runs of the
        MATLAB twin have processes of their own.

    Raises
    ------
    UprightError
        If `runs` or `seed` is no whole number in its range, or MATLAB or Octave is needed and
        missing.
    KeyboardInterrupt
        If interrupted; the runs that had ended are in the store.
    """
    check_study(runs, seed)
    missing = {case: sorted(set(range(runs)) - store.finished(case.key, seed)) for case in cases}
    ours = {case: numbers for case, numbers in missing.items() if case.language == "Python"}
    twins = {case.wanted(seed, missing[case]): case for case in missing if case not in ours}

    def keep(case: Case, result: Result) -> None:
        store.add(case.key, seed, result)
        on_result(case, result)

    with hold_interrupts():
        _study_here(ours, seed, keep, executor)
        with closing(matlab.make_runs(wanted for wanted in twins if wanted.runs)) as ended:
            for wanted, result in ended:
                keep(twins[wanted], result)


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
    futures: dict[Future[Result | None], Case] = {}
    ended: SimpleQueue[Future[Result | None]] = SimpleQueue()
    try:
        for case, numbers in missing.items():
            for run in numbers:
                with let_interrupts_through():
                    pass  # as there may be very many
                future = workers.submit(_job, case, seed, run, stop)
                futures[future] = case
                future.add_done_callback(ended.put)
        for _ in range(len(futures)):
            with let_interrupts_through():
                future = ended.get()
            result, case = future.result(), futures[future]
            assert result is not None, "only an interrupt stops a run"
            keep(case, result)
    except BaseException:
        stop[0] = True  # seen by threads; runs elsewhere end by themselves
        for future in futures:
            future.cancel()
        if executor is None:
            for process in set(multiprocessing.active_children()) - others:
                process.terminate()
        raise
    finally:
        if executor is None:
            workers.shutdown(wait=False)


def _workers(cases: list[Case]) -> Executor:
    """Return a worker for every core: threads, or processes if an agent is plain Python.

    Where there is one body only, there is one worker.
    """
    if any(case.plant.alone for case in cases):
        return ThreadPoolExecutor(1)
    outside = {case.settings for case in cases if is_outside(case.agent)}
    if all(is_compiled(settings.agent(np.random.default_rng(0))) for settings in outside):
        return ThreadPoolExecutor(cpu_count())
    return process_pool()


def check_study(runs: int, seed: int) -> None:
    """Raise UprightError unless a study can have so many runs and this seed."""
    require("runs", runs, 1, 10**6, whole=True)
    require("seed", seed, 0, 2**63 - 1, whole=True)


def stored(path: Path | str) -> list[tuple[Case, int, list[Result]]]:
    """Return what a store file holds: cases, seeds, and the runs made of them.

    Raises
    ------
    UprightError
        If the file is missing or not a store.
    """
    found = []
    with Store(path, must_exist=True) as store:
        for values, key, seed in store.cases():
            settings = restore_settings(values["agent"], values.pop("settings"))
            plant = restore_plant(values.pop("plant", {"name": "equations"}))
            values.pop("rule")
            case = Case(settings=settings, plant=plant, **values)
            found.append((case, seed, store.results(key, seed)))
    return found
