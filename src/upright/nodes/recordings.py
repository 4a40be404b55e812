"""Files of what passes over ROS 2 topics: MCAP, with every message as it came, and CSV."""

import csv
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO, Any, NamedTuple, Protocol

from upright.errors import UprightError, require_module, require_one_of
from upright.plants.ros2.messages import Joints, read_numbers, read_text
from upright.plants.ros2.topics import BALANCING, EFFORT, JOINT_STATES, STATUS

BUILT_IN = re.compile(r"(u?int(8|16|32|64)|float(32|64)|bool|char|byte|w?string)\b")
"""A field's type that has no definition of its own."""
LARGEST = 2**32 - 1
"""The largest number of a message in an MCAP file, after which it begins again at 0."""
COLUMNS = (
    *("stamp [s]", "x [m]", "x_dot [m/s]", "theta [rad]", "theta_dot [rad/s]"),
    *("command", "status", "trial"),
)
"""Columns of a CSV file: a row for each measurement, with the last command and status before it."""


class Topic(NamedTuple):
    """A topic as it is in the system that is recorded."""

    name: str
    """Its full name, which may be another one than a cart's usual one."""
    kind: str
    """The type of its messages, such as std_msgs/msg/String."""


class Message(NamedTuple):
    """A message as it came."""

    role: str
    """The usual name of its topic."""
    raw: bytes
    """Its serialised content."""
    received: int
    """When it came [ns since 1970]."""
    sent: int
    """When it was published, by its publisher's clock [ns since 1970]."""
    number: int
    """How many messages its publisher had published with it; 0 if that is not known."""


class Recording(Protocol):
    """A file that messages are written to."""

    def write(self, message: Message) -> None:
        """Write a message, which may be in the file only after `flush`."""

    def flush(self) -> None:
        """Put what was written into the file, where it survives should the process be killed."""

    def close(self) -> None:
        """Complete the file."""


Offers = Callable[[str], str]
"""Gives the quality of service that a topic's publishers offer, in YAML as rosbag2 writes it."""


@contextmanager
def open_recordings(
    paths: Sequence[str], topics: Mapping[str, Topic], joints: tuple[str, str], offers: Offers
) -> Iterator[list[Recording]]:
    """Provide recordings in new files, within the block; their endings decide on the formats.

    If one cannot be made, none is.

    Parameters
    ----------
    paths
        Files that do not exist; FILE.mcap or FILE.csv.
    topics
        The topics by their usual names.
    joints
        Names of slider and hinge.
    offers
        Called with the usual name of a topic when its first message has come.

    Raises
    ------
    UprightError
        If an ending is another one, a file exists or cannot be made, or a library is missing.
    """
    endings = [Path(path).suffix for path in paths]
    for path, ending in zip(paths, endings, strict=True):
        require_one_of(f"the ending of {path!r}", ending, [".mcap", ".csv"])
    if ".mcap" in endings:
        require_module("mcap", "MCAP files need the library mcap", "record")
    with ExitStack() as opened:
        recordings: list[Recording] = []
        with ExitStack() as made:
            for path, ending in zip(paths, endings, strict=True):
                is_table = ending == ".csv"
                file = _new_file(path, "x", newline="") if is_table else _new_file(path, "xb")
                made.callback(Path(path).unlink)
                opened.callback(file.close)  # should the recording not be made, or not be closed
                recording: Recording = (
                    CsvRecording(file, joints) if is_table else McapRecording(file, topics, offers)
                )
                opened.callback(recording.close)
                recordings.append(recording)
            made.pop_all()
        yield recordings


def _new_file(path: str, mode: str, **options: Any) -> IO[Any]:
    try:
        file: IO[Any] = Path(path).open(mode, **options)  # noqa: SIM115 - a recording closes it
    except FileExistsError:
        raise UprightError(f"{path!r} exists; a recording replaces no file") from None
    except OSError as error:
        raise UprightError(f"{path!r} cannot be written: {error.strerror}") from error
    return file


class McapRecording:
    """An MCAP file as rosbag2 and Foxglove read it, with the profile ros2.

    Parameters
    ----------
    file
        A binary file.
    topics
        The topics by their usual names.
    offers
        Called with the usual name of a topic when its first message has come.
    """

    def __init__(self, file: IO[bytes], topics: Mapping[str, Topic], offers: Offers) -> None:
        from mcap.writer import CompressionType, Writer

        self._file, self._topics, self._offers = file, topics, offers
        self._writer: Any = Writer(file, compression=CompressionType.NONE)
        with _naming(file):
            self._writer.start(profile="ros2", library="upright")
        self._channels: dict[str, int] = {}

    def write(self, message: Message) -> None:
        """Write a message as it came."""
        role, raw, received, sent, number = message
        with _naming(self._file):
            if role not in self._channels:
                self._channels[role] = self._new_channel(role)
            self._writer.add_message(self._channels[role], received, raw, sent, number & LARGEST)

    def flush(self) -> None:
        """End the part of the file that is being written; parts are read without an index."""
        with _naming(self._file):
            self._writer.flush()

    def close(self) -> None:
        """Write the index, and close the file."""
        with _naming(self._file), self._file:
            self._writer.finish()

    def _new_channel(self, role: str) -> int:
        topic = self._topics[role]
        text = definition(topic.kind).encode()
        schema = self._writer.register_schema(topic.kind, "ros2msg", text)
        metadata = {"offered_qos_profiles": self._offers(role)}
        return int(self._writer.register_channel(topic.name, "cdr", schema, metadata))


class CsvRecording:
    """A CSV file with a row for each measurement.

    Parameters
    ----------
    file
        A text file.
    joints
        Names of slider and hinge.
    """

    def __init__(self, file: IO[str], joints: tuple[str, str]) -> None:
        self._file, self._rows = file, csv.writer(file)
        self._names, self._joints = joints, Joints(*joints)
        self._command: float | str = ""
        self._status, self._trial = "", 0
        with _naming(file):
            self._rows.writerow(COLUMNS)

    def write(self, message: Message) -> None:
        """Remember a command or a status; write a measurement. Other topics are left out."""
        role, raw, row = message.role, message.raw, None
        with suppress(UprightError):  # what is no message of its kind is in no column
            if role == EFFORT:
                self._command = next(iter(read_numbers(raw)), "")
            elif role == STATUS:
                self._status = read_text(raw)
                self._trial += self._status == BALANCING
            elif role == JOINT_STATES:
                row = self._row(raw)
        if row:
            with _naming(self._file):
                self._rows.writerow(row)

    def flush(self) -> None:
        """Put the rows into the file."""
        with _naming(self._file):
            self._file.flush()

    def close(self) -> None:
        """Close the file."""
        with _naming(self._file):
            self._file.close()

    def _row(self, raw: bytes) -> list[float | str | int] | None:
        """Return the row of a measurement; None if it is of other joints."""
        measured = True
        try:
            read = self._joints.read(raw)
        except UprightError:  # without velocities, perhaps
            read, measured = Joints(*self._names, velocities=False).read(raw), False
        if read is None:
            return None
        stamp, (x, x_dot, theta, theta_dot) = read
        speeds = (x_dot, theta_dot) if measured else ("", "")
        seconds = f"{stamp // 10**9}.{stamp % 10**9:09d}"
        after = self._command, self._status, self._trial
        return [seconds, x, speeds[0], theta, speeds[1], *after]


@contextmanager
def _naming(file: IO[Any]) -> Iterator[None]:
    """Raise what goes wrong with a file as an error that names it."""
    try:
        yield
    except OSError as error:
        raise UprightError(
            f"{file.name!r} cannot be written: {error.strerror}; it has what came before"
        ) from error


def definition(kind: str) -> str:
    """Return the definition of a type of messages, followed by those of the types in it.

    Parameters
    ----------
    kind
        The type, such as std_msgs/msg/String.

    Raises
    ------
    UprightError
        If this ROS 2 has no such type.
    """
    parts = {kind: _own_definition(kind)}
    waiting = [kind]
    while waiting:
        package = waiting[0].partition("/")[0]
        for line in parts[waiting.pop(0)].splitlines():
            field = line.split("#")[0].strip()
            if not field or BUILT_IN.match(field):
                continue
            inner = re.split(r"[\s\[<]", field)[0].replace("/msg/", "/")
            inner = inner if "/" in inner else f"{package}/{inner}"
            inner = inner.replace("/", "/msg/")
            if inner not in parts:
                parts[inner] = _own_definition(inner)
                waiting.append(inner)
    first, *others = parts.values()
    names = [name.replace("/msg/", "/") for name in parts][1:]
    rest = [f"{'=' * 80}\nMSG: {name}\n{text}" for name, text in zip(names, others, strict=True)]
    return "\n".join([first, *rest])


def _own_definition(kind: str) -> str:
    package, _, name = kind.split("/")
    roots = [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]
    for root in filter(None, roots):
        path = Path(root) / "share" / package / "msg" / f"{name}.msg"
        if path.is_file():
            return path.read_text(encoding="utf-8")
    raise UprightError(f"this ROS 2 has no definition of the messages {kind}")
