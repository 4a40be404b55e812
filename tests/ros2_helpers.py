"""Shared by the tests of ROS 2 nodes: a node to act by hand, and what processes print."""

import os
import re
import signal
import time
from importlib.util import find_spec

import pytest

NODE_MARKS = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (find_spec("rclpy") or os.environ.get("UPRIGHT_REQUIRE_ROS2")),
        reason="ROS 2 (rclpy) is not installed: no node is tested",
    ),
    pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning"),  # what rclpy imports does
]
"""Marks of tests that start real nodes."""
SETTLED = 0.3
"""After this time, both sides of a topic know each other [s]."""
LIMIT = 90
"""Time limit of every process [s]."""
GARBAGE = {
    "a header alone": b"\0\1\0\0",
    "a count beyond the end": b"\0\1\0\0" + b"\xff" * 40,
    "another representation": b"\0\7\0\0" + bytes(40),
}
"""What is no message of any of the topics; on the count rclpy would end the process."""


class Hand:
    def __init__(self, node):
        from sensor_msgs.msg import JointState
        from std_msgs.msg import Float64MultiArray, String
        from std_srvs.srv import Trigger

        from upright.plants.ros2.node import KEPT, QOS, make_executor

        self.node, self.states, self.words = node, [], []
        self.message, self.trigger = Float64MultiArray, Trigger.Request
        self._effort, self._quality = None, QOS
        node.create_subscription(JointState, "joint_states", self.states.append, QOS)
        node.create_subscription(String, "status", lambda word: self.words.append(word.data), KEPT)
        self.reset_service = node.create_client(Trigger, "reset")
        self.executor = make_executor(node)
        self.until(lambda: self.words)
        assert self.reset_service.wait_for_service(LIMIT)

    @property
    def effort(self):
        """What commands are published with, from the first on: a learner refuses another one."""
        if self._effort is None:
            self._effort = self.node.create_publisher(self.message, "effort", self._quality)
            self.until(self._effort.get_subscription_count)
            time.sleep(SETTLED)  # the other side may know it later, and misses what comes before
        return self._effort

    def report(self, status):
        """Publish a status, as a part of the cart does."""
        from std_msgs.msg import String

        from upright.plants.ros2.node import KEPT

        publisher = self.node.create_publisher(String, "status", KEPT)
        self.until(lambda: publisher.get_subscription_count() > 1)  # the learner and this node
        publisher.publish(String(data=status))

    def set(self, name, value):
        """Set a parameter of the simulator, and return its answer."""
        from rcl_interfaces.srv import SetParameters
        from rclpy.parameter import Parameter

        parameters = [Parameter(name, value=value).to_parameter_msg()]
        answer = self.call(SetParameters, "simulator/set_parameters", parameters=parameters)
        return answer.results[0]

    def call(self, kind, name, **request):
        """Call a service of the simulator, and return its answer."""
        client = self.node.create_client(kind, name)
        assert client.wait_for_service(LIMIT)
        answer = client.call_async(kind.Request(**request))
        self.until(answer.done)
        return answer.result()

    def until(self, ready):
        end = time.monotonic() + LIMIT
        while not ready() and time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.02)
        assert ready()

    def reset(self):
        answer = self.reset_service.call_async(self.trigger())
        self.until(answer.done)
        self.until(lambda: self.words[-1] == "Balancing")

    def command(self, *forces):
        self.effort.publish(self.message(data=forces))


def is_gone(group):
    """Whether a group of processes has ended; end it if it has not within half a minute."""
    for _ in range(300):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    os.killpg(group, signal.SIGKILL)
    return False


def finish(process):
    out, told = process.communicate(timeout=LIMIT)
    return process.returncode, out, told


def lengths(text):
    found = re.findall(r"^trial +\d+ +([\d,]+) steps", text, re.MULTILINE)
    return [int(length.replace(",", "")) for length in found]


def has_begun(program):
    """Whether what a program prints next is the scale of the bars, and the first trial."""
    lines = [program.stdout.readline() for _ in range(2)]
    return "logarithmic" in lines[0] and lines[1].startswith("trial    1")
