"""The agents, by name: one learning rule a file, with its named settings beside it."""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol

from upright.errors import UprightError, require_one_of
from upright.support.settings import Fields, restored

if TYPE_CHECKING:
    import numpy as np

    from upright.agents.custom import CustomAgent

AGENTS = {
    "adaptive-lqr": "upright.agents.adaptive_lqr",
    "reinforce": "upright.agents.reinforce",
    "ndp": "upright.agents.ndp",
    "q-learning": "upright.agents.q_learning",
    "ase-ace": "upright.agents.ase_ace",
    "random-search": "upright.agents.random_search",
}
"""Where each agent is found. Modules are imported when used: compiled code is slow to load.

Examples
--------
>>> "adaptive-lqr" in upright.AGENTS
True
"""

MATLAB_AGENTS = ("q-learning", "reinforce", "random-search")
"""The agents that the MATLAB twin has, too."""


class Settings(Fields, Protocol):
    """The settings of an agent: a frozen dataclass that checks its values and makes the agent."""

    def agent(self, rng: "np.random.Generator") -> Any:
        """Return a new agent, its memory blank or random."""


def is_custom(agent: str) -> bool:
    """Whether this names an agent from outside the package."""
    return ":" in agent


def named_settings(agent: str) -> dict[str, Settings]:
    """Return an agent's settings by name: "default", and "as-published" where there is a source.

    Parameters
    ----------
    agent
        One of AGENTS, or `module:name` of an agent from outside.

    Raises
    ------
    UprightError
        If there is no such agent, or it is none.
    """
    if is_custom(agent):
        from numpy.random import default_rng

        outside = _outside(agent)
        outside.agent(default_rng(0))
        return {"default": outside}
    require_one_of("agent", agent, [*AGENTS, "module:name"])
    settings: dict[str, Settings] = import_module(AGENTS[agent]).SETTINGS
    return settings


def _outside(agent: str) -> "CustomAgent":
    from upright.agents.custom import CustomAgent

    return CustomAgent(agent)


def summarise_agent(agent: str) -> str:
    """Return what an agent is, in one line.

    Raises
    ------
    UprightError
        If there is no such agent.
    """
    if is_custom(agent):
        return _outside(agent).summary()
    require_one_of("agent", agent, [*AGENTS, "module:name"])
    return (import_module(AGENTS[agent]).__doc__ or "").partition("\n")[0]


def restore_settings(agent: str, values: dict[str, Any]) -> Settings:
    """Return the settings that were written to a file as JSON.

    An agent from outside need not be there any more, and is not looked for.

    Raises
    ------
    UprightError
        If they are not this agent's, or not allowed.
    """
    if is_custom(agent):
        if values != {"agent_name": agent}:  # another name would be other code
            raise UprightError(f"the settings are {values!r}; they are not those of {agent!r}")
        return _outside(agent)
    return restored(named_settings(agent)["default"], values, agent)
