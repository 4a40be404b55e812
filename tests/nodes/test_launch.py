"""The launch file, launched with ROS 2's own `launch`, where that is installed: it is in no wheel.

In place of robot_state_publisher and RViz, a program stands in that says what it was given.
"""

import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import fields
from importlib.util import find_spec

import pytest
from helpers import ROOT, ros_domain

from upright.nodes.settings import LearnerSettings, SimulatorSettings

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not find_spec("launch_ros"), reason="ROS 2's launch is not installed"),
]
PACKAGE = ROOT / "ros2"
LIMIT = 120
"""Time limit of every process [s]."""
LAUNCH = """
import sys

from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import AnyLaunchDescriptionSource

path, *arguments = sys.argv[1:]
source = AnyLaunchDescriptionSource(path)
given = [argument.split(":=", 1) for argument in arguments]
service = LaunchService(argv=arguments)
included = IncludeLaunchDescription(source, launch_arguments=given)
service.include_launch_description(LaunchDescription([included]))
raise SystemExit(service.run())
"""
"""What `ros2 launch` does in a terminal."""
ARGUMENTS = """
import sys

from launch import LaunchContext
from launch.launch_description_sources import AnyLaunchDescriptionSource

description = AnyLaunchDescriptionSource(sys.argv[1]).get_launch_description(LaunchContext())
for argument in description.get_launch_arguments():
    print(argument.name, "|", " ".join(argument.description.split()))
"""
STANDS_IN = """#!/usr/bin/env python3
import sys
from contextlib import suppress

import rclpy
from rclpy.executors import ExternalShutdownException
from rosgraph_msgs.msg import Clock

times = []
rclpy.init()
node = rclpy.create_node(sys.argv[0].rpartition("/")[2])
hear = lambda clock: times.append((clock.clock.sec, clock.clock.nanosec))
node.create_subscription(Clock, "/clock", hear, 10)
names = [node.resolve_topic_name(name) for name in ("/clock", "/tf", "robot_description")]
print(*names, node.get_parameter("use_sim_time").value, flush=True)
with suppress(KeyboardInterrupt, ExternalShutdownException):
    rclpy.spin(node)
print("clock:", bool(times), times == sorted(times), flush=True)
"""
"""Prints where its topics are, and at its end whether a clock ran, and always forward."""


@pytest.fixture(scope="module")
def prefixes(tmp_path_factory):
    """The package as colcon installs it, and one with what stands in for the other packages."""
    folder = tmp_path_factory.mktemp("prefixes")
    own, others = folder / "own", folder / "others"
    line = "setup.py --quiet egg_info --egg-base . build --build-base build install"
    line += f" --single-version-externally-managed --record record --prefix {own}"
    subprocess.run(["cp", "-r", PACKAGE, folder / "source"], check=True)
    done = subprocess.run(
        [sys.executable, *line.split()], cwd=folder / "source", capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    for name in ("robot_state_publisher", "rviz2"):
        program = others / "lib" / name / name
        program.parent.mkdir(parents=True)
        program.write_text(STANDS_IN)
        program.chmod(0o755)
        index = others / "share/ament_index/resource_index/packages" / name
        index.parent.mkdir(parents=True, exist_ok=True)
        index.touch()
    return own, others


@pytest.fixture
def start(prefixes, tmp_path):
    """Return a function that launches the file with arguments, in a group of processes."""

    def started(*arguments, code=LAUNCH):
        process = subprocess.Popen(
            [sys.executable, "-c", code, path, *arguments],
            env=env,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        processes.append(process)
        return process

    own, others = prefixes
    path = own / "share/upright_ros/launch/cartpole.launch.py"
    (module,) = own.rglob("upright_ros/__init__.py")
    processes = []
    with ros_domain() as domain:
        before = {name: os.environ.get(name, "") for name in ("AMENT_PREFIX_PATH", "PYTHONPATH")}
        paths = {
            "AMENT_PREFIX_PATH": f"{others}:{own}:{before['AMENT_PREFIX_PATH']}",
            "PYTHONPATH": f"{module.parents[1]}:{before['PYTHONPATH']}",
            "PATH": f"{os.path.dirname(sys.executable)}:{os.environ['PATH']}",
        }
        logs = {"ROS_LOG_DIR": str(tmp_path), "OVERRIDE_LAUNCH_PROCESS_OUTPUT": "both"}
        env = os.environ | domain | paths | logs
        yield started
        for process in processes:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            process.communicate(timeout=LIMIT)


def finish(process):
    out, _ = process.communicate(timeout=LIMIT)
    return process.returncode, out


def read_until(process, words):
    while words not in (line := process.stdout.readline()):
        assert line, f"it has ended without saying {words!r}"


def test_every_parameter_is_an_argument(start):
    status, out = finish(start(code=ARGUMENTS))
    assert status == 0, out
    described = dict(line.split(" | ") for line in out.splitlines())
    nodes = {"simulator": SimulatorSettings, "learner": LearnerSettings}
    parameters = {node: {field.name for field in fields(nodes[node])} for node in nodes}
    own = {"simulator", "namespace", "config", "rviz"}
    assert described.keys() == own | parameters["simulator"] | parameters["learner"]
    for node, names in parameters.items():
        assert all(f"{node}: " in described[name] for name in names)


def test_it_ends_with_the_learner(start):
    """It learns for long enough that the others find the clock, which takes up to 3 s."""
    status, out = finish(start("agent:=adaptive-lqr", "steps:=30000", "rviz:=true"))
    assert status == 0, out
    assert "balanced at trial" in out
    assert out.count("] /clock /tf /robot_description True") == 2
    assert re.findall("clock: .*|Error: .*", out) == ["clock: True True"] * 2
    assert "process has died" not in out


def test_two_namespaces_do_not_meet(start):
    launched = {
        side: start(f"namespace:={side}", "agent:=adaptive-lqr", "steps:=30000")
        for side in ("left", "right")
    }
    for side, process in launched.items():
        status, out = finish(process)
        assert status == 0, out
        assert f"/{side}/clock /{side}/tf /{side}/robot_description True" in out
        assert "clock: True True" in out


def test_a_cart_takes_the_place_of_the_simulator(start, prefixes, tmp_path):
    driver = start(code=(ROOT / "examples/ros2_cart.py").read_text())
    status, out = finish(start("simulator:=false", "agent:=adaptive-lqr", "steps:=100"))
    assert status == 0, out
    assert "simulator" not in out
    assert "/clock /tf /robot_description False" in out
    os.killpg(driver.pid, signal.SIGINT)
    assert finish(driver)[0] == 0


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        ("plant:=jelly", "the simulator has ended with exit status 2"),
        ("agent:=nobody", "the learner has ended with exit status 2"),
        ("simulator:=false patience:=1", "the learner has ended with exit status 2"),
        ("agent:=random-search trials:=1", "the learner has ended without a trial that succeeded"),
        ("simulator:=false plant:=mujoco seed:=3", "plant: given, but only the simulator has"),
        ("start_state:=[0,0,x,0]", "Cannot convert value '[0,0,x,0]'"),
    ],
)
def test_a_failure_is_its_own(arguments, why, start):
    status, out = finish(start(*arguments.split()))
    assert status == 1, out
    assert why in out


def test_ctrl_c_ends_it_cleanly(start):
    process = start("agent:=random-search", "trials:=100000", "steps:=100000000")
    read_until(process, "trial    3")
    os.killpg(process.pid, signal.SIGINT)
    status, out = finish(process)
    assert status == 0, out
    assert out.count("process has finished cleanly") == 3
    assert "died" not in out


def test_ctrl_c_as_it_starts_ends_the_nodes_cleanly(start):
    """`launch` itself may wait for ever then, if a process ends at once (3.7.1, with any)."""
    process = start()
    read_until(process, "[robot_state_publisher-3]: process started")
    time.sleep(0.3)
    os.killpg(process.pid, signal.SIGINT)
    ended = {}
    while len(ended) < 2 and (line := process.stdout.readline()):
        if found := re.search(r"\[(simulator|learner)-\d\]: process has (.*?) \[", line):
            ended[found[1]] = found[2]
    assert ended == {"simulator": "finished cleanly", "learner": "finished cleanly"}
