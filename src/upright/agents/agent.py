"""What an agent is: a memory and four functions, whatever body it balances.

A learner that only knows Gymnasium is none: it is not moved by the loop, but moves an environment.
"""

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from upright.cartpole import State

if TYPE_CHECKING:
    import gymnasium


class Agent(Protocol):
    """A learner. It knows nothing of the physics: it sees measurements and falls, and pushes."""

    def begin_trial(self, rng: np.random.Generator) -> None:
        """Get ready for a trial from a new start."""

    def act(self, observation: State, rng: np.random.Generator) -> bool:
        """Choose a push: True for +F, False for -F."""

    def learn(self, before: State, action: bool, after: State, fallen: bool) -> None:
        """Learn from one step: what was measured, what was done, what was measured then."""

    def end_trial(self, fallen: bool) -> None:
        """Learn from the trial as a whole, which ended by a fall or by success."""


class Learner(Protocol):
    """A learner that only knows Gymnasium."""

    def train(self, env: "gymnasium.Env[Any, Any]") -> None:
        """Learn in an environment until that raises `upright.protocol.RunOver`."""
