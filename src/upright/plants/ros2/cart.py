"""The learner's side of a cart on ROS 2 topics: a plant."""

import math
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import numpy as np
from rcl_interfaces.srv import SetParameters
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from upright.core.cartpole import has_fallen
from upright.core.parameters import Parameters, State
from upright.errors import Stopped, UprightError
from upright.plants.ros2.messages import Joints, read_text
from upright.plants.ros2.node import HEARD, POLL, QOS, ParameterValues, make_executor, new_node
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

ATTEMPTS = 3
"""Number of times that a reset is requested; on a new connection its measurement may be lost."""
ACKNOWLEDGED = Duration(seconds=0.2)
"""How long to wait for the last command to be acknowledged."""


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
    simulated
        Parameters to set on the simulator's node. None for a cart that is not a simulator, and so
        cannot be put into a given state.

    Raises
    ------
    UprightError
        If there is no cart, or its simulator refuses.
    """

    def __init__(
        self,
        node: Node,
        waiting: Waiting,
        parameters: Parameters,
        stop: np.ndarray,
        simulated: ParameterValues | None = None,
    ) -> None:
        self.missed = 0
        """Number of control periods without a new command; always 0 in lock-step."""
        self.closing = ExitStack()
        """Resources that are closed with the cart."""
        self._node, self._waiting, self._parameters = node, waiting, parameters
        self._stop, self._simulated = stop, simulated is not None
        self._state = State(math.nan, math.nan, math.nan, math.nan)
        self._stamp = -1  # time stamp of the newest measurement [ns]
        self._since = -1  # time stamp of the last measurement before the trial [ns]
        self._has_status, self._done, self._fault = False, True, ""
        self._joints = Joints()
        self._command = Float64MultiArray(data=[0.0])
        self._commands = node.create_publisher(Float64MultiArray, EFFORT, QOS)
        # Status comes first: if two subscriptions are ready, some executors serve the first.
        node.create_subscription(String, STATUS, self._on_status, QOS, raw=True)
        node.create_subscription(JointState, JOINT_STATES, self._on_state, HEARD, raw=True)
        self._reset = node.create_client(Trigger, RESET)
        self._set = node.create_client(SetParameters, f"{SIMULATOR}/set_parameters")
        self._executor = make_executor(node.context)
        self._executor.add_node(node)
        self._find()
        if simulated:
            self._set_parameters(simulated)

    def reset(self, state: State) -> State:
        """Start a trial, in `state` if the cart is a simulator; return the first measurement.

        Raises
        ------
        UprightError
            If the cart does not answer or refuses, or there are several carts.
        Stopped
            If the run was stopped.
        """
        if (carts := self._node.count_publishers(STATUS)) > 1:
            raise UprightError(
                f"there are {carts} carts in ROS domain {self._node.context.get_domain_id()}, and "
                "a command would move them all; give each its own domain or namespace (one that "
                "was killed counts for 20 s)"
            )
        if self._simulated:
            self._set_parameters({"start_state": list(state)})
        for _ in range(ATTEMPTS):
            self._done, self._fault = True, ""
            answer = self._call(self._reset, Trigger.Request())
            if not answer.success:
                raise UprightError(f"the cart was not reset: {answer.message}")
            if not self._has_status:
                self._since = self._stamp
            if self._spin(self._has_begun, self._waiting.watchdog):
                return self._state
        raise UprightError(f"the cart was reset, but no {JOINT_STATES} arrived")

    def _has_begun(self) -> bool:
        if self._node.count_publishers(STATUS) and not self._has_status:
            return False  # the connection is new, and the first status was missed
        return self._stamp > self._since and not (self._has_status and self._done)

    def step(self, force: float) -> State:
        """Command a force [N] and return the next measurement.

        Raises
        ------
        UprightError
            If the force exceeds the limit, measurements stop arriving, or the cart reports a fault.
        Stopped
            If the run was stopped.
        """
        if not abs(force) <= self._parameters.force:
            raise UprightError(f"force is {force!r}; it must be within ±{self._parameters.force} N")
        previous = self._stamp
        self._send(force)
        watchdog = self._waiting.watchdog
        if not self._spin(lambda: self._stamp > previous, watchdog):
            raise UprightError(
                f"no {JOINT_STATES} arrived for {watchdog:g} s; the cart was stopped"
            )
        periods = (self._stamp - previous) * 1e-9 / self._parameters.time_step
        self.missed += max(0, round(periods) - 1)
        if not self._has_status and self.has_fallen(self._state):
            self._send(0.0)  # a cart without a status may not have stopped by itself
        return self._state

    def has_fallen(self, state: State) -> bool:
        """Whether the cart's status is not Balancing; without a status, whether it left limits."""
        return self._done if self._has_status else has_fallen(self._parameters, state)

    def close(self) -> None:
        """Stop the cart."""
        if self._node.context.ok():
            self._send(0.0)
            self._commands.wait_for_all_acked(ACKNOWLEDGED)
        self._executor.remove_node(self._node)
        self.closing.close()

    def _find(self) -> None:
        """Wait until all of the cart's topics and services are available."""

        def missing() -> list[str]:
            availability = {
                f"topic {JOINT_STATES}": self._node.count_publishers(JOINT_STATES),
                f"topic {EFFORT}": self._commands.get_subscription_count(),
                f"service {RESET}": self._reset.service_is_ready(),
                f"node {SIMULATOR}": not self._simulated or self._set.service_is_ready(),
            }
            return [name for name, available in availability.items() if not available]

        if not self._spin(lambda: not missing(), self._waiting.patience, poll=0.01):
            raise UprightError(
                f"no cart was found within {self._waiting.patience:g} s in ROS domain "
                f"{self._node.context.get_domain_id()}: there is no {', no '.join(missing())}; "
                "`upright ros2 simulate` starts a simulator"
            )

    def _set_parameters(self, values: ParameterValues) -> None:
        request = SetParameters.Request()
        request.parameters = [
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
        ]
        for result in self._call(self._set, request).results:
            if not result.successful:
                raise UprightError(f"the simulator refused: {result.reason}")

    def _call(self, client: Any, request: Any) -> Any:
        future = client.call_async(request)
        if not self._spin(future.done, self._waiting.patience):
            raise UprightError(
                f"service {client.srv_name} did not answer within {self._waiting.patience:g} s"
            )
        return future.result()

    def _send(self, force: float) -> None:
        self._command.data = [force]
        self._commands.publish(self._command)

    def _spin(self, ready: Callable[[], bool], seconds: float, poll: float = POLL) -> bool:
        """Handle messages until `ready` returns True or the time is over; return which."""
        until = time.monotonic() + seconds
        while not ready():
            left = until - time.monotonic()
            if self._stop[0]:
                raise Stopped
            if self._fault:
                raise UprightError(f"the cart reports a {self._fault}")
            if left < 0:
                return False
            try:
                self._executor.spin_once(timeout_sec=min(left, poll))
            except ExternalShutdownException:
                raise Stopped from None
        return True

    def _on_state(self, raw: bytes) -> None:
        try:
            measured = self._joints.read(raw)
        except UprightError as error:
            self._fault = f"{FAULT}{error}"
            return
        if measured is None:
            return
        self._stamp, self._state = measured
        if not math.isfinite(sum(self._state)):
            self._fault = f"{FAULT}{JOINT_STATES} holds {self._state}"

    def _on_status(self, raw: bytes) -> None:
        try:
            status = read_text(raw)
        except UprightError as error:
            status = f"{FAULT}{error}"
        self._has_status = True
        self._done = status != BALANCING
        if not self._done:
            self._since = self._stamp
        if status.startswith(FAULT):
            self._fault = status


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
        cart = Cart(node, waiting, parameters, stop, simulated)
        cart.closing = opened.pop_all()
    return cart
