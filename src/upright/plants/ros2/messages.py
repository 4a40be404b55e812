"""Reads numbers directly from serialised messages.

rclpy turns whole messages into Python objects, although a control step needs only six numbers; that
would take a sixth of the step. Therefore rclpy deserialises only the first message of each layout.
ROS 2 sends messages in the Common Data Representation (CDR; OMG, DDS Interoperability Wire Protocol
2.3, 10): after a header of four bytes, each number is aligned to its size, and whatever varies in
length is preceded by a count.
"""

import struct

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from upright.core.parameters import State
from upright.errors import UprightError
from upright.plants.urdf import HINGE, SLIDER

HEADER = b"\x00\x01"
"""First bytes of a message that is CDR in little-endian byte order."""
COUNT, NUMBER, STAMP = struct.Struct("<I"), struct.Struct("<d"), struct.Struct("<iI")
ONE_NUMBER = COUNT.pack(0) + COUNT.pack(0) + COUNT.pack(1)
"""A Float64MultiArray's layout without dimensions or offset, and the count of one number."""


def read_numbers(raw: bytes) -> list[float]:
    """Return the numbers of a serialised Float64MultiArray."""
    if len(raw) == 28 and raw[:2] == HEADER and raw[4:16] == ONE_NUMBER:
        return list(NUMBER.unpack_from(raw, 20))
    return list(deserialize_message(raw, Float64MultiArray).data)


class Joints:
    """Reads serialised JointStates; without rclpy if the layout is that of the last message."""

    def __init__(self) -> None:
        self._length = -1  # length of a message in the known layout [bytes]
        self._form: list[tuple[slice, bytes]] = []  # its content except for the numbers
        self._places: tuple[int, ...] = ()  # offsets of the numbers of the state

    def read(self, raw: bytes) -> tuple[int, State] | None:
        """Return the time stamp [ns] and the state of the cart; None if the joints are others.

        Raises
        ------
        UprightError
            If a joint of the cart has no position or no velocity.
        """
        if len(raw) != self._length or not self._has_form(raw):
            return self._study(raw)
        seconds, nanoseconds = STAMP.unpack_from(raw, 4)
        numbers = [NUMBER.unpack_from(raw, place)[0] for place in self._places]
        return seconds * 10**9 + nanoseconds, State(*numbers)

    def _has_form(self, raw: bytes) -> bool:
        return all(raw[where] == content for where, content in self._form)

    def _study(self, raw: bytes) -> tuple[int, State] | None:
        """Let rclpy deserialise a message, and remember where its numbers are."""
        message = deserialize_message(raw, JointState)
        places, speeds = message.position, message.velocity
        try:
            slider, hinge = map(list(message.name).index, (SLIDER, HINGE))
        except ValueError:
            return None
        if max(slider, hinge) >= min(len(places), len(speeds)):
            raise UprightError(f"joint_states lack a position or a velocity: {message}")

        texts = [text.encode() + b"\0" for text in (message.header.frame_id, *message.name)]
        frame, *names = [COUNT.pack(len(text)) + text for text in texts]
        self._form, end = [(slice(0, 2), HEADER)], 12
        for content in (frame, COUNT.pack(len(names)), *names, COUNT.pack(len(places))):
            start = end + -end % 4
            end = start + len(content)
            self._form.append((slice(start, end), content))
        first = end + (4 - end) % 8  # start of the positions; alignment ignores the header
        end = first + 8 * len(places)
        self._form.append((slice(end, end + 4), COUNT.pack(len(speeds))))
        second = end + 4 + -end % 8  # start of the velocities
        self._places = tuple(
            start + 8 * joint for joint in (slider, hinge) for start in (first, second)
        )
        self._length = len(raw) if self._has_form(raw) else -1

        state = State(places[slider], speeds[slider], places[hinge], speeds[hinge])
        stamp = message.header.stamp
        return stamp.sec * 10**9 + stamp.nanosec, state
