"""Check that a new agent has the methods that the loop calls, with the parameters it passes."""

from typing import Any

from upright.errors import AgentError
from upright.support.custom_code import lacking, refuse_class, refuse_mismatches

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
    refuse_class(AgentError, name, agent)
    needed = TRAIN if is_learner(agent) else METHODS
    if missing := lacking(agent, needed):
        raise AgentError(
            f"agent is {name!r}; it lacks {_listed(missing)}; an agent has the methods "
            f"{_listed(METHODS)}; a learner that only knows Gymnasium has {_listed(TRAIN)}"
        )
    refuse_mismatches(AgentError, name, agent, needed, OPTIONAL)


def _listed(methods: Any) -> str:
    return ", ".join(f"{method}({', '.join((METHODS | TRAIN)[method])})" for method in methods)
