"""Custom agents, named `module:name`.

The name stands for anything that, called with the run's random numbers, returns an agent: a class
whose constructor takes them, or a function. The agent may be plain Python, which is slow, or a
NamedTuple with methods under `upright.compiled`, which is as fast as the package's own. Or it is a
learner that only knows Gymnasium.
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

from upright.core.contracts import Agent, GymnasiumLearner
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
"""What every agent has; `upright.core.contracts.Agent` says more."""


def is_learner(agent: object) -> bool:
    """Whether this is a learner that only knows Gymnasium."""
    return callable(getattr(agent, "train", None)) and not hasattr(agent, "act")


@dataclass(frozen=True)
class CustomAgent:
    """The settings of a custom agent: its name alone. Whatever else it needs is its own affair.

    The agent is imported when it is needed, not before, so that its stored runs can be shown when
    its code is gone.
    """

    agent_name: str
    """Where the agent is found: `module:name`."""

    def agent(self, rng: np.random.Generator) -> Agent | GymnasiumLearner:
        """Return a new agent, or a new learner that only knows Gymnasium.

        Raises
        ------
        UprightError
            If there is no agent of this name, it cannot be made from `rng` alone, or it lacks a
            method.
        """
        make = self._make()
        try:
            inspect.signature(make).bind(rng)
        except TypeError as error:
            raise UprightError(
                f"agent is {self.agent_name!r}; it must be made from the run's random numbers "
                f"alone: {error}"
            ) from None
        agent: Agent | GymnasiumLearner = make(rng)
        lacking = [text for name, text in METHODS.items() if not callable(getattr(agent, name, 0))]
        if lacking and not is_learner(agent):
            raise UprightError(
                f"agent is {self.agent_name!r}; it lacks {', '.join(lacking)}; "
                f"an agent has the methods {', '.join(METHODS.values())}; "
                "a learner that only knows Gymnasium has train(env)"
            )
        return agent

    def summary(self) -> str:
        """Return the first line of the agent's docstring, or of its module's; empty without one."""
        make = self._make()
        return (inspect.getdoc(make) or self._module().__doc__ or "").partition("\n")[0]

    def source(self) -> Path:
        """Return the file of the module that the agent is found in."""
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
        """Return the module, which may also be in the present folder, as for Python itself."""
        name = self.agent_name.partition(":")[0]
        if not all(part.isidentifier() for part in name.split(".")):
            raise UprightError(
                f"agent is {self.agent_name!r}; {name!r} is not the name of a module"
            )
        if os.getcwd() not in sys.path:
            sys.path.insert(0, os.getcwd())
        try:
            return import_module(name)
        except (ImportError, SyntaxError) as error:
            if _is_missing(name, error):
                why = f"there is no module {name!r} in this folder or where Python looks"
            else:  # the module is there, but not all that it needs, or it is not Python
                why = f"its module cannot be imported: {error}"
            raise UprightError(f"agent is {self.agent_name!r}; {why}") from error


def _is_missing(name: str, error: Exception) -> bool:
    """Whether importing the module `name` failed because it, or a package above it, is missing."""
    missing = getattr(error, "name", None)
    return isinstance(error, ModuleNotFoundError) and f"{name}.".startswith(f"{missing}.")
