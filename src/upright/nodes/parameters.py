"""Settings of a node as ROS parameters."""

from array import array
from collections.abc import Sequence
from typing import Any, TypeVar

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from upright.support.settings import Fields, describe_settings, restored, values_of

S = TypeVar("S", bound=Fields)


def declare(node: Node, settings: S, changeable: Sequence[str] = ()) -> S:
    """Declare a parameter for each setting; return the settings with the parameters' values.

    Parameters
    ----------
    node
        The node that declares the parameters.
    settings
        The default values.
    changeable
        Names of the parameters that may be set while the node runs.

    Raises
    ------
    UprightError
        If a value is not allowed.
    """
    texts, values = describe_settings(settings), {}
    for name, default in values_of(settings).items():
        descriptor = ParameterDescriptor(
            description=texts[name], read_only=name not in changeable, dynamic_typing=True
        )
        default = list(default) if isinstance(default, tuple) else default
        values[name] = plain(node.declare_parameter(name, default, descriptor).value)
    return restored(settings, values, node.get_name())


def plain(value: Any) -> Any:
    """Return a parameter's value as settings hold it."""
    return tuple(value) if isinstance(value, array | list) else value
