"""The loop: a trial from start to fall, and a run of trials.

`trial` is written once. As plain Python it works with any plant and any agent through their
methods; compiled, it runs the equations and the package's agents at millions of steps a second. The
same seed gives the same trial lengths either way.
"""

from typing import NamedTuple

import numpy as np
from numba.extending import overload

from upright.core.compiled import compiled, inlined
from upright.core.contracts import Agent, Plant
from upright.core.noise import draw_start
from upright.core.parameters import State
from upright.core.rig import acting_force, begin_episode, first_measurement, measurement, strength
from upright.core.task import Task
from upright.support.short_repr import short_list


class Result(NamedTuple):
    """The outcome of one run.

    Examples
    --------
    >>> _, result = upright.learn("random-search", steps=300, seed=3)
    >>> result.success, result.trials == len(result.lengths)
    (True, True)
    """

    run: int
    """Number of the run within its study."""
    success: bool
    """Whether its last trial lasted N steps."""
    lengths: np.ndarray
    """Steps of each trial, in order; every trial is counted."""
    seconds: float
    """Wall time."""

    @property
    def trials(self) -> int:
        """Number of trials in the run."""
        return len(self.lengths)

    def __repr__(self) -> str:
        lengths, seconds = short_list(self.lengths), f"{self.seconds:.3g}"
        return f"Result(run={self.run}, success={self.success}, {lengths=!s}, {seconds=!s})"


def trial(agent: Agent, plant: Plant, task: Task, rng: np.random.Generator) -> tuple[int, bool]:
    """Let an agent balance once, from a start to a fall or to the last step of a success.

    Parameters
    ----------
    agent
        The learner; its memory changes.
    plant
        The plant to balance; it is reset first.
    task
        Noise, rig, start, limits and the length of a success.
    rng
        The run's own random numbers.

    Returns
    -------
    tuple
        How many steps the trial lasted, and whether it ended with a fall.
    """
    observation = start(plant, task, rng)
    agent.begin_trial(rng)
    fallen = False
    steps = 0
    while steps < task.steps and not fallen:
        action = agent.act(observation, rng)
        before, (observation, fallen) = observation, push(plant, task, rng, action)
        agent.learn(before, action, observation, fallen)
        steps += 1
    agent.end_trial(fallen)
    return steps, fallen


@inlined
def start(plant: Plant, task: Task, rng: np.random.Generator) -> State:
    """Put the plant at a start, and return what is measured there."""
    begin_episode(task.rig, rng)
    state = plant.reset(draw_start(task.start, rng))
    return first_measurement(task.rig, task.noise, state, rng)


@inlined
def push(plant: Plant, task: Task, rng: np.random.Generator, action: bool) -> tuple[State, bool]:
    """Push the cart for a time step; return what is measured then, and whether it has fallen."""
    force = strength(task.rig, task.parameters.force)
    state = plant.step(acting_force(task.rig, task.noise, force if action else -force, rng))
    fallen = plant.has_fallen(state)
    return measurement(task.rig, task.noise, state, rng), fallen


_compiled_trial = compiled(trial)


@overload(trial)
def _call_compiled_trial(agent, plant, task, rng):  # type: ignore[no-untyped-def]  # noqa: ARG001
    return lambda agent, plant, task, rng: _compiled_trial(agent, plant, task, rng)


def run(
    agent: Agent,
    plant: Plant,
    task: Task,
    rng: np.random.Generator,
    lengths: np.ndarray,
    stop: np.ndarray,
) -> int:
    """Let an agent learn, trial after trial, until one succeeds.

    Parameters
    ----------
    agent, plant, task, rng
        As for `trial`. The agent's memory carries over from one trial to the next.
    lengths
        Shape (task.trials,), int64. The length of each trial is written here as the trial ends, so
        that another thread can watch.
    stop
        Shape (1,), bool. The run ends early, before the next trial, once another thread sets it.

    Returns
    -------
    int
        The number of the trial that succeeded, counted from 1; 0 if none did.
    """
    for number in range(task.trials):
        if stop[0]:
            break
        lengths[number], fallen = trial(agent, plant, task, rng)
        if not fallen:
            return number + 1
    return 0


# ---- A run in pieces, to be watched --------------------------------------------------------------

BETWEEN, BALANCING, SUCCEEDED, FAILED = range(4)
"""Stages of a run: before a trial, within one, and after the last."""


class Progress(NamedTuple):
    """Where a run stands between two steps."""

    observation: np.ndarray
    """The last measurement, shape (4,), float64."""
    action: np.ndarray
    """The last push, shape (1,), bool."""
    steps: np.ndarray
    """Steps of the present trial, or of the last one, shape (1,), int64."""
    trials: np.ndarray
    """How many trials have ended, shape (1,), int64."""
    stage: np.ndarray
    """One of the stages above, shape (1,), int64."""


def new_progress() -> Progress:
    """Return the progress of a run that begins."""
    counts = (np.zeros(1, np.int64) for _ in range(3))
    return Progress(np.zeros(4), np.zeros(1, np.bool_), *counts)


@inlined
def advance(
    agent: Agent,
    plant: Plant,
    task: Task,
    rng: np.random.Generator,
    progress: Progress,
    lengths: np.ndarray,
    count: int,
) -> int:
    """Advance a run by up to `count` steps: what `run` does, in pieces.

    Parameters
    ----------
    agent, plant, task, rng, lengths
        As for `run`.
    progress
        Where the run stands, which changes.
    count
        How many steps to make.

    Returns
    -------
    int
        How many were made: fewer than `count` if the run has ended.
    """
    made, stage = 0, progress.stage[0]
    seen = progress.observation
    observation = State(seen[0], seen[1], seen[2], seen[3])
    while made < count and stage < SUCCEEDED:
        if stage == BETWEEN:
            observation = start(plant, task, rng)
            agent.begin_trial(rng)
            progress.steps[0], stage = 0, BALANCING
        action = agent.act(observation, rng)
        before, (observation, fallen) = observation, push(plant, task, rng, action)
        agent.learn(before, action, observation, fallen)
        progress.action[0] = action
        progress.steps[0] += 1
        made += 1
        if fallen or progress.steps[0] == task.steps:
            agent.end_trial(fallen)
            lengths[progress.trials[0]] = progress.steps[0]
            progress.trials[0] += 1
            stage = BETWEEN if progress.trials[0] < task.trials else FAILED
            stage = stage if fallen else SUCCEEDED
    progress.stage[0] = stage
    for i in range(4):
        seen[i] = observation[i]
    return made
