"""The recorder: writes what passes between a learner and a cart to files. It only listens."""

import signal
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from inspect import Parameter, Signature
from threading import Event
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Int64, String

from upright.errors import UprightError, require
from upright.nodes.diagnostics import TOPIC as DIAGNOSTICS
from upright.nodes.recordings import Message, Recording, Topic, open_recordings
from upright.plants.ros2.messages import read_text
from upright.plants.ros2.node import POLL, OwnNode, make_executor, new_node
from upright.plants.ros2.topics import BALANCING, EFFORT, JOINT_STATES, STATUS
from upright.support.exit_status import exit_status
from upright.support.processes import leave_core
from upright.support.words import count

LISTENS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Whatever a publisher offers, this subscriber accepts; it may be late by a thousand messages."""
FLUSHED = 1.0
"""Longest time until what was recorded is in the files [s]."""
LOOKS = 0.1
"""How often to look for topics that are published [s]."""
LATE = 0.2
"""Longest time, once it is to end, to wait for messages that were sent before [s]."""
TRIAL_STEPS = "learner/trial_steps"
TOPICS: dict[str, Any] = {
    JOINT_STATES: JointState,
    EFFORT: Float64MultiArray,
    STATUS: String,
    TRIAL_STEPS: Int64,
    DIAGNOSTICS: DiagnosticArray,
}
"""What is recorded in any case."""
CLOCK = {"clock": Clock}
"""What is recorded if asked for: a simulator publishes it for subscribers alone, at a cost."""


class Recorder:
    """Listens to the topics of a learner and a cart, and writes each message as it comes.

    Parameters
    ----------
    node
        The node that listens.
    kinds
        Types of messages by the usual names of their topics.
    """

    def __init__(self, node: OwnNode, kinds: Mapping[str, Any]) -> None:
        self._node = node
        self.topics = {
            role: Topic(node.resolve_topic_name(role), f"{_package(kind)}/msg/{kind.__name__}")
            for role, kind in kinds.items()
        }
        """The topics that are listened to, by their usual names."""
        self.counts = dict.fromkeys(kinds, 0)
        """Number of messages of each."""
        self.lost = dict.fromkeys(kinds, 0)
        """Number of messages between these that did not come."""
        self.recordings: Sequence[Recording] = ()
        """Where they are written."""
        self.newest = 0
        """When the newest message came [ns since 1970]."""
        self.error: UprightError | None = None
        """Why nothing more is written, if so."""
        self._numbers: dict[tuple[str, bytes], int] = {}
        self._are_numbered = True
        self._found: set[str] = set()
        self._balances, self._falls = False, 0
        for role, kind in kinds.items():
            node.create_subscription(kind, role, _Informed(self._taking(role)), LISTENS, raw=True)

    def _taking(self, role: str) -> Callable[[bytes, Mapping[str, Any]], None]:
        """Return what is called with each message of a topic."""

        def take(raw: bytes, info: Mapping[str, Any]) -> None:
            if self.error:
                return
            self.counts[role] += 1
            self.newest = info["received_timestamp"] or time.time_ns()
            number = self._note_number(role, info)
            if role == STATUS:
                self._note_status(raw)
            sent = max(0, info["source_timestamp"])
            try:
                for recording in self.recordings:
                    recording.write(Message(role, raw, self.newest, sent, number))
            except UprightError as error:  # rclpy would show where it was raised
                self.error = error

        return take

    def _note_number(self, role: str, info: Mapping[str, Any]) -> int:
        """Return a message's number, and count those of its publisher that are missing before it.

        Those before the first or after the last one that came cannot be known.
        """
        number, publisher = info.get("publication_sequence_number"), info.get("publisher_gid")
        if number is None or publisher is None:
            self._are_numbered = False
            return 0
        key = role, bytes(publisher["data"])
        last = self._numbers.get(key, number - 1)
        self.lost[role] += max(0, number - last - 1)
        self._numbers[key] = max(number, last)
        return int(number)

    def _note_status(self, raw: bytes) -> None:
        with suppress(UprightError):
            balances = read_text(raw) == BALANCING
            self._falls += self._balances and not balances
            self._balances = balances

    def trials(self) -> int:
        """Return how many trials have ended, by the status or, without one, by the learner."""
        return max(self._falls, self.counts[TRIAL_STEPS])

    def flush(self) -> None:
        """Put what was written into the files."""
        for recording in self.recordings:
            recording.flush()

    def newly_found(self) -> list[str]:
        """Return the names of topics that are published by now, and were not at the last call."""
        names = {role: topic.name for role, topic in self.topics.items()}
        found = {role for role, name in names.items() if self._node.count_publishers(name)}
        new = found - self._found
        self._found |= new
        return [name for role, name in names.items() if role in new]

    def offers(self, role: str) -> str:
        """Return the quality of service that a topic's publishers offer, as rosbag2 writes it."""
        found = self._node.get_publishers_info_by_topic(self.topics[role].name)
        return "".join(_in_yaml(each.qos_profile) for each in found)

    def summary(self) -> str:
        """Return how many messages of each topic came or were lost, and which were silent."""
        heard, silent = [], []
        for role, topic in self.topics.items():
            lost = f" ({self.lost[role]:,} lost)" if self.lost[role] else ""
            if self.counts[role]:
                heard.append(f"{count(self.counts[role], 'message')} of {topic.name}{lost}")
            else:
                silent.append(topic.name)
        none = f"; none of {', '.join(silent)}" if silent else ""
        unknown = "" if self._are_numbered else "; this ROS 2 does not tell how many were lost"
        return (", ".join(heard) or "no message") + none + unknown


class _Informed:
    """Calls a function with a message and what is known of it, whichever executor calls this.

    rclpy tells by the signature that both are asked for. Its EventsExecutor then passes one tuple.
    """

    __signature__ = Signature([Parameter(name, Parameter.POSITIONAL_ONLY) for name in ("a", "b")])

    def __init__(self, take: Callable[[bytes, Mapping[str, Any]], None]) -> None:
        self._take = take

    def __call__(self, *given: Any) -> None:
        self._take(*(given if len(given) == 2 else given[0]))


def _in_yaml(offered: QoSProfile) -> str:
    """Return an item of a list of qualities of service, in the form of rosbag2 (its version 9)."""
    lines = [
        f"history: {offered.history.short_key}",
        f"depth: {offered.depth}",
        f"reliability: {offered.reliability.short_key}",
        f"durability: {offered.durability.short_key}",
        *_duration("deadline", offered.deadline),
        *_duration("lifespan", offered.lifespan),
        f"liveliness: {offered.liveliness.short_key}",
        *_duration("liveliness_lease_duration", offered.liveliness_lease_duration),
        f"avoid_ros_namespace_conventions: {str(offered.avoid_ros_namespace_conventions).lower()}",
    ]
    return "- " + "\n  ".join(lines) + "\n"


def _duration(name: str, value: Any) -> list[str]:
    seconds, rest = divmod(value.nanoseconds, 10**9)
    return [f"{name}:", f"  sec: {seconds}", f"  nsec: {rest}"]


def _package(kind: type) -> str:
    """Return the package of a type of messages."""
    return kind.__module__.partition(".")[0]


def main(
    files: Sequence[str],
    seconds: float | None,
    trials: int | None,
    joints: tuple[str, str],
    arguments: Sequence[str],
    *,
    clock: bool = False,
) -> int:
    """Record until interrupted or as long as asked for, and return the exit status.

    Parameters
    ----------
    files
        The files to write; FILE.mcap or FILE.csv.
    seconds
        How long to record [s]; None: without a limit.
    trials
        After how many trials of the learner to end; None: without a limit.
    joints
        Names of slider and hinge, for CSV.
    arguments
        ROS arguments.
    clock
        Whether to record the clock too.
    """
    stopped = Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())

    def work() -> int:
        if seconds is not None:
            require("seconds", seconds, 0, above=True)
        if trials is not None:
            require("trials", trials, 1, whole=True)
        with new_node("recorder", {}, arguments, leave_core) as node:
            recorder = Recorder(node, TOPICS | (CLOCK if clock else {}))
            with open_recordings(files, recorder.topics, joints, recorder.offers) as recordings:
                recorder.recordings = recordings
                began = time.monotonic()
                end = began + seconds if seconds is not None else float("inf")

                def is_over() -> bool:
                    enough = trials is not None and recorder.trials() >= trials
                    return stopped.is_set() or enough or time.monotonic() >= end

                _listen(node, recorder, is_over)
        print(f"{time.monotonic() - began:.1f} s: {recorder.summary()}")
        for path in files:
            print(f"recording: {path}")
        return 0

    return exit_status(work)


def _listen(node: OwnNode, recorder: Recorder, is_over: Callable[[], bool]) -> None:
    """Record until it is over, and then what was sent before.

    Raises
    ------
    UprightError
        If a file cannot be written.
    """
    executor = make_executor(node)
    names = ", ".join(topic.name for topic in recorder.topics.values())
    print(f"recording {names} (Ctrl-C ends)", flush=True)
    looked = flushed = time.monotonic()

    def spin(longest: float) -> None:
        nonlocal looked, flushed
        executor.spin_once(timeout_sec=longest)
        if recorder.error:
            raise recorder.error
        now = time.monotonic()
        if now >= looked + LOOKS:
            looked = now
            if found := recorder.newly_found():
                print(f"found {', '.join(found)}", flush=True)
        if now >= flushed + FLUSHED:
            flushed = now
            recorder.flush()

    try:
        while not is_over():
            spin(POLL)
        last, latest = time.time_ns(), time.monotonic() + LATE
        while recorder.newest < last and time.monotonic() < latest:
            spin(LATE / 10)
    finally:
        node.leave_executor()  # before the files are closed, as it takes what waits
