"""The learner's side of a cart on ROS 2 topics: a plant."""

import math
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import numpy as np
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException
from rclpy.parameter import Parameter
from rclpy.qos import ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from upright.core.cartpole import has_fallen
from upright.core.parameters import Parameters, State
from upright.errors import Stopped, UprightError, require
from upright.plants.ros2.messages import Joints, read_text
from upright.plants.ros2.node import (
    HEARD,
    POLL,
    QOS,
    OwnNode,
    ParameterValues,
    make_executor,
    new_node,
)
from upright.plants.ros2.peers import Peers, mismatch
from upright.plants.ros2.periods import Periods
from upright.plants.ros2.person import Person
from upright.plants.ros2.sensors import Sensors
from upright.plants.ros2.settings import MEASURED, PERSON, CartSettings
from upright.plants.ros2.topics import (
    BALANCING,
    EFFORT,
    FAULT,
    JOINT_STATES,
    RESET,
    SIMULATOR,
    STATUS,
    Waiting,
)

USUAL = CartSettings()
"""Settings of a cart that has the names and units of the simulator."""
ATTEMPTS = 3
"""Number of times that a reset is requested; on a new connection its measurement may be lost."""
ACKNOWLEDGED = Duration(seconds=0.2)
"""How long to wait for the last command to be acknowledged."""
SETTLED, SETTLING = 0.3, 0.02
"""After this time without new nodes, those that are there are known; how often to look [s]."""
ANNOUNCED = 3.2
"""Within this time each node announces itself again, so all are known by then [s]. Until then some
may be missing: Fast DDS loses an answer that arrives in the first milliseconds of a new node."""
NOTICE = 5.0
"""After this time it is said that a reset is waited for [s]."""
ABSURD = 1e6
"""A sensor that measures more than this, in any unit, is broken."""
INSTANT = 3
"""Number of trials in a row that may not all end with their first step."""


class Cart:
    """A plant that is commanded and measured over topics.

    Parameters
    ----------
    node
        The node that has the topics.
    waiting
        How long to wait for the cart.
    parameters
        The greatest force, the time step, and the limits for a cart that publishes no status.
    stop
        Shape (1,), bool. Once it is set, no further step is made.
    settings
        What the cart's numbers mean, and what starts its trials.
    simulated
        Parameters to set on the simulator's node. None for a cart that is not a simulator, and so
        cannot be put into a given state.
    say
        Called with what a person who stands by should know.

    Raises
    ------
    UprightError
        If there is no cart, or several, another node commands it, it measures at a rate that does
        not fit the time step, or its simulator refuses.
    """

    def __init__(
        self,
        node: OwnNode,
        waiting: Waiting,
        parameters: Parameters,
        stop: np.ndarray,
        settings: CartSettings = USUAL,
        simulated: ParameterValues | None = None,
        say: Callable[[str], None] = lambda text: print(text, file=sys.stderr),
    ) -> None:
        require("homing_force", settings.homing_force, 0, parameters.force)
        self.closing = ExitStack()
        """Resources that are closed with the cart."""
        self.periods = Periods(parameters.time_step, waiting.watchdog)
        """The control periods, by the time stamps of the cart's measurements."""
        self._created = time.monotonic()
        self._node, self._waiting, self._parameters = node, waiting, parameters
        self._stop, self._simulated, self._say = stop, simulated is not None, say
        self._settings, self._sensors = settings, Sensors(settings)
        self._joints = Joints(
            settings.slider, settings.hinge, velocities=settings.velocities == MEASURED
        )
        self._state = State(math.nan, math.nan, math.nan, math.nan)
        self._measured = 0  # number of measurements so far
        self._since = 0  # number of them before the trial
        self._strange = self._stale = 0  # how many were of no use since the last that was
        self._stale_stamp = 0  # of the last one that was not newer [ns]
        self._steps = self._instant = 0  # steps of the trial, and trials of one step in a row
        self._has_status, self._done, self._fault = False, True, ""
        self._resettable = settings.start_by != PERSON  # whether a first reset may mend a fault
        self._old_fault = ""  # what the cart reported before that
        self._over = False  # whether the trial ended in another way than by status or limits
        self._command = Float64MultiArray(data=[0.0])
        self._commands = node.create_publisher(Float64MultiArray, EFFORT, QOS)
        # Status comes first: if two subscriptions are ready, some executors serve the first.
        self._statuses = node.create_subscription(String, STATUS, self._on_status, QOS, raw=True)
        self._states = node.create_subscription(
            JointState, JOINT_STATES, self._on_state, HEARD, raw=True
        )
        self._reset = node.create_client(Trigger, RESET)
        self._set = node.create_client(SetParameters, f"{SIMULATOR}/set_parameters")
        self._get = node.create_client(GetParameters, f"{SIMULATOR}/get_parameters")
        listeners = frozenset(name.strip() for name in settings.listeners.split(","))
        self._peers = Peers(
            node,
            self._states.topic_name,
            self._commands.topic_name,
            listeners,
            stop=lambda: self._send(0.0),
        )
        self._person = Person(
            settings, parameters, self.periods, self._send, self._watch, self._say
        )
        self._executor = make_executor(node)
        self._find()
        self._settle()
        self._identity = self._peers.identity()
        self._peers.refuse_others()
        if simulated is not None:
            self._check_rate_of_simulator()
            if simulated:
                self._set_parameters(simulated)
        else:
            self._learn_rate()

    def reset(self, state: State) -> State:
        """Start a trial, in `state` if the cart is a simulator; return the first measurement.

        Raises
        ------
        UprightError
            If the cart does not answer or refuses, there are several carts, or the last trials
            all ended with their first step.
        Stopped
            If the run was stopped.
        """
        self._refuse_instant_falls()
        self._spin(lambda: self._peers.carts() <= 1, self._waiting.watchdog)
        self._peers.refuse_others()
        self._notice_restart()
        self._over = False
        if self._simulated:
            self._set_parameters({"start_state": list(state)})
        if self._settings.start_by == PERSON:
            self._person.wait()
        else:
            self._ask_for_reset()
        self.periods.begin()
        return self._state

    def step(self, force: float) -> State:
        """Command a force [N] for a control period, and return the measurement that ends it.

        Raises
        ------
        UprightError
            If the force exceeds the limit, measurements stop arriving or make no sense, the cart
            reports a fault, or another cart or learner appears.
        Stopped
            If the run was stopped.
        """
        if not abs(force) <= self._parameters.force:
            raise UprightError(f"force is {force!r}; it must be within ±{self._parameters.force} N")
        self._steps += 1
        self._peers.look()
        ended = False
        while not ended:
            # A cart in lock-step moves with each command, and a driver may stop without one.
            self._send(force)
            self._await_measurement()
            ended = self.has_fallen(self._state) or self.periods.is_over()
        if not self._has_status and self.has_fallen(self._state):
            self._send(0.0)  # a cart without a status may not have stopped by itself
        return self._state

    def has_fallen(self, state: State) -> bool:
        """Whether the cart's status is not Balancing; without a status, whether it left limits."""
        if self._over:
            return True
        return self._done if self._has_status else has_fallen(self._parameters, state)

    def close(self) -> None:
        """Stop the cart."""
        if self._node.context.ok():
            self._send(0.0)
            self._commands.wait_for_all_acked(ACKNOWLEDGED)
        self.closing.close()

    # ---- Before a run ----------------------------------------------------------------------------

    def _find(self) -> None:
        """Wait until all of the cart's topics and services are available."""

        def missing() -> list[str]:
            # Another learner ends when it sees this one: it must not be taken for gone before.
            self._peers.refuse_lasting()
            by_person = self._settings.start_by == PERSON
            availability = {
                f"topic {JOINT_STATES}": self._node.count_publishers(self._states.topic_name),
                f"topic {EFFORT}": self._commands.get_subscription_count(),
                f"service {RESET}": by_person or self._reset.service_is_ready(),
                f"node {SIMULATOR}": not self._simulated or self._set.service_is_ready(),
            }
            return [name for name, available in availability.items() if not available]

        if not self._spin(lambda: not missing(), self._waiting.patience, poll=0.01):
            raise UprightError(
                f"no cart was found within {self._waiting.patience:g} s in ROS domain "
                f"{self._node.context.get_domain_id()}: there is no {', no '.join(missing())}"
                f"{self._mismatches() or '; `upright ros2 simulate` starts a simulator'}"
            )
        offered = self._node.get_publishers_info_by_topic(self._statuses.topic_name)
        if any(each.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT for each in offered):
            self._node.destroy_subscription(self._statuses)
            self._statuses = self._node.create_subscription(
                String, STATUS, self._on_status, HEARD, raw=True
            )

    def _settle(self) -> None:
        """Wait until all nodes on the cart's topics are known, as they appear one by one."""
        present, until = self._peers.numbers(), time.monotonic() + SETTLED
        known = self._created + (0.0 if self._simulated else ANNOUNCED)
        while time.monotonic() < max(until, known):
            self._peers.refuse_lasting()
            self._spin(lambda: False, SETTLING)
            if present != (now := self._peers.numbers()):
                present, until = now, time.monotonic() + SETTLED

    def _learn_rate(self) -> None:
        """Listen until the cart's rate is known, unless it waits for commands; check the rate."""
        if self._measured > 1:
            self._spin(lambda: self.periods.knows_rate, self._waiting.watchdog)
        self.periods.check_rate()

    def _check_rate_of_simulator(self) -> None:
        """Refuse a simulator whose commands last another time: results would not be comparable."""
        answer = self._call(self._get, GetParameters.Request(names=["rate"]))
        rate, step = answer.values[0].double_value, self._parameters.time_step
        if not math.isclose(rate * step, 1.0, rel_tol=1e-6):
            raise UprightError(
                f"the simulator's rate is {rate:g} periods per second; the task has a time step of "
                f"{step:g} s, which needs `upright ros2 simulate --rate {1 / step:g}`"
            )

    def _set_parameters(self, values: ParameterValues) -> None:
        request = SetParameters.Request()
        request.parameters = [
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
        ]
        for result in self._call(self._set, request).results:
            if not result.successful:
                raise UprightError(f"the simulator refused: {result.reason}")

    # ---- The start of a trial --------------------------------------------------------------------

    def _refuse_instant_falls(self) -> None:
        """Raise UprightError after trials that ended with their first step: something is wrong."""
        self._instant = self._instant + 1 if self._steps == 1 else 0
        self._steps = 0
        if self._instant >= INSTANT and not self._simulated:
            x, theta = self._state.x, math.degrees(self._state.theta)
            raise UprightError(
                f"{INSTANT} trials in a row ended with their first step, the last at x = {x:.3g} m "
                f"and θ = {theta:.3g}°: a zero or a sign (parameters position_zero, position_gain, "
                "angle_zero, angle_gain) or a limit (position_limit, angle_limit) may be wrong"
            )

    def _ask_for_reset(self) -> None:
        """Have the cart start a trial, and wait for its first measurement."""
        self._resettable = False
        for _ in range(ATTEMPTS):
            self._done, self._fault = True, ""
            answer = self._call(self._reset, Trigger.Request(), self._waiting.reset)
            if not answer.success:
                raise UprightError(f"the cart was not reset: {answer.message}")
            if not self._has_status:
                self._note_start()
            if self._spin(self._has_begun, self._waiting.watchdog):
                return
        if self._old_fault:
            raise UprightError(f"the cart was reset, and still reports a {self._old_fault}")
        if self._measured > self._since and not self._has_begun():
            raise UprightError(
                f"the cart was reset, but it did not publish the {STATUS} {BALANCING!r} then (each "
                "reset must, even if that was the status before)"
            )
        raise UprightError(f"the cart was reset, but no {JOINT_STATES} arrived{self._unused()}")

    def _has_begun(self) -> bool:
        if self._node.count_publishers(self._statuses.topic_name) and not self._has_status:
            return False  # the connection is new, and the first status was missed
        return self._measured > self._since and not (self._has_status and self._done)

    def _note_start(self) -> None:
        """Take what is measured from now on for the new trial, whose start may be far away."""
        self._since = self._measured
        self._sensors.forget()

    # ---- Messages --------------------------------------------------------------------------------

    def _call(self, client: Any, request: Any, seconds: float | None = None) -> Any:
        """Return the answer of a service, which may take this long; `patience` by default."""
        seconds = self._waiting.patience if seconds is None else seconds
        if not self._spin(client.service_is_ready, self._waiting.patience):
            self._node.abandoned = True
            raise UprightError(f"the service {client.service_name} is gone")
        future = client.call_async(request)

        def settled() -> bool:
            return future.done() or not client.service_is_ready()

        if seconds > NOTICE and not self._spin(settled, NOTICE):
            self._say(f"waiting for the answer of {client.service_name} (Ctrl-C stops)")
        self._spin(settled, seconds - NOTICE if seconds > NOTICE else seconds)
        if not future.done():
            self._node.abandoned = True
            gone = not client.service_is_ready()
            why = "is gone" if gone else f"did not answer within {seconds:g} s"
            raise UprightError(f"the service {client.service_name} {why}")
        return future.result()

    def _send(self, force: float) -> None:
        self._command.data = [self._settings.command_gain * force]
        self._commands.publish(self._command)

    def _await_measurement(self) -> None:
        """Wait for the next measurement, or until the cart is known to have been started again."""
        before, watchdog = self._measured, self._waiting.watchdog
        if not self._spin(lambda: self._measured > before or self._over, watchdog):
            self._node.abandoned = True
            raise UprightError(
                f"no {JOINT_STATES} arrived for {watchdog:g} s{self._unused()}; the cart was "
                "stopped"
            )

    def _watch(self) -> State:
        """Return the next measurement, and look whether others command the cart."""
        self._peers.look()
        self._await_measurement()
        return self._state

    def _spin(self, ready: Callable[[], bool], seconds: float, poll: float = POLL) -> bool:
        """Handle messages until `ready` returns True or the time is over; return which."""
        until, late = time.monotonic() + seconds, False
        while True:
            if self._fault:
                raise UprightError(f"the cart reports a {self._fault}")
            if ready():
                return True
            left, measured = until - time.monotonic(), self._measured
            if self._stop[0]:
                raise Stopped
            if left < 0 and late:
                return False
            late = left < 0  # a last look, as this process may not have run for a while
            try:
                self._executor.spin_once(timeout_sec=max(0.0, min(left, poll)))
            except ExternalShutdownException:
                raise Stopped from None
            if self._measured == measured and self._steps:
                self._notice_restart()

    def _notice_restart(self) -> None:
        """End the trial if the cart has been started again, as its clock and its state are new."""
        identity = self._peers.identity()
        if identity and identity != self._identity:
            if not self._identity >= identity:  # a publisher that has gone is no new cart
                if self._simulated:  # its noise and random numbers are not those of the run
                    raise UprightError("the simulator was started again during the run")
                if self._steps:
                    self._say("the cart was started again, which ends the trial")
                self._over, self._has_status = True, False
                self.periods.restart()
                self._sensors.forget()
            self._identity = identity

    def _on_state(self, raw: bytes) -> None:
        try:
            measured = self._joints.read(raw)
        except UprightError as error:
            self._fault = f"{FAULT}{error}"
            return
        if measured is None:
            self._strange += 1
            return
        stamp, read = measured
        jumps = len(self.periods.jumps)
        if not self.periods.take(stamp, time.monotonic_ns()):
            self._stale, self._stale_stamp = self._stale + 1, stamp
            return
        if len(self.periods.jumps) > jumps:
            self._sensors.forget()
        self._state = self._sensors.state(stamp, read)
        self._strange = self._stale = 0
        self._measured += 1
        if not all(abs(number) < ABSURD for number in self._state):
            self._fault = f"{FAULT}{JOINT_STATES} holds {tuple(read)}, which no sensor can measure"

    def _on_status(self, raw: bytes) -> None:
        try:
            status = read_text(raw)
        except UprightError as error:
            status = f"{FAULT}{error}"
        if status.startswith(FAULT):
            self._note_fault(status)
        was_done, self._done = self._done, status != BALANCING
        if self._settings.start_by == PERSON:
            # Only a cart that has said that it balances can say that this is over.
            self._over = self._over or (self._steps > 0 and self._done and not was_done)
            return
        self._has_status = True
        if not self._done:
            self._old_fault = ""
            if not self._steps:
                self._note_start()

    def _note_fault(self, status: str) -> None:
        """Note a fault, unless it is an old one that the first reset may mend."""
        if self._resettable:
            self._old_fault = status
        elif status != self._old_fault:
            self._fault = status

    # ---- Why there are no measurements -----------------------------------------------------------

    def _unused(self) -> str:
        """Return what came instead of measurements that can be used, as the end of an error."""
        found = ""
        if self._strange:
            found = (
                f" that can be used: {self._strange} came of the joints "
                f"{', '.join(map(repr, self._joints.names))}, where "
                f"{self._settings.slider!r} and {self._settings.hinge!r} are wanted (the "
                "parameters slider and hinge name them)"
            )
        elif self._stale:
            found = (
                f" that can be used: {self._stale} came with a time stamp that is not later than "
                f"the one before, the last of {self._stale_stamp * 1e-9:g} s (each needs the time "
                "of its measurement in header.stamp)"
            )
        return found + self._mismatches()

    def _mismatches(self) -> str:
        """Return which topics have a quality of service that does not fit, as an error's end."""
        node = self._node
        topics = (
            (self._states, node.get_publishers_info_by_topic, HEARD, True),
            (self._statuses, node.get_publishers_info_by_topic, QOS, True),
            (self._commands, node.get_subscriptions_info_by_topic, QOS, False),
        )
        found = ""
        for ours, infos_of, profile, publishes in topics:
            if why := mismatch(infos_of(ours.topic_name), profile, publishes=publishes):
                found += f"; on {ours.topic_name}, {why}"
        return found


def open_cart(
    waiting: Waiting, parameters: Parameters, stop: np.ndarray, simulated: ParameterValues
) -> Cart:
    """Return a simulator's cart on a new node, which is closed with the cart.

    Raises
    ------
    UprightError
        If no simulator is found.
    """
    with ExitStack() as opened:
        node = opened.enter_context(new_node("learner", {}, []))
        cart = Cart(node, waiting, parameters, stop, simulated=simulated)
        cart.closing = opened.pop_all()
    return cart
