"""Carts that are not like the simulator, on real nodes in real processes."""

import json
import re
import sys
from pathlib import Path

import pytest
from ros2_helpers import NODE_MARKS, finish, has_begun, lengths

from upright.commands import run
from upright.policies.files import load_policy
from upright.support.exit_status import BAD_USE, FAILED, INTERRUPTED

pytestmark = [*NODE_MARKS, pytest.mark.usefixtures("domain")]
CART = [sys.executable, str(Path(__file__).with_name("quirky_cart.py"))]


@pytest.fixture
def cart(start):
    """Return a function that starts a cart with these quirks, and waits until it is there."""

    def started(**quirks):
        process = start("", [*CART, json.dumps(quirks)])
        assert process.stdout.readline() == "there\n", process.stderr.read()
        return process

    return started


@pytest.fixture(scope="module")
def policy(tmp_path_factory):
    """Path of a policy that balances the usual cart."""
    path = str(tmp_path_factory.mktemp("policy") / "policy.npz")
    assert run(["learn", "adaptive-lqr", "--quiet", "--save", path]) == 0
    return path


@pytest.fixture
def learn(start, policy):
    """Return a function that balances a cart with the policy; what came of it."""

    def learn_with(options="", steps=100):
        return finish(start(f"ros2 learn --policy {policy} --trials 10 --steps {steps} {options}"))

    return learn_with


def clock(out):
    """Return how long the last trial lasted, and how often the cart measured [s]."""
    found = re.search(r"lasted ([\d.,]+) s, with a measurement every ([\d.]+) ms", out)
    return float(found[1].replace(",", "")), float(found[2]) / 1e3


# ---- Time ----------------------------------------------------------------------------------------


@pytest.mark.timing
@pytest.mark.parametrize("rate", [50, 250, 500])
def test_a_trial_is_measured_in_time_however_often_the_cart_measures(rate, cart, learn):
    cart(rate=rate)
    status, out, told = learn()
    assert status == 0, told
    assert lengths(out)[-1] == 100
    lasted, interval = clock(out)
    assert lasted == pytest.approx(2.0, abs=0.1)
    assert interval == pytest.approx(1 / rate, rel=0.2)


@pytest.mark.timing
@pytest.mark.parametrize("rate", [20, 70])
def test_a_rate_that_does_not_fit_is_refused(rate, cart, learn):
    process = cart(rate=rate)
    status, _, told = learn()
    assert status == BAD_USE
    assert re.search(r"the cart measures every [\d.]+ ms, which does not fit a control pe", told)
    assert "parameter time_step=0.0" in told
    process.terminate()
    assert not set(finish(process)[1].split()) & {"10", "-10"}  # it was not pushed


def test_a_simulator_in_lock_step_may_have_shorter_periods(simulate, learn):
    simulate("--rate 200")
    status, out, told = learn()
    assert status == 0, told
    assert clock(out) == (2.0, 0.005)


def test_a_store_does_not_mix_rates(simulate, capsys):
    """The time step is a part of the task, so that of the simulator must be the same."""
    simulate("--rate 200")
    line = "learn random-search --plant ros2 --steps 100 --seed 3"
    assert run(line.split()) == BAD_USE
    assert "the simulator's rate is 200 periods per second; the task" in capsys.readouterr().err
    assert run([*line.split(), "--parameter", "time_step=0.005"]) == 0


@pytest.mark.timing
@pytest.mark.parametrize("jump", [3600.0, -3600.0])
def test_a_clock_that_is_set_misses_no_periods(jump, cart, learn):
    cart(jump=jump)
    status, out, told = learn()
    assert status == 0, told
    assert lengths(out)[-1] == 100
    assert clock(out)[0] == pytest.approx(2.0, abs=0.2)
    if "passed without" in out:  # on a busy machine
        assert int(re.search(r"([\d,]+) control periods? passed", out)[1]) < 20
    found = re.search(r"the clock was set 1 time, by up to ([-\d,.]+) s", out)
    assert float(found[1].replace(",", "")) == pytest.approx(jump, abs=1)


# ---- Measurements that cannot be used ------------------------------------------------------------


@pytest.mark.parametrize("broken", [float("nan"), -1e300])
def test_a_measurement_that_is_none_ends_the_run(broken, cart, learn):
    """With a status or without one."""
    for status in ("", "RELIABLE"):
        process = cart(broken_after=1.0, broken=broken, status=status)
        status, out, told = learn(steps=1000)
        assert status == BAD_USE
        assert f"a Fault: joint_states holds ({broken}, " in told
        assert "which no sensor can measure" in told
        assert not lengths(out)  # it was no fall
        process.terminate()
        assert finish(process)[1].split()[-1] in ("0", "-0")


def test_bytes_that_are_no_measurement_end_the_run(cart, learn):
    cart(garbage_after=200)
    status, _, told = learn(steps=100_000)
    assert status == BAD_USE
    assert "a Fault: joint_states brought what is not its kind of message: it has 44 bytes" in told
    assert len(told.splitlines()) == 1


@pytest.mark.parametrize(
    ("quirks", "message"),
    [
        (
            {"names": ["slider_to_cart", "pole_joint"]},
            r"arrived that can be used: \d+ came of the joints 'slider_to_cart', 'pole_joint', "
            r"where 'slider' and 'hinge' are wanted \(the parameters slider and hinge",
        ),
        (
            {"stamped": False},
            r"that can be used: \d+ came with a time stamp that is not later than the one before, "
            r"the last of 0 s",
        ),
        (
            {"velocities": False},
            "joint_states have no velocity of joint 'hinge': there are 2 joints, 2 positions and 0 "
            "velocities; velocities=differenced takes them from positions",
        ),
        (
            {"kept_commands": True},
            "there is no topic effort; on /effort, /cart asks for reliable and transient local, "
            "where the learner publishes reliable and volatile",
        ),
    ],
    ids=["names", "stamps", "velocities", "durability"],
)
def test_what_cannot_be_used_is_named(quirks, message, cart, learn):
    cart(**quirks)
    status, _, told = learn("--patience 4")
    assert status == BAD_USE
    assert re.search(message, told.replace("\n", "")), told
    assert "Traceback" not in told


def test_a_status_is_heard_whatever_its_reliability(cart, learn):
    cart(status="BEST_EFFORT")
    status, out, told = learn(steps=50)
    assert (status, lengths(out)) == (0, [50]), told


def test_trials_of_one_step_are_a_wrong_sign_zero_or_limit(cart, learn):
    cart(angle=(1.0, 1.0))
    status, out, told = learn()
    assert status == BAD_USE, told
    assert len(re.findall(r"^trial +\d +1 step ", out, re.MULTILINE)) == 3
    assert "3 trials in a row ended with their first step, the last at x = " in told


# ---- Other carts ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("quirks", "options"),
    [
        ({"angle": (1.0, 62.83185307179586)}, ""),
        ({"angle": (-57.29577951308232, 90.0)}, "--angle-zero 90 --angle-gain -0.0174532925199433"),
        ({"position": (-100.0, 7.0)}, "--position-zero 7 --position-gain -0.01"),
        ({"names": ["rail", "pivot"]}, "--slider rail --hinge pivot"),
        ({"command_gain": -0.5}, "--command-gain -2"),
        ({"velocities": False}, "--velocities differenced"),
        ({"velocities": False, "rate": 200}, "--velocities differenced --smoothing 0.004"),
    ],
    ids=["turns", "degrees", "centimetres", "names", "volts", "differences", "smoothed"],
)
def test_settings_fit_the_learner_to_a_cart(quirks, options, cart, learn):
    cart(**quirks)
    status, out, told = learn(options)
    assert status == 0, told
    assert lengths(out)[-1] == 100


def test_an_agent_may_learn_without_velocities(cart, start, tmp_path):
    """The policy remembers that it was."""
    cart(velocities=False)
    path = str(tmp_path / "policy.npz")
    line = f"ros2 learn adaptive-lqr --velocities hidden --steps 50 --trials 20 --save {path}"
    status, out, told = finish(start(line))
    assert status in (0, FAILED), told
    assert lengths(out)
    assert load_policy(path).learned_on.condition == "no-velocities"


def test_force_period_and_limits_are_those_of_the_cart(cart, start, tmp_path):
    """A weaker cart, which commands beyond its force would end; and a slower policy."""
    process = cart(force=6.0, rate=100)
    path = str(tmp_path / "policy.npz")
    parameters = "force=6", "time_step=0.04", "position_limit=0.05", "angle_limit=0.1"
    options = " ".join(f"--parameter {each}" for each in parameters)
    line = f"ros2 learn random-search --steps 300 --trials 5 --save {path} {options}"
    status, out, told = finish(start(line))
    assert status == FAILED, told
    assert clock(out)[1] == pytest.approx(0.01, rel=0.1)
    process.terminate()
    assert {"6", "-6"} <= set(finish(process)[1].split()) <= {"6", "-6", "0", "-0"}
    learned = load_policy(path).learned_on.parameters
    assert (learned.force, learned.time_step, learned.position_limit) == (6.0, 0.04, 0.05)


def test_a_reset_may_take_a_person_longer_than_the_patience(cart, learn):
    cart(reset_takes=6.0)
    status, out, told = learn("--patience 2", steps=20)
    assert status == 0, told
    assert "waiting for the answer of /reset (Ctrl-C stops)" in out
    assert "the clock was set" not in out  # there were no measurements meanwhile
    status, _, told = learn("--reset-patience 0.5")
    assert status == BAD_USE
    assert "the service /reset did not answer within 0.5 s" in told


def test_a_person_starts_a_trial_by_holding_the_pole_still(cart, learn):
    """Here only once the learner has brought the cart to the middle."""
    cart(by_person=True)
    status, out, told = learn("--start-by person --homing-force 5 --still 0.5", steps=50)
    assert status == 0, told
    assert "raise the pole, and hold it still for 0.5 s" in out
    assert lengths(out)[-1] == 50


def test_a_cart_that_a_person_starts_may_say_that_it_is_done(cart, learn):
    cart(by_person=True, status="RELIABLE", word="Balancing", done_after=1.0)
    status, out, told = learn("--start-by person --homing-force 5 --still 0.5 --trials 1")
    assert status == FAILED, told
    assert 30 < lengths(out)[0] < 80


def test_it_is_said_why_a_trial_of_a_person_does_not_begin(cart, start, policy):
    cart(by_person=True)  # without homing, the pole is never raised
    learner = start(f"ros2 learn --policy {policy} --start-by person")
    assert learner.stdout.readline().startswith("raise the pole")
    assert re.search(
        r"still waiting: x = 0.5 m, θ = -?180°, which must be within ±1.2 m and ±6°; they moved "
        r"by 0.000 m and 0.00°, and may by 0.02 m and 1.15°",
        learner.stdout.readline(),
    )
    learner.terminate()
    assert finish(learner)[0] == INTERRUPTED


@pytest.mark.parametrize("option", ["--position-gain -1", "--command-gain -1"])
def test_a_cart_that_moves_away_from_the_middle_is_stopped(option, cart, learn):
    process = cart(by_person=True)
    status, out, told = learn(f"--start-by person --homing-force 5 {option}")
    assert status == BAD_USE, told
    assert "the cart moved away from the middle, from 0.5 m to 0.6" in told
    assert "raise the pole" not in out
    process.terminate()
    assert finish(process)[1].split()[-1] in ("0", "-0")


def test_a_reset_without_a_status_is_not_taken_for_one_without_measurements(cart, learn):
    cart(status="RELIABLE", silent_reset=True)
    status, _, told = learn()
    assert status == BAD_USE
    assert "the cart was reset, but it did not publish the status 'Balancing' then" in told


def test_a_reset_may_mend_a_fault_of_before(cart, learn):
    cart(status="RELIABLE", word="Fault: the emergency stop was pressed")
    status, out, told = learn(steps=50)
    assert (status, lengths(out)) == (0, [50]), told


def test_a_fault_that_a_reset_does_not_mend_is_named(cart, learn):
    cart(status="RELIABLE", word="Fault: no current", silent_reset=True)
    status, _, told = learn(steps=50)
    assert status == BAD_USE
    assert "the cart was reset, and still reports a Fault: no current" in told


# ---- One learner, one cart -----------------------------------------------------------------------


def test_a_cart_may_have_two_publishers(cart, learn):
    cart(publishers=2)
    status, out, told = learn(steps=50)
    assert (status, lengths(out)) == (0, [50]), told


def test_two_carts_without_a_status_are_refused(cart, learn):
    carts = [cart(name="one"), cart(name="other")]
    status, _, told = learn()
    assert status == BAD_USE
    assert "there are 2 carts in ROS domain" in told
    assert "/one and /other have the topic /joint_states" in told
    for each in carts:
        each.terminate()
        assert not set(finish(each)[1].split()) & {"10", "-10"}


@pytest.mark.parametrize("states", [True, False], ids=["cart", "motor"])
def test_a_second_cart_stops_the_first(states, cart, start, policy):
    """Also one that publishes nothing, but would move."""
    first = cart(name="one")
    learner = start(f"ros2 learn --policy {policy}")
    for _ in range(50):  # it is being pushed
        first.stdout.readline()
    second = cart(name="other", states=states)
    status, _, told = finish(learner)
    assert status == BAD_USE
    assert "there are 2 carts in ROS domain" in told
    topic = "/joint_states" if states else "/effort"
    assert f"/one and /other have the topic {topic}" in told
    for each in (first, second):
        each.terminate()
    assert finish(first)[1].split()[-1] in ("0", "-0")


def test_listeners_are_no_motors(cart, learn):
    cart()
    cart(name="rosbag2_recorder", states=False)
    cart(name="plotter", states=False)
    status, out, told = learn("--listeners rosbag2_recorder,plotter", steps=50)
    assert (status, lengths(out)) == (0, [50]), told


def test_a_second_learner_is_refused(simulator, start):
    line = "ros2 learn random-search --trials 100000 --steps 100000000"
    first = start(line)
    assert has_begun(first)
    status, _, told = finish(start(line))
    assert status == BAD_USE, told
    assert "/learner also commands this cart, on /effort; a cart must have one" in told


@pytest.mark.timing
def test_a_listener_that_appears_leaves_no_gap_in_the_commands(cart, start, policy, tmp_path):
    pushed = cart()
    learner = start(f"ros2 learn --policy {policy} --trials 1 --steps 300")
    for _ in range(20):  # it is being pushed
        pushed.stdout.readline()
    start(f"ros2 record {tmp_path / 'run.csv'}")
    status, out, told = finish(learner)
    assert (status, lengths(out)) == (0, [300]), told
    assert "passed without a new command" not in out


def test_a_learner_may_follow_another_at_once(cart, learn):
    """Whatever waits in the first one as it ends, it does not stay on the topics."""
    cart(rate=500)
    for _ in range(3):
        status, out, told = learn(steps=20)
        assert (status, lengths(out)) == (0, [20]), told


def test_a_second_learner_stops_the_first(simulator, start, hand):
    """One that does not ask first. `hand` commanded nothing when the first began."""
    first = start("ros2 learn random-search --trials 100000 --steps 100000000")
    assert has_begun(first)
    hand.node.create_publisher(hand.message, "effort", 10)
    status, _, told = finish(first)
    assert status == BAD_USE
    assert "/hand also commands this cart, on /effort; a cart must have one learner" in told


def test_a_cart_that_is_started_again_is_found_again(simulate, start):
    simulator = simulate()
    # An agent of which the next trials soon end.
    learner = start("ros2 learn q-learning --trials 100000 --steps 100000000 --watchdog 30")
    assert has_begun(learner)
    simulator.terminate()
    finish(simulator)
    simulate()
    for line in learner.stdout:
        if "the cart was started again, which ends the trial" in line:
            break
    assert learner.stdout.readline().startswith("trial")
    assert learner.stdout.readline().startswith("trial")
    assert learner.poll() is None
    learner.terminate()
    finish(learner)


def test_a_simulator_that_is_started_again_ends_a_measured_run(simulate, start):
    """It no longer has the noise and the random numbers of the run."""
    simulator = simulate()
    line = "learn random-search --plant ros2 --plant-set watchdog=30 --steps 100000000"
    learner = start(line)
    assert has_begun(learner)
    simulator.terminate()
    finish(simulator)
    simulate()
    status, _, told = finish(learner)
    assert status == BAD_USE
    assert re.search("the simulator was started again during the run|is gone|not answer", told)
