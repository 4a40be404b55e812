"""Reads serialised messages, without rclpy: whoever shares the domain can send any bytes.

rclpy ends the process on some of them, because it trusts the counts in a message. Besides, it turns
whole messages into Python objects, although a control step needs only six numbers; that would take
a sixth of the step. So every count is checked here before it is used, and of a message with the
layout of the last one only the numbers are read.

ROS 2 sends messages in the Common Data Representation (CDR; OMG, DDS Interoperability Wire Protocol
2.3, 10): after a header of four bytes, each number is aligned to its size, and whatever varies in
length is preceded by a count.
"""

import struct
from typing import Literal

from upright.core.parameters import State
from upright.errors import UprightError, said
from upright.plants.ros2.topics import EFFORT, JOINT_STATES, STATUS
from upright.plants.urdf import HINGE, SLIDER

HEADER = 4
"""Length of the header [bytes], from whose end numbers are aligned."""
ORDERS: dict[bytes, Literal["<", ">"]] = {b"\x00\x00": ">", b"\x00\x01": "<"}
"""Byte orders by the first bytes of a message; those of other representations are refused."""
NUMBER = struct.Struct("<d")
ONE_NUMBER = struct.pack(">I", 1 << 16) + struct.pack("<3I", 0, 0, 1)
"""A Float64MultiArray's header, its layout without dimensions or offset, and a count of one number.
"""


class Reader:
    """Takes what a message holds, one thing after the other.

    Every method raises UprightError if the message is too short for it.

    Parameters
    ----------
    raw
        The serialised message.
    topic
        The topic that it came on, for errors.
    """

    def __init__(self, raw: bytes, topic: str) -> None:
        self._raw, self._topic, self._end = raw, topic, HEADER
        self._length = len(raw)
        if len(raw) < HEADER or raw[:2] not in ORDERS:
            raise self._garbled("its header is not one of CDR")
        self._length -= raw[3] & 3  # how many bytes were added behind the content
        self.order = ORDERS[raw[:2]]
        self.form: list[tuple[slice, bytes]] = [(slice(0, HEADER), raw[:HEADER])]
        """What was taken so far, but for numbers, and where it stands."""

    def skip(self, size: int, alignment: int) -> int:
        """Go past this many bytes, and return where they begin."""
        start = self._end + (HEADER - self._end) % alignment
        if start + size > self._length:
            raise self._garbled(f"it has {self._length} bytes where {start + size} are stated")
        self._end = start + size
        return start

    def content(self, size: int, alignment: int) -> bytes:
        """Return this many bytes, and note them as part of the message's form."""
        where = slice(start := self.skip(size, alignment), start + size)
        self.form.append((where, self._raw[where]))
        return self._raw[where]

    def count(self) -> int:
        """Return a count, which may still be any."""
        return int.from_bytes(self.content(4, 4), "little" if self.order == "<" else "big")

    def text(self) -> str:
        """Return a text, which ends in a zero byte."""
        text = self.content(self.count(), 1)
        if text and text[-1]:
            raise self._garbled("a text in it has no end")
        return text[:-1].decode(errors="replace")

    def texts(self) -> list[str]:
        """Return a sequence of texts."""
        return [self.text() for _ in range(self.count())]  # each takes four bytes at least

    def numbers(self) -> range:
        """Return where each number of a sequence stands."""
        count = self.count()
        start = self.skip(8 * count, 8 if count else 1)
        return range(start, start + 8 * count, 8)

    def _garbled(self, why: str) -> UprightError:
        return UprightError(f"{self._topic} brought what is not its kind of message: {why}")


def read_numbers(raw: bytes) -> list[float]:
    """Return the numbers of a serialised Float64MultiArray.

    Raises
    ------
    UprightError
        If it is none.
    """
    if len(raw) == 28 and raw[:16] == ONE_NUMBER:
        return list(NUMBER.unpack_from(raw, 20))
    reader = Reader(raw, EFFORT)
    for _ in range(reader.count()):
        reader.text()  # a dimension's label, before its size and stride
        reader.skip(8, 4)
    reader.skip(4, 4)  # the offset
    number = struct.Struct(f"{reader.order}d")
    return [number.unpack_from(raw, place)[0] for place in reader.numbers()]


def read_text(raw: bytes) -> str:
    """Return the text of a serialised String.

    Raises
    ------
    UprightError
        If it is none.
    """
    return Reader(raw, STATUS).text()


class Joints:
    """Reads serialised JointStates, the faster if the layout is that of the last message.

    Parameters
    ----------
    slider, hinge
        Names of the joints between track and cart, and between cart and pole.
    velocities
        Whether velocities are read; otherwise they are 0, and the message need not have any.
    """

    def __init__(
        self, slider: str = SLIDER, hinge: str = HINGE, *, velocities: bool = True
    ) -> None:
        self.names: list[str] = []
        """Names of the joints of the last message whose layout was new."""
        self._wanted, self._velocities = (slider, hinge), velocities
        self._length = -1  # length of a message in the known layout [bytes]
        self._form: list[tuple[slice, bytes]] = []  # its content except for the numbers
        self._places: tuple[int, ...] = ()  # offsets of the numbers of the state
        self._stamp, self._number = struct.Struct("<iI"), NUMBER

    def read(self, raw: bytes) -> tuple[int, State] | None:
        """Return the time stamp [ns] and the readings of the cart; None if the joints are others.

        Raises
        ------
        UprightError
            If it is no JointState, or a joint of the cart has no position or no velocity.
        """
        known = len(raw) == self._length and all(raw[part] == held for part, held in self._form)
        if not known and not self._study(raw):
            return None
        seconds, nanoseconds = self._stamp.unpack_from(raw, HEADER)
        numbers = [self._number.unpack_from(raw, place)[0] for place in self._places]
        if self._velocities:
            return seconds * 10**9 + nanoseconds, State(*numbers)
        return seconds * 10**9 + nanoseconds, State(numbers[0], 0.0, numbers[1], 0.0)

    def _study(self, raw: bytes) -> bool:
        """Remember where a message has its numbers; return whether its joints are the cart's."""
        self._length = -1
        reader = Reader(raw, JOINT_STATES)
        reader.skip(8, 4)  # the stamp
        reader.text()  # the frame
        self.names = names = reader.texts()
        places, speeds = reader.numbers(), reader.numbers()
        form = list(reader.form)
        reader.numbers()  # the efforts
        if not {*self._wanted} <= {*names}:
            return False
        joints = [names.index(name) for name in self._wanted]
        read = {"position": places} | ({"velocity": speeds} if self._velocities else {})
        for kind, numbers in read.items():
            if max(joints) >= len(numbers):
                joint = said(self._wanted[joints.index(max(joints))])
                raise UprightError(
                    f"{JOINT_STATES} have no {kind} of joint {joint}: there are {len(names)} "
                    f"joints, {len(places)} positions and {len(speeds)} velocities"
                    + ("; velocities=differenced takes them from positions" * (kind != "position"))
                )
        self._places = tuple(some[joint] for joint in joints for some in read.values())
        self._stamp = struct.Struct(f"{reader.order}iI")
        self._number = struct.Struct(f"{reader.order}d")
        self._length, self._form = len(raw), form
        return True
