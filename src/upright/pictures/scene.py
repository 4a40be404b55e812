"""What one picture of the cart-pole shows."""

import math
from typing import NamedTuple

import numpy as np

from upright.core.parameters import State

NOT_FINITE = "the state is not finite"
"""Shown in place of a state that has diverged."""


class History(NamedTuple):
    """The trials of a run so far, for the strip chart below the cart-pole."""

    lengths: np.ndarray
    """Steps of each trial that has ended, in order."""
    present: int
    """Steps of the trial in progress; 0 if there is none."""
    success: int
    """N: a trial of this many steps is a success."""


class Scene(NamedTuple):
    """What one picture shows."""

    state: State
    """The true state."""
    measured: State | None = None
    """The state as the agent measured it."""
    force: float = 0.0
    """The force that acts on the cart [N]."""
    caption: str = ""
    """The title at the top."""
    detail: str = ""
    """The line below the title."""
    ending: str = ""
    """How the trial ended: "fallen", "balanced", or empty while it goes on."""
    last_fall: State | None = None
    """The state in which the previous trial ended with a fall."""
    history: History | None = None
    """The trials so far, if they are to be shown."""
    note: str = ""
    """The line at the bottom, on the left."""
    hint: str = ""
    """The line at the bottom, on the right."""

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
