"""Reports once a second how a node is doing, on the topic that ROS 2's monitors listen to."""

from collections.abc import Callable
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from upright.plants.ros2.node import QOS
from upright.plants.ros2.periods import Periods

TOPIC = "/diagnostics"
"""The same in every namespace, as ROS 2 has it."""
INTERVAL = 1.0
"""Time between two reports [s]."""


class Health(NamedTuple):
    """How a node is doing."""

    warning: str
    """What is wrong; empty if nothing is."""
    values: dict[str, str]
    """Figures, by their name and unit."""


class Diagnostics:
    """Publishes the health of a node.

    Parameters
    ----------
    node
        The node, which must be spun.
    part
        What the report is about.
    health
        Returns the health.
    """

    def __init__(self, node: Node, part: str, health: Callable[[], Health]) -> None:
        self._node, self._part, self._health = node, part, health
        self._publisher = node.create_publisher(DiagnosticArray, TOPIC, QOS)
        node.create_timer(INTERVAL, self._publish)

    def _publish(self) -> None:
        warning, values = self._health()
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if warning else DiagnosticStatus.OK,
            name=f"{self._node.get_fully_qualified_name()}: {self._part}",
            message=warning or "in order",
            hardware_id="cart-pole",
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        report = DiagnosticArray(status=[status])
        report.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(report)


class PeriodsHealth:
    """How well a cart's measurements fit the control periods of its learner."""

    def __init__(self, periods: Periods) -> None:
        self._periods, self._missed, self._jumps = periods, 0, 0

    def __call__(self) -> Health:
        """Return the figures, with a warning of what happened since the last call."""
        periods = self._periods
        missed, jumps = periods.missed - self._missed, len(periods.jumps) - self._jumps
        self._missed, self._jumps = periods.missed, len(periods.jumps)
        warnings = [f"{missed} control periods were missed"] * bool(missed)
        warnings += ["the cart's clock was set"] * bool(jumps)
        values = {
            "rate of measurements [1/s]": f"{1 / periods.interval:.4g}",
            "jitter [ms]": f"{1e3 * periods.jitter:.3g}",
            "missed control periods": f"{periods.missed}",
            "duration of the trial [s]": f"{periods.seconds:.2f}",
        }
        return Health("; ".join(warnings), values)
