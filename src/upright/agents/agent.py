"""What an agent is: a memory and four functions, whatever body it balances."""

from typing import Protocol

import numpy as np

from upright.cartpole import State


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
