import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from helpers import arrays

from upright.agents.ndp import (
    PROMISING_STEPS,
    SETTINGS,
    STALLED_STEPS,
    STALLED_TRIALS,
    DirectNDP,
    squash,
)
from upright.core.parameters import State
from upright.errors import UprightError
from upright.policies.files import load_policy, save_policy
from upright.studies.case import make_case
from upright.studies.learned import learned_policy
from upright.studies.run import make_run

HERE, THERE = State(0.4, -0.9, 0.06, 0.5), State(0.3, -1.2, 0.08, 0.9)
LAYERS = ("layer_1", "layer_2")


def make(seed=1, **settings):
    return replace(SETTINGS["default"], **settings).agent(np.random.default_rng(seed))


def weights(agent):
    """Return copies of the action network's two layers and of the critic's."""
    return [getattr(net, layer).copy() for net in (agent.action, agent.critic) for layer in LAYERS]


# ------------------------------------------------------------------------------ NumPy twin


def phi(y):
    return (1 - np.exp(-y)) / (1 + np.exp(-y))


def network(inputs, layer_1, layer_2):
    return (phi(inputs @ layer_1) @ layer_2.T).item()


def cost(w, inputs):
    """Return J for the push that the action network wants."""
    return network(np.append(inputs, phi(network(inputs, *w[:2]))), *w[2:])


def differences(error, w, which):
    """Return the gradient of `error` of all weights along those of one network."""
    gradients = []
    for layer in which:
        gradient = np.zeros_like(w[layer])
        for place in np.ndindex(gradient.shape):
            ends = []
            for shift in (1e-5, -1e-5):
                shifted = [each.copy() for each in w]
                shifted[layer][place] += shift
                ends.append(error(shifted))
            gradient[place] = (ends[0] - ends[1]) / 2e-5
        gradients.append(gradient)
    return gradients


class Twin:
    """The rule in NumPy, its gradients by finite differences."""

    def __init__(self, settings, agent):
        self.s, self.w, self.steps = settings, weights(agent), 0

    def move(self, error, threshold, cycles, which, rate):
        for _ in range(cycles):
            if error(self.w) <= threshold:
                break
            for layer, gradient in zip(which, differences(error, self.w, which), strict=True):
                self.w[layer] -= rate * gradient
        for layer in which:
            top = np.abs(self.w[layer]).max()
            if self.s.weight_limit and top > self.s.weight_limit:
                self.w[layer] /= top

    def learn(self, before, after, fallen):
        s = self.s
        reinforcement = -1 if fallen else 0
        rate = max(s.rate_floor, s.learning_rate - s.rate_decrement * (self.steps // 5))
        then = cost(self.w, before)
        self.move(
            lambda w: 0.5 * (s.discount * cost(w, after) - (then - reinforcement)) ** 2,
            s.critic_threshold,
            s.critic_cycles,
            (2, 3),
            rate,
        )
        self.move(
            lambda w: 0.5 * cost(w, after) ** 2,
            s.action_threshold,
            s.action_cycles,
            (0, 1),
            rate,
        )
        self.steps += 1


def scaled(agent, state):
    return np.array(state) / agent.scales


# ------------------------------------------------------------------------------ networks


def test_unit_outputs_are_those_of_the_paper():
    for y in np.concatenate([np.linspace(-36, 36, 99), [1e-9, 0.3, -0.3]]).tolist():
        assert squash(y) == pytest.approx(math.tanh(y / 2), rel=2e-15)
    assert squash(1e9) == -squash(-1e9) == 1
    assert squash(0.0) == 0


@pytest.mark.parametrize("label", SETTINGS)
def test_the_push_is_the_sign_of_the_action_network(label):
    agent, rng = SETTINGS[label].agent(np.random.default_rng(2)), np.random.default_rng(3)
    pushes = set()
    for _ in range(50):
        agent.begin_trial(rng)
        seen = State(*(agent.scales * rng.normal(size=4)).tolist())
        right = network(scaled(agent, seen), *weights(agent)[:2]) >= 0
        assert agent.act(seen, rng) == right
        assert agent.push_probability(seen) == float(right)
        pushes.add(right)
    assert pushes == {True, False}


def test_evaluating_the_policy_changes_nothing():
    agent, rng = make(), np.random.default_rng(4)
    agent.begin_trial(rng)
    agent.learn(HERE, agent.act(HERE, rng), THERE, False)
    before = [array.copy() for array in arrays(agent)]
    agent.push_probability(HERE)
    assert all(map(np.array_equal, before, arrays(agent)))


# ------------------------------------------------------------------------------ learning rule


@pytest.mark.parametrize("fallen", [False, True])
@pytest.mark.parametrize("part", ["critic", "action"])
def test_one_cycle_descends_the_gradient_of_the_error(part, fallen):
    """Against finite differences: the critic's weights, and the action's through the critic."""
    cycles = {"critic_cycles": int(part == "critic"), "action_cycles": int(part == "action")}
    agent = make(critic_threshold=0.0, action_threshold=0.0, weight_limit=0.0, **cycles)
    agent.begin_trial(np.random.default_rng(5))
    w = weights(agent)
    agent.learn(HERE, agent.act(HERE, None), THERE, fallen)
    here, there = scaled(agent, HERE), scaled(agent, THERE)
    target, alpha = cost(w, here) + fallen, agent.discount

    def critic_error(v):
        return 0.5 * (alpha * network(np.append(there, u), *v[2:]) - target) ** 2

    u = phi(network(there, *w[:2]))
    errors = {"critic": critic_error, "action": lambda v: 0.5 * cost(v, there) ** 2}
    moved = (2, 3) if part == "critic" else (0, 1)
    gradient = differences(errors[part], w, moved)
    assert max(np.abs(g).max() for g in gradient) > 1e-3
    learned = weights(agent)
    for layer, g in zip(moved, gradient, strict=True):
        change = (learned[layer] - w[layer]) / -SETTINGS["default"].learning_rate
        assert change == pytest.approx(g, abs=1e-8)
    for layer in {0, 1, 2, 3} - set(moved):
        assert np.array_equal(learned[layer], w[layer])


@pytest.mark.parametrize("label", SETTINGS)
def test_a_few_steps_by_hand(label):
    """Cycles, thresholds, limits and the learning rate together."""
    settings = replace(SETTINGS[label], learning_rate=0.2, critic_cycles=3, action_cycles=4)
    settings = replace(settings, weight_limit=settings.weight_limit and 0.99 * settings.init_range)
    rng = np.random.default_rng(6)
    agent = settings.agent(rng)
    agent.begin_trial(rng)
    twin, moved = Twin(settings, agent), 0
    states = [State(*(agent.scales * rng.normal(size=4)).tolist()) for _ in range(12)]
    for number, (before, after) in enumerate(pairwise(states)):
        old = weights(agent)
        agent.learn(before, agent.act(before, rng), after, number == 10)
        twin.learn(scaled(agent, before), scaled(agent, after), number == 10)
        for ours, theirs in zip(weights(agent), twin.w, strict=True):
            assert ours == pytest.approx(theirs, abs=1e-5)
        moved += not all(map(np.array_equal, old, weights(agent)))
    assert moved > 5


def test_nothing_is_learned_below_the_thresholds():
    agent, rng = make(critic_threshold=1e9, action_threshold=1e9), np.random.default_rng(7)
    agent.begin_trial(rng)
    before = weights(agent)
    agent.learn(HERE, agent.act(HERE, rng), THERE, True)
    assert all(map(np.array_equal, before, weights(agent)))


@pytest.mark.parametrize("restarts", [False, True])
def test_the_learning_rate_falls_to_its_floor(restarts):
    """Read off the weights: with one cycle, a step moves them by the rate times the gradient."""
    published = SETTINGS["as-published"]
    agent = make(
        hidden=6,
        learning_rate=published.learning_rate,
        rate_decrement=published.rate_decrement,
        rate_interval=published.rate_interval,
        rate_floor=published.rate_floor,
        rate_restarts=restarts,
        critic_cycles=1,
        action_cycles=0,
        critic_threshold=0.0,
        redraw="never",
        weight_limit=0.0,
    )
    rates = []
    for length in (32, 3):
        agent.begin_trial(np.random.default_rng(8))
        agent.act(HERE, None)
        for _ in range(length):
            w, here = weights(agent), scaled(agent, HERE)
            agent.learn(HERE, True, HERE, True)
            inputs = np.append(here, phi(network(here, *w[:2])))
            j = network(inputs, *w[2:])
            slope = 0.95 * (0.95 * j - (j + 1)) * phi(inputs @ w[2])
            moves = (w[3] - weights(agent)[3])[0]
            rates.append(np.mean(moves / slope))
        agent.end_trial(True)
    first = np.repeat([0.3, 0.25, 0.2, 0.15, 0.1, 0.05, 0.005], 5)[:32].tolist()
    assert rates == pytest.approx(first + 3 * [0.3 if restarts else 0.005], rel=1e-6)


# ------------------------------------------------------------------------------ fresh weights


def redrawn(redraw, lengths):
    """Return for each trial whether its weights were drawn when it began."""
    agent, rng = make(redraw=redraw, critic_cycles=0, action_cycles=0), np.random.default_rng(9)
    drawn = []
    for length in lengths:
        before = weights(agent)
        agent.begin_trial(rng)
        changed = [not np.array_equal(*pair) for pair in zip(before, weights(agent), strict=True)]
        assert len(set(changed)) == 1, "all layers or none"
        drawn.append(changed[0])
        for step in range(length):
            agent.learn(HERE, agent.act(HERE, rng), THERE, step == length - 1)
        agent.end_trial(True)
    return drawn


def test_weights_are_drawn_always_or_never():
    assert redrawn("always", [9] * 3) == [True] * 3
    assert redrawn("never", [9] * 20) == [False] * 20


def test_weights_are_drawn_when_learning_has_stalled():
    assert (STALLED_TRIALS, STALLED_STEPS) == (6, 5)
    for lengths, when in (
        ([9] * 14, [6, 12]),
        ([9, 14, 9, 14, 9, 14, 9], [6]),
        ([9, 15, 9, 15, 9, 15, 9, 15], []),
        ([30, 9, 10, 11, 12, 13, 14, 14, 14, 14, 14, 14, 14], [7, 13]),
    ):
        drawn = redrawn("stalled", [*lengths, 1])
        assert [i for i, d in enumerate(drawn) if d] == when


def test_weights_are_kept_while_trials_get_longer():
    assert PROMISING_STEPS == 100
    for lengths, kept in (
        ([1, 99, 9], []),
        ([100, 9, 9], [1]),
        ([100, 100, 9, 9], [1]),
        ([100, 101, 102, 9, 101, 9], [1, 2, 3, 5]),
        ([300, 200, 201, 9], [1, 3]),
    ):
        drawn = redrawn("unpromising", [*lengths, 1])
        assert [i for i, d in enumerate(drawn) if not d] == kept


def test_fresh_weights_are_uniform():
    agent, rng = make(redraw="always", init_range=0.7), np.random.default_rng(10)
    drawn = []
    for _ in range(300):
        agent.begin_trial(rng)
        drawn.append(np.concatenate([layer.ravel() for layer in weights(agent)]))
    for values in (drawn, [np.concatenate([w.ravel() for w in weights(make(init_range=0.7))])]):
        assert 0.55 < np.abs(values).max() <= 0.7
    assert np.var(drawn) == pytest.approx(0.7**2 / 3, rel=0.05)
    assert np.abs(np.mean(drawn, axis=0)).max() < 0.12


# ------------------------------------------------------------------------------ settings


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"hidden": 0}, "hidden is 0; it must be a whole number, at least 1"),
        ({"hidden": 4.0}, "hidden is 4.0; it must be a whole number"),
        ({"learning_rate": -0.1}, "learning_rate is -0.1; it must be a number, at least 0"),
        ({"rate_decrement": math.nan}, "rate_decrement is nan;"),
        ({"rate_interval": 0}, "rate_interval is 0; it must be a whole number, at least 1"),
        ({"rate_floor": -1.0}, "rate_floor is -1.0;"),
        ({"critic_cycles": -1}, "critic_cycles is -1;"),
        ({"action_cycles": 1.5}, "action_cycles is 1.5; it must be a whole number"),
        ({"critic_threshold": -0.1}, "critic_threshold is -0.1;"),
        ({"action_threshold": math.inf}, "action_threshold is inf;"),
        ({"discount": 1.1}, "discount is 1.1; it must be a number, at least 0 and at most 1"),
        ({"redraw": "often"}, "redraw is 'often'; it must be one of always, never, stalled, unp"),
        ({"init_range": -2.0}, "init_range is -2.0;"),
        ({"weight_limit": -1.0}, "weight_limit is -1.0;"),
        ({"x_scale": 0.0}, "x_scale is 0.0; it must be a number, at least 1e-09"),
        ({"theta_dot_scale": "1"}, "theta_dot_scale is '1'; it must be a number, at least 1e-09"),
    ],
    ids=str,
)
def test_impossible_settings_are_refused_by_name(change, message):
    with pytest.raises(UprightError) as error:
        DirectNDP(**change)
    assert str(error.value).startswith(message)


def test_published_settings_are_those_of_the_paper():
    s = SETTINGS["as-published"]
    assert (s.hidden, s.discount) == (6, 0.95)
    assert (s.learning_rate, s.rate_decrement, s.rate_interval, s.rate_floor) == (
        0.3,
        0.05,
        5,
        5e-3,
    )
    assert (s.critic_cycles, s.action_cycles) == (50, 100)
    assert (s.critic_threshold, s.action_threshold) == (0.05, 0.005)
    assert SETTINGS["default"] == DirectNDP()


# ------------------------------------------------------------------------------ learning


def mean_trials(case, runs):
    results = [make_run(case, 1, run)[1] for run in range(runs)]
    assert all(result.success for result in results)
    return np.mean([result.trials for result in results])


@pytest.mark.parametrize("noise", ["none", "gaussian-0.2"])
def test_it_learns_to_balance(noise):
    assert mean_trials(make_case("ndp", noise=noise, steps=60_000), 20) < 18


def test_without_learning_it_guesses_and_needs_longer():
    case = make_case("ndp", steps=10_000)
    off = replace(case, settings=replace(case.settings, critic_cycles=0, action_cycles=0))
    assert mean_trials(off, 150) > 1.25 * mean_trials(case, 150)


def test_a_seed_gives_the_same_run_again():
    case = make_case("ndp", noise="gaussian-0.2", steps=3000)
    first, second = (make_run(case, 5, 3) for _ in range(2))
    assert np.array_equal(first[1].lengths, second[1].lengths)
    assert all(map(np.array_equal, arrays(first[0]), arrays(second[0])))


def test_a_policy_read_back_balances_alike(tmp_path):
    case = make_case("ndp", steps=3000)
    policy = learned_policy(case, 5, 3, make_run(case, 5, 3)[0])
    save_policy(tmp_path / "policy.npz", policy)
    again = load_policy(tmp_path / "policy.npz")
    pushes = set()
    for point in np.random.default_rng(11).normal(0, 0.2, (100, 4)):
        pushes.add(policy.push_probability(point))
        assert again.push_probability(point) == policy.push_probability(point)
    assert pushes == {0.0, 1.0}


def test_published_settings_run():
    result = make_run(make_case("ndp", "as-published", steps=3000), 1, 0)[1]
    assert result.success
    assert result.trials > 1
