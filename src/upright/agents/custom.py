"""Custom agents, named `module:name`.

The name refers to any callable that returns an agent when called with the run's random generator: a
class whose constructor takes the generator, or a function. The agent may be plain Python, which is
slow; a NamedTuple whose methods have the decorator `upright.compiled`, which is as fast as the
package's own agents; or a learner that only knows Gymnasium.
"""

import inspect
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from upright.agents.checks.contract import check_contract
from upright.agents.checks.faults import RAISED, fault, reporting
from upright.agents.checks.names import advice
from upright.core.contracts import Agent, GymnasiumLearner
from upright.errors import AgentError, UprightError


@dataclass(frozen=True)
class CustomAgent:
    """Placeholder for the settings of a custom agent, which manages its own.

    The agent is imported only when needed, so its stored runs stay readable after its code is gone.
    """

    agent_name: str
    """Where the agent is found: `module:name`."""

    def agent(self, rng: np.random.Generator) -> Agent | GymnasiumLearner:
        """Return a new agent, or a new learner that only knows Gymnasium.

        Raises
        ------
        UprightError
            If there is no agent of this name.
        AgentError
            If its code raises an exception, it cannot be created from `rng` alone, or it lacks a
            method that can be called as it must be.
        """
        make = self._make()
        try:
            inspect.signature(make).bind(rng)
        except TypeError as error:
            raise AgentError(
                f"agent is {self.agent_name!r}; it must be callable with the run's random "
                f"generator alone: {error}"
            ) from None
        except ValueError:  # nothing is known of its parameters, as for some functions written in C
            pass
        with reporting(self.agent_name, "it cannot be created"):
            agent: Agent | GymnasiumLearner = make(rng)
        check_contract(self.agent_name, agent)
        return agent

    def summary(self) -> str:
        """Return the first line of the docstring of the agent or its module; empty if none."""
        make = self._make()
        return (inspect.getdoc(make) or self._module().__doc__ or "").partition("\n")[0]

    def source(self) -> Path:
        """Return the file of the agent's module.

        Raises
        ------
        UprightError
            If the module has no file.
        """
        file = self._module().__file__
        if file is None:
            raise UprightError(f"agent is {self.agent_name!r}; its module has no file")
        return Path(file)

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
        """Return the module; it may also be in the current folder, as for Python itself."""
        name = self.agent_name.partition(":")[0]
        if not all(part.isidentifier() for part in name.split(".")) or Path(name).is_file():
            why = advice(self.agent_name) or f"{name!r} is not the name of a module"
            raise UprightError(f"agent is {self.agent_name!r}; {why}")
        if os.getcwd() not in sys.path:
            sys.path.insert(0, os.getcwd())
        try:
            return import_module(name)
        except RAISED as error:
            if _is_missing(name, error):
                why = f"there is no module {name!r} in this folder or where Python looks"
                raise UprightError(f"agent is {self.agent_name!r}; {why}") from error
            raise fault(self.agent_name, "its module cannot be imported", error) from error


def _is_missing(name: str, error: BaseException) -> bool:
    """Whether importing the module `name` failed because it, or a package above it, is missing."""
    missing = getattr(error, "name", None)
    return isinstance(error, ModuleNotFoundError) and f"{name}.".startswith(f"{missing}.")
