"""Check that a new agent has the methods that the loop calls, with the parameters it passes."""

import inspect
from collections.abc import Callable
from typing import Any

from upright.errors import AgentError

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
    wrong = [text for method, call in calls.items() if (text := _mismatch(agent, method, call))]
    if wrong:
        raise AgentError(f"agent is {name!r}; {'; '.join(wrong)}")


def _listed(methods: Any) -> str:
    return ", ".join(f"{method}({', '.join((METHODS | TRAIN)[method])})" for method in methods)


def _mismatch(agent: object, name: str, call: tuple[str, ...]) -> str:
    """Return how a method is defined and how it must be; empty if it can be called so."""
    method = getattr(agent, name)
    try:
        inspect.signature(method).bind(*call)
    except TypeError:
        pass
    except ValueError:  # nothing is known of its parameters, as for some functions written in C
        return ""
    else:
        return ""
    if not callable(method):
        return f"{name} is {method!r}; it must be a method {name}(self, {', '.join(call)})"
    function: Callable[..., Any] = getattr(method, "__func__", method)
    own = ("self",) if function is not method else ()
    plain = [p.replace(annotation=p.empty) for p in inspect.signature(function).parameters.values()]
    defined = inspect.Signature(plain)
    return f"{name}{defined} must be {name}({', '.join((*own, *call))})"
