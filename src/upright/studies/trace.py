"""Traces of runs: what tells whether two runs are the same."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from typing import Any

import numpy as np

from upright.agents.checks.contract import is_learner
from upright.core.compiled import is_compiled
from upright.core.contracts import Plant
from upright.core.parameters import State
from upright.policies.npz_file import arrays_of
from upright.studies.case import Case
from upright.studies.run import make_plant, make_run, new_agent


@dataclass(frozen=True)
class Trace:
    """What an agent did in a run."""

    lengths: tuple[int, ...]
    """Steps of each trial."""
    pushes: tuple[bool, ...]
    """Whether each push went to the right; empty unless the agent is plain Python."""
    memory: tuple[bytes, ...]
    """The arrays that a compiled agent ends with; empty for others."""
    seconds: float
    """Wall time."""

    @property
    def speed(self) -> float:
        """Steps per second."""
        return sum(self.lengths) / max(self.seconds, 1e-9)

    def is_like(self, other: "Trace") -> bool:
        """Whether the same happened in another run."""
        ours, others = ((t.lengths, t.pushes, t.memory) for t in (self, other))
        return ours == others


def trace(case: Case, seed: int, run: int = 0) -> tuple[Any, Trace]:
    """Make a run, and return the trained agent and the trace.

    Raises
    ------
    AgentError
        As for `make_run`.
    """
    agent = new_agent(case, np.random.default_rng(0))
    recorder = None
    if not is_learner(agent) and not is_compiled(agent):
        recorder = _Recorder(make_plant(case, seed, run, np.zeros(1, np.bool_))[0])
    agent, result = make_run(case, seed, run, plant=recorder)
    assert result is not None, "nothing stops this run"
    pushes = tuple(recorder.pushes) if recorder else ()
    arrays = arrays_of(agent) if is_compiled(agent) else ()
    memory = tuple(array.tobytes() for _, array in arrays)
    return agent, Trace(tuple(result.lengths.tolist()), pushes, memory, result.seconds)


def trace_elsewhere(case: Case, seed: int) -> tuple[str, Trace]:
    """Return the key of a case and its trace, as the process that this is called in finds them.

    What the agent prints is not shown.
    """
    with unseen():
        return case.key, trace(case, seed)[1]


@contextmanager
def unseen() -> Iterator[None]:
    """Show nothing that is printed, and do not stop at breakpoints, where nobody would see why."""
    hook, sys.breakpointhook = sys.breakpointhook, lambda *_, **__: None
    try:
        with redirect_stdout(StringIO()):
            yield
    finally:
        sys.breakpointhook = hook


class _Recorder:
    """A plant that records to which side it is pushed."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self.pushes: list[bool] = []
        self.reset, self.has_fallen, self.close = plant.reset, plant.has_fallen, plant.close

    def step(self, force: float) -> State:
        """Record the direction of a force, and apply it."""
        self.pushes.append(force > 0.0)
        return self._plant.step(force)
