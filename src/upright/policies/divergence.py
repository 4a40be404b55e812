"""Notice learning that diverged: numbers that have become infinite, or NaN.

The trials of such a run are what they are, but its agent has nothing left that it could learn with.
The memories of this package's agents are looked at; custom agents may keep such numbers on purpose.
"""

from typing import Any

import numpy as np

from upright.agents import is_custom
from upright.errors import UprightError
from upright.policies.npz_file import arrays_of
from upright.policies.policy import Policy


def diverged_array(agent: str, memory: Any) -> str:
    """Return the name of an array that is not finite; an empty string if all of them are."""
    if is_custom(agent) or not hasattr(memory, "_asdict"):
        return ""
    numbers = (pair for pair in arrays_of(memory) if pair[1].dtype.kind == "f")
    return next((name for name, array in numbers if not np.isfinite(array).all()), "")


def refuse_diverged(policy: Policy) -> None:
    """Raise UprightError if a policy's agent diverged as it learned."""
    if name := diverged_array(policy.agent, policy.memory):
        why = f"it is not written, because learning diverged: {name} is no longer finite"
        raise UprightError(f"policy is one of {policy.agent!r}; {why}")
