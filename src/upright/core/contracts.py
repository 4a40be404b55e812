"""What the loop asks of an agent and of a plant.

An agent is a memory and four functions, whatever plant it balances. A learner that only knows
Gymnasium is not an agent: the loop does not call it; it steps an environment itself.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np

from upright.core.parameters import State

if TYPE_CHECKING:
    import gymnasium


class Agent(Protocol):
    """A learner. It knows nothing of the physics: it sees measurements and falls, and pushes."""

    def begin_trial(self, rng: np.random.Generator) -> None:
        """Prepare for a trial from a new start."""

    def act(self, observation: State, rng: np.random.Generator) -> bool:
        """Choose a push: True for +F, False for -F."""

    def learn(self, before: State, action: bool, after: State, fallen: bool) -> None:
        """Learn from one step: the measurement, the action taken, and the measurement after it."""

    def end_trial(self, fallen: bool) -> None:
        """Learn from the trial as a whole, which ended with a fall or in success."""


class GymnasiumLearner(Protocol):
    """A learner that only knows Gymnasium."""

    def train(self, env: "gymnasium.Env[Any, Any]") -> None:
        """Learn in an environment until it raises `upright.RunOver`."""


AnyAgent: TypeAlias = str | Callable[[np.random.Generator], Any]
"""An agent by its name, or its path `module:name`; or the class or function that returns it."""


class Plant(Protocol):
    """Anything with a cart that can be pushed and a pole that can fall."""

    def reset(self, state: State) -> State:
        """Put the plant into `state` and return the state it is then in."""

    def step(self, force: float) -> State:
        """Apply a force [N] for one time step and return the true state after it."""

    def has_fallen(self, state: State) -> bool:
        """Whether the plant in `state` is outside its limits."""

    def close(self) -> None:
        """Release what the plant holds."""
