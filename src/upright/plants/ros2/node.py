"""Creates, spins and destroys ROS 2 nodes, and sets the quality of service of their topics."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from io import UnsupportedOperation
from typing import Any

import rclpy
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from upright.support.processes import share_core

QOS = QoSProfile(depth=10)
"""For publishers: reliable, which any subscriber accepts."""
HEARD = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
"""For messages in every period, whose acknowledgement would take a fifth of the time."""
KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""For messages that are published once, so that later subscribers can receive them too."""
POLL = 0.05
"""How long to wait for messages before checking whether the run was stopped [s]."""

ParameterValues = Mapping[str, Any]
"""Values of some of a node's parameters, by name."""


def make_executor(context: rclpy.Context) -> Executor:
    """Return the fastest executor that this ROS 2 has; its `spin_once` is to be called."""
    try:
        from rclpy.experimental import EventsExecutor

        return EventsExecutor(context=context)
    except (ImportError, UnsupportedOperation):  # the latter: standard error is not a file
        return SingleThreadedExecutor(context=context)


@contextmanager
def new_node(name: str, values: ParameterValues, arguments: Sequence[str] | None) -> Iterator[Node]:
    """Provide a node within the block. By default it discovers nodes on this machine only.

    Parameters
    ----------
    name
        Name of the node, unless ROS arguments give another.
    values
        Values of its parameters.
    arguments
        ROS arguments; those of the command line by default.
    """
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = rclpy.Context()
    rclpy.init(args=arguments, context=context, signal_handler_options=SignalHandlerOptions.NO)
    with ExitStack() as opened:
        opened.callback(context.try_shutdown)
        opened.enter_context(share_core(context.get_domain_id()))  # the other side shares it too
        overrides = [Parameter(key, value=value) for key, value in values.items()]
        node = Node(name, context=context, parameter_overrides=overrides)
        opened.callback(node.destroy_node)  # otherwise other nodes still see it for a while
        yield node
