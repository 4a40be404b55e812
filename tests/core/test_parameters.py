"""Parameters of the plant, from the name to every plant that is made of them."""

import json
import re

import numpy as np
import pytest
from helpers import PUSHES, trajectory

import upright
from upright.core.parameters import Parameters
from upright.plants.equations import equations
from upright.plants.settings import RunContext
from upright.policies.files import read_header

LONG = {"half_length": 1.0, "pole_mass": 0.3, "cart_mass": 1.5}
"""A pole of two metres, heavier, on a heavier cart."""
SIMULATORS = ["mujoco", pytest.param("gazebo", marks=[pytest.mark.gazebo, pytest.mark.slow])]


def moved(plant, parameters):
    """Return the states that a plant with these parameters goes through under a constant push."""
    spec = upright.TaskSpec(parameters=parameters)
    context = RunContext(spec.task(), spec, 0, np.zeros(1, np.bool_))
    made, _ = upright.PLANTS.default(plant).make(context)
    try:
        return trajectory(made, PUSHES["constant"][:20])
    finally:
        made.close()


@pytest.mark.parametrize("plant", SIMULATORS)
def test_a_simulator_moves_as_the_equations_do_with_changed_parameters(plant):
    parameters = Parameters(**LONG)
    states = moved(plant, parameters)
    exact = trajectory(equations(parameters, "rk4"), PUSHES["constant"][:20])
    usual = trajectory(equations(integrator="rk4"), PUSHES["constant"][:20])
    assert np.abs(states - exact).max() < 0.02
    assert np.abs(exact - usual).max() > 0.3, "the parameters must matter for this to mean anything"


@pytest.mark.parametrize("name", Parameters._fields)
def test_every_parameter_is_a_part_of_a_run_s_key(name):
    usual = upright.make_case("random-search")
    value = 1.5 * getattr(Parameters(), name) or 1.5
    changed = upright.make_case("random-search", parameters={name: value})
    assert changed.key != usual.key
    assert json.loads(changed.key)["task"]["parameters"] == {name: value}


def test_a_policy_plays_on_the_pole_that_it_learned_on(tmp_path):
    policy, _ = upright.learn("adaptive-lqr", steps=300, parameters=LONG)
    path = tmp_path / "policy.npz"
    upright.save_policy(path, policy)
    assert read_header(path)["task"]["parameters"] == LONG
    assert upright.load_policy(path).learned_on.parameters == Parameters(**LONG)
    played = upright.play(policy, episodes=3)
    other = upright.play(policy, episodes=3, parameters={"half_length": 0.05, "force": 40.0})
    assert all(trial.balanced for trial in played)
    assert not all(trial.balanced for trial in other)


def test_tables_name_the_parameters_that_were_changed():
    cases = [upright.make_case("random-search", steps=50, parameters=p) for p in ({}, LONG)]
    results = upright.study(cases, runs=2)
    rows = [upright.summarise(case, 0, results[case]) for case in cases]
    text = upright.render(rows, "text", width=1000)
    head, _, *lines = (re.split(r" {2,}", line) for line in text.splitlines()[:4])
    for name, value in LONG.items():
        (column,) = [k for k, title in enumerate(head) if title.startswith(f"{name} [")]
        usual = getattr(Parameters(), name)
        assert sorted(float(line[column]) for line in lines) == sorted([usual, value])
    assert "2 runs per case, N = 50 steps, start random, seed 0" in text
    assert [row["parameters"] for row in json.loads(upright.render(rows, "json"))] == [{}, LONG]


def test_the_integrator_is_named_where_it_is_not_the_usual_one():
    from upright.plants.equations import EquationsSettings

    case = upright.make_case("random-search", steps=50, plant=EquationsSettings("rk4"))
    row = upright.summarise(case, 0, upright.study([case], runs=2)[case])
    assert "integrator rk4" in upright.render([row], "text")


def test_parameters_are_numbers_whatever_they_are_given_as():
    whole = upright.make_case("random-search", parameters={"half_length": 1})
    assert whole.key == upright.make_case("random-search", parameters={"half_length": 1.0}).key


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"length": 1.0}, "parameter is 'length'; it must be one of gravity"),
        ({"half_length": 0}, "half_length is 0; it must be a number, at least 1e-12"),
        ({"half_length": "long"}, "half_length is 'long'; it must be a number"),
    ],
)
def test_impossible_parameters_are_refused_by_name(changes, named):
    with pytest.raises(upright.UprightError, match=named):
        upright.make_case("random-search", parameters=changes)


def test_rows_of_different_plants_can_be_told_apart():
    cases = [upright.make_case("random-search", steps=50, parameters=p) for p in ({}, LONG)]
    results = upright.study(cases, runs=2)
    text = upright.render([upright.summarise(c, 0, results[c]) for c in cases], "markdown")
    head, _, usual, changed, *_ = text.splitlines()
    assert "| half_length [m] |" in head
    assert "| 0.5 |" in usual
    assert "| 1 |" in changed
    alone = upright.render([upright.summarise(cases[1], 0, results[cases[1]])], "markdown")
    assert "| half_length [m] |" not in alone


def test_published_figures_are_of_the_published_plant_alone():
    cases = [upright.make_case("reinforce", trials=1000, parameters=p) for p in ({}, LONG)]
    results = [upright.Result(0, True, np.array([60_000]), 0.1)]
    usual, changed = (upright.summarise(case, 0, results) for case in cases)
    assert usual.published
    assert not changed.published


def test_boards_say_that_the_plant_is_another(tmp_path):
    from upright.reports.leaderboards import LEADERBOARD, ROBUST_BOARD, BoardPlan, make_board

    plan = BoardPlan(("random-search",), runs=1, steps=50, parameters={"half_length": 1.0})
    for board in (LEADERBOARD, ROBUST_BOARD):
        path = tmp_path / f"{board.name}.md"
        rows = make_board(board, plan._replace(output=path))
        text = path.read_text()
        assert "--parameter half_length=1.0" in text
        assert "The plant is not the published one**: half_length 1.0." in text
        assert "half_length 1.0" in board.text(rows, plan)
        assert "*Si & Wang 2001" not in text


@pytest.mark.parametrize("wrong", [3, "half_length=1", [1.0], None])
def test_parameters_of_another_kind_are_refused(wrong):
    with pytest.raises(upright.UprightError, match=r"parameters is .*; it must be Parameters, or"):
        upright.TaskSpec(parameters=wrong)


def test_parameters_may_be_given_by_name():
    assert upright.TaskSpec(parameters=LONG).parameters == Parameters(**LONG)


@pytest.mark.parametrize("value", [1e-9, 1e-12])
def test_what_mujoco_cannot_simulate_is_refused_in_one_line(value):
    with pytest.raises(upright.UprightError, match="MuJoCo refuses these parameters") as error:
        upright.learn("random-search", plant="mujoco", parameters={"half_length": value})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("value", [1e10, 10**400])
def test_parameters_beyond_reason_are_refused(value):
    with pytest.raises(upright.UprightError, match=r"cart_mass is 1.*at most 1,000,000,000"):
        upright.TaskSpec(parameters={"cart_mass": value})
