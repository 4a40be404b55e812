"""Agents from outside the package, named `module:name`.

The name stands for anything that, called with the run's random numbers, returns an agent: a class
whose constructor takes them, or a function. The agent may be plain Python, which is slow, or a
NamedTuple with methods under `upright.compiled.compiled`, which is as fast as the package's own.
"""

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from upright.agents.agent import Agent
from upright.errors import UprightError

METHODS = {
    name: f"{name}{signature}"
    for name, signature in (
        ("begin_trial", "(rng)"),
        ("act", "(observation, rng)"),
        ("learn", "(before, action, after, fallen)"),
        ("end_trial", "(fallen)"),
    )
}
"""What every agent has; `agents/agent.py` says more."""


@dataclass(frozen=True)
class Outside:
    """Stands in for the settings of an agent from outside, which are its own affair."""

    agent_name: str
    """Where the agent is found: `module:name`."""

    def __post_init__(self) -> None:
        """Refuse a name that leads to no agent."""
        self._make()

    def agent(self, rng: np.random.Generator) -> Agent:
        """Return a new agent.

        Raises
        ------
        UprightError
            If it lacks a method.
        """
        agent: Agent = self._make()(rng)
        lacking = [text for name, text in METHODS.items() if not callable(getattr(agent, name, 0))]
        if lacking:
            raise UprightError(
                f"agent is {self.agent_name!r}; it lacks {', '.join(lacking)}; "
                f"an agent has the methods {', '.join(METHODS.values())}"
            )
        return agent

    def source(self) -> Path:
        """Return the file that the agent is written in."""
        return Path(str(self._module().__file__))

    def _make(self) -> Callable[[np.random.Generator], Any]:
        name = self.agent_name.partition(":")[2]
        make = getattr(self._module(), name, None)
        if not callable(make):
            raise UprightError(
                f"agent is {self.agent_name!r}; there is no class or function {name!r} in "
                f"{self._module().__name__}"
            )
        return make  # type: ignore[no-any-return]

    def _module(self) -> ModuleType:
        """Return the module, looked for in the present folder too, as Python itself does."""
        name = self.agent_name.partition(":")[0]
        if os.getcwd() not in sys.path:
            sys.path.insert(0, os.getcwd())
        try:
            return import_module(name)
        except ModuleNotFoundError as error:
            if error.name and not f"{name}.".startswith(f"{error.name}."):
                raise  # the module is there, but something that it needs is not
            raise UprightError(
                f"agent is {self.agent_name!r}; there is no module {name!r} in this folder or "
                "where Python looks"
            ) from None
