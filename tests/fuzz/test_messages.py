"""Bytes from the network are read or refused, whatever they are; no ROS 2 is needed for that."""

import struct
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from upright.errors import UprightError
from upright.plants.ros2.messages import Joints, read_numbers, read_text


def packed(order, header, *parts):
    """Return a message of counts, texts, and lists of numbers."""
    data = b""
    for part in parts:
        data += bytes(-len(data) % 4)
        if isinstance(part, str):
            text = part.encode() + b"\0"
            data += struct.pack(f"{order}I", len(text)) + text
        elif isinstance(part, list):
            data += struct.pack(f"{order}I", len(part))
            data += bytes(-len(data) % 8 if part else 0) + struct.pack(
                f"{order}{len(part)}d", *part
            )
        else:
            data += struct.pack(f"{order}I", part)
    return header + data


JOINTS = (13, 5, "cart", 2, "slider", "hinge", [1.0, 2.0], [3.0, 4.0], [])
WHOLE = {
    "little": packed("<", b"\0\1\0\0", *JOINTS),
    "big": packed(">", b"\0\0\0\0", *JOINTS),
}


@given(st.binary(max_size=120) | st.binary(max_size=120).map(lambda data: b"\0\1\0\0" + data))
def test_any_bytes(raw):
    for read in (read_numbers, read_text, Joints().read):
        with suppress(UprightError):
            read(raw)


@pytest.mark.parametrize("raw", WHOLE.values(), ids=WHOLE)
def test_both_byte_orders_are_read(raw):
    joints = Joints()
    for _ in range(2):  # the second time its form is known
        assert joints.read(raw) == (13 * 10**9 + 5, (1.0, 3.0, 2.0, 4.0))


@pytest.mark.parametrize("raw", WHOLE.values(), ids=WHOLE)
def test_every_part_of_a_message_is_needed(raw):
    for end in range(len(raw)):
        with pytest.raises(UprightError, match="joint_states brought what is not its kind"):
            Joints().read(raw[:end])
    # The last bytes may be said to be no content.
    for added in (1, 2, 3):
        stated = raw[:3] + bytes([added]) + raw[4:]
        assert Joints().read(stated + bytes(added)) == Joints().read(raw)
        with pytest.raises(UprightError, match="bytes where"):
            Joints().read(stated)


@pytest.mark.parametrize("place", range(0, 92, 4))
def test_counts_beyond_the_end_are_refused_at_once(place):
    raw = bytearray(WHOLE["little"])
    raw[place : place + 4] = b"\xff\xff\xff\x7f"
    joints = Joints()
    with suppress(UprightError):
        joints.read(bytes(raw))
    assert joints.read(WHOLE["little"]) == (13 * 10**9 + 5, (1.0, 3.0, 2.0, 4.0))


def test_efforts_and_words():
    assert read_numbers(packed("<", b"\0\1\0\0", 0, 0, [2.5])) == [2.5]
    assert read_numbers(packed(">", b"\0\0\0\0", 1, "x", 1, 1, 0, [2.5, 3.5])) == [2.5, 3.5]
    assert read_text(packed(">", b"\0\0\0\0", "Balancing")) == "Balancing"
    assert read_text(b"\0\1\0\0\0\0\0\0") == ""
    with pytest.raises(UprightError, match=r"status brought .* a text in it has no end"):
        read_text(b"\0\1\0\0\1\0\0\0x")
