"""Creates, spins and destroys ROS 2 nodes, and sets the quality of service of their topics."""

import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from io import UnsupportedOperation
from typing import Any

import rclpy
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.service import Service
from rclpy.signals import SignalHandlerOptions

from upright.errors import UprightError, require
from upright.plants.ros2.shared_memory import remove_left_over
from upright.support.processes import share_core

QOS = QoSProfile(depth=10)
"""For publishers: reliable, which any subscriber accepts."""
HEARD = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
"""For messages in every period, whose acknowledgement would take a fifth of the time."""
KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""For messages that are published once, so that later subscribers can receive them too."""
LARGEST_DOMAIN = 232
"""The largest ROS domain, whose ports are the last below 65,536."""
QUEUED = 100
"""At most this many messages wait in an executor."""
POLL = 0.05
"""How long to wait for messages before checking whether the run was stopped [s]."""

ParameterValues = Mapping[str, Any]
"""Values of some of a node's parameters, by name."""


class OwnNode(Node):  # type: ignore[misc]
    """A node that no request can end, and that others no longer see once it is destroyed."""

    abandoned = False
    """Whether the other side is gone, perhaps killed. If the node is destroyed then, Fast DDS
    crashes in one of twenty ends; so the executor keeps it, and others see it for 20 s."""

    def leave_executor(self) -> None:
        """Have the executor let go of the node, which others see as long as one holds it."""
        executor = self.executor
        if self.abandoned or not executor:
            return
        executor.remove_node(self)
        with suppress(ExternalShutdownException):
            for _ in range(QUEUED):  # it lets go only after what is waiting already
                executor.spin_once(timeout_sec=0.0)

    def destroy_node(self) -> None:
        """Destroy the node."""
        self.leave_executor()
        super().destroy_node()

    def create_service(
        self, srv_type: Any, srv_name: str, callback: Any, **options: Any
    ) -> Service[Any, Any]:
        """Create a service; those that set parameters refuse a type that rclpy raises for."""

        def answer(request: Any, response: Any) -> Any:
            known = {kind.value for kind in Parameter.Type}
            if all(each.value.type in known for each in request.parameters):
                return callback(request, response)
            refusal = SetParametersResult(reason="a parameter is of a type that does not exist")
            if srv_type is SetParameters:
                response.results = [refusal] * len(request.parameters)
            else:
                response.result = refusal
            return response

        sets = srv_type in (SetParameters, SetParametersAtomically)
        return super().create_service(srv_type, srv_name, answer if sets else callback, **options)


def make_executor(node: Node) -> Executor:
    """Return the fastest executor that this ROS 2 has, with this node; call its `spin_once`.

    It is not shut down with the context: Fast DDS could crash then (see `OwnNode.abandoned`).
    """
    executor = _new_executor(node.context)
    executor.add_node(node)
    return executor


def _new_executor(context: rclpy.Context) -> Executor:
    try:
        from rclpy.experimental import EventsExecutor

        return EventsExecutor(context=context)
    except (ImportError, UnsupportedOperation):  # the latter: standard error is not a file
        return SingleThreadedExecutor(context=context)


@contextmanager
def new_node(
    name: str,
    values: ParameterValues,
    arguments: Sequence[str] | None,
    core: Callable[[int], AbstractContextManager[None]] = share_core,
) -> Iterator[OwnNode]:
    """Provide a node within the block. By default it discovers nodes on this machine only.

    Parameters
    ----------
    name
        Name of the node, unless ROS arguments give another.
    values
        Values of its parameters.
    arguments
        ROS arguments; those of the command line by default.
    core
        Chooses the core by the domain's number: that which partners in lock-step share, or others.

    Raises
    ------
    UprightError
        If ROS 2 reports an error: within the block too, where names of topics are checked.
    """
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    remove_left_over()
    context = rclpy.Context()
    with _errors_in_one_line(), ExitStack() as opened:
        rclpy.init(args=arguments, context=context, signal_handler_options=SignalHandlerOptions.NO)
        opened.callback(context.try_shutdown)
        require("ROS_DOMAIN_ID", context.get_domain_id(), 0, LARGEST_DOMAIN, whole=True)
        opened.enter_context(core(context.get_domain_id()))
        overrides = [Parameter(key, value=value) for key, value in values.items()]
        node = OwnNode(name, context=context, parameter_overrides=overrides)
        opened.callback(node.destroy_node)  # otherwise other nodes still see it for a while
        yield node


@contextmanager
def _errors_in_one_line() -> Iterator[None]:
    """Turn the errors with which ROS 2 refuses arguments, names and parameters into one line."""
    try:
        yield
    except rclpy_implementation.UnknownROSArgsError as error:
        raise UprightError(f"ROS 2 does not know the arguments {error}") from None
    except (rclpy_implementation.RCLError, ParameterException) as error:
        why = re.sub(r", at /[^,\s]+", "", str(error))  # places in the source code of ROS 2
        raise UprightError(f"ROS 2 reports an error: {why}") from error
