"""The loop: a trial from start to fall, and a run of trials.

`trial` is written once. As plain Python it works with any plant and any agent through their
methods; compiled, it runs the equations and the package's agents at millions of steps a second. The
same seed gives the same trial lengths either way.
"""

from typing import NamedTuple

import numpy as np
from numba.extending import overload

from upright.core.compiled import compiled
from upright.core.contracts import Agent, Plant
from upright.core.noise import draw_start
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
    rig, noise = task.rig, task.noise
    begin_episode(rig, rng)
    state = plant.reset(draw_start(task.start, rng))
    observation = first_measurement(rig, noise, state, rng)
    agent.begin_trial(rng)
    fallen = False
    steps = 0
    while steps < task.steps and not fallen:
        action = agent.act(observation, rng)
        force = strength(rig, task.parameters.force)
        state = plant.step(acting_force(rig, noise, force if action else -force, rng))
        fallen = plant.has_fallen(state)
        before, observation = observation, measurement(rig, noise, state, rng)
        agent.learn(before, action, observation, fallen)
        steps += 1
    agent.end_trial(fallen)
    return steps, fallen


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
