"""One run: its task, its plant, its loop and its result."""

import time
import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager, closing, nullcontext
from typing import Any

import numpy as np

from upright.agents import is_custom
from upright.agents.checks.checked import check_returned_type, checked
from upright.agents.checks.contract import is_learner
from upright.agents.checks.faults import reporting
from upright.core.compiled import explain, is_compiled
from upright.core.contracts import Plant
from upright.core.loops import loop_for
from upright.core.task import Task
from upright.core.trials import Result
from upright.errors import AgentError, AgentWarning, require_kind, require_module, require_one_of
from upright.plants import PLANTS
from upright.plants.custom import reporting_trial
from upright.plants.settings import RunContext
from upright.policies.divergence import diverged_array
from upright.policies.going_on import carry_over
from upright.policies.policy import Policy
from upright.studies.case import Case
from upright.studies.observing import Observer, observed_loop
from upright.studies.random_streams import Stream, random_numbers, sequence

DIVERGED = "learning diverged"
"""What a warning says of a run whose agent has numbers left that are none."""


def make_run_task(case: Case, seed: int, run: int) -> Task:
    """Return the task of one run, with the run's own plant under a condition that varies it.

    All agents meet the same plant in the run with this number.
    """
    return case.spec.task(np.random.default_rng(sequence(seed, run, Stream.PARAMETERS)))


def make_plant(case: Case, seed: int, run: int, stop: np.ndarray) -> tuple[Plant, Task]:
    """Return the plant of a run, and the part of the task that is left to the loop."""
    plant_seed = int(sequence(seed, run, Stream.PLANT).generate_state(1)[0]) // 2  # below 2³¹
    context = RunContext(make_run_task(case, seed, run), case.spec, plant_seed, stop, run)
    return case.plant.make(context)


def choose_loop(case: Case, agent: Any, plant: Plant) -> Callable[..., int]:
    """Return the loop for an agent and a plant; for a Gymnasium learner, `run_learner`."""
    if is_learner(agent):
        require_one_of("plant of learners that only know Gymnasium", case.plant.name, ["equations"])
        require_module("gymnasium", f"{case.agent} needs Gymnasium", "gymnasium")
        from upright.environments.trial_protocol import run_learner

        return run_learner
    ours = not is_custom(case.agent) and case.plant.name in PLANTS.built_in
    return loop_for(agent, plant, kept=ours)


def make_run(
    case: Case,
    seed: int,
    run: int,
    lengths: np.ndarray | None = None,
    stop: np.ndarray | None = None,
    numbers: Callable[[int, int], np.random.Generator] | None = None,
    plant: Plant | None = None,
    observer: Observer | None = None,
    policy: Policy | None = None,
) -> tuple[Any, Result | None]:
    """Train a new agent until a trial succeeds, or one that goes on from a policy.

    Parameters
    ----------
    case
        The agent with its settings, on a task.
    seed, run
        Seed of the study, and number of the run within it: they determine the result.
    lengths
        Array that the length of each trial is written to as it ends, shape (case.spec.trials,),
        int64, so that another thread can watch.
    stop
        Set its one element, a bool, to end the run before its next trial.
    numbers
        Returns the random numbers of a run with this seed and number: `random_numbers` by default,
        or `twister_numbers`.
    plant
        The plant to balance in place of the case's: an object with the methods `reset`, `step`,
        `has_fallen` and `close`. The noise of the case is added to it.
    observer
        Called after each start and each step, as for pictures. The loop then runs in Python; its
        trials are the same.
    policy
        What the agent has learned before, by the same agent; by default nothing. The policy itself
        does not change.

    Returns
    -------
    tuple
        The trained agent, and the result, which is None if the run was stopped.

    Raises
    ------
    UprightError
        If the plant fails, or the policy is another agent's.
    AgentError
        If a custom agent raises an exception, or breaks the rules for agents.
    PlantError
        If a custom plant does the same.

    Warns
    -----
    AgentWarning
        If learning diverged: what the agent learned is no longer finite.

    Examples
    --------
    >>> case = upright.make_case("adaptive-lqr", steps=2000)
    >>> agent, result = upright.make_run(case, seed=0, run=0)
    >>> result.success, result.trials
    (True, 1)
    """
    require_kind("case", case, Case, "what make_case returns")
    rng = (numbers or random_numbers)(seed, run)
    agent, task = new_agent(case, rng, policy), make_run_task(case, seed, run)
    lengths = np.zeros(case.spec.trials, np.int64) if lengths is None else lengths
    stop = np.zeros(1, np.bool_) if stop is None else stop
    if plant is None:
        plant, task = make_plant(case, seed, run, stop)
    with closing(plant):
        loop = choose_loop(case, agent, plant)
        if observer is not None:
            loop = observed_loop(loop, observer)
        with _watched(case, run, lengths), _called(case, agent, run) as called:
            if is_compiled(agent):
                _compile(case, called, loop, plant, task)
                if is_custom(case.agent):
                    check_returned_type(agent, case.agent)
            began = time.perf_counter()
            success = loop(called, plant, task, rng, lengths, stop) > 0
            seconds = time.perf_counter() - began
    if diverged_array(case.agent, agent):
        said = f"agent is {case.agent!r}; {DIVERGED} with the settings {case.settings_name}"
        warnings.warn(f"{said}: its numbers are no longer finite", AgentWarning, stacklevel=2)
    return agent, outcome(case, run, success, lengths, seconds)


def new_agent(case: Case, rng: np.random.Generator, policy: Policy | None = None) -> Any:
    """Return a new agent of a case, which has learned what a policy's agent has, if one is given.

    Raises
    ------
    AgentError
        If a custom agent cannot be created.
    UprightError
        If the policy is another agent's, or its agent's code has changed.
    """
    if not is_custom(case.agent):
        agent = case.settings.agent(rng)
    else:
        with reporting(case.agent, "it cannot be created"):
            agent = case.settings.agent(rng)
    if policy is None:
        return agent
    require_one_of("agent of the policy", policy.agent, [case.agent])
    return carry_over(policy, agent)


def _called(case: Case, agent: Any, run: int) -> AbstractContextManager[Any]:
    """Return the context of what the loop calls: the agent itself, or a custom one, checked."""
    if not is_custom(case.agent):
        return nullcontext(agent)
    noise = case.spec.noise
    which = f"run {run}" if noise == "none" else f"run {run} with {noise}"
    if is_learner(agent):
        from upright.environments.checked_learner import CheckedLearner

        return nullcontext(CheckedLearner(agent, case.agent, which))
    return checked(agent, case.agent, which)


def _watched(case: Case, run: int, lengths: np.ndarray) -> AbstractContextManager[None]:
    """Return a context that reports what a custom plant raises."""
    if not PLANTS.is_path(case.plant.name):
        return nullcontext()
    return reporting_trial(case.plant.name, run, lengths)


def outcome(
    case: Case, run: int, success: bool, lengths: np.ndarray, seconds: float
) -> Result | None:
    """Return the result of a run from the array of lengths; None if the run was stopped."""
    ended = lengths[lengths > 0]
    stopped = not success and len(ended) < case.spec.trials
    return None if stopped else Result(run, success, ended, seconds)


def _compile(case: Case, agent: Any, loop: Callable[..., int], plant: Plant, task: Task) -> None:
    """Compile everything that a run needs, before its time is measured."""
    rng, stop = np.random.default_rng(0), np.zeros(1, np.bool_)
    try:
        loop(agent, plant, task._replace(trials=0), rng, np.zeros(0, np.int64), stop)
    except Exception as error:
        if not is_custom(case.agent):
            raise
        # The loop was asked for 0 trials, so it must be the compilation that failed.
        reason = f"it cannot be compiled: {explain(error)}"
        raise AgentError(f"agent is {case.agent!r}; {reason}") from error
