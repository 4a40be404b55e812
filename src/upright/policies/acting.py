"""Plays an agent of which only its choice of pushes is known, `act(observation, rng)`."""

import copy
from collections import deque
from typing import Any

import numpy as np

from upright.agents.checks.checked import is_push, wrong_action
from upright.agents.checks.faults import reporting
from upright.core.parameters import State
from upright.errors import UprightError
from upright.policies.own_classes import CODE, attributes_of

SAMPLES = 25
"""Number of pushes from which a probability is estimated if they differ."""


class Actor:
    """An agent that does not learn any more: it is only asked which way to push.

    Every trial begins with a copy of the agent as it was at the end of its run, in which the random
    numbers of the trial replace the agent's own generator. So nothing that the agent does while it
    plays changes what it does in other trials.

    Parameters
    ----------
    name
        The name of the agent, for errors.
    agent
        The agent, which is never changed.

    Raises
    ------
    AgentError
        From every method, if the agent's code raises an exception, or `act` returns no push.
    UprightError
        From the first method that needs a copy, if the agent cannot be copied.
    """

    def __init__(self, name: str, agent: Any) -> None:
        self._name, self._agent = name, agent
        self._generators = generators_in(agent)
        self._rng = np.random.default_rng(0)
        self._unused = self._rng.bit_generator.state
        self._playing: Any = None
        self._asked: Any = None

    def begin_trial(self, rng: np.random.Generator, *, draws: bool = True) -> None:
        """Begin from the end of the run. If it draws, then from `rng`; `likelier` does not."""
        rng = rng if draws else self._rng
        self._playing = self._copy(rng)
        if hasattr(self._playing, "remember"):
            with reporting(self._name, "begin_trial failed in play"):
                self._playing.begin_trial(rng)

    def act(self, observation: State, rng: np.random.Generator) -> bool:
        """Choose a push."""
        if self._playing is None:
            self.begin_trial(rng)
        return self._push(self._playing, observation, rng)

    def likelier(self, observation: State, rng: np.random.Generator) -> bool:
        """Choose the push that it makes more often; draw nothing from `rng`."""
        if self._playing is None:
            self.begin_trial(rng, draws=False)
        return self._estimate(self._playing, observation) > 0.5

    def remember(self, observation: State, action: bool) -> None:
        """Enter a step into the history, if the agent has one."""
        if hasattr(self._playing, "remember"):
            with reporting(self._name, f"remember failed in play at {observation}"):
                self._playing.remember(observation, action)

    def push_probability(self, observation: State) -> float:
        """Return the fraction of pushes to the right, from one or from `SAMPLES` choices.

        One is enough if no random number was drawn for it. The same numbers are drawn for every
        measurement, so that a map of them is smooth.
        """
        if self._asked is None:
            self._asked = self._copy(self._rng)
        return self._estimate(self._asked, observation)

    def _estimate(self, asked: Any, observation: State) -> float:
        # A copy of the copy: what the agent counts or notes begins anew, as far as it costs little.
        agent = copy.copy(asked)
        self._rng.bit_generator.state = self._unused
        right = self._push(agent, observation, self._rng)
        if self._rng.bit_generator.state == self._unused:
            return float(right)
        others = sum(self._push(agent, observation, self._rng) for _ in range(SAMPLES - 1))
        return (right + others) / SAMPLES

    def _push(self, agent: Any, observation: State, rng: np.random.Generator) -> bool:
        where = f"play at {observation}"
        with reporting(self._name, f"act failed in {where}"):
            action = agent.act(observation, rng)
        if not is_push(action):
            raise wrong_action(self._name, action, where)
        return bool(action)

    def _copy(self, rng: np.random.Generator) -> Any:
        """Return a copy of the agent that draws from these random numbers."""
        try:
            return copy.deepcopy(self._agent, {id(each): rng for each in self._generators})
        except Exception as error:  # what an agent keeps may refuse in any way
            raise UprightError(
                f"agent is {self._name!r}; without push_probability(observation) it is played from "
                f"a copy, and it cannot be copied: {error}"
            ) from error


def generators_in(agent: object) -> list[np.random.Generator]:
    """Return the random generators that an agent keeps."""
    found, seen, waiting = [], set(), [agent]
    while waiting:
        value = waiting.pop()
        if id(value) in seen or isinstance(value, (bool, int, float, str, np.ndarray, *CODE)):
            continue
        seen.add(id(value))
        if isinstance(value, np.random.Generator):
            found.append(value)
        elif isinstance(value, dict):
            waiting += value.values()
        elif isinstance(value, (list, tuple, set, frozenset, deque)):
            waiting += value
        else:
            waiting += attributes_of(value).values()
    return found
