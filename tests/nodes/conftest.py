"""Fixtures of the tests of ROS 2 nodes: real nodes in real processes."""

import subprocess
import sys

import pytest
from helpers import ros_domain
from ros2_helpers import LIMIT, Hand, is_gone

COMMAND = [sys.executable, "-m", "upright"]


@pytest.fixture
def domain(monkeypatch, tmp_path):
    """A ROS domain for each test; its number."""
    with ros_domain() as own:
        for name, value in (own | {"ROS_LOG_DIR": str(tmp_path)}).items():
            monkeypatch.setenv(name, value)
        yield own["ROS_DOMAIN_ID"]


@pytest.fixture
def start(domain):
    """Return a function that starts commands; their child processes must end with them."""
    started = []

    def start_one(line, command=COMMAND):
        process = subprocess.Popen(
            [*command, *line.split()],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        started.append(process)
        return process

    yield start_one
    for process in started:
        if process.poll() is None:
            process.kill()
        process.communicate(timeout=LIMIT)
    left = [process.args for process in started if not is_gone(process.pid)]
    assert not left, "something is left over of them"


@pytest.fixture
def simulate(start):
    def simulate_with(options=""):
        process = start(f"ros2 simulate {options}")
        assert process.stdout.readline().startswith("simulating ")
        return process

    return simulate_with


@pytest.fixture
def simulator(simulate):
    return simulate()


@pytest.fixture
def hand(domain):
    """A node of this process, to send commands and listen by hand."""
    from upright.plants.ros2.node import new_node

    with new_node("hand", {}, []) as node:
        yield Hand(node)


@pytest.fixture
def hand_of_simulator(domain, request):
    """Return a function that makes a hand, for once there is a simulator."""
    return lambda: request.getfixturevalue("hand")
