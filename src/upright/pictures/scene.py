"""What one picture of the cart-pole shows."""

import math
from typing import NamedTuple

from upright.core.parameters import State

NOT_FINITE = "the state is not finite"
"""Shown in place of a state that has diverged."""


class Scene(NamedTuple):
    """What one picture shows."""

    state: State
    """The true state."""
    measured: State | None = None
    """The state as the agent measured it."""
    force: float = 0.0
    """The force that acts on the cart [N]."""
    caption: str = ""
    """The line at the top."""

    @property
    def is_finite(self) -> bool:
        """Whether the state can be drawn; one that has diverged cannot."""
        return all(map(math.isfinite, (*self.state, self.force)))

    @property
    def mismeasured(self) -> State | None:
        """The measured state, if its cart or pole is not where the true one is."""
        measured = self.measured
        if measured is None or not all(map(math.isfinite, measured)):
            return None
        is_right = (measured.x, measured.theta) == (self.state.x, self.state.theta)
        return None if is_right else measured
