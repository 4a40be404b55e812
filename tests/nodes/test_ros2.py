"""Real nodes in real processes, in domains of their own on this machine alone."""

import math
import os
import re
import signal
import time

import pytest
from helpers import make_context, make_task
from ros2_helpers import GARBAGE, NODE_MARKS, finish, has_begun, lengths

from upright.commands import run
from upright.core.parameters import State
from upright.core.task import TaskSpec
from upright.errors import UprightError
from upright.plants import PLANTS
from upright.policies.files import load_policy, save_policy
from upright.reports.learning import learn
from upright.studies.case import make_case
from upright.studies.run import make_run
from upright.support.exit_status import BAD_USE, FAILED, INTERRUPTED

pytestmark = NODE_MARKS
STATE = State(0.1, -0.2, 0.03, 0.4)


def make_cart():
    return PLANTS.default("ros2").make(make_context())


# ---- What it is for ------------------------------------------------------------------------------


def test_trials_are_those_of_the_equations(simulator, start):
    """Numbers pass unchanged, so the same seed gives the same trials as without ROS 2."""
    line = "learn reinforce --plant ros2 --steps 1000 --seed 3"
    status, out, told = finish(start(line))
    assert status == 0, told
    _, alone = make_run(make_case("reinforce", steps=1000), 3, 0)
    assert lengths(out) == alone.lengths.tolist()


def test_a_cart_is_a_plant(simulator):
    cores = os.sched_getaffinity(0)
    cart, left = make_cart()
    assert left == make_task()
    assert cart.reset(STATE) == STATE
    first = [cart.step(10.0) for _ in range(3)]
    assert first[-1].x_dot > STATE.x_dot + 0.3
    assert not cart.has_fallen(first[-1])
    assert cart.reset(STATE) == STATE
    assert [cart.step(10.0) for _ in range(3)] == first
    while not cart.has_fallen(state := cart.step(10.0)):
        assert abs(state.theta) <= math.radians(12)
    assert abs(state.theta) > math.radians(12)
    with pytest.raises(UprightError, match=r"force is 10.5; it must be within ±10"):
        cart.step(10.5)
    with pytest.raises(UprightError, match=r"force is nan"):
        cart.step(math.nan)
    cart.close()
    assert os.sched_getaffinity(0) == cores


def test_tables_and_policies_know_the_plant(simulator, tmp_path, capsys):
    """In this process, where capsys makes ROS 2 use its slower executor."""
    line = "learn random-search --plant ros2 --steps 300 --seed 3"
    assert run(line.split()) == 0
    _, alone = make_run(make_case("random-search", steps=300), 3, 0)
    assert lengths(capsys.readouterr().out) == alone.lengths.tolist()
    path = str(tmp_path / "policy.npz")
    line = "learn adaptive-lqr --plant ros2 --noise gaussian-0.1 --steps 500 --save"
    assert run([*line.split(), path]) == 0
    assert run(["play", path, "--plant", "ros2", "--episodes", "2", "--steps", "500"]) == 0
    assert "balanced in 2 of 2 trials" in capsys.readouterr().out
    line = "table --plant ros2 --agents random-search --noises none --runs 2 --steps 100"
    assert run(line.split()) == 0
    assert "random-search (ros2)" in capsys.readouterr().out


def test_carts_may_follow_each_other_in_one_process(simulator):
    """Nothing of the last one is left that would count as another learner."""
    for number in range(5):
        cart, _ = make_cart()
        assert cart.reset(STATE) == STATE, number
        cart.close()


def test_a_learner_learns_where_the_simulator_makes_the_noise(simulate, start, tmp_path):
    simulate("--noise gaussian-0.1 --seed 3")
    path = tmp_path / "policy.json"
    line = f"ros2 learn adaptive-lqr --steps 1000 --trials 20 --save {path}"
    status, out, told = finish(start(line))
    assert status == 0, told
    assert lengths(out)[-1] == 1000
    assert path.exists()


def test_an_agent_goes_on_learning_on_the_cart(simulator, start, tmp_path, capsys):
    """As a plant, with the trials of the equations; as a learner, where the cart draws starts."""
    first, second = str(tmp_path / "first.npz"), str(tmp_path / "second.npz")
    policy, before = learn("q-learning", steps=200, trials=3)
    save_policy(first, policy)
    options = f"--from {first} --steps 1000 --trials 5 --seed 3"
    assert run(f"learn {options} --plant ros2".split()) in (0, FAILED)
    alone = learn(policy, seed=3, steps=1000, trials=5)
    assert lengths(capsys.readouterr().out) == alone.result.lengths.tolist()

    status, out, told = finish(start(f"ros2 learn {options} --save {second}"))
    assert status in (0, FAILED), told
    assert "goes on from first.npz: q-learning" in out
    trials = [stage.trials for stage in load_policy(second).stages]
    assert trials == [before.trials, len(lengths(out))]
    status, out, told = finish(start(f"ros2 learn --policy {second} --greedy --steps 5"))
    assert lengths(out) == [5], told


def test_ros_arguments_reach_the_nodes(simulate, start):
    """Parameters and other names for topics, as ROS users give them."""
    simulate("--ros-args -p seed:=5 -r effort:=/cart/effort")
    line = (
        "ros2 learn random-search --ros-args -p trials:=3 -p steps:=50000 -r effort:=/cart/effort"
    )
    status, out, told = finish(start(line))
    assert status == FAILED, told
    assert len(lengths(out)) == 3


@pytest.mark.timing
def test_a_policy_balances_by_the_wall_clock(simulate, start, tmp_path):
    path = str(tmp_path / "policy.npz")
    assert run(["learn", "adaptive-lqr", "--quiet", "--save", path]) == 0
    simulator = simulate("--no-lock-step")
    began = time.monotonic()
    status, out, told = finish(start(f"ros2 learn --policy {path} --steps 250"))
    assert status == 0, told
    assert time.monotonic() - began > 5
    assert lengths(out) == [250]
    simulator.terminate()
    status, _, told = finish(simulator)
    assert status == 0
    periods, missed = re.search(r"(\d+) periods, (\d+) missed; jitter: p50 \d", told).groups()
    # A step is a period, or several where commands came too late.
    assert abs(int(periods) - int(missed) - 250) <= 5
    assert int(missed) <= 100


def test_the_demonstration_shows_trials(start):
    line = "ros2 demo random-search --noise all-5 --steps 300 --seed 2"
    status, out, told = finish(start(line))
    assert status == 0, told
    assert out.startswith("simulating equations in lock-step, ROS domain")
    assert lengths(out)[-1] == 300


# ---- What goes wrong -----------------------------------------------------------------------------


def test_without_a_cart_there_is_a_clear_error(start, domain):
    status, _, told = finish(start("ros2 learn reinforce --patience 1"))
    assert status == BAD_USE
    assert f"no cart was found within 1 s in ROS domain {domain}: there is no topic" in told


def test_two_carts_are_refused(simulate, start):
    simulate()
    simulate()
    status, _, told = finish(start("ros2 learn random-search"))
    assert status == BAD_USE
    assert "there are 2 carts in ROS domain" in told


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("simulate --plant jelly", "plant is 'jelly'"),
        ("simulate --ros-args -p rate:=0.0", "rate is 0.0; it must be"),
        ("learn nobody", "agent is 'nobody'; it must be one of"),
        ("learn --policy nowhere.npz", "nowhere.npz"),
        ("demo --start-state 1", "unrecognized arguments"),
        ("demo --plant mujoco --plant-set physics_step=1", "physics_step is 1"),
        ("learn --seed 99999999999999999999", "seed is 99999999999999999999; it must be"),
        ("simulate --seed 99999999999999999999", "seed is 99999999999999999999; it must be"),
        ("learn --ros-args -r x", "ROS 2 reports an error: failed to initialize rcl: Couldn't"),
        ("learn --ros-args --params-file nowhere.yaml", "Error opening YAML file"),
        ("simulate --ros-args --no-such", "ROS 2 does not know the arguments ['--no-such']"),
        ("simulate --ros-args -p use_sim_time:=5", "Trying to set parameter 'use_sim_time'"),
        (f"learn --ros-args -r effort:={'a' * 300}", "topic length should not exceed"),
    ],
)
def test_invalid_settings_are_refused(options, message, start):
    status, _, told = finish(start(f"ros2 {options}"))
    assert status == BAD_USE
    assert message in told.splitlines()[-1]  # ROS 2 may log a line of its own
    assert "Traceback" not in told


@pytest.mark.parametrize("number", ["here", "99999"])
def test_a_domain_that_cannot_be_is_refused(number, start, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", number)
    status, _, told = finish(start("ros2 simulate"))
    assert status == BAD_USE
    assert "ROS_DOMAIN_ID is " in told
    assert len(told.splitlines()) == 1


class Newer(TaskSpec):
    """A task as a version of the package has it that knows more noise cases."""

    def __post_init__(self):
        pass


def test_a_simulator_refuses_what_it_cannot_be_set_to(simulator):
    settings = PLANTS.default("ros2")
    with pytest.raises(UprightError, match="the simulator refused: noise is 'magic'"):
        settings.make(make_context()._replace(spec=Newer(noise="magic")))


@pytest.mark.parametrize("forces", [(math.nan,), (1e9,), (-10.01,), (), (1.0, 2.0)])
def test_an_impossible_effort_moves_nothing(forces, simulator, hand):
    hand.reset()
    hand.command(10.0)
    hand.until(lambda: hand.states and hand.states[-1].velocity[0] > 0.1)
    count = len(hand.states)
    hand.command(*forces)
    hand.until(lambda: hand.words and hand.words[-1].startswith("Fault: effort is ["))
    assert len(hand.states) == count
    hand.reset()  # it has recovered
    hand.command(-10.0)
    hand.until(lambda: hand.states and hand.states[-1].velocity[0] < -0.1)


def test_bytes_that_are_no_effort_move_nothing(simulator, hand):
    for raw in GARBAGE.values():
        hand.reset()
        hand.effort.publish(raw)
        hand.until(lambda: hand.words[-1].startswith("Fault: effort brought what is not its"))
    hand.reset()  # it has recovered
    hand.command(10.0)
    hand.until(lambda: hand.states and hand.states[-1].velocity[0] > 0.1)
    assert simulator.poll() is None


def test_parameters_have_descriptions_and_ranges(simulator, hand):
    from rcl_interfaces.srv import DescribeParameters

    names = ["rate", "seed", "noise"]
    answer = hand.call(DescribeParameters, "simulator/describe_parameters", names=names)
    rate, seed, noise = answer.descriptors
    assert (rate.floating_point_range[0].from_value, rate.read_only) == (1.0, True)
    assert (seed.integer_range[0].from_value, seed.read_only) == (0, False)
    assert "disturb forces" in noise.description
    assert hand.set("seed", -1).reason
    assert hand.set("seed", 5).successful


def test_both_sides_report_their_health(simulator, start, hand):
    from diagnostic_msgs.msg import DiagnosticArray

    reports = {}
    hand.node.create_subscription(
        DiagnosticArray,
        "/diagnostics",
        lambda report: reports.update({each.name: each for each in report.status}),
        10,
    )
    start("ros2 learn random-search --trials 100000 --steps 100000000")
    names = "/simulator: control periods", "/learner: control periods"
    hand.until(lambda: reports.keys() >= {*names})
    values = {each.key: each.value for name in names for each in reports[name].values}
    assert float(values["rate of measurements [1/s]"]) == 50
    assert values["missed control periods"] == "0"
    assert float(values["control periods per second"]) >= 0


def test_a_simulator_that_cannot_keep_up_still_answers(simulate, hand_of_simulator):
    simulate("--no-lock-step --rate 10000 --real-time-factor 1000")
    hand = hand_of_simulator()
    assert hand.set("seed", 5).successful


def test_impossible_parameters_are_refused_and_nothing_changes(simulate, hand_of_simulator):
    simulator = simulate("--plant mujoco")
    hand = hand_of_simulator()
    for value in (5, 1.5, True, ["a"], [1.0], "no_such=1", "static_friction=1"):
        assert not hand.set("parameters", value).successful
    assert not hand.set("start_state", [0.0, 0.0, 0.0, 1e308]).successful
    assert hand.set("parameters", "half_length=0.4").successful
    hand.reset()
    assert simulator.poll() is None


def test_a_parameter_of_no_known_type_is_refused(simulator, hand):
    """Both services answer it; in rclpy it raises an error, which would end the node."""
    from rcl_interfaces.msg import Parameter, ParameterValue
    from rcl_interfaces.srv import SetParameters, SetParametersAtomically

    request = [Parameter(name="seed", value=ParameterValue(type=77))]
    answer = hand.call(SetParameters, "simulator/set_parameters", parameters=request)
    assert not answer.results[0].successful
    name = "simulator/set_parameters_atomically"
    answer = hand.call(SetParametersAtomically, name, parameters=request)
    assert answer.result.reason == "a parameter is of a type that does not exist"
    hand.reset()
    assert simulator.poll() is None


def test_a_fault_ends_the_learner(simulator, start, hand):
    """As an emergency stop does, which another node may report."""
    learner = start("ros2 learn random-search --trials 100000 --steps 100000000")
    assert has_begun(learner)
    hand.report("Fault: the emergency stop is pressed")
    status, _, told = finish(learner)
    assert status == BAD_USE
    assert "the cart reports a Fault: the emergency stop is pressed" in told


def test_a_killed_simulator_ends_the_learner(simulator, start):
    learner = start("ros2 learn random-search")
    assert has_begun(learner)
    simulator.kill()
    status, _, told = finish(learner)
    assert status == BAD_USE
    assert re.search(
        "no joint_states arrived for 0.5 s; the cart was stopped|is gone|did not answer", told
    )


def test_a_gap_in_the_messages_ends_the_learner(simulator, start):
    learner = start("ros2 learn random-search --watchdog 0.3")
    assert has_begun(learner)
    simulator.send_signal(signal.SIGSTOP)
    status, _, told = finish(learner)
    simulator.send_signal(signal.SIGCONT)
    assert status == BAD_USE
    assert re.search(
        "no joint_states arrived for 0.3 s; the cart was stopped|is gone|did not answer", told
    )
    # Nodes that knew it may have forgotten it, as Fast DDS does after 20 s; new ones find it.
    status, _, told = finish(start("ros2 learn random-search --steps 5"))
    assert status == 0, told


@pytest.mark.timing
def test_a_killed_learner_leaves_a_cart_at_rest(simulate, start, hand_of_simulator, tmp_path):
    """By the wall clock, as a real cart: without commands the force is 0."""
    path = str(tmp_path / "policy.npz")
    assert run(["learn", "adaptive-lqr", "--quiet", "--save", path]) == 0
    simulate("--no-lock-step")
    hand = hand_of_simulator()
    learner = start(f"ros2 learn --policy {path}")
    hand.until(lambda: len(hand.states) > 50 and abs(hand.states[-1].effort[0]) == 10)
    learner.kill()
    hand.until(lambda: hand.words and hand.words[-1] == "Done")
    seen = len(hand.states)
    hand.until(lambda: len(hand.states) >= seen + 4)  # past the fall's own measurement
    pushes = [abs(state.effort[0]) for state in hand.states]
    assert pushes[-2:] == [0, 0]
    assert 10 in pushes
    finish(learner)
    status, _, told = finish(start(f"ros2 learn --policy {path} --steps 50"))
    assert status == 0, told


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_both_sides_stop_on_a_signal(number, simulator, start):
    learner = start("ros2 learn random-search --trials 100000 --steps 100000000")
    assert has_begun(learner)
    learner.send_signal(number)
    status, _, told = finish(learner)
    assert (status, told) == (INTERRUPTED, "upright: stopped\n")
    simulator.send_signal(number)
    assert finish(simulator)[0] == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_the_demonstration_leaves_nothing_behind(number, start):
    """Its simulator ends with it, however it ends (see `start`)."""
    demo = start("ros2 demo random-search --trials 100000 --steps 100000000")
    assert demo.stdout.readline().startswith("simulating")
    assert has_begun(demo)
    demo.send_signal(number)
    status, _, _ = finish(demo)
    assert status == (INTERRUPTED if number != signal.SIGKILL else -signal.SIGKILL)
