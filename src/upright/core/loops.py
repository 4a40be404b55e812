"""The loop in the forms that agents and plants call for: compiled, bound, for custom agents."""

from functools import cache, partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from upright.core.compiled import Compiled, compiled, machine_code
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
def custom_run(kind: type) -> Compiled:  # noqa: ARG001 - the cache tells kinds apart by it
    """Return the loop for a compiled agent from outside, whose changes no cache would notice.

    Every kind of agent has its own: called from Python, a compiled function tells NamedTuples apart
    by the names of the class and its fields and by their types alone, and would take an agent for
    another of the same form. (Within the package, a test compares them.)
    """
    return Compiled(run, kept=False)
