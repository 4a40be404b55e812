import math
from itertools import combinations

import numpy as np
import pytest
from helpers import GOOD_WEIGHTS, LinearAgent, RecordingPlant, make_task
from scipy import stats

from upright.core.cartpole import step
from upright.core.conditions import NOISES, STARTS, Noise
from upright.core.noise import disturb, draw_start, measure
from upright.core.parameters import State
from upright.core.trials import trial

TRUE = State(0.7, -0.9, 0.13, -1.1)
SAMPLES = 4000


def measurements(noise, count=SAMPLES):
    """Return relative errors of many measurements, one column a component."""
    rng = np.random.default_rng(1)
    return np.array([measure(noise, TRUE, rng) for _ in range(count)]) / TRUE - 1


def looks_uniform(values, half_width):
    assert np.abs(values).max() <= half_width * (1 + 1e-12)
    return stats.kstest(values, stats.uniform(-half_width, 2 * half_width).cdf).pvalue > 1e-3


def looks_independent(columns):
    limit = 4 / math.sqrt(len(columns[0]))
    return all(abs(np.corrcoef(a, b)[0, 1]) < limit for a, b in combinations(columns, 2))


@pytest.mark.parametrize(("name", "part"), [("actuator-5", 0.05), ("actuator-10", 0.10)])
@pytest.mark.parametrize("force", [10.0, -10.0])
def test_actuator_noise_is_uniform_on_the_force(name, part, force):
    rng = np.random.default_rng(2)
    errors = np.array([disturb(NOISES[name], force, rng) for _ in range(SAMPLES)]) / force - 1
    assert looks_uniform(errors, part)
    assert looks_independent([errors[:-1], errors[1:]]), "drawn anew each step"


@pytest.mark.parametrize(("name", "part"), [("sensor-5", 0.05), ("sensor-10", 0.10)])
def test_sensor_noise_is_uniform_on_the_angle(name, part):
    errors = measurements(NOISES[name])
    assert looks_uniform(errors[:, 2], part)
    assert looks_independent([errors[:-1, 2], errors[1:, 2]])


@pytest.mark.parametrize(("name", "part"), [("all-5", 0.05), ("all-10", 0.10)])
def test_noise_on_all_sensors_is_uniform_and_independent(name, part):
    errors = measurements(NOISES[name])
    assert all(looks_uniform(column, part) for column in errors.T)
    assert looks_independent(errors.T)


@pytest.mark.parametrize(("name", "variance"), [("gaussian-0.1", 0.1), ("gaussian-0.2", 0.2)])
@pytest.mark.parametrize("angle", [0.0, 0.13])
def test_gaussian_noise_is_normal_with_a_variance_in_square_degrees(name, variance, angle):
    rng = np.random.default_rng(3)
    state = TRUE._replace(theta=angle)
    errors = [measure(NOISES[name], state, rng).theta - angle for _ in range(SAMPLES)]
    degrees = np.degrees(errors)
    assert stats.kstest(degrees, stats.norm(0, math.sqrt(variance)).cdf).pvalue > 1e-3
    assert degrees.var() == pytest.approx(variance, rel=0.1)
    assert looks_independent([degrees[:-1], degrees[1:]])


@pytest.mark.parametrize("name", NOISES)
def test_only_what_a_case_names_is_disturbed(name):
    noise, rng = NOISES[name], np.random.default_rng(4)
    seen = measure(noise, TRUE, rng)
    changed = {field for field in State._fields if getattr(seen, field) != getattr(TRUE, field)}
    expected = {"all": set(State._fields), "sensor": {"theta"}, "gaussian": {"theta"}}
    assert changed == expected.get(name.split("-")[0], set())
    assert (disturb(noise, 10.0, rng) != 10.0) == name.startswith("actuator")


@pytest.mark.parametrize("name", NOISES)
def test_a_case_draws_random_numbers_only_for_what_it_disturbs(name):
    noise, rng = NOISES[name], np.random.default_rng(5)
    before = rng.bit_generator.state
    disturb(noise, 10.0, rng)
    assert (rng.bit_generator.state == before) == (not name.startswith("actuator"))
    before = rng.bit_generator.state
    measure(noise, TRUE, rng)
    assert (rng.bit_generator.state == before) == name.startswith(("none", "actuator"))


def test_no_noise_is_the_default():
    assert Noise() == NOISES["none"]


@pytest.mark.parametrize("name", NOISES)
def test_the_plant_goes_through_its_true_states(name):
    """Noise on a measurement reaches the agent alone; noise on the force reaches the plant."""
    task = make_task(noise=name, steps=200)
    plant, agent = RecordingPlant(), LinearAgent(*GOOD_WEIGHTS)
    trial(agent, plant, task, np.random.default_rng(6))
    state, forces, moves = plant.starts[0], np.array(plant.forces[0]), agent.moves[0]
    assert len(forces) > 20
    for force, after in zip(forces, plant.states[0], strict=True):
        state = step(task.parameters, state, float(force))
        assert after == state
    asked = np.where([action for _, action, _, _ in moves], 10.0, -10.0)
    assert np.all(forces == asked) == (not name.startswith("actuator"))
    seen = [moves[0][0]] + [after for _, _, after, _ in moves]
    differs = np.any(np.array(seen) != np.array([plant.starts[0], *plant.states[0]]), axis=0)
    columns = {"all": [True] * 4, "sensor": [0, 0, 1, 0], "gaussian": [0, 0, 1, 0]}
    assert differs.tolist() == columns.get(name.split("-")[0], [False] * 4)


def test_a_random_start_is_uniform():
    rng = np.random.default_rng(7)
    drawn = np.array([draw_start(STARTS["random"], rng) for _ in range(SAMPLES)])
    assert all(looks_uniform(column, 0.05) for column in drawn.T)
    assert looks_independent(drawn.T)


def test_a_start_from_zero_is_zero():
    assert draw_start(STARTS["zero"], np.random.default_rng(8)) == State(0.0, 0.0, 0.0, 0.0)
