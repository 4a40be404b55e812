"""Names that both sides of a cart on ROS 2 topics use (docs/ros2.md)."""

from typing import NamedTuple

JOINT_STATES, STATUS, EFFORT, RESET = "joint_states", "status", "effort", "reset"
"""Topics of measurements, of the status, and of forces [N]; the service that starts a trial."""
BALANCING, DONE, FAULT = "Balancing", "Done", "Fault: "
"""Values of the status: the report's two words, and the prefix of a refusal."""
SIMULATOR = "simulator"
"""Name of the simulator's node, whose parameters set noise, seed and start."""


class Waiting(NamedTuple):
    """How long to wait for a cart."""

    watchdog: float
    """Longest time to wait for its next measurement [s]."""
    patience: float
    """Longest time to wait until it is found, and for an answer of its simulator [s]."""
    reset: float
    """Longest time to wait until it is reset [s]."""
