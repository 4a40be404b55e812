import doctest
from dataclasses import replace

import pytest

import upright
from upright.agents import AGENTS
from upright.agents.custom import CustomAgent
from upright.core.conditions import NOISES
from upright.core.task import TaskSpec
from upright.reports import names
from upright.reports.names import (
    AGENT_NAMES,
    agent_name,
    case_name,
    case_names,
    noise_name,
    task_name,
)
from upright.studies.case import Case, make_case


def custom(agent):
    return Case(agent, "default", CustomAgent(agent))


def test_every_agent_of_the_package_has_a_name():
    assert set(AGENT_NAMES) == set(AGENTS.built_in)
    assert len(set(AGENT_NAMES.values())) == len(AGENT_NAMES)


@pytest.mark.parametrize(
    ("agent", "name"),
    [("q-learning", "Q-learning"), ("lessons.mine:Pd", "Pd"), ("installed-one", "installed-one")],
)
def test_an_agent_has_a_name_in_words(agent, name):
    assert agent_name(agent) == name


def test_every_noise_case_has_its_own_name():
    names = [noise_name(noise) for noise in NOISES]
    assert names == [
        "without noise",
        "5 % actuator noise",
        "10 % actuator noise",
        "5 % sensor noise",
        "10 % sensor noise",
        "Gaussian sensor noise of 0.1 deg²",
        "Gaussian sensor noise of 0.2 deg²",
        "5 % noise on all measurements",
        "10 % noise on all measurements",
    ]


def test_only_what_is_unusual_in_a_task_is_named():
    assert task_name(TaskSpec(noise="sensor-5")) == ""
    assert task_name(TaskSpec(start="zero", trials=1)) == "start zero, at most 1 trial"


@pytest.mark.parametrize(
    ("case", "name"),
    [
        (make_case("reinforce"), "REINFORCE"),
        (make_case("reinforce", "as-published"), "REINFORCE, as published"),
        (make_case("q-learning", language="MATLAB"), "Q-learning (MATLAB)"),
        (
            replace(make_case("q-learning"), label="default, learning_rate=0.3"),
            "Q-learning, learning_rate=0.3",
        ),
        (replace(make_case("ndp"), label="default, seed 3"), "NDP, seed 3"),
        (custom("mine:Pd"), "Pd"),
    ],
)
def test_a_case_is_named_by_its_agent_and_what_is_unusual(case, name):
    assert case_name(case) == name


def test_a_changed_plant_is_named():
    plant = replace(make_case("ndp").plant, integrator="rk4")
    assert case_name(make_case("ndp", plant=plant)) == "NDP, integrator=rk4"


def test_classes_of_one_name_are_told_apart_by_their_modules():
    cases = [custom("mine:Pd"), custom("yours:Pd"), custom("mine:Lqr"), custom("mine:Pd")]
    assert case_names(cases) == ["mine:Pd", "yours:Pd", "Lqr", "mine:Pd"]


def test_the_examples_hold():
    result = doctest.testmod(names, extraglobs={"upright": upright})
    assert result.attempted
    assert not result.failed
