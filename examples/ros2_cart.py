"""A driver for a real cart, which replaces the simulator.

    python examples/ros2_cart.py                                    in one terminal
    upright ros2 learn adaptive-lqr --steps 1000                    in another

In place of a motor and two encoders, this example uses the equations of motion: replace `self.body`
with your hardware. The driver does not publish a status, so the learner uses the limits of the task
to decide whether the pole has fallen.
"""

from contextlib import suppress
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from upright import State, equations

PERIOD = 0.02
"""Time between two measurements [s]."""
SILENCE = 5
"""Periods without a command after which the motor stops."""


class Cart(Node):
    """A cart that moves with the last command and publishes its measurements 50 times a second."""

    def __init__(self) -> None:
        super().__init__("cart")
        self.body = equations()
        self.force, self.silent = 0.0, 0
        self.states = self.create_publisher(JointState, "joint_states", 10)
        self.create_subscription(Float64MultiArray, "effort", self.on_effort, 10)
        self.create_service(Trigger, "reset", self.on_reset)
        self.create_timer(PERIOD, self.on_period)

    def on_effort(self, command: Float64MultiArray) -> None:
        """Store a command [N] until the next one arrives."""
        self.force, self.silent = command.data[0], 0

    def on_period(self) -> None:
        """Apply the force for one period, then publish the measurements."""
        self.silent += 1
        x, x_dot, theta, theta_dot = self.body.step(self.force if self.silent <= SILENCE else 0.0)
        message = JointState(name=["slider", "hinge"])
        message.header.stamp = self.get_clock().now().to_msg()
        message.position, message.velocity = [x, theta], [x_dot, theta_dot]
        self.states.publish(message)

    def on_reset(self, _: Any, response: Any) -> Any:
        """Respond once a person or a swing-up controller has raised the pole."""
        self.force = 0.0
        self.body.reset(State(0.0, 0.0, 0.02, 0.0))
        response.success = True
        return response


if __name__ == "__main__":
    rclpy.init()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Cart())
