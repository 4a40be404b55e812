"""A cart that is not like the simulator: `python quirky_cart.py QUIRKS`, a dictionary in JSON."""

import json
import math
import sys
import time
from contextlib import suppress
from dataclasses import dataclass, replace

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from upright import Parameters, State, equations

DOWN = State(0.5, 0.0, math.pi, 0.0)
UP = State(0.0, 0.0, 0.02, 0.0)


@dataclass(frozen=True)
class Quirks:
    """How a cart differs from the one that the learner expects by default."""

    name: str = "cart"
    rate: float = 50.0
    """Measurements per second."""
    names: tuple[str, ...] = ("slider", "hinge")
    position: tuple[float, float] = (1.0, 0.0)
    angle: tuple[float, float] = (1.0, 0.0)
    """Readings are gain × quantity + zero."""
    command_gain: float = 1.0
    """Newtons for a command of 1."""
    velocities: bool = True
    broken_after: float = math.inf
    """After this time from the first push, measurements of the position are broken [s]."""
    broken: float = math.nan
    """What a broken sensor measures."""
    garbage_after: int = 0
    """This measurement is no message of its kind; 0: none."""
    stamped: bool = True
    jump: float = 0.0
    """By how much the clock is set a second after the first push [s]."""
    status: str = ""
    """Reliability of a status: RELIABLE, BEST_EFFORT or empty for none."""
    done_after: float = math.inf
    """After this time from the first push, the status is Done [s]."""
    word: str = ""
    """The status at the start, published again and again until a reset."""
    publishers: int = 1
    """How many publishers of measurements it has; it uses one."""
    silent_reset: bool = False
    """Whether a reset publishes no status."""
    kept_commands: bool = False
    """Whether commands are asked for with transient durability."""
    reset_takes: float = 0.0
    """After this time a reset is answered [s]."""
    by_person: bool = False
    """Whether there is no service: the pole hangs down, and is raised once the cart is at rest in
    the middle."""
    states: bool = True
    """Whether there are measurements."""
    force: float = 10.0
    """What the cart refuses to exceed [N]."""


class QuirkyCart(Node):
    """Equations of motion behind the topics of a cart, by the wall clock."""

    def __init__(self, quirks: Quirks) -> None:
        super().__init__(quirks.name)
        self.quirks = quirks
        self.body = equations(Parameters(time_step=1 / quirks.rate))
        self.state = self.body.reset(DOWN if quirks.by_person else UP)
        self.force, self.commanded, self.number, self.held_since = 0.0, 0.0, 0, math.inf
        self.pushed = math.inf
        self.status = None
        if quirks.status:
            profile = QoSProfile(depth=10, reliability=ReliabilityPolicy[quirks.status])
            self.status = self.create_publisher(String, "status", profile)
        self.word = quirks.word
        if quirks.states:
            found = [
                self.create_publisher(JointState, "joint_states", 10)
                for _ in range(quirks.publishers)
            ]
            self.states = found[0]
            self.create_timer(1 / quirks.rate, self.on_period)
        durability = DurabilityPolicy.VOLATILE
        if quirks.kept_commands:
            durability = DurabilityPolicy.TRANSIENT_LOCAL
        profile = QoSProfile(depth=10, durability=durability)
        self.create_subscription(Float64MultiArray, "effort", self.on_effort, profile)
        if not quirks.by_person:
            self.create_service(Trigger, "reset", self.on_reset)

    def on_effort(self, command: Float64MultiArray) -> None:
        """Store a command."""
        self.force, self.commanded = self.quirks.command_gain * command.data[0], time.monotonic()
        if self.force:
            self.pushed = min(self.pushed, time.time())
        print(f"{self.force:g}", flush=True)
        if abs(self.force) > self.quirks.force * 1.000001:
            raise SystemExit(f"{self.force} N")

    def on_period(self) -> None:
        """Move for one period, and publish a measurement."""
        quirks = self.quirks
        if time.monotonic() - self.commanded > 0.1:
            self.force = 0.0
        hangs = abs(self.state.theta) > 1
        self.state = self.body.step(self.force)
        if hangs:
            self.pushed = math.inf  # what brings the cart to the middle does not count
            self.raise_pole()
        elif math.isfinite(self.held_since):
            self.hold_pole()
        self.number += 1
        if time.time() - self.pushed > quirks.done_after:
            self.word = "Done"
        if self.word and self.number % 5 == 0:
            self.status.publish(String(data=self.word))
        x, x_dot, theta, theta_dot = self.state
        (a, b), (c, d) = quirks.position, quirks.angle
        message = JointState(name=list(quirks.names))
        message.position = [a * x + b, c * theta + d]
        message.velocity = [a * x_dot, c * theta_dot] if quirks.velocities else []
        if time.time() - self.pushed > quirks.broken_after:
            message.position[0] = quirks.broken
        if quirks.stamped:
            now = time.time() + quirks.jump * (time.time() - self.pushed > 1)
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(int(now * 1e9), 10**9)
        garbage = b"\0\1\0\0" + b"\xff" * 40  # a count beyond the end
        self.states.publish(garbage if self.number == quirks.garbage_after else message)

    def raise_pole(self) -> None:
        """As a person does who waits until the cart has come to rest in the middle."""
        self.state = self.body.reset(self.state._replace(theta=math.pi, theta_dot=0.0))
        if abs(self.state.x) < 0.05 and abs(self.state.x_dot) < 0.05:
            self.state, self.held_since = self.body.reset(UP), time.monotonic()

    def hold_pole(self) -> None:
        """Keep it still until the learner pushes."""
        if self.force:
            self.held_since = math.inf
        else:
            self.state, self.pushed = self.body.reset(UP), math.inf

    def on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Put the pole up."""
        time.sleep(self.quirks.reset_takes)
        self.force, self.word = 0.0, ""
        self.state = self.body.reset(UP)
        if self.status and not self.quirks.silent_reset:
            self.status.publish(String(data="Balancing"))
        response.success = True
        return response


def main() -> None:
    """Run until interrupted."""
    given = json.loads(sys.argv[1])
    tuples = {name: tuple(value) for name, value in given.items() if isinstance(value, list)}
    rclpy.init()
    cart = QuirkyCart(replace(Quirks(), **(given | tuples)))
    print("there", flush=True)
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(cart)


if __name__ == "__main__":
    main()
