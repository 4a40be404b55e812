import json
import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import (
    GOOD_WEIGHTS,
    HARD_START,
    POOR_WEIGHTS,
    LinearAgent,
    RecordingPlant,
    arrays,
    make_task,
)
from scipy import stats

from upright.agents import AGENTS
from upright.core.cartpole import step
from upright.core.conditions import CONDITIONS, NOISES, STARTS
from upright.core.loops import compiled_run
from upright.core.noise import draw_start, measure
from upright.core.parameters import Parameters, State
from upright.core.task import Task, TaskSpec, draw_plant
from upright.core.trials import run, trial
from upright.errors import UprightError
from upright.plants.equations import equations
from upright.studies.case import make_case
from upright.studies.random_streams import random_numbers
from upright.studies.run import make_run, make_run_task

NOMINAL = Parameters()


class Recorder(LinearAgent):
    """A linear policy that remembers what it saw when it acted, and what it did."""

    def __init__(self, *weights):
        super().__init__(*weights)
        self.acted = []

    def act(self, observation, rng):
        self.acted.append((observation, super().act(observation, rng)))
        return self.acted[-1][1]


def play(weights=POOR_WEIGHTS, seed=6, **task):
    """Return an agent and a plant after a trial."""
    task = make_task(**({"steps": 300} | task))
    agent, plant = Recorder(*weights), RecordingPlant(task.parameters)
    trial(agent, plant, task, np.random.default_rng(seed))
    assert len(agent.acted) > 15
    return agent, plant


# ------------------------------------------------------------------------------ names


def test_the_published_task_is_the_default():
    assert make_task() == Task() == make_task(condition="nominal")
    assert CONDITIONS["nominal"] == type(CONDITIONS["nominal"])()


def test_a_condition_changes_only_what_it_names():
    changed = {
        name: {
            field
            for field in Task._fields
            if getattr(make_task(condition=name), field) != getattr(Task(), field)
        }
        for name in CONDITIONS
    }
    assert changed == {
        "nominal": set(),
        "varied-plant": set(),
        "friction-100": {"parameters"},
        "delay-1": {"rig"},
        "delay-2": {"rig"},
        "no-velocities": {"noise"},
    }


def test_a_condition_goes_with_every_noise_case():
    for name, noise in NOISES.items():
        task = make_task(noise=name, condition="no-velocities")
        assert task.noise == noise._replace(hides_velocities=True)


def test_an_unknown_condition_is_refused():
    for make in (make_task, lambda **named: make_case("random-search", **named)):
        with pytest.raises(UprightError, match="condition is 'windy'; it must be one of nominal, "):
            make(condition="windy")


def test_a_condition_is_another_case():
    cases = [make_case("random-search", condition=name) for name in CONDITIONS]
    assert len({case.key for case in cases}) == len(CONDITIONS)


# ------------------------------------------------------------------------------ as data

ODD = {
    "noise": "all-10",
    "start": "wide",
    "condition": "delay-2",
    "steps": 7,
    "trials": 9,
    "parameters": {"half_length": 0.7, "gravity": 1.62},
}
"""A task of which nothing is usual."""


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"noise": "loud"}, "noise is 'loud'; it must be one of none, "),
        ({"noise": None}, "noise is None; it must be one of none, "),
        ({"start": "low"}, "start is 'low'; it must be one of random, zero, wide"),
        ({"condition": "windy"}, "condition is 'windy'; it must be one of nominal, "),
        ({"steps": 0}, "steps is 0; it must be a whole number, at least 1"),
        ({"steps": 10**9 + 1}, "steps is 1000000001; it must be a whole number"),
        ({"steps": True}, "steps is True; it must be a whole number"),
        ({"trials": 0}, "trials is 0; it must be a whole number, at least 1"),
        ({"trials": 10**6 + 1}, "trials is 1000001; it must be a whole number"),
        ({"trials": 2.0}, "trials is 2.0; it must be a whole number"),
        (
            {"parameters": Parameters(pole_mass=0.0)},
            "pole_mass is 0.0; it must be a number, at least",
        ),
        ({"parameters": Parameters(cart_friction=-1.0)}, "cart_friction is -1.0; it must be"),
        (
            {"parameters": {"angle_limit": 0.04}},
            "start is 'random', with theta up to 0.05, but angle_limit is 0.04; it must be a start "
            "within the limit, such as zero, or angle_limit at least 0.05",
        ),
        (
            {"start": "wide", "parameters": {"angle_limit": 0.06}},
            "start is 'wide', with theta up to 0.10471975511965978, but angle_limit is 0.06; it "
            "must be a start within the limit, such as random or zero, or angle_limit at least",
        ),
        (
            {"parameters": {"position_limit": 0.03}},
            "start is 'random', with x up to 0.05, but position_limit is 0.03; it must be",
        ),
        (
            {"condition": "each-run.half_length=0.3:1", "parameters": {"half_length": 0.3}},
            "half_length is 0.3, and the condition has each-run.half_length, which sets it too; "
            "leave out one of them",
        ),
        (
            {"condition": "each-episode.force=9:11", "parameters": {"force": 9.0}},
            "force is 9.0, and the condition has each-episode.force, which sets it too",
        ),
        (
            {"condition": "stick-slip=2", "parameters": {"static_friction": 1.0}},
            "static_friction is 1.0, and the condition has stick-slip, which sets it too",
        ),
    ],
    ids=str,
)
def test_a_task_that_cannot_be_is_refused_by_name(parts, message):
    for make in (TaskSpec, lambda **named: TaskSpec.from_data(named)):
        with pytest.raises(UprightError) as error:
            make(**parts)
        assert str(error.value).startswith(message)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"weather": "fair"}, "part of a task is 'weather'; it must be one of noise, start, "),
        ({"parameters": {"mass": 1.0}}, "parameter is 'mass'; it must be one of gravity, "),
        (
            {"parameters": {"half_length": 0}},
            "half_length is 0; it must be a number, at least 1e-12",
        ),
        ({"parameters": {"gravity": math.nan}}, "gravity is nan; it must be a number"),
        ({"parameters": {"gravity": "9.8"}}, "gravity is '9.8'; it must be a number"),
        (
            {"parameters": [9.8]},
            "parameters is [9.8]; it must be Parameters, or map names to numbers",
        ),
        (
            {"parameters": None},
            "parameters is None; it must be Parameters, or map names to numbers",
        ),
    ],
    ids=str,
)
def test_data_that_are_no_task_are_refused_by_name(parts, message):
    with pytest.raises(UprightError) as error:
        TaskSpec.from_data(parts)
    assert str(error.value).startswith(message)


def test_a_parameter_may_be_set_that_a_condition_starts_from():
    parameters = {"half_length": 0.3, "force": 9.0, "gravity": 9.0, "cart_friction": 0.001}
    condition = "varied-plant,friction=2,tilt=1,at-5.force=8,each-run.pole_friction=0:1"
    assert TaskSpec(condition=condition, parameters=parameters).parameters.half_length == 0.3


def test_a_task_is_read_back_from_its_data():
    spec = TaskSpec.from_data(ODD)
    assert spec.as_data() == ODD
    assert TaskSpec.from_data(json.loads(json.dumps(spec.as_data()))) == spec
    assert spec.parameters == Parameters(half_length=0.7, gravity=1.62)
    for name in ODD:  # every part counts, and is the usual one where it is not named
        one = TaskSpec.from_data({name: ODD[name]})
        assert one.as_data() == TaskSpec().as_data() | {name: ODD[name]}
        assert one != TaskSpec()
    assert TaskSpec.from_data({}) == TaskSpec()
    assert TaskSpec().as_data()["parameters"] == {}


def test_reading_changes_no_data():
    data = {"steps": 7, "parameters": {"half_length": 1}}
    TaskSpec.from_data(data)
    assert data == {"steps": 7, "parameters": {"half_length": 1}}


def test_parameters_are_floats():
    """Compiled code tells a float from a whole number, and a key 1 from 1.0."""
    parameters = {"half_length": 1, "gravity": 0}
    for spec in (
        TaskSpec.from_data({"parameters": parameters}),
        TaskSpec.from_data({"parameters": Parameters(**parameters)}),
        TaskSpec(parameters=Parameters(**parameters)),
        make_case("random-search", parameters=parameters).spec,
    ):
        assert {type(value) for value in spec.parameters} == {float}
        assert {type(value) for value in spec.task().parameters} == {float}
        assert spec.as_data()["parameters"] == {"gravity": 0.0, "half_length": 1.0}
        assert json.dumps(spec.as_data()["parameters"]) == '{"gravity": 0.0, "half_length": 1.0}'
    assert make_case("random-search", parameters={"half_length": 0.5}) == make_case("random-search")


def test_a_task_has_the_numbers_of_its_names():
    task = TaskSpec.from_data(ODD | {"condition": "friction-100"}).task()
    assert task == Task(
        parameters=Parameters(
            half_length=0.7,
            gravity=1.62,
            cart_friction=100 * NOMINAL.cart_friction,
            pole_friction=100 * NOMINAL.pole_friction,
        ),
        noise=NOISES["all-10"],
        start=STARTS["wide"],
        steps=7,
        trials=9,
    )
    assert TaskSpec.from_data({"parameters": {"time_step": 0.01}}).time_step == 0.01


# ------------------------------------------------------------------------------ delay


@pytest.mark.parametrize("steps", [0, 1, 2])
def test_a_push_acts_so_many_steps_later(steps):
    name = f"delay-{steps}" if steps else "nominal"
    agent, plant = play(condition=name)
    asked = [10.0 if action else -10.0 for _, action in agent.acted]
    assert set(asked) == {10.0, -10.0}
    assert plant.forces[0] == [0.0] * steps + asked[: len(asked) - steps]


@pytest.mark.parametrize("steps", [1, 2])
def test_pushes_of_one_trial_do_not_reach_the_next(steps):
    task = make_task(condition=f"delay-{steps}", steps=200, trials=4)
    plant, lengths = RecordingPlant(), np.zeros(4, np.int64)
    rng = np.random.default_rng(1)
    run(LinearAgent(*POOR_WEIGHTS), plant, task, rng, lengths, np.zeros(1, np.bool_))
    assert len(plant.forces) == 4
    for forces in plant.forces:
        assert forces[:steps] == [0.0] * steps
        assert 0.0 not in forces[steps:]


def test_noise_acts_on_the_push_that_arrives():
    agent, plant = play(condition="delay-2", noise="actuator-10")
    asked = np.array([10.0 if action else -10.0 for _, action in agent.acted])
    factors = np.array(plant.forces[0][2:]) / asked[:-2]
    assert np.all(np.abs(factors - 1) <= 0.1)
    assert len(set(factors)) == len(factors)
    assert plant.forces[0][:2] == [0.0, 0.0]


# ------------------------------------------------------------------------------ velocities


@pytest.mark.parametrize("noise", ["none", "all-10"])
def test_hidden_velocities_read_zero_and_the_plant_does_not_notice(noise):
    agent, plant = play(condition="no-velocities", noise=noise)
    (moves,) = agent.moves
    seen = [observation for observation, _ in agent.acted]
    assert [before for before, _, _, _ in moves] == seen
    assert [after for _, _, after, _ in moves][:-1] == seen[1:]
    true = [plant.starts[0], *plant.states[0]]
    for observed, state in zip([*seen, moves[-1][2]], true, strict=True):
        assert (observed.x_dot, observed.theta_dot) == (0.0, 0.0)
        if noise == "none":
            assert (observed.x, observed.theta) == (state.x, state.theta)
    state = true[0]
    for force, after in zip(plant.forces[0], true[1:], strict=True):
        state = step(NOMINAL, state, force)
        assert state == after
    assert all(state.x_dot and state.theta_dot for state in true)


def test_hiding_draws_the_same_random_numbers():
    shown, hidden = (
        make_task(noise="all-10", condition=c).noise for c in ("nominal", "no-velocities")
    )
    state = State(0.7, -0.9, 0.13, -1.1)
    seen, unseen = (measure(noise, state, np.random.default_rng(1)) for noise in (shown, hidden))
    assert unseen == seen._replace(x_dot=0.0, theta_dot=0.0)


# ------------------------------------------------------------------------------ friction


def test_friction_is_a_hundredfold():
    task = make_task(condition="friction-100")
    assert task.parameters == NOMINAL._replace(
        cart_friction=100 * NOMINAL.cart_friction, pole_friction=100 * NOMINAL.pole_friction
    )
    state = State(0.0, 0.5, 0.1, 0.5)
    assert step(task.parameters, state, 10.0) != step(NOMINAL, state, 10.0)


# ------------------------------------------------------------------------------ varied plants


def test_plants_are_drawn_uniformly_on_a_scale_of_powers():
    rng = np.random.default_rng(2)
    plants = [draw_plant(NOMINAL, rng) for _ in range(3000)]
    for name, low, high in (
        ("half_length", 0.125, 1.0),  # a pole of 0.25 to 2 m
        ("cart_mass", 0.5, 2.0),
        ("pole_mass", 0.05, 0.2),
    ):
        values = np.array([getattr(plant, name) for plant in plants])
        assert low <= values.min() < 1.02 * low
        assert high / 1.02 < values.max() <= high
        span = stats.uniform(math.log(low), math.log(high / low))
        assert stats.kstest(np.log(values), span.cdf).pvalue > 1e-3
    logs = np.log([(p.half_length, p.cart_mass, p.pole_mass) for p in plants])
    assert np.abs(np.corrcoef(logs.T) - np.eye(3)).max() < 4 / math.sqrt(len(plants))


def test_a_plant_differs_in_nothing_else():
    plant = draw_plant(NOMINAL, np.random.default_rng(3))
    drawn = {"half_length", "cart_mass", "pole_mass"}
    assert {f for f in plant._fields if getattr(plant, f) != getattr(NOMINAL, f)} == drawn


def test_every_run_has_a_plant_of_its_own_and_every_agent_the_same():
    plants = {}
    for agent in AGENTS:
        case = make_case(agent, condition="varied-plant")
        plants[agent] = [make_run_task(case, 7, run).parameters for run in range(20)]
        assert make_run_task(case, 8, 0).parameters != make_run_task(case, 7, 0).parameters
    first = plants["random-search"]
    assert len({plant.half_length for plant in first}) == 20
    assert all(each == first for each in plants.values())
    for noise in ("gaussian-0.2", "all-10"):
        noisy = make_case("random-search", condition="varied-plant", noise=noise)
        assert make_run_task(noisy, 7, 3).parameters == first[3]


@pytest.mark.parametrize("condition", CONDITIONS)
def test_only_varied_plants_vary(condition):
    case = make_case("random-search", condition=condition)
    varies = make_run_task(case, 7, 0).parameters != case.spec.task().parameters
    assert varies == (condition == "varied-plant")


def test_a_run_is_made_with_its_own_plant_and_the_stream_it_always_had():
    """The run is repeated here by the loop in Python, with the nominal run's random numbers."""
    case = make_case("random-search", condition="varied-plant", steps=300, trials=30)
    for number in range(3):
        task, rng = make_run_task(case, 7, number), random_numbers(7, number)
        agent, lengths = case.settings.agent(rng), np.zeros(30, np.int64)
        run(agent, equations(task.parameters), task, rng, lengths, np.zeros(1, np.bool_))
        learned, result = make_run(case, 7, number)
        assert result.lengths.tolist() == lengths[lengths > 0].tolist()
        assert learned.weights.tolist() == agent.weights.tolist()
        calm = replace(case, spec=replace(case.spec, condition="nominal"))
        nominal = make_run(calm, 7, number)[1]
        assert nominal.lengths.tolist() != result.lengths.tolist()


def test_the_stream_of_plants_is_not_that_of_a_run():
    """Of this run or any other: an agent must not learn its plant from its numbers."""
    case = make_case("random-search", condition="varied-plant")
    for number in range(3):
        plant = make_run_task(case, 7, number).parameters
        for other in range(4):
            assert draw_plant(NOMINAL, random_numbers(7, other)) != plant


# ------------------------------------------------------------------------------ start


def test_a_wide_start_leans_up_to_six_degrees():
    rng = np.random.default_rng(7)
    starts = np.array([draw_start(STARTS["wide"], rng) for _ in range(3000)])
    for column, half_width in zip(starts.T, (0.05, 0.05, math.radians(6), 0.05), strict=True):
        assert np.abs(column).max() <= half_width
        uniform = stats.uniform(-half_width, 2 * half_width)
        assert stats.kstest(column, uniform.cdf).pvalue > 1e-3


def test_a_trial_begins_at_a_wide_start():
    angles = [play(GOOD_WEIGHTS, seed, start="wide")[1].starts[0].theta for seed in range(20)]
    assert 0.06 < max(map(abs, angles)) <= math.radians(6)


# ------------------------------------------------------------------------------ the two loops


@pytest.mark.parametrize("name", AGENTS)
@pytest.mark.parametrize("condition", [name for name in CONDITIONS if name != "nominal"])
def test_the_compiled_loop_is_the_python_loop_under_every_condition(name, condition):
    """The same trial lengths, and the same memory to the last bit."""
    case = make_case(name, condition=condition, noise="actuator-10", steps=300, trials=8)
    outcomes = []
    for either in (run, compiled_run):
        task = make_run_task(case, 5, 1)._replace(start=HARD_START)
        rng = np.random.default_rng(2)
        agent, lengths = case.settings.agent(np.random.default_rng(4)), np.zeros(8, np.int64)
        either(agent, equations(task.parameters), task, rng, lengths, np.zeros(1, np.bool_))
        outcomes.append((lengths.tolist(), [array.tolist() for array in arrays(agent)]))
    assert outcomes[0] == outcomes[1]
    made = [length for length in outcomes[0][0] if length]
    if name != "adaptive-lqr":  # which may balance at once, but then has learned at every step
        assert len(set(made)) > 1, "trials differ, so the comparison means something"
