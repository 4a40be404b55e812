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
from upright.core.contracts import Agent, AnyAgent, GymnasiumLearner
from upright.errors import AgentError, UprightError, did_you_mean


def name_of(agent: AnyAgent) -> str:
    """Return the name of an agent; for a class or a function, its path `module:name`.

    Raises
    ------
    UprightError
        If it is something else, or what stands at that path is not this class or function.
    """
    if isinstance(agent, str):
        return agent
    name = getattr(agent, "__qualname__", None)
    if not callable(agent) or name is None:
        shown = f"of type {type(agent).__qualname__}" if hasattr(agent, "act") else repr(agent)
        raise UprightError(
            f"agent is {shown}; it must be a name, or a class or function which returns an agent "
            "when it is called with the run's random numbers"
        )
    path = f"{agent.__module__}:{name}"
    if "<" in name:  # of a lambda, or within a function
        raise UprightError(
            f"agent is {path!r}; it must be defined at the top level of a module, a script or a "
            "notebook, under a name"
        )
    if CustomAgent(path).make() is not agent:
        raise UprightError(f"agent is {path!r}; another class or function has that name now")
    return path


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
        make = self.make()
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
        make = self.make()
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

    def make(self) -> Callable[[np.random.Generator], Any]:
        """Return the class or function that returns a new agent.

        Raises
        ------
        UprightError
            If there is none of this name.
        """
        name = self.agent_name.partition(":")[2]
        make: Any = self._module()
        for part in name.split("."):
            make = getattr(make, part, None)
        if not callable(make):
            module = self._module()
            hint = did_you_mean(
                name, (key for key, value in vars(module).items() if callable(value))
            )
            raise UprightError(
                f"agent is {self.agent_name!r}; there is no class or function {name!r} in "
                f"{module.__name__}{hint}"
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
