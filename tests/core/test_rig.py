"""What each term of a condition does, by hand; and that both loops do the same."""

import math
from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from helpers import (
    GOOD_WEIGHTS,
    SIZES,
    LinearAgent,
    RecordingPlant,
    arrays,
    make_context,
    make_task,
    task_texts,
)
from hypothesis import given, settings

from upright.agents import AGENTS
from upright.core.cartpole import step
from upright.core.conditions import CONDITION_TERMS, CONDITIONS
from upright.core.loops import compiled_run
from upright.core.parameters import Parameters, State
from upright.core.task import TaskSpec
from upright.core.trials import run, trial
from upright.errors import UprightError
from upright.plants.equations import ChangingEquations, EquationsSettings, equations
from upright.studies.case import make_case
from upright.studies.run import make_run_task

AGENT = AGENTS.default("random-search")


class Scripted:
    """An agent that pushes as it is told, and remembers what it measures."""

    def __init__(self, pushes):
        self.pushes, self.seen = iter(pushes), []

    def begin_trial(self, rng): ...

    def act(self, observation, rng):
        if not self.seen:
            self.seen.append(observation)
        return next(self.pushes)

    def learn(self, before, action, after, fallen):
        self.seen.append(after)

    def end_trial(self, fallen): ...


class Still:
    """A plant that stays as it is, or moves through given states; it records forces."""

    def __init__(self, *states):
        self.states, self.forces = iter(states), []
        self.state = State(0.0, 0.0, 0.0, 0.0)

    def reset(self, state):
        return self.state

    def step(self, force):
        self.forces.append(force)
        self.state = next(self.states, self.state)
        return self.state

    def has_fallen(self, state):
        return False


def forces(condition, pushes, noise="none", seed=1):
    """Return the forces that act on a cart under these pushes."""
    plant = Still()
    task = make_task(noise, condition=condition, steps=len(pushes))
    trial(Scripted(pushes), plant, task, np.random.default_rng(seed))
    return np.array(plant.forces)


def measured(condition, *states, noise="none", seed=1):
    """Return what an agent measures of these states, and of rest before them."""
    agent = Scripted([True] * len(states))
    task = make_task(noise, condition=condition, steps=len(states))
    trial(agent, Still(*states), task, np.random.default_rng(seed))
    return agent.seen


def moving(count):
    return [State(0.01 * k, 0.5, 0.002 * k, 0.1) for k in range(1, count + 1)]


# ------------------------------------------------------------------------------ motor


def test_pushes_arrive_late():
    assert forces("delay=3", [True, False, True, True, False]).tolist() == [0, 0, 0, 10, -10]


def test_a_push_to_the_left_has_a_force_of_its_own():
    assert forces("left-force=5", [True, False]).tolist() == [10, -5]
    assert forces("left-force=0", [True, False]).tolist() == [10, 0]


def test_a_motor_lags():
    part = 1 - math.exp(-0.02 / 0.05)
    expected, force = [], 0.0
    for push in (10, 10, -10):
        force += part * (push - force)
        expected.append(force)
    assert forces("lag=0.05", [True, True, False]) == pytest.approx(expected, rel=1e-14)
    assert forces("lag=1e-6", [True, False]).tolist() == [10, -10]


def test_a_dead_zone_and_saturation():
    assert forces("dead-zone=1.5", [True, False]).tolist() == [8.5, -8.5]
    assert forces("dead-zone=20", [True, False]).tolist() == [0, 0]
    assert forces("saturation=8", [True, False]).tolist() == [8, -8]
    assert forces("dead-zone=1,saturation=9.5", [True, False]).tolist() == [9, -9]


def test_wind_is_added_after_the_motor():
    assert forces("wind=-2,saturation=8", [True, False]).tolist() == [6, -10]
    noisy = forces("wind=-2", [True] * 500, noise="actuator-10")
    assert np.abs((noisy + 2) / 10 - 1).max() <= 0.1


def test_gusts_last_and_come_as_often_as_they_should():
    gusts = forces("gust=4,gust-every=1,gust-for=0.1", [True] * 40_000) - 10
    assert set(gusts.tolist()) == {-4, 0, 4}
    edges = np.flatnonzero(np.diff(np.concatenate([[0], gusts != 0, [0]]).astype(int)))
    durations = Counter((edges[1::2] - edges[::2]).tolist())
    assert durations[5] > 0.85 * sum(durations.values()), "a gust may follow at once"
    assert all(duration % 5 == 0 for duration in list(durations)[:-1])
    starts = (gusts != 0).sum() / 5
    assert starts == pytest.approx(40_000 * 0.02 / 1.1, rel=0.12)
    assert 0.4 < (gusts > 0).sum() / (gusts != 0).sum() < 0.6


# ------------------------------------------------------------------------------ sensors


def test_sensors_are_biased():
    (first, second) = measured("angle-bias=0.5,position-bias=-0.1", State(1.0, 2.0, 0.1, 0.2))
    assert first == (-0.1, 0, math.radians(0.5), 0)
    assert second == (1.0 - 0.1, 2.0, 0.1 + math.radians(0.5), 0.2)


def test_encoders_count():
    states = [State(x, 0.3, theta, 0.2) for x, theta in ((0.0126, 0.011), (-0.0126, -0.02))]
    _, *seen = measured("encoder=100", *states)
    turn = 2 * math.pi / 100
    assert [each.x for each in seen] == [0.01, -0.01]
    assert [each.theta for each in seen] == [0.0, 0.0]
    assert [(each.x_dot, each.theta_dot) for each in seen] == [(0.3, 0.2)] * 2
    _, seen = measured("encoder=100", State(0.0, 0.0, 0.9 * turn, 0.0))
    assert seen.theta == pytest.approx(turn, rel=1e-15)


def test_velocities_are_differences_of_what_is_measured():
    states = moving(3)
    for condition in ("velocity-differences", "velocity-differences,encoder=500"):
        seen = measured(condition, *states)
        assert (seen[0].x_dot, seen[0].theta_dot) == (0, 0)
        for before, after in pairwise(seen):
            assert after.x_dot == (after.x - before.x) / 0.02
            assert after.theta_dot == (after.theta - before.theta) / 0.02
    assert measured("velocity-differences", *states)[2].x_dot == pytest.approx(0.5)


def test_measurements_arrive_late():
    states = moving(5)
    seen = measured("measurement-delay=2", *states)
    start = State(0.0, 0.0, 0.0, 0.0)
    assert seen == [start, start, start, *states[:3]]


def test_a_lost_measurement_is_the_previous_one_again():
    states = [State(float(k), 0.0, 0.0, 0.0) for k in range(1, 2001)]
    seen = [int(each.x) for each in measured("dropped=0.3", *states)]
    lost = [after == before for before, after in pairwise(seen)]
    assert all(x == k for k, x in enumerate(seen) if k == 0 or not lost[k - 1])
    assert np.mean(lost) == pytest.approx(0.3, abs=0.04)
    assert len(set(measured("dropped=1", *states[:50]))) == 1


# ------------------------------------------------------------------------------ the plant


def test_a_track_tilts():
    task = make_task(condition="tilt=3")
    angle = math.radians(3)
    assert task.parameters.gravity == pytest.approx(9.8 * math.cos(angle), rel=1e-15)
    assert task.parameters.gravity_along == pytest.approx(9.8 * math.sin(angle), rel=1e-14)
    assert task.rig is None, "it costs nothing"
    vertical = State(0.0, 0.0, angle, 0.0)
    hold = 1.1 * task.parameters.gravity_along
    after = step(task.parameters, vertical, hold)
    assert (after.x_dot, after.theta_dot) == pytest.approx((0, 0), abs=1e-15)


def test_the_plant_changes_once_in_a_run():
    """Whatever the trial; the force has the new sign from the step after."""
    task = make_task(condition="at-30.force=-7,at-30.half_length=2", steps=200, trials=3)
    plant = RecordingPlant()
    agent = LinearAgent(*GOOD_WEIGHTS)
    lengths = np.zeros(3, np.int64)
    run(agent, plant, task, np.random.default_rng(1), lengths, np.zeros(1, np.bool_))
    sides = [action for moves in agent.moves for _, action, _, _ in moves]
    acted = [force for forces in plant.forces for force in forces]
    expected = [(10 if s else -10) if k < 30 else (-7 if s else 7) for k, s in enumerate(sides)]
    assert acted == expected
    assert len(lengths[lengths > 0]) > 1
    assert task.rig.present[:, 0].tolist() == list(Parameters(half_length=2.0, force=-7.0))


def test_the_equations_follow_the_plant():
    spec = TaskSpec(condition="at-1.half_length=2,at-1.pole_mass=0.3", steps=4)
    plant, task = EquationsSettings().make(make_context(spec=spec))
    assert isinstance(plant, ChangingEquations)
    states = []

    class Watching(Scripted):
        def learn(self, before, action, after, fallen):
            states.append(after)

    trial(Watching([True] * 4), plant, task, np.random.default_rng(2))
    now = Parameters(half_length=2.0, pole_mass=0.3)
    for before, after in pairwise(states):
        assert after == step(now, before, 10.0)
    assert states[1] != step(Parameters(), states[0], 10.0)


def test_a_plant_that_does_not_change_is_the_fast_one():
    for condition in ("delay=2,gust=3", "at-5.force=-10", "each-run.half_length=1:2"):
        plant, _ = EquationsSettings().make(make_context(spec=TaskSpec(condition=condition)))
        assert type(plant) is type(equations())


def test_a_plant_is_drawn_for_each_trial():
    condition = "each-episode.half_length=0.25:1:log,each-episode.cart_mass=0.5:2"
    task = make_task(condition=condition, steps=1)
    drawn = []
    rng = np.random.default_rng(3)
    for _ in range(2000):
        trial(LinearAgent(*GOOD_WEIGHTS), RecordingPlant(), task, rng)
        drawn.append(Parameters(*task.rig.present[:, 0]))
    lengths = np.log([p.half_length for p in drawn])
    masses = [p.cart_mass for p in drawn]
    for values, low, high in ((lengths, math.log(0.25), 0.0), (masses, 0.5, 2.0)):
        assert low <= min(values) < low + 0.01 * (high - low)
        assert high - 0.01 * (high - low) < max(values) <= high
        assert np.mean(values) == pytest.approx((low + high) / 2, abs=0.03 * (high - low))
    assert len({p.pole_mass for p in drawn}) == 1


def test_a_plant_is_drawn_for_each_run_and_every_agent_meets_the_same():
    condition = "each-run.half_length=0.25:1:log,each-run.force=8:12"
    drawn = {}
    for agent in ("random-search", "q-learning"):
        case = make_case(agent, condition=condition)
        drawn[agent] = [make_run_task(case, 7, number).parameters for number in range(20)]
    assert drawn["random-search"] == drawn["q-learning"]
    assert len({p.half_length for p in drawn["q-learning"]}) == 20
    assert all(8 <= p.force <= 12 for p in drawn["q-learning"])
    assert case.spec.task().parameters == Parameters(), "the nominal plant"


def test_what_is_drawn_for_a_run_is_neither_multiplied_nor_tilted():
    condition = "friction=3,tilt=10,each-run.cart_friction=1:2,each-run.gravity=5:6"
    plant = TaskSpec(condition=condition).task(np.random.default_rng(0)).parameters
    assert 1 <= plant.cart_friction <= 2
    assert 5 <= plant.gravity <= 6
    assert plant.pole_friction == 3 * Parameters().pole_friction
    assert plant.gravity_along == pytest.approx(9.8 * math.sin(math.radians(10)))


@pytest.mark.parametrize("plant", ["mujoco", "gazebo", "ros2"])
def test_a_simulated_plant_cannot_change_within_a_run(plant):
    for condition in ("at-5.half_length=1", "each-episode.cart_mass=1:2"):
        with pytest.raises(UprightError, match="cannot change, except for the force of a push"):
            make_case("random-search", plant=plant, condition=condition)
    make_case("random-search", plant=plant, condition="at-5.force=-10,delay=2,each-run.force=5:9")


# ------------------------------------------------------------------------------ the loops


def outcome(loop, spec, seed):
    """Return the lengths of a run, the agent's memory and the state of its random numbers."""
    plant, task = EquationsSettings().make(make_context(task=spec.task(), spec=spec))
    rng, lengths = np.random.default_rng(seed), np.zeros(spec.trials, np.int64)
    agent = AGENT.agent(rng)
    loop(agent, plant, task, rng, lengths, np.zeros(1, np.bool_))
    return lengths.tolist(), [array.tolist() for array in arrays(agent)], rng.bit_generator.state


@settings(deadline=None, max_examples=60)
@given(task_texts())
def test_the_compiled_loop_is_the_python_loop(texts):
    noise, condition = texts
    spec = TaskSpec(noise, condition=condition, steps=120, trials=3)
    plain, compiled = (outcome(loop, spec, 5) for loop in (run, compiled_run))
    assert plain == compiled


@pytest.mark.parametrize("name", SIZES)
def test_every_term_matters(name):
    """What an agent goes through is not what it goes through without the term."""
    size = SIZES[name][0]
    moves = []
    for condition in (size if "." in name else f"{name}={size}" if size else name, "nominal"):
        spec = TaskSpec(condition=condition, steps=100)
        context = make_context(task=spec.task(np.random.default_rng(1)), spec=spec)
        plant, task = EquationsSettings().make(context)
        agent = LinearAgent(*GOOD_WEIGHTS)
        trial(agent, plant, task, np.random.default_rng(2))
        moves.append(agent.moves[0])
    assert moves[0] != moves[1]


def test_every_term_is_tried_here():
    assert set(SIZES) | {"gust-every", "gust-for"} == set(CONDITION_TERMS)


@pytest.mark.parametrize("name", CONDITIONS)
def test_what_has_no_need_of_a_rig_has_none(name):
    assert (make_task(condition=name).rig is None) == (not name.startswith("delay"))
