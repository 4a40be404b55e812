"""Names that both sides of a cart behind ROS 2's topics use (docs/ros2.md)."""

from typing import NamedTuple

JOINT_STATES, STATUS, EFFORT, RESET = "joint_states", "status", "effort", "reset"
"""Topics of measurements, of whether the pole stands, and of forces [N]; the service that starts a
trial."""
BALANCING, DONE, FAULT = "Balancing", "Done", "Fault: "
"""What the status says: the report's two words, and how a refusal begins."""
SIMULATOR = "simulator"
"""Name of the simulator's node, whose parameters set noise, seed and start."""


class Waiting(NamedTuple):
    """How long to wait for a cart."""

    watchdog: float
    """For its next measurement [s]."""
    patience: float
    """Until it is found, and until it is reset [s]."""
