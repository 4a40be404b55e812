import math
from dataclasses import fields

import numpy as np
import pytest

from upright.agents.parts.adam import ascend
from upright.agents.reinforce import (
    BASELINE_MEMORY,
    RIDGE,
    SETTINGS,
    Reinforce,
    fit_baseline,
    set_advantages,
    set_policy_gradient,
)
from upright.core.parameters import State
from upright.errors import UprightError
from upright.studies.case import make_case
from upright.studies.run import make_run

LENGTHS = (12, 5, 20)
"""Of the episodes in `filled_agent`; the last one is longer than the memory of an episode."""
KEPT = 12


def filled_agent(**settings):
    """Return an agent that remembers three episodes of random steps."""
    rng = np.random.default_rng(1)
    settings = {"init_std": 0.6, "logit_scale": 3.0} | settings
    agent = Reinforce(episodes=3, kept_steps=KEPT, **settings).agent(rng)
    for length in LENGTHS:
        agent.begin_trial(rng)
        for step in range(length):
            seen = State(*(agent.scales * rng.normal(size=4)).tolist())
            agent.learn(seen, agent.act(seen, rng), seen, step == length - 1)
    return agent


def remembered(agent):
    """Yield the episodes in the order they were made, the steps of each in order too.

    Each step is a tuple of the input, the push, and the probability of that push then; and its
    place in the arrays.
    """
    e = agent.episodes
    count = len(e.lengths)
    for k in range(count):
        episode = (e.newest[0] + 1 + k) % count
        kept = min(e.lengths[episode], e.actions.shape[1])
        rows = [(e.lengths[episode] - kept + i) % e.actions.shape[1] for i in range(kept)]
        yield [
            (e.inputs[episode, r], e.actions[episode, r], e.probabilities[episode, r], (episode, r))
            for r in rows
        ]


def network(weights, inputs):
    """Evaluate the 4-8-16-1 network in NumPy."""

    def activation(z):
        return np.where(z > 0, z, z / np.sqrt(1 + z * z))

    hidden_1 = activation(inputs @ weights[:32].reshape(4, 8))
    hidden_2 = activation(hidden_1 @ weights[32:160].reshape(8, 16))
    return hidden_2 @ weights[160:]


def probability_right(agent, weights, inputs):
    return 1 / (1 + np.exp(-agent.logit_scale * network(weights, inputs)))


def features(inputs):
    products = [inputs[i] * inputs[j] for i in range(4) for j in range(i + 1)]
    return np.array([1.0, *products])


# ------------------------------------------------------------------------------ policy


def test_the_policy_is_the_network():
    agent, rng = filled_agent(), np.random.default_rng(2)
    for _ in range(20):
        seen = agent.scales * rng.normal(size=4)
        expected = probability_right(agent, agent.adam.weights, seen / agent.scales)
        assert agent.push_probability(State(*seen.tolist())) == pytest.approx(expected, rel=1e-12)


def test_pushes_are_sampled_with_the_policy_s_probability():
    agent, rng = filled_agent(), np.random.default_rng(3)
    seen = State(0.5, -0.3, 0.02, 0.1)
    probability = agent.push_probability(seen)
    assert 0.1 < probability < 0.9
    pushes = [agent.act(seen, rng) for _ in range(4000)]
    assert np.mean(pushes) == pytest.approx(probability, abs=4 * 0.5 / math.sqrt(4000))


def test_first_weights_spread_as_set():
    weights = np.array(
        [Reinforce(init_std=0.6).agent(np.random.default_rng(i)).adam.weights for i in range(200)]
    )
    for layer, fan_in in ((weights[:, :32], 4), (weights[:, 32:160], 8), (weights[:, 160:], 16)):
        assert layer.std() == pytest.approx(0.6 / math.sqrt(fan_in), rel=0.05)
        assert abs(layer.mean()) < 0.02


# ------------------------------------------------------------------------------ memory of steps


@pytest.mark.parametrize(("length", "kept"), [(1, [1]), (5, [1, 2, 3, 4, 5]), (13, range(9, 14))])
def test_the_last_steps_of_an_episode_are_kept_in_order(length, kept):
    rng = np.random.default_rng(4)
    agent = Reinforce(episodes=2, kept_steps=5, x_scale=1.0, baseline="mean").agent(rng)
    agent.begin_trial(rng)
    for step in range(1, length + 1):
        seen = State(float(step), 0.0, 0.0, 0.0)
        agent.learn(seen, agent.act(seen, rng), seen, step == length)
    episode = list(remembered(agent))[-1]
    assert [inputs[0] for inputs, _, _, _ in episode] == list(kept)
    set_advantages(agent.episodes, agent.baseline, 0.5, False)
    returns = -(0.5 ** np.arange(len(kept))[::-1])
    advantages = [agent.episodes.advantages[place] for _, _, _, place in episode]
    assert advantages == pytest.approx(list((returns - returns.mean()) / max(returns.std(), 1e-6)))


def test_the_oldest_episode_gives_way():
    rng = np.random.default_rng(5)
    agent = Reinforce(episodes=2, kept_steps=5, x_scale=1.0).agent(rng)
    for trial in range(1, 4):
        agent.begin_trial(rng)
        for _ in range(trial):
            seen = State(float(trial), 0.0, 0.0, 0.0)
            agent.learn(seen, agent.act(seen, rng), seen, False)
    assert [[inputs[0] for inputs, *_ in each] for each in remembered(agent)] == [[2, 2], [3, 3, 3]]


def test_a_step_is_remembered_with_the_probability_of_its_push():
    agent = filled_agent()
    pushes = set()
    for episode in remembered(agent):
        for inputs, action, probability, _ in episode:
            to_the_right = probability_right(agent, agent.adam.weights, inputs)
            pushes.add(bool(action))
            assert probability == pytest.approx(to_the_right if action else 1 - to_the_right)
    assert pushes == {True, False}


# ------------------------------------------------------------------------------ advantages


def discounted(length, discount):
    return -(discount ** np.arange(length)[::-1])


def all_advantages(agent):
    return np.array([agent.episodes.advantages[s[3]] for each in remembered(agent) for s in each])


def test_advantages_against_the_mean_are_standardised_returns():
    agent = filled_agent(baseline="mean")
    set_advantages(agent.episodes, agent.baseline, 0.9, False)
    advantages = all_advantages(agent)
    assert advantages.mean() == pytest.approx(0, abs=1e-12)
    assert advantages.std() == pytest.approx(1)
    returns = np.concatenate([discounted(len(each), 0.9) for each in remembered(agent)])
    assert advantages == pytest.approx((returns - returns.mean()) / returns.std())


def test_advantages_against_a_baseline_are_normalised_by_their_rms():
    agent = filled_agent()
    agent.baseline.coefficients[:] = np.random.default_rng(6).normal(size=11) - 0.7
    set_advantages(agent.episodes, agent.baseline, 0.9, True)
    expected, values = [], []
    for episode in remembered(agent):
        for g, (inputs, *_) in zip(discounted(len(episode), 0.9), episode, strict=True):
            values.append(agent.baseline.coefficients @ features(inputs))
            expected.append(g - np.clip(values[-1], -1, 0))
    assert min(values) < -1 < 0 < max(values), "V is clipped at both ends"
    assert all_advantages(agent) == pytest.approx(
        np.array(expected) / np.sqrt(np.mean(np.square(expected)))
    )


def test_equal_returns_give_no_advantage():
    agent = filled_agent(baseline="mean")
    set_advantages(agent.episodes, agent.baseline, 1.0, False)
    assert not all_advantages(agent).any()


def test_the_baseline_is_a_ridge_regression_that_forgets():
    agent, discount = Reinforce(kept_steps=KEPT).agent(np.random.default_rng(7)), 0.9
    rng = np.random.default_rng(8)
    rows, targets, ridge = np.zeros((0, 11)), np.zeros(0), 0.0
    for length in (30, 8, 12):
        agent.begin_trial(rng)
        for _ in range(length):
            seen = State(*(agent.scales * rng.normal(size=4)).tolist())
            agent.learn(seen, agent.act(seen, rng), seen, False)
        fit_baseline(agent.baseline, agent.episodes, discount)
        new = np.array([features(inputs) for inputs, *_ in list(remembered(agent))[-1]])
        root = math.sqrt(BASELINE_MEMORY)
        rows = np.vstack([root * rows, new])
        targets = np.concatenate([root * targets, discounted(len(new), discount)])
        ridge = BASELINE_MEMORY * ridge + RIDGE
        augmented = np.vstack([rows, math.sqrt(ridge) * np.eye(11)])
        expected = np.linalg.lstsq(augmented, np.concatenate([targets, np.zeros(11)]))[0]
        assert agent.baseline.coefficients == pytest.approx(expected, rel=1e-6, abs=1e-9)


# ------------------------------------------------------------------------------ gradient


def importances(agent):
    for episode in remembered(agent):
        for inputs, action, then, _ in episode:
            now = probability_right(agent, agent.adam.weights, inputs)
            yield min(1.0, (now if action else 1 - now) / then)


def test_the_gradient_is_that_of_the_weighted_log_probabilities():
    """Finite differences of a sum in NumPy, the importance of each step held."""
    agent, rng = filled_agent(stride=1), np.random.default_rng(10)
    agent.episodes.advantages[:] = rng.normal(size=(3, KEPT))
    agent.adam.weights[:] += 0.3 * rng.normal(size=176)  # so that the policy is another one now
    steps = [step for episode in remembered(agent) for step in episode]
    held = list(importances(agent))
    assert min(held) < 0.9
    assert held.count(1.0) > 3, "some are clipped, some are not"

    def objective(weights):
        total = 0.0
        for (inputs, action, _, place), importance in zip(steps, held, strict=True):
            to_the_right = probability_right(agent, weights, inputs)
            log_probability = np.log(to_the_right if action else 1 - to_the_right)
            total += importance * agent.episodes.advantages[place] * log_probability
        return total / len(steps)

    set_policy_gradient(agent, 0)
    differences = np.zeros(176)
    for i in range(176):
        shift = np.zeros(176)
        shift[i] = 1e-5
        weights = agent.adam.weights
        differences[i] = (objective(weights + shift) - objective(weights - shift)) / 2e-5
    assert np.abs(differences).max() > 0.05
    assert agent.adam.gradient == pytest.approx(differences, rel=1e-5, abs=1e-8)


def test_gradients_of_every_third_step_together_make_the_whole_one():
    parts, counts = [], []
    for first in range(3):
        agent = filled_agent(stride=3)
        agent.episodes.advantages[:] = np.random.default_rng(12).normal(size=(3, KEPT))
        set_policy_gradient(agent, first)
        parts.append(agent.adam.gradient.copy())
        lengths = np.minimum(agent.episodes.lengths, KEPT)
        counts.append(sum(len(range(first, length, 3)) for length in lengths))
    whole = filled_agent(stride=1)
    whole.episodes.advantages[:] = np.random.default_rng(12).normal(size=(3, KEPT))
    set_policy_gradient(whole, 0)
    assert np.average(parts, 0, counts) == pytest.approx(whole.adam.gradient, rel=1e-9, abs=1e-12)
    assert not np.allclose(parts[0], parts[1])


@pytest.mark.parametrize(
    ("factor", "importance"), [(0.5, 1.0), (1.0, 1.0), (2.0, 0.5), (4.0, 0.25)]
)
def test_importance_is_the_ratio_of_probabilities_and_at_most_one(factor, importance):
    gradients = []
    for each in (1.0, factor):
        agent = filled_agent()
        agent.episodes.advantages[:] = 1.0
        agent.episodes.probabilities[:] *= each
        set_policy_gradient(agent, 0)
        gradients.append(agent.adam.gradient.copy())
    assert np.abs(gradients[0]).max() > 1e-3
    assert gradients[1] == pytest.approx(importance * gradients[0], rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("weight_decay", [0.0, 0.01])
def test_ascend_is_adam_with_weight_decay(weight_decay):
    settings = {"learning_rate": 0.02, "beta1": 0.9, "beta2": 0.99, "weight_decay": weight_decay}
    agent, rng = filled_agent(**settings), np.random.default_rng(11)
    weights, mean, square = agent.adam.weights.copy(), 0.0, 0.0
    for t in range(1, 8):
        gradient = rng.normal(size=176)
        agent.adam.gradient[:] = gradient
        ascend(agent.adam)
        mean = 0.9 * mean + 0.1 * gradient
        square = 0.99 * square + 0.01 * gradient**2
        step = (mean / (1 - 0.9**t)) / (np.sqrt(square / (1 - 0.99**t)) + 1e-8)
        weights = (1 - weight_decay) * (weights + 0.02 * step)
        assert agent.adam.weights == pytest.approx(weights, rel=1e-10, abs=1e-13)


def test_an_update_makes_as_many_steps_of_adam_as_it_has_epochs():
    agent = filled_agent(epochs=4)
    agent.end_trial(True)
    assert agent.adam.steps[0] == 4


def test_a_success_changes_nothing():
    agent = filled_agent()
    before = agent.adam.weights.copy()
    agent.end_trial(False)
    assert np.array_equal(agent.adam.weights, before)
    agent.end_trial(True)
    assert not np.array_equal(agent.adam.weights, before)


# ------------------------------------------------------------------------------ settings


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"learning_rate": 0.0}, "learning_rate is 0.0; it must be a number, at least 1e-09"),
        ({"learning_rate": math.inf}, "learning_rate is inf; it must be a number, at least 1e-09"),
        ({"discount": 1.1}, "discount is 1.1; it must be a number, at least 0 and at most 1"),
        ({"discount": math.nan}, "discount is nan;"),
        ({"baseline": "none"}, "baseline is 'none'; it must be one of mean, fitted"),
        ({"episodes": 0}, "episodes is 0; it must be a whole number, at least 1"),
        ({"kept_steps": 2.5}, "kept_steps is 2.5; it must be a whole number"),
        ({"epochs": -1}, "epochs is -1;"),
        ({"beta1": 1.0}, "beta1 is 1.0;"),
        ({"beta2": 1.0}, "beta2 is 1.0;"),
        ({"weight_decay": -0.1}, "weight_decay is -0.1;"),
        ({"init_std": -1.0}, "init_std is -1.0; it must be a number, at least 0"),
        ({"logit_scale": 0.0}, "logit_scale is 0.0;"),
        ({"theta_scale": 0.0}, "theta_scale is 0.0;"),
        ({"x_scale": "1"}, "x_scale is '1'; it must be a number"),
    ],
    ids=str,
)
def test_impossible_settings_are_refused_by_name(change, message):
    with pytest.raises(UprightError) as error:
        Reinforce(**change)
    assert str(error.value).startswith(message)


@pytest.mark.parametrize("name", [each.name for each in fields(Reinforce) if each.type is int])
def test_a_whole_number_written_as_a_float_is_refused(name):
    with pytest.raises(UprightError, match=f"^{name} is 2.0; it must be a whole number"):
        Reinforce(**{name: 2.0})


def test_published_settings_are_those_of_the_report():
    published = SETTINGS["as-published"]
    assert (published.learning_rate, published.discount) == (0.1, 0.97)
    assert SETTINGS["default"] == Reinforce()


# ------------------------------------------------------------------------------ learning


@pytest.mark.parametrize("noise", ["none", "gaussian-0.2"])
def test_it_learns_to_balance(noise):
    case = make_case("reinforce", noise=noise)
    results = [make_run(case, 1, run)[1] for run in range(20)]
    assert all(result.success for result in results)
    assert np.mean([result.trials for result in results]) < 16


def test_published_settings_run_and_learn_something():
    case = make_case("reinforce", "as-published", steps=5000, trials=60)
    for run in range(3):
        agent, result = make_run(case, 1, run)
        assert result.trials == 60 or result.success
        assert np.isfinite(agent.adam.weights).all()
        assert agent.adam.steps[0] == result.trials - result.success
