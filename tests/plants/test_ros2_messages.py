"""What is read out of bytes is what rclpy reads."""

import os
from importlib.util import find_spec

import pytest
from hypothesis import given
from hypothesis import strategies as st

from upright.errors import UprightError

pytestmark = [
    pytest.mark.skipif(
        not (find_spec("rclpy") or os.environ.get("UPRIGHT_REQUIRE_ROS2")),
        reason="ROS 2 (rclpy) is not installed: no message is read",
    ),
    pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning"),  # what rclpy imports does
]
NUMBERS = st.floats(allow_nan=False)
NAMES = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=9)


def joint_state(names, numbers, frame="", stamp=0, efforts=0):
    from sensor_msgs.msg import JointState

    message = JointState(name=names, position=numbers[0], velocity=numbers[1])
    message.effort = [1.0] * efforts
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    return message


def serialise(message):
    from rclpy.serialization import serialize_message

    return serialize_message(message)


@st.composite
def messages(draw):
    names = draw(st.permutations(["slider", "hinge", *draw(st.lists(NAMES, max_size=3))]))
    numbers = [
        draw(st.lists(NUMBERS, min_size=len(names), max_size=len(names))),
        draw(st.lists(NUMBERS, min_size=len(names), max_size=len(names) + 1)),
    ]
    stamp = draw(st.integers(0, 2**31 * 10**9 - 1))
    return joint_state(names, numbers, draw(NAMES), stamp, draw(st.integers(0, len(names))))


@given(st.lists(messages(), min_size=1, max_size=4))
def test_joints_are_read_as_rclpy_reads_them(some):
    from upright.plants.ros2.messages import Joints

    joints = Joints()
    for message in [some[0], *some]:  # the second time its form is known
        names = list(message.name)
        slider, hinge = names.index("slider"), names.index("hinge")
        stamp, state = joints.read(serialise(message))
        assert stamp == message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        assert state == (
            message.position[slider],
            message.velocity[slider],
            message.position[hinge],
            message.velocity[hinge],
        )


def test_a_known_form_is_not_studied_again(monkeypatch):
    from upright.plants.ros2 import messages as ros2_messages

    joints = ros2_messages.Joints()
    names = ["hinge", "wheel", "slider"]
    joints.read(serialise(joint_state(names, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], "cart")))
    monkeypatch.delattr(ros2_messages, "Reader")
    raw = serialise(joint_state(names, [[7.0, 8.0, 9.0], [10.0, 11.0, 12.0]], "cart", 13))
    assert joints.read(raw) == (13, (9.0, 12.0, 7.0, 10.0))
    assert ros2_messages.read_numbers(serialise(numbers_message([-2.5]))) == [-2.5]


def test_other_joints_are_ignored():
    from upright.plants.ros2.messages import Joints

    assert Joints().read(serialise(joint_state(["wheel"], [[1.0], [2.0]]))) is None


def test_a_cart_without_velocities_is_refused():
    from upright.plants.ros2.messages import Joints

    raw = serialise(joint_state(["slider", "hinge"], [[1.0, 2.0], []]))
    with pytest.raises(UprightError, match=r"no velocity of joint 'hinge'.*; velocities=dif"):
        Joints().read(raw)


def numbers_message(numbers):
    from std_msgs.msg import Float64MultiArray

    return Float64MultiArray(data=numbers)


@given(st.lists(NUMBERS, max_size=4))
def test_commands_are_read_as_rclpy_reads_them(numbers):
    from upright.plants.ros2.messages import read_numbers

    assert read_numbers(serialise(numbers_message(numbers))) == numbers
