"""ROS 2 nodes: how they are made, moved and ended, and the quality of their topics."""

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
"""Reliable, which any subscriber accepts."""
HEARD = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
"""For what comes every period: to acknowledge it would take a fifth of the time."""
KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""For a word that is said once: who comes later may hear it, too."""
POLL = 0.05
"""How long to wait for messages before looking whether the run was stopped [s]."""

ParameterValues = Mapping[str, Any]
"""Values of a node's parameters, of those that were given."""


def make_executor(context: rclpy.Context) -> Executor:
    """Return the fastest executor that this ROS 2 has, to be moved by its `spin_once`."""
    try:
        from rclpy.experimental import EventsExecutor

        return EventsExecutor(context=context)
    except (ImportError, UnsupportedOperation):  # it wants a file as standard error
        return SingleThreadedExecutor(context=context)


@contextmanager
def new_node(name: str, given: ParameterValues, arguments: Sequence[str] | None) -> Iterator[Node]:
    """Give a node of this name, and end it. It hears this machine alone, unless told otherwise.

    Parameters
    ----------
    name
        Its name, unless ROS arguments give another.
    given
        Values of its parameters.
    arguments
        ROS arguments; those of the command line unless given.
    """
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = rclpy.Context()
    rclpy.init(args=arguments, context=context, signal_handler_options=SignalHandlerOptions.NO)
    with ExitStack() as opened:
        opened.callback(context.try_shutdown)
        opened.enter_context(share_core(context.get_domain_id()))  # the other side's, too
        overrides = [Parameter(key, value=value) for key, value in given.items()]
        node = Node(name, context=context, parameter_overrides=overrides)
        opened.callback(node.destroy_node)  # else others count it for a while
        yield node
