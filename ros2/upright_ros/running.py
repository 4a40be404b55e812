"""What both nodes share: how they begin and end, and take their settings."""

import signal
from array import array
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

import rclpy
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from upright.settings import Fields, describe_settings, restored, values_of

S = TypeVar("S", bound=Fields)
Given = Mapping[str, Any]
"""Settings by name, of those that were given."""


@contextmanager
def new_node(name: str, given: Given, arguments: Sequence[str] | None) -> Iterator[Node]:
    """Give a node of this name, and end it.

    SIGTERM becomes KeyboardInterrupt, as SIGINT does, so that a cart is stopped in either case.
    """
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    context = rclpy.Context()
    rclpy.init(args=arguments, context=context, signal_handler_options=SignalHandlerOptions.NO)
    try:
        overrides = [Parameter(key, value=value) for key, value in given.items()]
        node = Node(name, context=context, parameter_overrides=overrides)
        yield node
    finally:
        context.try_shutdown()


def declare(node: Node, settings: S, changeable: Sequence[str] = ()) -> S:
    """Declare a parameter for each setting; return the settings with the values given.

    Raises
    ------
    UprightError
        If a value is not allowed.
    """
    texts, values = describe_settings(settings), {}
    for name, default in values_of(settings).items():
        described = ParameterDescriptor(
            description=texts[name], read_only=name not in changeable, dynamic_typing=True
        )
        default = list(default) if isinstance(default, tuple) else default
        values[name] = plain(node.declare_parameter(name, default, described).value)
    return restored(settings, values, node.get_name())


def plain(value: Any) -> Any:
    """Return a parameter's value as settings have it."""
    return tuple(value) if isinstance(value, array | list) else value
