"""The simulator: a cart-pole with the topics of a real cart."""

import math
import os
import reprlib
import signal
import time
from collections.abc import Sequence
from threading import Event

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from upright.core.contracts import Plant
from upright.core.noise import disturb, draw_start, measure
from upright.core.parameters import State
from upright.errors import UprightError
from upright.nodes.diagnostics import INTERVAL, Diagnostics, Health
from upright.nodes.parameters import declare, plain
from upright.nodes.punctuality import Punctuality
from upright.nodes.settings import DRAWN, SimulatorSettings
from upright.plants.ros2.messages import read_numbers
from upright.plants.ros2.node import (
    HEARD,
    KEPT,
    POLL,
    QOS,
    OwnNode,
    ParameterValues,
    make_executor,
    new_node,
)
from upright.plants.ros2.topics import (
    BALANCING,
    DONE,
    EFFORT,
    FAULT,
    JOINT_STATES,
    RESET,
    SIMULATOR,
    STATUS,
)
from upright.plants.settings import RunContext
from upright.plants.urdf import HINGE, SLIDER
from upright.support.exit_status import exit_status
from upright.support.settings import with_values

CHANGEABLE = ("noise", "start", "start_state", "seed", "parameters")
"""Parameters that may be set while the node runs; they take effect at the next reset."""


class Simulator:
    """Owns a plant, moves it as commanded, and publishes measurements.

    Parameters
    ----------
    node
        The node that has the topics and parameters.

    Raises
    ------
    UprightError
        If a parameter has an impossible value, or the plant's library is missing.
    """

    def __init__(self, node: OwnNode) -> None:
        self.settings = declare(node, SimulatorSettings(), CHANGEABLE)
        self._node, self._log = node, node.get_logger()
        self._task = self.settings.spec().task()
        self._plant = self._make_plant()
        self._rng = np.random.default_rng(self.settings.seed)
        self._period = round(1e9 / self.settings.rate)  # [ns]
        self._stamp = 0  # simulated time [ns]
        self._status = String(data=DONE)
        self._measured = JointState(name=[SLIDER, HINGE], effort=[0.0, 0.0])
        self._held = False  # whether the pole is held until the first command of a trial
        self._force = 0.0  # the last command [N]
        self._commanded = 0.0  # time at which it arrived [s]
        self._punctuality = Punctuality()
        self._periods = 0  # since the last report of diagnostics
        self._missed = 0  # of the trial, at that time

        self._warm_up()  # before any program can find the topics
        node.add_on_set_parameters_callback(self._on_parameters)
        self._states = node.create_publisher(JointState, JOINT_STATES, QOS)
        self._statuses = node.create_publisher(String, STATUS, KEPT)
        self._clocks = node.create_publisher(Clock, "clock", QOS)
        node.create_subscription(Float64MultiArray, EFFORT, self._on_effort, HEARD, raw=True)
        node.create_service(Trigger, RESET, self._on_reset)
        Diagnostics(node, "control periods", self._health)
        self._executor = make_executor(node)
        self._set_status(DONE)
        self._publish(self._plant.reset(State(0.0, 0.0, 0.0, 0.0)), 0.0)

    def run(self, stopped: Event, parent: int | None) -> None:
        """Serve until stopped, or until the parent process is gone."""
        period = 1 / (self.settings.rate * self.settings.real_time_factor)
        due = math.inf if self.settings.lock_step else time.monotonic() + period
        while not stopped.is_set() and (parent is None or os.getppid() == parent):
            left = due - time.monotonic()
            if left <= 0:
                self._tick(due)
                due += period
            # Even if each period ends late, so that commands and resets are heard.
            self._executor.spin_once(timeout_sec=min(max(left, 0.0), POLL))

    def __str__(self) -> str:
        pace = "in lock-step" if self.settings.lock_step else "in real time"
        return f"{self.settings.plant} {pace}, ROS domain {self._node.context.get_domain_id()}"

    def close(self) -> None:
        """Release the plant, and log how punctual its last trial was."""
        self._report()
        self._node.leave_executor()  # before the plant, which its messages move
        self._plant.close()

    def _make_plant(self) -> Plant:
        spec = self.settings.spec()
        context = RunContext(spec.task(), spec, 0, np.zeros(1, np.bool_))
        return self.settings.plant_settings().make(context)[0]

    def _warm_up(self) -> None:
        """Compile everything, which takes longer than a client waits for an answer."""
        self._plant.reset(draw_start(self._task.start, np.random.default_rng(0)))
        self._plant.has_fallen(self._plant.step(0.0))

    def _on_parameters(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        values = {parameter.name: plain(parameter.value) for parameter in parameters}
        previous = self.settings
        try:
            self.settings = with_values(previous, values)
            if "parameters" in values:
                self._plant.close()
                self._plant = self._make_plant()
        except (UprightError, TypeError) as error:
            if self.settings is not previous:  # its plant refuses the parameters
                self.settings = previous
                self._plant = self._make_plant()
            return SetParametersResult(successful=False, reason=str(error))
        self._task = self.settings.spec().task()
        if values.keys() & {"noise", "seed"}:
            self._rng = np.random.default_rng(self.settings.seed)
        return SetParametersResult(successful=True)

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Start a trial."""
        self._report()
        state = State(*self.settings.start_state)
        if any(map(math.isnan, state)):
            state = draw_start(self._task.start, self._rng)
        else:
            self._node.set_parameters([Parameter("start_state", value=list(DRAWN))])
        state = self._plant.reset(state)
        self._force, self._held = 0.0, True
        self._set_status(BALANCING)
        self._publish(measure(self._task.noise, state, self._rng), 0.0)
        response.success = True
        return response

    def _on_effort(self, raw: bytes) -> None:
        """Obey a command if a trial is in progress and the force is within the limit."""
        limit = self._task.parameters.force
        try:
            numbers = read_numbers(raw)
        except UprightError as error:
            self._log.error(str(error))
            self._set_status(f"{FAULT}{error}")
            return
        force = numbers[0] if len(numbers) == 1 else math.nan
        if not abs(force) <= limit:
            shown = reprlib.repr(numbers)
            self._log.error(f"{EFFORT} is {shown}; it must be one number in ±{limit}")
            self._set_status(f"{FAULT}{EFFORT} is {shown}, beyond ±{limit} N")
        elif self._status.data != BALANCING:
            self._set_status(self._status.data)  # the learner may have missed it
            self._rest()
        elif self.settings.lock_step:
            self._advance(force)
        else:
            self._held, self._force, self._commanded = False, force, time.monotonic()
            self._punctuality.command(self._commanded)

    def _advance(self, force: float) -> None:
        """Move the cart by one period."""
        noise = self._task.noise
        state = self._plant.step(disturb(noise, force, self._rng))
        if self._plant.has_fallen(state):
            self._set_status(DONE)
        self._publish(measure(noise, state, self._rng), force)

    def _tick(self, due: float) -> None:
        """Let a real-time period pass, which was due to end at the time `due` [s]."""
        if self._status.data != BALANCING or self._held:
            self._measured.effort = [0.0, 0.0]  # that of a fall was the last push
            self._rest()
            return
        now = time.monotonic()
        if self._force and now - self._commanded > self.settings.command_timeout:
            self._force = 0.0
            timeout = self.settings.command_timeout
            self._log.warning(f"no {EFFORT} arrived for {timeout:g} s; the force is now 0")
        self._advance(self._force)
        self._punctuality.period(now - due, time.monotonic())

    def _publish(self, measured: State, force: float) -> None:
        """Let a period pass, and publish a new measurement."""
        x, x_dot, theta, theta_dot = measured
        self._measured.position, self._measured.velocity = [x, theta], [x_dot, theta_dot]
        self._measured.effort = [force, 0.0]
        self._rest()

    def _rest(self) -> None:
        """Let a period pass, and publish the last measurement again."""
        self._stamp += self._period
        self._periods += 1
        stamp = self._measured.header.stamp
        stamp.sec, stamp.nanosec = divmod(self._stamp, 10**9)
        if self._clocks.get_subscription_count():  # publishing takes as long as the plant does
            self._clocks.publish(Clock(clock=stamp))
        self._states.publish(self._measured)

    def _set_status(self, status: str) -> None:
        """Publish a status, which must precede the measurement that it belongs to."""
        self._status.data = status
        self._statuses.publish(self._status)

    def _health(self) -> Health:
        """Return how many periods passed since the last report, and whether commands were late."""
        periods, self._periods = self._periods, 0
        missed, previous = self._punctuality.missed, self._missed
        self._missed = missed
        late = max(0, missed - previous)
        values = {
            "control periods per second": f"{periods / INTERVAL:g}",
            "periods of the trial without a command": f"{missed}",
        }
        return Health(f"{late} control periods had no command" if late else "", values)

    def _report(self) -> None:
        if summary := self._punctuality.summary():
            self._log.info(summary)
        self._punctuality = Punctuality()


def main(
    values: ParameterValues | None = None,
    arguments: Sequence[str] | None = None,
    parent: int | None = None,
) -> int:
    """Run the simulator until it is interrupted, and return the exit status.

    Parameters
    ----------
    values
        Settings by name; ROS arguments can set others.
    arguments
        ROS arguments; those of the command line by default.
    parent
        Id of the parent process: the simulator exits when that is gone.
    """
    stopped = Event()
    # Not KeyboardInterrupt, which the compilation at the start would swallow.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())

    def work() -> int:
        with new_node(SIMULATOR, values or {}, arguments) as node:
            simulator = Simulator(node)
            try:
                print(f"simulating {simulator}", flush=True)
                simulator.run(stopped, parent)
            finally:
                simulator.close()
        return 0

    return exit_status(work)
