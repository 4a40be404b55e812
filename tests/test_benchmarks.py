import importlib.util
import os
import shutil
import subprocess
import sys

import pytest
from helpers import ROOT, ros_domain

pytestmark = pytest.mark.slow
BENCHMARKS = ROOT / "benchmarks"


def measured(script, *options):
    """Return what a script prints."""
    command = [sys.executable, BENCHMARKS / script, *options]
    with ros_domain() as own:
        result = subprocess.run(
            command, env=os.environ | own, capture_output=True, text=True, timeout=300
        )
    assert result.returncode == 0, result.stderr
    return result.stdout


@pytest.mark.skipif(not shutil.which("gcc"), reason="gcc is not installed: C is not compared")
@pytest.mark.skipif(not importlib.util.find_spec("gymnasium"), reason="gymnasium is not installed")
def test_c_reaches_the_same_states_to_the_last_bit():
    """The script refuses to time two programs that do not compute the same."""
    found = measured("speed.py", "--scale", "0.001", "--repetitions", "1")
    lines = [line for line in found.splitlines() if line.startswith("| ")]
    assert len(lines) == 11
    for name in ("reinforce", "q-learning", "random-search", "Gymnasium", "NumPy"):
        assert any(name in line for line in lines)


@pytest.mark.skipif(not shutil.which("gcc"), reason="gcc is not installed: C is not compared")
def test_c_observes_what_the_vector_environment_observes():
    """The script refuses to time two programs that do not compute the same."""
    found = measured("environments.py", "--count", "600", "--rounds", "1")
    for name in ("upright", "C", "upright, gaussian-0.2", "Gymnasium"):
        assert f"\n| {name} | " in found
    assert "Python takes" in found


@pytest.mark.skipif(not importlib.util.find_spec("rclpy"), reason="ROS 2 is not installed")
def test_learning_over_ros_2_is_measured():
    """The script refuses to time trials that are not those of the equations."""
    found = measured("ros2.py", "--steps", "300", "--rounds", "1", "--periods", "60")
    for text in (
        "| equations | ",
        "| mujoco | ",
        "| total | ",
        "In real time, the pole ",  # on a busy machine it may fall
    ):
        assert text in found


@pytest.mark.gazebo
def test_learning_in_gazebo_is_measured():
    found = measured("gazebo.py", "--steps", "200", "--rounds", "1")
    for text in (
        "| DART, 1 ms | quiet | ",
        "| ODE, 1 ms | ",
        "1 ms, over ROS 2 | every core busy | ",
        "physics steps take",
    ):
        assert text in found


@pytest.mark.gazebo
def test_what_was_learned_on_each_plant_plays_on_every_other():
    """One agent, because each trial on Gazebo starts a server of its own."""
    found = measured("transfer.py", "--steps", "100", "--runs", "1", "--agent", "adaptive-lqr")
    for plant in ("equations", "MuJoCo", "Gazebo"):
        assert f"| adaptive-lqr | {plant} | 1 of 1 [21, 100] % | 1 of 1 [21, 100] % | 1" in found
    assert "1 runs on each plant; 0 runs failed" in found


def test_the_cost_of_every_kind_of_disturbance_is_measured():
    found = measured("disturbances.py", "--steps", "2000", "--repetitions", "1")
    assert "\n| `nominal` | " in found
    assert "\n| `delay=1,lag=0.02,gust=1,encoder=4096,dropped=0.01` | " in found


@pytest.mark.skipif(not importlib.util.find_spec("distributed"), reason="dask is not installed")
def test_the_cost_of_a_cluster_is_measured():
    """The script refuses to time two studies that do not give the same."""
    found = measured("scale.py", "--runs", "4", "--rounds", "1", "--pieces", "20")
    for text in ("| 1 | ", "A piece of work costs ", "| 1,000 | 10 | "):
        assert text in found
