"""Custom agents, named `module:name`.

The name refers to any callable that returns an agent when called with the run's random generator: a
class whose constructor takes the generator, or a function. The agent may be plain Python, which is
slow; a NamedTuple whose methods have the decorator `upright.compiled`, which is as fast as the
package's own agents; or a learner that only knows Gymnasium.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from upright.agents.checks.contract import check_contract
from upright.agents.checks.names import advice
from upright.core.contracts import Agent, AnyAgent, GymnasiumLearner
from upright.errors import AgentError, UprightError
from upright.support.custom_code import CustomCode, path_of


def name_of(agent: AnyAgent) -> str:
    """Return the name of an agent; for a class or a function, its path `module:name`.

    Raises
    ------
    UprightError
        If it is something else, or what stands at that path is not this class or function.
    """
    if isinstance(agent, str):
        return agent
    if not callable(agent) or not hasattr(agent, "__qualname__"):
        shown = f"of type {type(agent).__qualname__}" if hasattr(agent, "act") else repr(agent)
        raise UprightError(
            f"agent is {shown}; it must be a name, or a class or function which returns an agent "
            "when it is called with the run's random numbers"
        )
    return path_of(agent, AgentError, lambda path: CustomAgent(path).make())


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
        agent: Agent | GymnasiumLearner
        agent = self.code.call(rng, "the run's random generator")
        check_contract(self.agent_name, agent)
        return agent

    @property
    def code(self) -> CustomCode:
        """The class or function that returns a new agent."""
        return CustomCode(self.agent_name, AgentError, advice)

    def summary(self) -> str:
        """Return the first line of the docstring of the agent or its module; empty if none."""
        return self.code.summary()

    def make(self) -> Callable[[np.random.Generator], Any]:
        """Return the class or function that returns a new agent.

        Raises
        ------
        UprightError
            If there is none of this name.
        """
        return self.code.find()
