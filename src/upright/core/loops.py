"""The forms of the loop for different agents and plants: compiled, bound, or for custom code."""

from collections.abc import Callable
from functools import cache, partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from upright.core.compiled import Compiled, compiled, guard, is_compiled, machine_code
from upright.core.contracts import Plant
from upright.core.guards import require_array, require_lane
from upright.core.parameters import State
from upright.core.rig import check_rig
from upright.core.task import Task
from upright.core.trials import run
from upright.errors import require


def bind(agent: Any, rng: np.random.Generator) -> Any:
    """Return the methods of a compiled agent as machine code, which Python calls directly.

    That is three times as fast as calling the methods; everything is compiled first.
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
    return SimpleNamespace(**methods)


def bound_run(
    agent: Any,
    plant: Plant,
    task: Task,
    rng: np.random.Generator,
    lengths: np.ndarray,
    stop: np.ndarray,
) -> int:
    """Do what `run` does, for a compiled agent and a plant that compiled code cannot step.

    Compiles everything before the first trial, because a real-time plant will not wait.
    """
    return run(bind(agent, rng), plant, task, rng, lengths, stop)


compiled_run = compiled(run)
"""The loop for the package's own agents; its machine code is cached on disk."""


@guard(compiled_run)
def check_run(
    _agent: Any,
    _plant: Any,
    task: Task,
    _rng: np.random.Generator,
    lengths: np.ndarray,
    stop: np.ndarray,
) -> None:
    """Raise UprightError unless the arrays of a run have the sizes that the loop relies on."""
    require_array("lengths", lengths, np.int64, None)
    require("number of lengths", len(lengths), task.trials, whole=True)
    require_array("stop", stop, np.bool_, 1, written=False)
    if task.rig is not None:
        check_rig(task.rig)
        require_lane(0, task.rig.memory.shape[1])


@cache
def custom_run(agent: type, plant: type) -> Compiled:  # noqa: ARG001 - keys of the cache
    """Return the compiled loop for custom code, whose changes a cache on disk would not notice.

    Every pair of types has its own loop: called from Python, a compiled function tells NamedTuples
    apart only by the names of the class and its fields and by the fields' types, and would confuse
    two agents of the same form. (Within the package, a test ensures that no two are alike.)
    """
    loop = Compiled(run, kept=False)
    guard(loop)(check_run)
    return loop


def loop_for(agent: Any, plant: Any, *, kept: bool) -> Callable[..., int]:
    """Return the fastest loop for this agent and this plant.

    Parameters
    ----------
    kept
        Whether machine code may be cached on disk, as agent and plant are both of this package.
    """
    if not is_compiled(agent):
        return run
    if not is_compiled(plant):
        return bound_run
    kinds: Any = type(agent), type(plant)
    return compiled_run if kept else custom_run(*kinds)
