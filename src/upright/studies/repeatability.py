"""Notice custom agents that do not repeat themselves: the same seed must give the same run."""

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import replace
from functools import cache
from io import StringIO
from threading import Lock
from typing import Any

import numpy as np

from upright.agents import is_custom
from upright.agents.checks.contract import is_learner
from upright.core.compiled import is_compiled
from upright.core.contracts import Plant
from upright.core.parameters import State
from upright.errors import AgentWarning, UprightError
from upright.plants.equations import EQUATIONS
from upright.policies.npz_file import arrays_of
from upright.studies.case import Case
from upright.studies.run import make_plant, make_run, new_agent

TRIALS, STEPS = 3, 100
"""Trials of the two runs that are compared, and the most steps of each trial."""
DOUBT = (
    "two runs with the same seed differ, so its results cannot be repeated; all random numbers "
    "must come from rng, and no global variable, class attribute or default argument may change"
)

_one_at_a_time = Lock()


def warn_if_doubtful(doubt: str) -> None:
    """Warn of what `doubt_about` returned, unless it is empty."""
    if doubt:
        warnings.warn(doubt, AgentWarning, stacklevel=2)


def doubt_about(case: Case) -> str:
    """Return why results of a case's agent may not be repeatable; empty if nothing was noticed.

    A custom agent whose plant is the equations makes two short runs with the same seed, once per
    process. What it prints is not shown. An agent that fails is not judged: the run that follows
    reports it.
    """
    if not is_custom(case.agent) or case.plant.name != EQUATIONS.name:
        return ""
    spec = replace(case.spec, trials=TRIALS, steps=min(STEPS, case.spec.steps))
    with _one_at_a_time:
        repeats = _repeats(replace(case, spec=spec), case.key)
    return "" if repeats else f"agent is {case.agent!r}; {DOUBT}"


@cache
def _repeats(case: Case, key: str) -> bool:  # noqa: ARG001 - it tells versions of code apart
    try:
        with _unseen():
            return _trace(case) == _trace(case)
    except UprightError:
        return True


@contextmanager
def _unseen() -> Iterator[None]:
    """Show nothing that is printed, and do not stop at breakpoints, where nobody would see why."""
    hook, sys.breakpointhook = sys.breakpointhook, lambda *_, **__: None
    try:
        with redirect_stdout(StringIO()):
            yield
    finally:
        sys.breakpointhook = hook


def _trace(case: Case) -> tuple[Any, ...]:
    """Make a run and return what shows whether another is the same."""
    recorder = None
    agent = new_agent(case, np.random.default_rng(0))
    if not is_learner(agent) and not is_compiled(agent):
        recorder = _Recorder(make_plant(case, 0, 0, np.zeros(1, np.bool_))[0])
    agent, result = make_run(case, 0, 0, plant=recorder)
    assert result is not None, "nothing stops this run"
    memory = [array.tobytes() for _, array in arrays_of(agent)] if is_compiled(agent) else []
    return result.lengths.tolist(), recorder and recorder.forces, memory


class _Recorder:
    """A plant that records the forces."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self.forces: list[float] = []
        self.reset, self.has_fallen, self.close = plant.reset, plant.has_fallen, plant.close

    def step(self, force: float) -> State:
        """Record a force and apply it."""
        self.forces.append(force)
        return self._plant.step(force)
