"""A cart on ROS 2 topics: a simulator in another process, or a real cart (docs/ros2.md)."""

from dataclasses import dataclass
from typing import ClassVar

from upright.core.conditions import Noise
from upright.core.contracts import Plant
from upright.core.parameters import changed_parameters
from upright.core.task import Task
from upright.errors import require, require_module
from upright.plants.ros2.topics import Waiting
from upright.plants.settings import RunContext


@dataclass(frozen=True)
class Ros2:
    """Settings of a cart in another process."""

    watchdog: float = 0.5
    """Longest time without a measurement before the cart is stopped and the run aborted [s]."""
    patience: float = 10.0
    """Longest time to wait for the cart to appear, and for its answers [s]."""

    name: ClassVar[str] = "ros2"
    alone: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Refuse impossible values."""
        require("watchdog", self.watchdog, 0.001, 3600)
        require("patience", self.patience, 0.001, 3600)

    def make(self, context: RunContext) -> tuple[Plant, Task]:
        """Connect to a simulator, which produces the noise; return it with the noise-free task.

        Raises
        ------
        UprightError
            If ROS 2 is missing, there is no simulator, its rate is not that of the task, or it
            refuses the task.
        """
        require_rclpy()
        from upright.plants.ros2.cart import open_cart

        task = context.task
        changes = changed_parameters(task.parameters)
        changes.pop("time_step", None)  # the simulator's rate, which is checked
        parameters = ",".join(f"{name}={value!r}" for name, value in changes.items())
        simulated = {"noise": context.spec.noise, "seed": context.seed, "parameters": parameters}
        cart = open_cart(self.waiting, task.parameters, context.stop, simulated)
        noise = Noise(hides_velocities=task.noise.hides_velocities)  # the rest is the simulator's
        return cart, task._replace(noise=noise)

    @property
    def waiting(self) -> Waiting:
        """How long to wait for the cart."""
        return Waiting(self.watchdog, self.patience, self.patience)

    def version(self) -> str:
        """Return an empty string: only the cart's own process knows what moves it."""
        return ""


def require_rclpy() -> None:
    """Raise UprightError unless ROS 2 is available in Python."""
    require_module("rclpy", "ROS 2 is missing; source its setup.bash, or", "ros2")


SETTINGS = {"default": Ros2()}
