"""Policies from runs: what an agent learned, checked and saved."""

from typing import Any

import numpy as np

from upright.errors import UprightError
from upright.plants import describe_plant
from upright.policies.files import export_policy
from upright.policies.npz_file import arrays_of, save_policy
from upright.policies.policy import Policy
from upright.studies.case import Case
from upright.support.files import check_output


def check_policy(case: Case) -> None:
    """Make sure that what the case's agent learns can be saved.

    Raises
    ------
    UprightError
        If its memory is no NamedTuple of plain arrays, or it cannot tell the probability of a push.
    """
    agent = case.settings.agent(np.random.default_rng(0))
    plain = hasattr(agent, "_asdict") and not any(a.dtype.hasobject for _, a in arrays_of(agent))
    if not (plain and callable(getattr(agent, "push_probability", None))):
        raise UprightError(
            f"agent is {case.agent!r}; its policy cannot be saved: that takes a NamedTuple of "
            "arrays of numbers with the method push_probability(observation)"
        )


def learned_policy(case: Case, seed: int, run: int, memory: Any) -> Policy:
    """Return the policy that an agent learned in a run."""
    return Policy(case.agent, memory, case.spec, seed, run, describe_plant(case.plant))


def check_learned(path: str, case: Case) -> None:
    """Make sure that what the case's agent learns can be saved there later.

    Raises
    ------
    UprightError
        If it cannot.
    """
    check_output(path)
    check_policy(case)


def save_learned(path: str, case: Case, seed: int, run: int, memory: Any) -> None:
    """Save what an agent learned in a run: as JSON if the path ends so, else as NumPy's archive.

    Raises
    ------
    UprightError
        If it cannot be written.
    """
    policy = learned_policy(case, seed, run, memory)
    if path.endswith(".json"):
        export_policy(path, policy)
    else:
        save_policy(path, policy, case.settings)
