"""A cart on ROS 2's topics: a simulator in another process, or a real one (docs/ros2.md)."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from upright.cartpole import Parameters
from upright.errors import UprightError, require, require_module
from upright.noise import Noise
from upright.task import Task
from upright.trials import Plant

JOINT_STATES, STATUS, EFFORT, RESET = "joint_states", "status", "effort", "reset"
"""Topics of measurements, of whether the pole stands, and of forces [N]; the service that starts a
trial."""
BALANCING, DONE, FAULT = "Balancing", "Done", "Fault: "
"""What the status says: the report's two words, and how a refusal begins."""
SIMULATOR = "simulator"
"""Name of the simulator's node, whose parameters set noise, seed and start."""


@dataclass(frozen=True)
class Ros2:
    """How to wait for a cart that is somewhere else."""

    watchdog: float = 0.5
    """How long measurements may cease before the cart is stopped and the run given up [s]."""
    patience: float = 10.0
    """How long to wait until the cart is found, and until it is reset [s]."""

    name: ClassVar[str] = "ros2"
    alone: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Refuse impossible values."""
        require("watchdog", self.watchdog, 0, 3600, above=True)
        require("patience", self.patience, 0, 3600, above=True)

    def make(self, task: Task, noise: str, seed: int, stop: np.ndarray) -> tuple[Plant, Task]:
        """Find a simulator, have it make the noise, and return it with the task without noise.

        Raises
        ------
        UprightError
            If ROS 2 is missing, there is no simulator, or it cannot do the task.
        """
        require_rclpy()
        if task.parameters != Parameters():
            raise UprightError("plant is 'ros2'; the simulator has the nominal parameters alone")
        from upright.plants.ros2_cart import open_cart

        cart = open_cart(self, task.parameters, stop, {"noise": noise, "seed": seed})
        left = Noise(hides_velocities=task.noise.hides_velocities)
        return cart, task._replace(noise=left)

    def version(self) -> str:
        """Return nothing: what the body is, only its own process knows."""
        return ""


def require_rclpy() -> None:
    """Raise UprightError unless ROS 2 can be used from Python."""
    require_module("rclpy", "ROS 2 is missing; source its setup.bash, or", "ros2")


SETTINGS = Ros2()
