"""Methods must be there, and take what the loop passes."""

import re
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from upright.agents import AGENTS
from upright.agents.checks.contract import check_contract
from upright.errors import AgentError


class Good:
    def begin_trial(self, rng): ...
    def act(self, observation, rng): ...
    def learn(self, before, action, after, fallen): ...
    def end_trial(self, fallen): ...


def with_method(name, method):
    return type("Changed", (Good,), {name: method})()


GOOD = {
    "other names": with_method("act", lambda self, x, r: True),
    "any number": with_method("learn", lambda *_: None),
    "defaults": with_method("act", lambda self, observation, rng, greedy=False: True),
    "static": with_method("end_trial", staticmethod(lambda fallen: None)),
    "functions": SimpleNamespace(
        begin_trial=lambda rng: None,
        act=lambda observation, rng: True,
        learn=lambda before, action, after, fallen: None,
        end_trial=lambda fallen: None,
    ),
    "bound beforehand": with_method("end_trial", staticmethod(partial(print, "end"))),
    "a form of its own": with_method("push_probability", lambda self, observation: 0.5),
}
WRONG = {
    "too few": (
        with_method("learn", lambda self, observation, reward: None),
        "learn(self, observation, reward) must be learn(self, before, action, after, fallen)",
    ),
    "no self": (
        with_method("act", lambda observation, rng: True),
        "act(observation, rng) must be act(self, observation, rng)",
    ),
    "keyword only": (
        with_method("end_trial", lambda self, *, fallen: None),
        "end_trial(self, *, fallen) must be end_trial(self, fallen)",
    ),
    "optional": (
        with_method("push_probability", lambda self: 0.5),
        "push_probability(self) must be push_probability(self, observation)",
    ),
    "no method": (
        with_method("remember", 3),
        "remember is 3; it must be a method remember(self, observation, action)",
    ),
    "lacking": (
        with_method("act", None),
        "it lacks act(observation, rng); an agent has the methods begin_trial(rng), act(",
    ),
    "a class": (Good, "it returned the class Good; it must return an object of the class"),
    "a learner": (
        type("Learner", (), {"train": lambda self: None})(),
        "train(self) must be train(self, env)",
    ),
}


@pytest.mark.parametrize("agent", GOOD.values(), ids=GOOD)
def test_what_can_be_called_is_taken(agent):
    check_contract("mine:Pd", agent)


@pytest.mark.parametrize(("agent", "said"), WRONG.values(), ids=WRONG)
def test_what_cannot_be_called_is_refused_in_one_line(agent, said):
    with pytest.raises(AgentError, match=re.escape(f"agent is 'mine:Pd'; {said}")) as caught:
        check_contract("mine:Pd", agent)
    assert "\n" not in str(caught.value)


def test_all_methods_that_are_wrong_are_named():
    agent = with_method("act", lambda self: True)
    type(agent).learn = lambda self: None
    with pytest.raises(AgentError, match=r"act\(self\) must be .*; learn\(self\) must be "):
        check_contract("mine:Pd", agent)


def test_annotations_are_left_out():
    def learn(self, before: tuple[float, ...], reward: float) -> None: ...

    with pytest.raises(AgentError, match=re.escape("learn(self, before, reward) must")):
        check_contract("mine:Pd", with_method("learn", learn))


@pytest.mark.parametrize("name", AGENTS.built_in)
def test_the_package_s_own_agents_meet_the_contract(name):
    check_contract(name, AGENTS.default(name).agent(np.random.default_rng(0)))
