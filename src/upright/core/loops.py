"""The loop in the forms that agents and plants call for: compiled, bound, or for custom code."""

from collections.abc import Callable
from functools import cache, partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from upright.core.compiled import Compiled, compiled, is_compiled, machine_code
from upright.core.contracts import Plant
from upright.core.parameters import State
from upright.core.task import Task
from upright.core.trials import run


def bound_run(
    agent: Any,
    plant: Plant,
    task: Task,
    rng: np.random.Generator,
    lengths: np.ndarray,
    stop: np.ndarray,
) -> int:
    """Do what `run` does with a compiled agent and a plant that compiled code cannot move.

    Compiles everything before the first trial, because a real-time plant will not wait, and calls
    the machine code directly, which is three times as fast.
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
def custom_run(agent: type, plant: type) -> Compiled:  # noqa: ARG001 - the cache tells them apart
    """Return the compiled loop for code outside the package, whose changes no cache would notice.

    Every pair of kinds has its own loop: called from Python, a compiled function tells NamedTuples
    apart by the names of the class and its fields and by their types alone, and would take an agent
    for another of the same form. (Within the package, a test compares them.)
    """
    return Compiled(run, kept=False)


def loop_for(agent: Any, plant: Any, *, kept: bool) -> Callable[..., int]:
    """Return the loop that moves this agent and this plant fastest.

    Parameters
    ----------
    kept
        Whether machine code may be kept on disk: agent and plant are both of this package.
    """
    if not is_compiled(agent):
        return run
    if not is_compiled(plant):
        return bound_run
    kinds: Any = type(agent), type(plant)
    return compiled_run if kept else custom_run(*kinds)
