import sys

import gymnasium
import numpy as np
import pytest
from helpers import POOR_WEIGHTS, ROOT, LinearAgent

from upright.core import trials
from upright.errors import UprightError
from upright.studies.case import make_case

sys.path.insert(0, str(ROOT))

from examples import agents_on_gymnasium
from examples.agents_on_gymnasium import GymnasiumBody, make_run


def test_adaptive_lqr_balances_the_cart_pole_of_gymnasium():
    """For four times as long as Gymnasium's episodes last by default."""
    case = make_case("adaptive-lqr", steps=2000, trials=20)
    for number in range(3):
        result = make_run("CartPole-v1", case, 0, number)
        assert result.success
        assert result.trials <= 3


@pytest.mark.parametrize("name", ["CartPole-v1", "upright/CartPole-v0"])
def test_trials_are_the_episodes_of_the_environment(name):
    """An agent falls where the environment ends an episode, never a step sooner or later."""
    env = gymnasium.make(name)
    observation, _ = env.reset(seed=5)
    episodes = []
    for _ in range(300):
        observation, _ = env.reset()
        episodes.append(0)
        fallen = False
        while not fallen:
            observation, _, fallen, _, _ = env.step(int(observation @ POOR_WEIGHTS > 0))
            episodes[-1] += 1

    task = make_case("random-search", steps=500, trials=300).spec.task()
    agent, body = LinearAgent(*POOR_WEIGHTS), GymnasiumBody(name, 500, 5)
    lengths = np.zeros(300, np.int64)
    trials.run(agent, body, task, np.random.default_rng(0), lengths, np.zeros(1, np.bool_))
    assert lengths.tolist() == episodes
    assert len(set(episodes)) > 10


def test_runs_differ_and_can_be_repeated():
    case = make_case("random-search", steps=100, trials=100)
    first, again, other = (make_run("CartPole-v1", case, 0, number) for number in (0, 0, 1))
    assert first.lengths.tolist() == again.lengths.tolist() != other.lengths.tolist()


def test_an_environment_of_another_kind_is_refused():
    with pytest.raises(UprightError, match="env is 'Acrobot-v1'; it must have"):
        GymnasiumBody("Acrobot-v1", 100, 0)


def test_the_environment_tells_when_the_pole_has_fallen():
    """By its own limits, whatever the limits of the task are."""
    task, lengths = make_case("random-search", steps=200).spec.task(), []
    for limit in (0.2, 0.1):
        body = GymnasiumBody("CartPole-v1", 200, 0)
        body.env.unwrapped.theta_threshold_radians = limit
        agent, rng = LinearAgent(*POOR_WEIGHTS), np.random.default_rng(0)
        steps, fallen = trials.trial(agent, body, task, rng)
        assert fallen
        lengths.append(steps)
    assert lengths[0] > lengths[1]


def test_the_table_is_printed(monkeypatch, capsys):
    line = "agents_on_gymnasium.py --agents adaptive-lqr,random-search --runs 2 --steps 300"
    monkeypatch.setattr(sys, "argv", line.split())
    agents_on_gymnasium.main()
    shown = capsys.readouterr().out
    assert shown.startswith("CartPole-v1\n")
    for agent in ("adaptive-lqr", "random-search"):
        assert f"\n{agent} (CartPole-v1) " in shown
    assert "2 runs per case, N = 300 steps" in shown
