import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import arrays, make_task
from scipy.linalg import solve_discrete_are

from upright.agents.adaptive_lqr import SETTINGS, AdaptiveLQR, fit_and_design
from upright.agents.parts.history import BLOCK
from upright.core.cartpole import step
from upright.core.loops import compiled_run
from upright.core.parameters import Parameters, State
from upright.errors import UprightError
from upright.plants.equations import equations
from upright.studies.case import make_case
from upright.studies.random_streams import random_numbers
from upright.studies.run import make_run

DEFAULT = SETTINGS["default"]
ANGLE = np.array([0.0, 0.0, 1.0, 0.0])
COSTS = (DEFAULT.x_cost, DEFAULT.x_dot_cost, DEFAULT.theta_cost, DEFAULT.theta_dot_cost)


def agent_of(rng=None, **settings):
    return replace(DEFAULT, **settings).agent(rng or np.random.default_rng(1))


def linear_plant():
    """Return A (4, 4) and b (4,) of the equations at rest, for a push of ±1."""
    parameters = Parameters(cart_friction=0.0)

    def after(state, force):
        return np.array(step(parameters, State(*state), force))

    small = 1e-6
    a = np.stack([after((small * row).tolist(), 0.0) / small for row in np.eye(4)], axis=1)
    return a, after((0.0, 0.0, 0.0, 0.0), 1e-4) / 1e-4 * parameters.force


def companion(model):
    """Return what leads from a regressor (its push being 0) and a push to the next regressor."""
    size = model.shape[1]
    matrix = np.eye(size, k=-BLOCK)
    matrix[1:BLOCK] = model
    matrix[0] = 0.0
    return matrix


def feed(agent, samples, rng=None):
    for before, action, after in samples:
        agent.learn(State(*before), action, State(*after), False)


def random_trial(a, b, length, rng, noise=0.0):
    """Return samples of a linear plant under random pushes, measured with noise on the angle."""
    state = rng.uniform(-0.05, 0.05, 4)
    samples = []
    for _ in range(length):
        action = bool(rng.random() < 0.5)
        after = a @ state + b * (1.0 if action else -1.0)
        samples.append((state, action, after))
        state = after
    offsets = np.outer(noise * rng.normal(size=length + 1), ANGLE)
    return [
        ((s + o).tolist(), action, (n + p).tolist())
        for (s, action, n), o, p in zip(samples, offsets, offsets[1:], strict=False)
    ]


# ------------------------------------------------------------------------------ the model


def regressors(samples, history):
    """Return what each prediction rests on, block by block, the newest first."""
    found = []
    for k, (_, action, _) in enumerate(samples):
        row = []
        for back in range(history):
            before, push, _ = samples[max(0, k - back)]
            seen = back <= k
            row += [(1.0 if push else -1.0) if seen else 0.0, *before]
        row[0] = 1.0 if action else -1.0
        found.append(row)
    return np.array(found)


@pytest.mark.parametrize("history", [1, 2, 5])
def test_the_model_is_the_ridge_regression_of_all_samples(history):
    rng = np.random.default_rng(4)
    agent = agent_of(history=history)
    trials = [random_trial(*linear_plant(), length, rng, noise=0.005) for length in (7, 12)]
    for samples in trials:
        agent.begin_trial(rng)
        feed(agent, samples)
    fit_and_design(agent)
    rows = np.vstack([regressors(samples, history) for samples in trials])
    changes = np.array([np.subtract(n, s) for samples in trials for s, _, n in samples])
    beliefs = np.array([DEFAULT.push_ridge, *[DEFAULT.ridge] * 4])
    ridge = np.concatenate([beliefs * DEFAULT.ridge_growth**back for back in range(history)])
    expected = np.linalg.solve(rows.T @ rows + np.diag(ridge), rows.T @ changes).T
    expected[:, 1:BLOCK] += np.eye(4)
    assert agent.model == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_before_any_sample_it_expects_that_nothing_changes():
    agent = agent_of()
    fit_and_design(agent)
    np.testing.assert_array_equal(agent.model, np.eye(4, BLOCK * DEFAULT.history, k=1))
    np.testing.assert_array_equal(agent.gains[1:], 0.0)


def test_six_samples_of_a_linear_plant_tell_it_exactly():
    rng = np.random.default_rng(5)
    a, b = linear_plant()
    agent = agent_of(history=1, ridge=1e-12, push_ridge=1e-12)
    feed(agent, random_trial(a, b, 6, rng))
    fit_and_design(agent)
    assert agent.model == pytest.approx(np.column_stack([b, a]), abs=1e-6)


def test_history_finds_the_instability_that_noise_hides():
    """With the last measurement alone, noise makes the pole look more stable than it is."""
    a, b = linear_plant()
    feedback = np.array([2.0, 2.9, 17.0, 4.6])

    def growth(history):
        rng, agent = np.random.default_rng(6), agent_of(history=history, learning_steps=10**6)
        state = np.zeros(4)
        seen = state.copy()
        for _ in range(3000):
            explores, pushes_right = rng.random(2) < [0.1, 0.5]
            action = bool(pushes_right if explores else feedback @ state > 0)
            state = a @ state + b * (1.0 if action else -1.0)
            after = state + 0.008 * rng.normal() * ANGLE
            feed(agent, [(seen.tolist(), action, after.tolist())])
            seen = after
        fit_and_design(agent)
        return max(abs(np.linalg.eigvals(companion(agent.model))))

    true = max(abs(np.linalg.eigvals(a)))
    assert true > 1.07
    assert growth(1) < 1 + 0.3 * (true - 1)
    assert growth(6) > 1 + 0.8 * (true - 1)


# ------------------------------------------------------------------------------ the control


def set_model(agent, model):
    agent.model[:] = model
    moments = agent.moments
    moments[:] = np.eye(len(moments))
    agent.targets[:] = model - np.eye(*model.shape, k=1)


def test_over_a_long_horizon_the_gains_are_those_of_the_riccati_equation():
    a, b = linear_plant()
    agent = agent_of(history=1, horizon=3000)
    set_model(agent, np.column_stack([b, a]))
    fit_and_design(agent)
    v = solve_discrete_are(a, b[:, None], np.diag(COSTS), [[DEFAULT.push_cost]])
    expected = b @ v @ a / (DEFAULT.push_cost + b @ v @ b)
    assert agent.gains[1:] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("horizon", [1, 7])
def test_the_gains_minimise_the_cost_over_the_horizon(horizon):
    """Against the least squares problem of all pushes at once, with a history and noise-made b."""
    rng = np.random.default_rng(7)
    history = 3
    agent = agent_of(history=history, horizon=horizon)
    size = BLOCK * history
    model = np.eye(4, size, k=1) + 0.2 * rng.normal(size=(4, size))
    set_model(agent, model)
    fit_and_design(agent)
    matrix = companion(model)
    root = np.sqrt(np.array(COSTS))
    start = rng.normal(size=size)
    start[0] = 0.0
    # Regressors before each push, as affine functions of all pushes.
    constant, effect = start, np.zeros((size, horizon + 1))
    rows, right_side = [], []
    for k in range(horizon + 1):
        rows.append(root[:, None] * effect[1:BLOCK])
        right_side.append(-root * constant[1:BLOCK])
        push = np.zeros(horizon + 1)
        push[k] = 1.0
        rows.append(math.sqrt(DEFAULT.push_cost) * push[None])
        right_side.append([0.0])
        with_push = effect.copy()
        with_push[0] = push
        constant, effect = matrix @ constant, matrix @ with_push
    pushes = np.linalg.lstsq(np.vstack(rows), np.concatenate(right_side))[0]
    assert -agent.gains[1:] @ start[1:] == pytest.approx(pushes[0], rel=1e-6)


def test_it_pushes_against_the_gains_times_the_state():
    rng = np.random.default_rng(8)
    agent = agent_of(history=4, exploration=0.0, learning_steps=0)
    agent.gains[:] = rng.normal(size=BLOCK * 4)
    seen, pushes = [], []
    agent.begin_trial(rng)
    for _ in range(30):
        observation = rng.normal(size=4)
        seen.append(observation)
        blocks = []
        for back in range(4):
            push = pushes[-back] if 0 < back <= len(pushes) else 0.0
            blocks += [push, *seen[max(0, len(seen) - 1 - back)]]
        wanted = -np.dot(agent.gains[1:], blocks[1:])
        state = State(*observation.tolist())
        action = agent.act(state, rng)
        assert action == (wanted > 0) == (agent.push_probability(state) > 0.5)
        agent.learn(state, action, state, False)
        pushes.append(1.0 if action else -1.0)


def test_playing_remembers_as_learning_does():
    rng = np.random.default_rng(9)
    one, other = agent_of(learning_steps=0), agent_of(learning_steps=0)
    for agent in (one, other):
        agent.begin_trial(rng)
    for _ in range(20):
        state, action = State(*rng.normal(size=4).tolist()), bool(rng.random() < 0.5)
        one.learn(state, action, state, False)
        other.remember(state, action)
        np.testing.assert_array_equal(one.regressor, other.regressor)
    np.testing.assert_array_equal(other.moments, agent_of().moments)


# ------------------------------------------------------------------------------ when it learns


def test_a_fall_leaves_few_samples_and_the_belief():
    rng = np.random.default_rng(10)
    agent = agent_of(kept_samples=10.0)
    feed(agent, random_trial(*linear_plant(), 40, rng))
    belief = agent_of().moments
    data, targets = agent.moments - belief, agent.targets.copy()
    agent.end_trial(True)
    assert agent.samples[0] == 10.0
    assert agent.moments - belief == pytest.approx(data / 4, rel=1e-6, abs=1e-12)
    assert agent.targets == pytest.approx(targets / 4)


def test_success_forgets_nothing():
    agent = agent_of(kept_samples=10.0)
    feed(agent, random_trial(*linear_plant(), 40, np.random.default_rng(11)))
    before = [array.copy() for array in arrays(agent)]
    agent.end_trial(False)
    for array, old in zip(arrays(agent), before, strict=True):
        np.testing.assert_array_equal(array, old)


def test_a_trial_that_has_lasted_is_no_longer_learned_from():
    agent = agent_of(learning_steps=15)
    rng = np.random.default_rng(12)
    samples = random_trial(*linear_plant(), 30, rng)
    feed(agent, samples)
    assert agent.samples[0] == 15.0
    agent.begin_trial(rng)
    feed(agent, samples[:5])
    assert agent.samples[0] == 20.0


def test_it_explores_as_often_as_it_should():
    agent, rng = agent_of(exploration=0.2), np.random.default_rng(13)
    agent.gains[1:] = -1.0
    right = State(1.0, 1.0, 1.0, 1.0)
    pushes = [agent.act(right, rng) for _ in range(4000)]
    assert np.mean(pushes) == pytest.approx(0.9, abs=0.015)


# ------------------------------------------------------------------------------ learning


NOMINAL = Parameters()


def trials_to_success(parameters, noise="none", runs=20, steps=5000):
    found = []
    for run in range(runs):
        rng = random_numbers(0, run)
        agent = DEFAULT.agent(rng)
        task = make_task(noise, steps=steps, trials=50)._replace(parameters=parameters)
        lengths, stop = np.zeros(50, np.int64), np.zeros(1, np.bool_)
        plant = equations(parameters._replace(force=NOMINAL.force))
        success = compiled_run(agent, plant, task, rng, lengths, stop)
        found.append(success or math.inf)
    return found


@pytest.mark.parametrize(
    "parameters",
    [
        NOMINAL._replace(force=-NOMINAL.force),
        NOMINAL._replace(half_length=0.5 * NOMINAL.half_length),
        NOMINAL._replace(half_length=2.0 * NOMINAL.half_length),
        NOMINAL._replace(cart_mass=0.5 * NOMINAL.cart_mass),
        NOMINAL._replace(cart_mass=3.0 * NOMINAL.cart_mass),
    ],
    ids=["swapped", "short", "long", "light", "heavy"],
)
def test_it_balances_another_plant_without_being_told(parameters):
    assert np.mean(trials_to_success(parameters)) <= 2.0


@pytest.mark.parametrize(
    ("noise", "most"), [("none", 1.05), ("actuator-10", 1.1), ("sensor-10", 1.3), ("all-10", 1.8)]
)
def test_it_balances_at_once(noise, most):
    assert np.mean(trials_to_success(NOMINAL, noise, runs=40)) <= most


@pytest.mark.parametrize("condition", ["delay-2", "no-velocities"])
def test_history_makes_up_for_delay_and_missing_velocities(condition):
    case = make_case("adaptive-lqr", condition=condition, steps=5000, trials=30)
    assert all(make_run(case, 0, run)[1].success for run in range(10))


def test_the_same_seed_gives_the_same_agent():
    case = make_case("adaptive-lqr", noise="gaussian-0.2", steps=3000)
    one, other = (make_run(case, 3, 5) for _ in range(2))
    np.testing.assert_array_equal(one[1].lengths, other[1].lengths)
    for a, b in zip(arrays(one[0]), arrays(other[0]), strict=True):
        np.testing.assert_array_equal(a, b)


# ------------------------------------------------------------------------------ settings


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("history", 0),
        ("history", 2.5),
        ("ridge", 0.0),
        ("push_ridge", -1.0),
        ("ridge_growth", 0.9),
        ("x_cost", -1.0),
        ("theta_cost", math.nan),
        ("push_cost", 0.0),
        ("horizon", 0),
        ("exploration", 1.1),
        ("learning_steps", -1),
        ("kept_samples", 0.0),
    ],
)
def test_impossible_settings_are_refused(name, value):
    with pytest.raises(UprightError, match=name):
        AdaptiveLQR(**{name: value})
