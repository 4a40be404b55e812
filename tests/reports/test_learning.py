from dataclasses import replace

import pytest
from helpers import ROOT

import upright

PLAIN = "examples.plain_agent:PlainAgent"


@pytest.fixture(scope="module")
def learned():
    return upright.learn("q-learning", noise="sensor-5", steps=300, seed=3)


def test_it_unpacks_as_a_policy_and_a_result(learned):
    policy, result = learned
    assert (policy, result) == (learned.policy, learned.result)


def test_a_frame_has_a_row_for_each_trial(learned):
    frame = learned.frame()
    assert frame["steps"].tolist() == learned.result.lengths.tolist()
    assert frame["trial"].tolist() == list(range(1, learned.result.trials + 1))
    assert frame["fallen"].tolist() == [True] * (learned.result.trials - 1) + [False]


def test_in_a_run_that_fails_every_trial_ends_in_a_fall():
    assert (
        upright.learn("q-learning", steps=5000, trials=2).frame()["fallen"].tolist() == [True] * 2
    )


def test_settings_are_named_or_changed():
    policy, _ = upright.learn("random-search", {"x_scale": 2}, steps=300, seed=3)
    assert policy.settings == replace(upright.AGENTS.default("random-search"), x_scale=2.0)
    with pytest.raises(upright.UprightError, match="settings is 3; it must be one of default"):
        upright.learn("random-search", 3)


def test_it_is_drawn_and_a_notebook_shows_the_figure(learned):
    assert learned.plot()._repr_png_().startswith(b"\x89PNG")


def test_it_is_shown_short_and_as_html(learned):
    assert len(repr(learned)) < 300
    shown = learned._repr_html_()
    assert ">q-learning</td>" in shown
    assert f">{learned.result.trials}</td>" in shown
    assert "300 of 300 steps" in shown


def test_an_agent_in_plain_python_learns_and_is_played(monkeypatch):
    monkeypatch.syspath_prepend(ROOT)
    policy, result = upright.learn(PLAIN, steps=60, trials=200)
    assert result.success
    assert policy.memory.weights
    assert len(upright.play(policy, 2)) == 2


def test_a_class_stands_for_its_path(monkeypatch):
    monkeypatch.syspath_prepend(ROOT)
    from examples.plain_agent import PlainAgent

    assert upright.make_case(PlainAgent) == upright.make_case(PLAIN)
    assert upright.learn(PlainAgent, steps=60, trials=200).policy.agent == PLAIN
