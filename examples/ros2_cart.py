"""A driver for a real cart, which replaces the simulator: a template to start from.

    python examples/ros2_cart.py                                    in one terminal
    upright ros2 learn adaptive-lqr --steps 1000                    in another

Replace the class `Hardware`, which stands in for a cart, and its limits below. The motor stops when
commands cease or are impossible, when the pole has fallen, and when this program ends or fails. A
program that is killed cannot do that: have the motor's own controller stop it if it hears nothing,
and keep a hand on the emergency stop.
"""

import math
import signal
import time
from typing import Any

import rclpy
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from upright import State, equations

LIMIT = 10.0
"""The greatest force [N]."""
TRACK, TILT = 2.4, math.radians(12)
"""The greatest |x| [m] and |θ| [rad] of a trial."""
PERIOD = 0.02
"""Time between two measurements [s]."""
SILENCE = 0.1
"""Time without a command after which the motor stops [s]."""
PATIENCE = 300.0
"""Longest time that a reset waits until the pole is up [s]; the learner waits for 600 s."""


class Hardware:
    """Stands in for a motor, two encoders, and a person who raises the pole. Replace it."""

    def __init__(self) -> None:
        self.body = equations()
        self.force, self.idle = 0.0, 25

    def push(self, force: float) -> None:
        """Let the motor push with this force [N] until the next call."""
        self.force = force

    def read(self) -> State:
        """Return x, its velocity, θ (0 is up, positive to the right) and its velocity."""
        self.idle = 0 if self.force else self.idle + 1
        if self.idle < 25:
            return self.body.step(self.force)
        # The motor has been off for half a second: someone raises the pole and holds it.
        return self.body.reset(State(0.0, 0.0, 0.02, 0.0))


class Cart(Node):
    """Publishes measurements, and lets the motor push as commanded as long as that is safe."""

    def __init__(self, hardware: Hardware) -> None:
        super().__init__("cart")
        self.hardware, self.status = hardware, ""
        self.commanded = math.inf  # when the last command arrived [s]; inf: the motor is off
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.statuses = self.create_publisher(String, "status", kept)
        self.states = self.create_publisher(JointState, "joint_states", 10)
        self.create_subscription(Float64MultiArray, "effort", self.on_effort, 1)
        self.create_service(Trigger, "reset", self.on_reset)
        self.create_timer(PERIOD, self.on_period)
        self.stop("Done")

    def on_effort(self, command: Float64MultiArray) -> None:
        """Push as commanded during a trial; refuse what is not one number within the limit."""
        force = command.data[0] if len(command.data) == 1 else math.nan
        if not abs(force) <= LIMIT * (1 + 1e-9):
            shown = [*command.data[:3]]
            self.stop(f"Fault: effort is {shown}; it must be one number within ±{LIMIT} N")
        elif self.status == "Balancing":
            self.hardware.push(min(max(force, -LIMIT), LIMIT))
            self.commanded = time.monotonic()

    def on_period(self) -> None:
        """Measure, and stop the motor if commands have ceased."""
        self.measure()
        if time.monotonic() - self.commanded > SILENCE:
            self.stop(self.status)
            self.get_logger().warning(f"no effort arrived for {SILENCE} s; the motor has stopped")

    def on_reset(self, _: Any, response: Any) -> Any:
        """Start a trial once a person, or a swing-up controller, has raised the pole."""
        self.stop("Done")
        until = time.monotonic() + PATIENCE
        while not is_up(self.measure()):
            if time.monotonic() > until:
                response.message = f"the pole was not up within {PATIENCE:g} s"
                return response
            time.sleep(PERIOD)
        self.report("Balancing")
        response.success = True
        return response

    def measure(self) -> State:
        """Publish the measurements, with the time at which they were made; return them."""
        message = JointState(name=["slider", "hinge"])
        message.header.stamp = self.get_clock().now().to_msg()
        x, x_dot, theta, theta_dot = state = self.hardware.read()
        if self.status == "Balancing" and not (abs(x) <= TRACK and abs(theta) <= TILT):
            self.stop("Done")  # reported first, as the measurement belongs to it
        message.position, message.velocity = [x, theta], [x_dot, theta_dot]
        self.states.publish(message)
        return state

    def stop(self, status: str) -> None:
        """Stop the motor, and report why."""
        self.hardware.push(0.0)
        self.commanded = math.inf
        self.report(status)

    def report(self, status: str) -> None:
        """Publish and log the status if it has changed: Balancing, Done or Fault: with a reason."""
        if status != self.status:
            self.status = status
            self.statuses.publish(String(data=status))
            self.get_logger().info(status)


def is_up(state: State) -> bool:
    """Whether a trial can start: the cart is near the middle, and the pole up and at rest."""
    x, x_dot, theta, theta_dot = map(abs, state)
    return x < 0.5 and x_dot < 0.2 and theta < 0.05 and theta_dot < 0.2


def main() -> None:
    """Serve until Ctrl-C or SIGTERM."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    # ROS 2's own handlers would close the topics before the last status.
    with rclpy.init(signal_handler_options=SignalHandlerOptions.NO):
        cart = Cart(Hardware())
        try:
            rclpy.spin(cart)
        except KeyboardInterrupt:
            pass
        finally:
            cart.stop("Fault: the driver has ended")
            cart.statuses.wait_for_all_acked(Duration(seconds=1))
            cart.destroy_node()


if __name__ == "__main__":
    main()
