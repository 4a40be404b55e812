"""A learner on its plant as functions and one block of memory, for any machine."""

from typing import Any, NamedTuple

import numpy as np

from upright.builds.machine import Function, Machine, emit
from upright.builds.memory import Memory
from upright.builds.numba_inside import lower
from upright.core.compiled import inlined
from upright.core.loops import compiled_run
from upright.core.pcg64 import Pcg64, new_stream
from upright.studies.case import Case
from upright.studies.run import make_plant


class Built(NamedTuple):
    """A learner for a machine."""

    code: bytes
    """An object file."""
    memory: Memory
    """How the learner's memory is laid out."""


def build(case: Case, machine: Machine) -> Built:
    """Return a learner on its plant, for a machine.

    Its functions take a pointer to its memory:

    - ``begin(memory)`` sets all numbers to those of a new learner;
    - ``seed(memory, seed, run)`` draws what a new learner draws, so that what follows is the run
      with this number of a study with this seed, both below 2³²;
    - ``run(memory)`` is the run; it returns the number of the trial that succeeded, or 0.

    Raises
    ------
    UprightError
        If the agent calls the C library.
    """
    stop = np.zeros(1, np.bool_)
    agent, rng = case.settings.agent(np.random.default_rng(0)), new_stream(0, 0)
    plant, task = make_plant(case, 0, 0, stop)
    lengths = np.zeros(case.spec.trials, np.int64)
    whole = {"agent": agent, "plant": plant, "task": task, "rng": rng, "lengths": lengths}
    functions = {
        "run": Function(lower(compiled_run, whole | {"stop": stop})),
        "seed": _seed(agent, rng),
    }
    leaves = [leaf for each in functions.values() for leaf in each.leaves()]
    memory = Memory(leaves)
    return Built(emit(functions, memory, machine), memory)


def _seed(agent: Any, rng: Pcg64) -> Function:
    if hasattr(agent, "begin_run"):
        arguments = {"agent": agent, "rng": rng, "seed": 0, "run": 0}
        return Function(lower(_begin_run, arguments), ("seed", "run"))
    return Function(lower(Pcg64.seed, {"rng": rng, "seed": 0, "run": 0}), ("seed", "run"))


@inlined
def _begin_run(agent: Any, rng: Pcg64, seed: int, run: int) -> None:
    rng.seed(seed, run)
    agent.begin_run(rng)
