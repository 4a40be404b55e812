"""Stable-Baselines3 on the environments; `make test-sb3` installs what it takes, some gigabytes."""

import sys
import warnings

import gymnasium
import pytest
from helpers import ROOT

from upright.studies.case import make_case
from upright.studies.run import make_run

pytest.importorskip("stable_baselines3", reason="no Stable-Baselines3 here: make test-sb3")
from stable_baselines3.common.env_checker import check_env


@pytest.mark.parametrize("noise", ["none", "gaussian-0.2"])
@pytest.mark.parametrize("name", ["upright/CartPole-v0", "upright/ContinuousCartPole-v0"])
def test_the_stable_baselines_checker_passes(name, noise):
    with warnings.catch_warnings():
        # Forces are newtons: the checker would like them within ±1.
        warnings.filterwarnings("ignore", message="We recommend you to use a symmetric and norm")
        check_env(gymnasium.make(name, noise=noise).unwrapped)


@pytest.mark.parametrize("learner", ["PPO", "DQN"])
def test_the_learners_of_the_example_run_by_the_protocol(learner, monkeypatch):
    """A run depends on its seed and number alone."""
    monkeypatch.setattr(sys, "path", [str(ROOT), *sys.path])
    case = make_case(f"examples.train_sb3:{learner}", noise="gaussian-0.2", steps=100, trials=200)
    first, again, other = (make_run(case, 0, run)[1] for run in (0, 0, 1))
    assert first.lengths.tolist() == again.lengths.tolist() != other.lengths.tolist()
    assert first.success == (first.lengths[-1] == 100)
    assert first.success or first.trials == 200
