"""NaN is found wherever an agent keeps numbers, unless it was there from the beginning."""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from upright.agents.checks.missing_numbers import NumberWatch
from upright.errors import AgentError

NAN = float("nan")


class Net(NamedTuple):
    weights: np.ndarray


class Slotted:
    __slots__ = ("gain", "unset")

    def __init__(self, gain):
        self.gain = gain


def agent(**attributes):
    return SimpleNamespace(**attributes)


PLACES = {
    "gain": agent(gain=NAN),
    "small": agent(small=np.float32(NAN)),
    "w": agent(w=np.array([1.0, NAN])),
    "phase": agent(phase=np.array([NAN + 1j])),
    "layers[1]": agent(layers=[np.zeros(2), np.array([[NAN]])]),
    "values['a'][0]": agent(values={"a": [NAN]}),
    "net.weights": agent(net=Net(np.array([NAN]))),
    "part.gain": agent(part=Slotted(NAN)),
    "weights": Net(np.array([NAN])),
}
FINE = {
    "infinite": agent(w=np.array([np.inf, -np.inf]), gain=-np.inf),
    "no numbers": agent(text="nan", none=None, n=3, kind=float, work=print, rng=None),
    "integers": agent(w=np.zeros(3, np.int64), flags=np.ones(2, np.bool_)),
    "objects": agent(w=np.array([None, NAN], object)),
    "empty": agent(w=np.zeros(0), layers=[], values={}),
}


def watch(agent):
    return NumberWatch("mine:Pd", agent)


@pytest.mark.parametrize("name", PLACES)
def test_a_number_that_becomes_nan_is_named(name):
    watched = watch(agent())
    watched._agent = PLACES[name]
    with pytest.raises(AgentError) as caught:
        watched.look("run 0, trial 4")
    start = f"agent is 'mine:Pd'; its {name} is NaN (not a number) after run 0, trial 4; what is"
    assert str(caught.value).startswith(start)


@pytest.mark.parametrize("name", PLACES)
def test_a_number_that_is_nan_from_the_beginning_is_meant_to_be(name):
    watch(PLACES[name]).look("run 0, trial 4")


@pytest.mark.parametrize("fine", FINE.values(), ids=FINE)
def test_other_numbers_pass(fine):
    watched = watch(agent())
    watched._agent = fine
    watched.look("run 0, trial 4")


def test_a_circle_has_an_end():
    round_about = agent(gain=1.0)
    round_about.me = round_about.list = [round_about]
    watch(round_about).look("run 0, trial 1")


def test_looking_is_due_the_later_the_more_there_is_to_look_at():
    small, large = watch(agent(w=np.zeros(4))), watch(agent(w=np.zeros((1000, 1000))))
    assert small.is_due(50)
    assert not large.is_due(50)
    assert not large.is_due(5_000)
    assert large.is_due(10_000)
    large.look("run 0, trial 9")
    assert not large.is_due(50)
