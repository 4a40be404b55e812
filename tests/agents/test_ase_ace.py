import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from upright.agents.ase_ace import NEGLIGIBLE, SETTINGS, AseAce, find_place
from upright.agents.parts.boxes import BARTO_SUTTON_ANDERSON, find_box
from upright.core.parameters import State
from upright.errors import UprightError
from upright.studies.case import make_case
from upright.studies.run import make_run

PUBLISHED = SETTINGS["as-published"]


def blank(settings, seed=1):
    return settings.agent(np.random.default_rng(seed))


def states(count, seed=2):
    rng = np.random.default_rng(seed)
    return [State(*(rng.normal(size=4) * (1.0, 0.5, 0.07, 0.6)).tolist()) for _ in range(count)]


# ------------------------------------------------------------------------------ boxes


def test_published_boxes_are_the_162():
    agent = blank(PUBLISHED)
    assert len(agent.weights) == 162
    places = itertools.product(
        (-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0), np.radians((-9, -3, -0.5, 0.5, 3, 9)), (-2.0, 0.0, 2.0)
    )
    found = [find_place(agent, State(*map(float, place))) for place in places]
    assert found == [(box, 1.0) for box in range(162)]


def test_mirror_images_share_a_place():
    agent = blank(AseAce())
    count = len(agent.weights)
    places = set()
    for state in states(2000):
        box, side = find_place(agent, state)
        assert find_place(agent, State(*(-value for value in state))) == (box, -side)
        assert box == (find_box(agent.boxes, state) if side > 0 else image(agent, state))
        places.add(box)
    assert max(places) < count / 2


def image(agent, state):
    return len(agent.weights) - 1 - find_box(agent.boxes, state)


# ------------------------------------------------------------------------------ policy


@pytest.mark.parametrize("label", SETTINGS)
def test_it_pushes_right_when_weight_plus_normal_noise_is_above_zero(label):
    settings = SETTINGS[label]
    agent = blank(settings)
    agent.weights[:] = np.random.default_rng(3).normal(0, settings.noise, len(agent.weights))
    for state in states(200):
        box, side = find_place(agent, state)
        expected = norm.cdf(side * agent.weights[box] / settings.noise)
        assert agent.push_probability(state) == pytest.approx(expected, rel=1e-9)


def test_pushes_are_as_frequent_as_their_probability():
    agent, rng = blank(PUBLISHED), np.random.default_rng(4)
    state = State(0.1, 0.2, 0.03, 0.4)
    agent.weights[find_box(agent.boxes, state)] = 0.5 * PUBLISHED.noise
    right = np.mean([agent.act(state, rng) for _ in range(20_000)])
    assert right == pytest.approx(norm.cdf(0.5), abs=0.015)


def test_an_untrained_agent_pushes_either_way():
    assert blank(AseAce()).push_probability(State(0.1, 0.2, 0.03, 0.4)) == 0.5


def test_a_weight_that_has_grown_huge_decides_alone():
    agent, state = blank(PUBLISHED), State(0.1, 0.2, 0.03, 0.4)
    for weight, right in ((1e300, 1.0), (-1e300, 0.0)):
        agent.weights[:] = weight
        assert agent.push_probability(state) == right


# ------------------------------------------------------------------------------ the rule


def random_steps(lengths, seed=5):
    """Yield steps of trials that end by falls: before, action, after, fallen."""
    rng = np.random.default_rng(seed)
    for length in lengths:
        state, *others = states(length + 1, seed=int(rng.integers(1000)))
        for number, after in enumerate(others, 1):
            yield state, bool(rng.random() < 0.5), after, number == length
            state = after


@pytest.mark.parametrize("mirrored", [False, True])
def test_steps_change_all_boxes_by_the_equations_of_the_paper(mirrored):
    """Against whole arrays in NumPy, without a list of traced boxes."""
    changed = {"critic_learning_rate": 0.4, "critic_trace_decay": 0.7}
    settings = replace(PUBLISHED, mirrored=mirrored, **changed)
    agent, rng = blank(settings), np.random.default_rng(6)
    w, v = rng.normal(size=162), -rng.random(162)
    agent.weights[:], agent.predictions[:] = w, v
    e, x_bar = np.zeros(162), np.zeros(162)
    agent.begin_trial(rng)
    for before, action, after, fallen in random_steps((4, 60, 1, 25)):
        y, box, p_after = (1 if action else -1), find_box(agent.boxes, before), 0.0
        if mirrored and box > 80:
            y, box = -y, 161 - box
        x = np.zeros(162)
        x[box] = 1
        e = 0.9 * e + 0.1 * y * x
        x_bar = 0.7 * x_bar + 0.3 * x
        if not fallen:
            next_box = find_box(agent.boxes, after)
            p_after = v[min(next_box, 161 - next_box) if mirrored else next_box]
        r_hat = (-1 if fallen else 0) + 0.95 * p_after - v[box]
        w = w + 1000 * r_hat * e
        v = v + 0.4 * r_hat * x_bar
        agent.learn(before, action, after, fallen)
        assert agent.weights == pytest.approx(w, rel=1e-10, abs=1e-8)
        assert agent.predictions == pytest.approx(v, rel=1e-10, abs=1e-10)
        if fallen:
            agent.end_trial(True)
            agent.begin_trial(rng)
            e[:], x_bar[:] = 0, 0
    assert np.abs(w).max() > 100, "something was learned"


def test_the_first_fall_by_hand():
    agent, rng = blank(PUBLISHED), np.random.default_rng(7)
    state = State(0.1, 0.2, 0.03, 0.4)
    agent.begin_trial(rng)
    agent.learn(state, True, state, True)
    box = find_box(agent.boxes, state)
    assert agent.weights[box] == pytest.approx(-100)  # α δ' = 1000 · 0.1, against the push
    assert agent.predictions[box] == pytest.approx(-0.1)  # β λ' = 0.5 · 0.2, a fall is expected
    assert np.count_nonzero(agent.weights) == np.count_nonzero(agent.predictions) == 1


def test_traces_decay_and_are_forgotten_when_negligible():
    agent, rng = blank(PUBLISHED), np.random.default_rng(8)
    here, there = State(0.1, 0.2, 0.03, 0.4), State(-1.0, 0.2, 0.03, 0.4)
    left, other = find_box(agent.boxes, here), find_box(agent.boxes, there)
    agent.begin_trial(rng)
    agent.learn(here, False, there, False)
    for steps in range(1, 240):
        push, visit = -0.1 * 0.9**steps, 0.2 * 0.8**steps
        assert agent.push_traces[left] == pytest.approx(push if -push > NEGLIGIBLE else 0.0)
        assert agent.visit_traces[left] == pytest.approx(visit, abs=1.1 * NEGLIGIBLE)
        agent.learn(there, True, there, False)
    agent.learn(there, True, there, False)
    assert agent.push_traces[left] == agent.visit_traces[left] == 0
    assert agent.traced_boxes[: agent.traced_count[0]].tolist() == [other]
    assert agent.push_traces[other] == pytest.approx(0.9)  # almost 1, faded once
    assert agent.visit_traces[other] == pytest.approx(0.8)


def test_a_new_trial_begins_without_traces():
    agent, rng = blank(PUBLISHED), np.random.default_rng(9)
    for step in random_steps((50,)):
        agent.learn(*step)
    weights = agent.weights.copy()
    agent.begin_trial(rng)
    assert not agent.push_traces.any()
    assert not agent.visit_traces.any()
    assert agent.traced_count[0] == 0
    assert np.array_equal(agent.weights, weights)


@pytest.mark.parametrize("label", SETTINGS)
def test_numbers_stay_of_a_sensible_size_while_the_pole_stands(label):
    """The smallest of double precision, at which processors slow, begin at 2e-308."""
    agent = blank(SETTINGS[label])
    for step in random_steps((40, 40, 40)):
        agent.learn(*step)
    inside = states(4, seed=11)
    for number in range(60_000):
        agent.learn(inside[number % 4], number % 2 == 0, inside[(number + 1) % 4], False)
    for array in (agent.weights, agent.predictions, agent.push_traces, agent.visit_traces):
        sizes = np.abs(array[array != 0])
        assert sizes.min(initial=1.0) > 1e-30
        assert sizes.max(initial=0.0) < 1e12


# ------------------------------------------------------------------------------ settings


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"learning_rate": -1.0}, "learning_rate is -1.0; it must be a number, at least 0"),
        ({"learning_rate": math.inf}, "learning_rate is inf;"),
        ({"critic_learning_rate": 1.1}, "critic_learning_rate is 1.1;"),
        ({"discount": 1.5}, "discount is 1.5;"),
        ({"actor_trace_decay": 1.0}, "actor_trace_decay is 1.0;"),
        ({"critic_trace_decay": -0.1}, "critic_trace_decay is -0.1;"),
        ({"noise": 0.0}, "noise is 0.0; it must be a number, at least 1e-09"),
        ({"noise": math.nan}, "noise is nan;"),
        ({"x_edges": (1.0, -1.0)}, "x_edges is (1.0, -1.0); its edges must ascend"),
        ({"theta_edges": (-1.0, 0.5)}, "theta_edges is (-1.0, 0.5); mirrored boxes need edges ali"),
        ({"x_dot_edges": (math.nan,)}, "an edge in x_dot_edges is nan; it must be a number"),
    ],
    ids=str,
)
def test_impossible_settings_are_refused_by_name(change, message):
    with pytest.raises(UprightError) as error:
        AseAce(**change)
    assert str(error.value).startswith(message)


def test_published_settings_are_those_of_the_paper():
    p = PUBLISHED
    assert (p.learning_rate, p.critic_learning_rate, p.discount) == (1000, 0.5, 0.95)
    assert (p.actor_trace_decay, p.critic_trace_decay, p.noise) == (0.9, 0.8, 0.01)
    assert not p.mirrored
    assert {name: getattr(p, name) for name in BARTO_SUTTON_ANDERSON} == BARTO_SUTTON_ANDERSON
    assert np.degrees(p.theta_edges) == pytest.approx([-6, -1, 0, 1, 6])
    assert SETTINGS["default"] == AseAce()


# ------------------------------------------------------------------------------ learning


def test_the_same_seed_gives_the_same_result():
    case = make_case("ase-ace", noise="gaussian-0.1", steps=2000, trials=60)
    lengths = [make_run(case, seed, 0)[1].lengths.tolist() for seed in (1, 1, 2)]
    assert lengths[0] == lengths[1] != lengths[2]


@pytest.mark.parametrize(("label", "mean"), [("default", 50), ("as-published", 130)])
@pytest.mark.parametrize("noise", ["none", "gaussian-0.1"])
def test_it_learns_to_balance(label, mean, noise):
    case = make_case("ase-ace", label, noise=noise)
    results = [make_run(case, 1, run)[1] for run in range(20)]
    assert all(result.success for result in results)
    assert np.mean([result.trials for result in results]) < mean
