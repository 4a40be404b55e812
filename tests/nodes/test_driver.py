"""The example driver of a real cart: it balances, and it is safe whatever commands arrive."""

import math
import re
import signal
import sys
import time

import pytest
from helpers import ROOT
from ros2_helpers import GARBAGE, NODE_MARKS, finish, lengths

from upright.support.exit_status import BAD_USE, FAILED

pytestmark = NODE_MARKS
EXAMPLE = ROOT / "examples/ros2_cart.py"
WATCHED = f"""
import importlib.util
import os

spec = importlib.util.spec_from_file_location("driver", {str(EXAMPLE)!r})
driver = importlib.util.module_from_spec(spec)
spec.loader.exec_module(driver)


class Hardware(driver.Hardware):
    def push(self, force):
        print(force, flush=True)
        super().push(force)

    def read(self):
        if os.path.exists(os.environ["ROS_LOG_DIR"] + "/encoder fails"):
            raise OSError("the encoder does not answer")
        if os.path.exists(os.environ["ROS_LOG_DIR"] + "/nobody is there"):
            self.idle = 0
        return super().read()


driver.Hardware, driver.PATIENCE = Hardware, 1.0
driver.main()
"""
"""The driver with a motor that prints every force, and with hardware that can fail."""


@pytest.fixture
def driver(start, tmp_path):
    path = tmp_path / "watched.py"
    path.write_text(WATCHED)
    process = start(str(path), [sys.executable])
    assert process.stdout.readline() == "0.0\n"
    return process


@pytest.fixture
def balancing(driver, hand):
    """The driver during a trial, with the motor on."""
    hand.reset()
    hand.command(10.0)
    hand.until(lambda: hand.states and hand.states[-1].velocity[0] > 0.1)
    return driver


def forces(driver):
    """End a driver, and return the forces of the motor, and what it logged."""
    driver.send_signal(signal.SIGINT)
    status, out, told = finish(driver)
    assert status == 0, told
    return [float(line) for line in out.split()], told


@pytest.mark.timing
@pytest.mark.parametrize("options", ["", "--ros-args -r status:=unheard"], ids=["", "no status"])
def test_a_learner_balances_it(options, start):
    """Also without a status, where the learner decides by itself whether the pole has fallen."""
    start(f"{EXAMPLE} {options}", [sys.executable])
    status, out, told = finish(start("ros2 learn adaptive-lqr --steps 250 --trials 20"))
    assert status == 0, told
    assert lengths(out)[-1] == 250


def test_trials_end_and_begin_again(start):
    driver = start(str(EXAMPLE), [sys.executable])
    status, out, told = finish(start("ros2 learn random-search --trials 3"))
    assert status == FAILED, told
    assert len(lengths(out)) == 3
    driver.send_signal(signal.SIGINT)
    status, _, told = finish(driver)
    said = re.findall(r"\[cart\]: (Balancing|Done|Fault)", told)
    assert said == ["Done", *["Balancing", "Done"] * 3, "Fault"]


def test_measurements_bear_the_time_at_which_they_were_made(driver, hand):
    hand.until(lambda: len(hand.states) >= 25)
    now = hand.node.get_clock().now().nanoseconds * 1e-9
    stamps = [state.header.stamp for state in hand.states]
    times = [stamp.sec + stamp.nanosec * 1e-9 for stamp in stamps]
    assert times == sorted(set(times))
    assert 0 < now - times[-1] < 1


@pytest.mark.parametrize(
    "command", [(), (1.0, 2.0), (math.nan,), (math.inf,), (-math.inf,), (1000.0,), (-10.001,)]
)
def test_an_impossible_effort_stops_the_motor(command, balancing, hand):
    hand.command(*command)
    hand.until(lambda: hand.words[-1].startswith("Fault: effort is ["))
    hand.command(10.0)  # it waits for the next reset
    hand.reset()
    hand.command(-10.0)
    hand.until(lambda: hand.states[-1].velocity[0] < -0.1)
    pushed, told = forces(balancing)
    assert set(pushed) <= {10.0, 0.0, -10.0}
    last = len(pushed) - pushed[::-1].index(10.0)
    assert pushed[last] == 0.0
    assert "Fault: effort is [" in told


def test_an_effort_beyond_the_limit_by_rounding_is_obeyed(driver, hand):
    hand.reset()
    hand.command(10.000000000000002)
    hand.until(lambda: hand.states and hand.states[-1].velocity[0] > 0.1)
    assert max(forces(driver)[0]) == 10.0


@pytest.mark.parametrize("raw", GARBAGE.values(), ids=GARBAGE)
def test_garbage_does_not_end_it(raw, balancing, hand):
    hand.effort.publish(raw)
    time.sleep(0.5)
    assert balancing.poll() is None
    hand.reset()
    hand.command(-10.0)
    hand.until(lambda: hand.states[-1].velocity[0] < -0.1)
    pushed, _ = forces(balancing)
    assert set(pushed) == {10.0, 0.0, -10.0}


def test_silence_stops_the_motor(balancing, hand):
    count = len(hand.states)
    hand.until(lambda: len(hand.states) > count + 15)
    speeds = [state.velocity[0] for state in hand.states]
    assert max(speeds) < 10 * 0.3, "it was pushed for longer than 0.1 s, and two periods"
    hand.until(lambda: hand.words[-1] == "Done")  # without a push the pole falls
    pushed, told = forces(balancing)
    first = pushed.index(10.0)
    assert pushed[first + 1] == 0.0
    assert "no effort arrived for 0.1 s; the motor has stopped" in told


def test_a_killed_learner_leaves_it_at_rest(driver, start, hand):
    learner = start("ros2 learn random-search --trials 1000")
    hand.until(lambda: hand.states and abs(hand.states[-1].velocity[0]) > 0.1)
    learner.kill()
    finish(learner)
    hand.until(lambda: hand.words[-1] == "Done")
    pushed, _ = forces(driver)
    assert pushed[-1] == 0.0
    assert {abs(force) for force in pushed} == {0.0, 10.0}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_the_motor_and_the_learner(number, driver, start, hand):
    learner = start("ros2 learn adaptive-lqr")
    hand.until(lambda: hand.states and abs(hand.states[-1].velocity[0]) > 0.1)
    driver.send_signal(number)
    status, out, told = finish(driver)
    assert status == 0, told
    assert out.split()[-1] == "0.0"
    hand.until(lambda: hand.words[-1] == "Fault: the driver has ended")
    status, _, told = finish(learner)
    assert status == BAD_USE
    assert "Fault: the driver has ended" in told


def test_an_error_of_its_own_stops_the_motor(balancing, hand, tmp_path):
    (tmp_path / "encoder fails").touch()
    status, out, told = finish(balancing)
    assert status == 1
    assert out.split()[-1] == "0.0"
    assert told.rstrip().endswith("OSError: the encoder does not answer")
    hand.until(lambda: hand.words[-1] == "Fault: the driver has ended")


def test_a_reset_is_refused_while_the_pole_is_down(balancing, hand, tmp_path):
    (tmp_path / "nobody is there").touch()
    hand.until(lambda: hand.words[-1] == "Done")
    answer = hand.reset_service.call_async(hand.trigger())
    hand.until(answer.done)
    assert not answer.result().success
    assert answer.result().message == "the pole was not up within 1 s"
    hand.command(10.0)
    time.sleep(0.2)
    assert hand.words[-1] == "Done"
    (tmp_path / "nobody is there").unlink()
    hand.reset()
    assert forces(balancing)[0].count(10.0) == 1
