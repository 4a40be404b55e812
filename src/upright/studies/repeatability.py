"""Notice custom agents that do not repeat themselves: the same seed must give the same run."""

import warnings
from dataclasses import replace
from functools import cache
from threading import Lock

from upright.agents import is_custom
from upright.errors import AgentWarning, UprightError
from upright.plants.equations import EQUATIONS
from upright.studies.case import Case
from upright.studies.trace import trace, unseen

TRIALS, STEPS = 3, 100
"""Trials of the two runs that are compared, and the most steps of each trial."""
SEED = 0
"""Seed of these runs."""
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
        with unseen():
            (_, first), (_, again) = trace(case, SEED), trace(case, SEED)
            return first.is_like(again)
    except UprightError:
        return True
