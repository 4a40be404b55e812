"""Looks who else is on a cart's topics: one learner must command one cart."""

import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from upright.errors import UprightError

INTERVAL = 0.1
"""How often to look while a trial is in progress [s]."""
SEEN = 1.0
"""How long a learner that has stopped its cart for another one is still to be seen by that [s]."""
GOING = 0.3
"""How long a learner that has ended may still be seen [s]."""
UNNAMED, NAMED, UNKNOWN = 0.5, 1.0, "UNKNOWN"
"""How long a node may be without a name while the cart moves, and how long to wait for one when it
does not [s]; a part of a name that is not known yet."""
TOOLS = "_ros2cli"
"""How the names of command-line tools begin, such as `ros2 topic echo`, which only listen."""
PREFIX = 12
"""Number of bytes of an endpoint's identity that all those of a process share."""
KILLED = "one that was killed counts for 20 s"

Infos = list[Any]
"""What ROS 2 knows of the publishers or subscribers of a topic."""


class Peers:
    """The nodes that measure, move and command the cart of one learner.

    Parameters
    ----------
    node
        The learner's node, which already publishes commands.
    measured, commanded
        The resolved names of the topics of measurements and of commands.
    listeners
        Names of nodes that may hear commands without being a motor.
    stop
        Stops the motor; called before an error about others is raised.
    """

    def __init__(
        self,
        node: Node,
        measured: str,
        commanded: str,
        listeners: frozenset[str],
        stop: Callable[[], None],
    ) -> None:
        self._node, self._listeners, self._stop = node, listeners, stop
        self._measured, self._commanded = measured, commanded
        self._due = 0.0  # when to look again [s]
        self._alone = time.monotonic()  # when no other learner was to be seen [s]
        self._complete = 0.0  # when the names of all were known [s]

    def look(self) -> None:
        """Refuse others while the cart moves, if the last look was a while ago.

        A node whose name would tell that it only listens gets time to tell it: a cart that is left
        without commands until then may fall.
        """
        now = time.monotonic()
        if now < self._due:
            return
        self._due = now + INTERVAL
        carts, motors, commanders = numbers = self.numbers()
        if carts + motors > 2 and commanders < 2 and self._lacks_names():
            if now < self._complete + UNNAMED:
                return
            self._stop()
        else:
            self._complete = now
        self._refuse(*numbers)

    def refuse_lasting(self) -> None:
        """Refuse others, but for another learner that has ended and is about to disappear."""
        now, (carts, motors, commanders) = time.monotonic(), self.numbers()
        if commanders < 2:
            self._alone = now
        if commanders < 2 or now - self._alone >= GOING:
            self._refuse(carts, motors, commanders)

    def refuse_others(self) -> None:
        """Look who is there.

        Raises
        ------
        UprightError
            If several nodes measure or move a cart, or another one can command it.
        """
        self._refuse(*self.numbers())

    def _refuse(self, carts: int, motors: int, commanders: int) -> None:
        if carts > 1:
            self._refuse_carts(self._measuring, self._measured)
        if motors > 1:
            self._refuse_carts(self._motors, self._commanded)
        if commanders > 1:
            self._stop()
            stopped = time.monotonic()
            names = _names(self._named(self._commanders, NAMED)) or "another node"
            # Or the other one may find nobody, and take the cart over.
            time.sleep(max(0.0, stopped + SEEN - time.monotonic()))
            raise UprightError(
                f"{names} also commands this cart, on {self._commanded}; a cart must have one "
                f"learner ({KILLED})"
            )

    def carts(self) -> int:
        """Return how many nodes publish measurements."""
        number = int(self._node.count_publishers(self._measured))
        return len(_distinct(self._measuring())) if number > 1 else number

    def numbers(self) -> tuple[int, int, int]:
        """Return how many nodes publish measurements, hear commands, and publish commands."""
        return (
            self.carts(),
            int(self._node.count_subscribers(self._commanded)),
            int(self._node.count_publishers(self._commanded)),
        )

    def identity(self) -> frozenset[bytes]:
        """Return the publishers of measurements: if the cart is started again, it is another."""
        return frozenset(bytes(info.endpoint_gid) for info in self._measuring())

    def _refuse_carts(self, find: Callable[[], Infos], topic: str) -> None:
        """Raise UprightError if there are several, once it is known which of them only listen."""
        if len(infos := self._named(find, NAMED)) > 1:
            self._stop()
            raise UprightError(
                f"there are {len(infos)} carts in ROS domain "
                f"{self._node.context.get_domain_id()}, and a command would move them all: "
                f"{_names(infos)} have the topic {topic}; give each its own domain or namespace "
                f"({KILLED}), or name those that only listen in the parameter listeners"
            )

    def _named(self, find: Callable[[], Infos], seconds: float) -> Infos:
        """Return what is found once all have names, which arrive a little after their topics."""
        until = time.monotonic() + seconds
        while any(UNKNOWN in info.node_name for info in find()) and time.monotonic() < until:
            time.sleep(0.01)
        return _distinct(find())

    def _lacks_names(self) -> bool:
        infos = self._measuring() + self._motors()
        return any(UNKNOWN in info.node_name for info in infos)

    def _measuring(self) -> Infos:
        return list(self._node.get_publishers_info_by_topic(self._measured))

    def _motors(self) -> Infos:
        """Return those that hear commands and are not known to be listeners."""
        infos = self._node.get_subscriptions_info_by_topic(self._commanded)
        return [
            info
            for info in infos
            if info.node_name not in self._listeners and not info.node_name.startswith(TOOLS)
        ]

    def _commanders(self) -> Infos:
        """Return those that publish commands, but for this node itself."""
        infos = list(self._node.get_publishers_info_by_topic(self._commanded))
        own = [info for info in infos if self._is_own(info)]
        return [info for info in infos if info not in own[:1]]

    def _is_own(self, info: Any) -> bool:
        own = self._node.get_name(), self._node.get_namespace()
        return (info.node_name, info.node_namespace) == own


def _distinct(infos: Infos) -> Infos:
    """Return one of those that belong to the same node of the same process."""
    return list({(bytes(i.endpoint_gid)[:PREFIX], i.node_name): i for i in infos}.values())


def mismatch(infos: Infos, ours: QoSProfile, *, publishes: bool) -> str:
    """Return why a topic's other side and we cannot communicate, or an empty string if we can.

    Parameters
    ----------
    infos
        The other side.
    ours
        Our quality of service.
    publishes
        Whether the other side publishes.
    """
    for info in infos:
        both = (info.qos_profile, ours) if publishes else (ours, info.qos_profile)
        if not _compatible(*both):
            verb = "publishes" if publishes else "asks for"
            return (
                f"{_names([info])} {verb} {_described(info.qos_profile)}, where the learner "
                f"{'asks for' if publishes else 'publishes'} {_described(ours)}"
            )
    return ""


def _compatible(offered: QoSProfile, asked: QoSProfile) -> bool:
    """Whether a publisher offers what a subscriber asks for."""
    # Not rclpy's qos_check_compatible, which takes an infinite deadline for a deadline.
    unreliable = offered.reliability == ReliabilityPolicy.BEST_EFFORT
    forgetful = offered.durability == DurabilityPolicy.VOLATILE
    return not (
        (unreliable and asked.reliability == ReliabilityPolicy.RELIABLE)
        or (forgetful and asked.durability == DurabilityPolicy.TRANSIENT_LOCAL)
    )


def _described(profile: QoSProfile) -> str:
    """Return the quality of service in the words of ROS 2."""
    parts = profile.reliability.name, profile.durability.name
    return " and ".join(part.lower().replace("_", " ") for part in parts)


def _names(infos: Infos) -> str:
    """Return the full names of the nodes of some publishers or subscribers."""
    names = [f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos]
    return " and ".join(sorted(names))
