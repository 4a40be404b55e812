"""Check that a new agent has the methods that the loop calls, with the parameters it passes."""

from typing import Any

from upright.errors import AgentError
from upright.support.custom_code import mismatch

METHODS = {
    "begin_trial": ("rng",),
    "act": ("observation", "rng"),
    "learn": ("before", "action", "after", "fallen"),
    "end_trial": ("fallen",),
}
"""The parameters of the methods of every agent; `upright.core.contracts.Agent` describes them."""
OPTIONAL = {"push_probability": ("observation",), "remember": ("observation", "action")}
"""Those of methods that an agent may have besides."""
TRAIN = {"train": ("env",)}
"""Those of the method of a learner that only knows Gymnasium."""


def is_learner(agent: object) -> bool:
    """Whether this is a learner that only knows Gymnasium."""
    return callable(getattr(agent, "train", None)) and not hasattr(agent, "act")


def check_contract(name: str, agent: object) -> None:
    """Raise AgentError unless an agent can be called as the loop does.

    Parameters
    ----------
    name
        Name of the agent.
    agent
        What was created under this name.
    """
    if isinstance(agent, type):
        raise AgentError(
            f"agent is {name!r}; it returned the class {agent.__name__}; it must return an object "
            "of the class"
        )
    needed = TRAIN if is_learner(agent) else METHODS
    lacking = [method for method in needed if not callable(getattr(agent, method, None))]
    if lacking:
        raise AgentError(
            f"agent is {name!r}; it lacks {_listed(lacking)}; an agent has the methods "
            f"{_listed(METHODS)}; a learner that only knows Gymnasium has {_listed(TRAIN)}"
        )
    given = {method: call for method, call in OPTIONAL.items() if hasattr(agent, method)}
    calls = needed | given
    wrong = [text for method, call in calls.items() if (text := mismatch(agent, method, call))]
    if wrong:
        raise AgentError(f"agent is {name!r}; {'; '.join(wrong)}")


def _listed(methods: Any) -> str:
    return ", ".join(f"{method}({', '.join((METHODS | TRAIN)[method])})" for method in methods)
