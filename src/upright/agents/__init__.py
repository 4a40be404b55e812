"""The agents: one learning rule a file, with its named settings beside it.

`parts/` has what several rules share, `custom.py` fetches agents named `module:name`, and `checks/`
has what these are held to. May import `upright.core` and what stands left of it, and no other
agent.
"""

from typing import TYPE_CHECKING, Any, Protocol

from upright.support.registry import Registry
from upright.support.settings import Fields

if TYPE_CHECKING:
    import numpy as np


class Settings(Fields, Protocol):
    """The settings of an agent: a frozen dataclass that checks its values and makes the agent."""

    def agent(self, rng: "np.random.Generator") -> Any:
        """Return a new agent, its memory blank or random."""


def _custom(name: str) -> Settings:
    from upright.agents.custom import CustomAgent

    return CustomAgent(name)


def _advice(name: str) -> str:
    from upright.agents.checks.names import advice

    return advice(name)


AGENTS: Registry[Settings] = Registry(
    "agent",
    {
        "adaptive-lqr": "upright.agents.adaptive_lqr",
        "reinforce": "upright.agents.reinforce",
        "ndp": "upright.agents.ndp",
        "q-learning": "upright.agents.q_learning",
        "ase-ace": "upright.agents.ase_ace",
        "random-search": "upright.agents.random_search",
    },
    group="upright.agents",
    custom=_custom,
    advice=_advice,
)
"""Every agent, and its module. Installed packages register more: entry points `upright.agents`.

Examples
--------
>>> "adaptive-lqr" in upright.AGENTS
True
>>> upright.AGENTS.default("q-learning").discount
0.99
"""

LABELS = ("default", "as-published")
"""Names that an agent's settings may have; the first one's are tuned."""


def is_custom(agent: str) -> bool:
    """Whether an agent's code is not of this package: `module:name`, or an installed package's."""
    return agent not in AGENTS.built_in
