"""A driver for a cart of your own, in the place of the simulator.

    python examples/ros2_cart.py                                    in one terminal
    upright ros2 learn adaptive-lqr --steps 1000                    in another

It has the equations where yours has a motor and two encoders: put them where `self.body` is. It has
no status, so that the learner judges by the limits of the task whether the pole fell.
"""

from contextlib import suppress
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from upright.core.parameters import State
from upright.plants.equations import equations

PERIOD = 0.02
"""Time between two measurements [s]."""
SILENCE = 5
"""Periods without a command after which the motor stops."""


class Cart(Node):
    """Moves by the last command, and tells what it measures 50 times a second."""

    def __init__(self) -> None:
        super().__init__("cart")
        self.body = equations()
        self.force, self.silent = 0.0, 0
        self.states = self.create_publisher(JointState, "joint_states", 10)
        self.create_subscription(Float64MultiArray, "effort", self.on_effort, 10)
        self.create_service(Trigger, "reset", self.on_reset)
        self.create_timer(PERIOD, self.on_period)

    def on_effort(self, command: Float64MultiArray) -> None:
        """Keep a command [N] until the next one."""
        self.force, self.silent = command.data[0], 0

    def on_period(self) -> None:
        """Let the motor push, and publish what the encoders say then."""
        self.silent += 1
        x, x_dot, theta, theta_dot = self.body.step(self.force if self.silent <= SILENCE else 0.0)
        message = JointState(name=["slider", "hinge"])
        message.header.stamp = self.get_clock().now().to_msg()
        message.position, message.velocity = [x, theta], [x_dot, theta_dot]
        self.states.publish(message)

    def on_reset(self, _: Any, response: Any) -> Any:
        """Answer once the pole stands: set up by a person, or by a swing-up."""
        self.force = 0.0
        self.body.reset(State(0.0, 0.0, 0.02, 0.0))
        response.success = True
        return response


if __name__ == "__main__":
    rclpy.init()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Cart())
