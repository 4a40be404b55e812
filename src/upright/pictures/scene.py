"""What one picture of the cart-pole shows."""

import math
from typing import TYPE_CHECKING, NamedTuple

from upright.core.parameters import State

if TYPE_CHECKING:
    pass


class Scene(NamedTuple):
    """What one picture shows."""

    state: State
    """The true state."""
    measured: State | None = None
    """What the agent saw of it."""
    force: float = 0.0
    """The force that acts on the cart [N]."""
    caption: str = ""
    """The line on top."""

    @property
    def is_finite(self) -> bool:
        """Whether there is something to draw: a state that diverged is none."""
        return all(map(math.isfinite, (*self.state, self.force)))

    @property
    def mistaken(self) -> State | None:
        """What the agent saw, if it saw cart or pole at another place than they are."""
        seen = self.measured
        if seen is None or not all(map(math.isfinite, seen)):
            return None
        return seen if (seen.x, seen.theta) != (self.state.x, self.state.theta) else None
