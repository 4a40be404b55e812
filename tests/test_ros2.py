"""Real nodes in real processes, in a domain of their own on this machine alone."""

import os
import re
import signal
import subprocess
import sys
import time
from importlib.util import find_spec

import pytest

from upright.cli import BAD_USE
from upright.study import make_case, make_run

pytestmark = pytest.mark.skipif(
    not (find_spec("rclpy") or os.environ.get("UPRIGHT_REQUIRE_ROS2")),
    reason="ROS 2 (rclpy) is not installed: no node is tested",
)
COMMAND = [sys.executable, "-c", "from upright.cli import main; main()"]
LIMIT = 90
"""No process takes longer [s]."""


@pytest.fixture
def surroundings(tmp_path):
    domain = str(1 + os.getpid() % 100)
    own = {"ROS_DOMAIN_ID": domain, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    return os.environ | own | {"ROS_LOG_DIR": str(tmp_path)}


@pytest.fixture
def simulator(surroundings):
    process = subprocess.Popen(
        [*COMMAND, "ros2", "simulate"], env=surroundings, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline().startswith("simulating equations in lock-step")
    yield process
    process.kill()
    process.communicate(timeout=LIMIT)


def upright(surroundings, line):
    return subprocess.run(
        [*COMMAND, *line.split()], env=surroundings, capture_output=True, text=True, timeout=LIMIT
    )


def lengths(text):
    found = re.findall(r"^trial +\d+ +([\d,]+) steps", text, re.MULTILINE)
    return [int(length.replace(",", "")) for length in found]


def test_trials_are_those_of_the_equations(simulator, surroundings):
    """Numbers pass unchanged, so the same seed gives the same trials as without ROS 2."""
    line = "learn reinforce --plant ros2 --steps 1000 --seed 3"
    done = upright(surroundings, line)
    assert done.returncode == 0, done.stderr
    _, alone = make_run(make_case("reinforce", steps=1000), 3, 0)
    assert lengths(done.stdout) == alone.lengths.tolist()
    simulator.send_signal(signal.SIGINT)
    assert simulator.wait(LIMIT) == 0


def test_a_learner_learns_where_the_simulator_makes_the_noise(simulator, surroundings):
    done = upright(surroundings, "ros2 learn adaptive-lqr --steps 1000 --trials 20")
    assert done.returncode == 0, done.stderr
    assert lengths(done.stdout)[-1] == 1000


def test_without_a_cart_there_is_a_clear_error(surroundings):
    done = upright(surroundings, "ros2 learn reinforce --patience 1")
    assert done.returncode == BAD_USE
    assert "no cart was found within 1 s in ROS domain" in done.stderr


def test_a_killed_simulator_ends_the_learner(simulator, surroundings):
    learner = subprocess.Popen(
        [*COMMAND, "ros2", "learn", "random-search"],
        env=surroundings,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert learner.stdout.readline().startswith("trial    1")
    time.sleep(0.5)
    simulator.kill()
    _, told = learner.communicate(timeout=LIMIT)
    assert learner.returncode == BAD_USE
    assert re.search("no joint_states came for 0.5 s; the cart was stopped|did not answer", told)
