"""The loop: a trial from start to fall, and a run of trials.

`trial` is written once. Called as it stands it moves any plant and any agent through their methods;
compiled, it moves the equations and the package's agents at millions of steps a second. The same
seed gives the same trial lengths either way.
"""

from functools import cache, partial
from types import SimpleNamespace
from typing import Any, Protocol

import numpy as np
from numba.extending import overload

from upright.agents.agent import Agent
from upright.cartpole import State
from upright.compiled import Compiled, compiled, inlined, machine_code
from upright.noise import disturb, draw_start, measure
from upright.task import Task

NO_PUSHES = (0.0, 0.0)
"""The pushes [N] on their way to the cart at the start of a trial, as many as a delay may have."""


class Plant(Protocol):
    """A body: anything with a cart that can be pushed and a pole that can fall."""

    def reset(self, state: State) -> State:
        """Put the plant into `state` and return the state it is in."""

    def step(self, force: float) -> State:
        """Apply a force [N] for one time step and return the true state then."""

    def has_fallen(self, state: State) -> bool:
        """Whether the body, being in `state`, has left its limits."""

    def close(self) -> None:
        """Release what the plant holds."""


@inlined
def delay(
    steps: int, waiting: tuple[float, float], push: float
) -> tuple[tuple[float, float], float]:
    """Return the pushes [N] that wait after a new one, and the one that acts now."""
    acting = push if steps == 0 else waiting[0] if steps == 1 else waiting[1]
    return (push, waiting[0]), acting


def trial(agent: Agent, plant: Plant, task: Task, rng: np.random.Generator) -> tuple[int, bool]:
    """Let an agent balance once, from a start to a fall or to the step that makes it a success.

    Parameters
    ----------
    agent
        The learner; its memory changes.
    plant
        The body to balance; it is reset first.
    task
        Noise, start, limits and the length of a success.
    rng
        The run's own random numbers.

    Returns
    -------
    tuple
        How many steps the trial lasted, and whether it ended by a fall.
    """
    waiting = NO_PUSHES
    state = plant.reset(draw_start(task.start, rng))
    observation = measure(task.noise, state, rng)
    agent.begin_trial(rng)
    fallen = False
    steps = 0
    while steps < task.steps and not fallen:
        action = agent.act(observation, rng)
        push = task.parameters.force if action else -task.parameters.force
        waiting, push = delay(task.delay, waiting, push)
        state = plant.step(disturb(task.noise, push, rng))
        fallen = plant.has_fallen(state)
        before, observation = observation, measure(task.noise, state, rng)
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
        As for `trial`. The agent's memory is kept from one trial to the next.
    lengths
        Shape (task.trials,), int64. The length of each trial is written here as it ends, so that
        another thread can watch.
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


def bound_run(
    agent: Any,
    plant: Plant,
    task: Task,
    rng: np.random.Generator,
    lengths: np.ndarray,
    stop: np.ndarray,
) -> int:
    """Do the same with a compiled agent and a plant that compiled code cannot move.

    All machine code is there before the first trial, as a body that moves by the wall clock would
    not wait for it, and is called as it stands, which takes a third of the time.
    """
    state = State(0.0, 0.0, 0.0, 0.0)
    calls: dict[str, tuple[Any, ...]] = {
        "begin_trial": (rng,),
        "act": (state, rng),
        "learn": (state, True, state, False),
        "end_trial": (False,),
    }
    methods = {
        name: partial(machine_code(getattr(type(agent), name), agent, *given), agent)
        for name, given in calls.items()
    }
    bound: Any = SimpleNamespace(**methods)
    return run(bound, plant, task, rng, lengths, stop)


compiled_run = compiled(run)
"""For the package's own agents: its machine code is kept on disk."""


@cache
def outside_run(kind: type) -> Compiled:  # noqa: ARG001 - the cache tells kinds apart by it
    """Return the loop for a compiled agent from outside, whose changes no cache would notice.

    Every kind of agent has its own: called from Python, a compiled function tells NamedTuples apart
    by the names of the class and its fields and by their types alone, and would take an agent for
    another of the same form. (Within the package, a test compares them.)
    """
    return Compiled(run, kept=False)
