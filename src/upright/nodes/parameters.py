"""Settings of a node as ROS parameters."""

from array import array
from collections.abc import Sequence
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from upright.support.settings import Fields, describe_settings, ranges_of, restored, values_of

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
    texts, ranges, values = describe_settings(settings), ranges_of(settings), {}
    dynamic = ParameterDescriptor(dynamic_typing=True)
    for name, default in values_of(settings).items():
        default = list(default) if isinstance(default, tuple) else default
        values[name] = plain(node.declare_parameter(name, default, dynamic).value)
    checked = restored(settings, values, node.get_name())
    # Only now, as the errors of the settings say more than those of ROS 2.
    for name, default in values_of(settings).items():
        descriptor = ParameterDescriptor(
            description=texts[name], read_only=name not in changeable, dynamic_typing=True
        )
        _describe_range(descriptor, default, ranges.get(name))
        node.set_descriptor(name, descriptor)
    return checked


def _describe_range(
    descriptor: ParameterDescriptor, default: Any, ends: tuple[float, float] | None
) -> None:
    """Note the smallest and the largest value of a number, which programs may show."""
    if ends is None:
        return
    if isinstance(default, int):
        low, high = map(int, ends)
        descriptor.integer_range = [IntegerRange(from_value=low, to_value=high)]
    else:
        span = FloatingPointRange(from_value=ends[0], to_value=ends[1])
        descriptor.floating_point_range = [span]


def plain(value: Any) -> Any:
    """Return a parameter's value as settings hold it."""
    return tuple(value) if isinstance(value, array | list) else value
