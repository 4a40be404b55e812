from dataclasses import fields

import numpy as np
import pytest

from upright.agents import AGENTS
from upright.agents.random_search import RandomSearch
from upright.core.parameters import State
from upright.errors import UprightError
from upright.studies.case import make_case
from upright.studies.run import make_run

SEEN = State(0.3, -0.2, 0.1, 0.4)


def test_weights_change_only_when_a_trial_begins():
    agent, rng = RandomSearch().agent(np.random.default_rng(1)), np.random.default_rng(2)
    agent.begin_trial(rng)
    weights, state = agent.weights.copy(), rng.bit_generator.state
    assert weights.all()
    for fallen in (False, True):
        agent.learn(SEEN, agent.act(SEEN, rng), SEEN, fallen)
        agent.end_trial(fallen)
    assert np.array_equal(agent.weights, weights)
    assert rng.bit_generator.state == state
    agent.begin_trial(rng)
    assert (agent.weights != weights).all()


def test_weights_are_uniform_per_unit_of_input():
    agent, rng = RandomSearch().agent(None), np.random.default_rng(3)
    drawn = []
    for _ in range(2000):
        agent.begin_trial(rng)
        drawn.append(agent.weights * agent.scales)
    assert np.abs(drawn).max() <= 1
    assert np.mean(drawn, axis=0) == pytest.approx(np.zeros(4), abs=0.06)
    assert np.var(drawn, axis=0) == pytest.approx(np.full(4, 1 / 3), rel=0.1)


def test_it_pushes_to_the_side_of_the_weighted_sum():
    agent, rng = RandomSearch().agent(None), np.random.default_rng(4)
    for _ in range(50):
        agent.begin_trial(rng)
        assert agent.act(SEEN, rng) == (np.dot(agent.weights, SEEN) > 0)


@pytest.mark.parametrize("name", [each.name for each in fields(RandomSearch)])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), "1"])
def test_impossible_settings_are_refused_by_name(name, value):
    with pytest.raises(
        UprightError,
        match=f"^{name} is .*; it must be a number, at least 1e-09 and at most 1,000,000,000$",
    ):
        RandomSearch(**{name: value})


def test_it_knows_only_its_default_settings():
    assert list(AGENTS.settings("random-search")) == ["default"]
    assert make_case("random-search", "as-published").label == "default"


def test_guessing_takes_about_as_many_trials_as_it_should():
    """The null hypothesis: the success of trials is independent, so the number is geometric."""
    results = [make_run(make_case("random-search"), 1, run)[1] for run in range(50)]
    assert all(result.success for result in results)
    trials = np.array([result.trials for result in results])
    assert 5 < trials.mean() < 25
    assert trials.std() > trials.mean() / 2
