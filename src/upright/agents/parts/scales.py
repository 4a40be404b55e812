"""Scales: what counts as one unit of each measurement, for agents that compute with them.

Settings hold four numbers; `scales_of` turns them into what compiled code reads.
"""

from typing import Any

import numpy as np

from upright.core.parameters import LARGEST
from upright.errors import require

SCALES = ("x_scale", "x_dot_scale", "theta_scale", "theta_dot_scale")
"""The scales as settings name them, in the order of a measurement."""


def check_scales(settings: Any) -> None:
    """Raise UprightError unless the four scales that an agent's settings hold are in range."""
    for name in SCALES:
        require(name, getattr(settings, name), 1 / LARGEST, LARGEST)


def scales_of(settings: Any) -> np.ndarray:
    """Return the scales that an agent's settings hold, shape (4,)."""
    return np.array([getattr(settings, name) for name in SCALES])
