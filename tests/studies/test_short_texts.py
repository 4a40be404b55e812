from dataclasses import replace

import numpy as np
import pytest

import upright
from upright.core.trials import Result


@pytest.mark.parametrize(
    ("case", "shown"),
    [
        (upright.make_case("reinforce"), "Case('reinforce')"),
        (
            upright.make_case("q-learning", "as-published", noise="sensor-5", steps=90),
            "Case('q-learning', 'as-published', noise='sensor-5', steps=90)",
        ),
        (
            upright.make_case("reinforce", language="MATLAB"),
            "Case('reinforce', language='MATLAB')",
        ),
        (
            upright.make_case("reinforce", parameters={"half_length": 1.0}),
            "Case('reinforce', parameters={'half_length': 1.0})",
        ),
    ],
)
def test_a_case_shows_what_is_unusual(case, shown):
    assert repr(case) == shown


def test_a_case_shows_settings_and_plant_that_are_changed():
    case = upright.make_case("q-learning")
    changed = replace(case, settings=replace(case.settings, learning_rate=0.125))
    assert repr(changed) == "Case('q-learning', settings={'learning_rate': 0.125})"
    plant = replace(upright.PLANTS.default("equations"), integrator="rk4")
    shown = "Case('q-learning', plant={'name': 'equations', 'integrator': 'rk4'})"
    assert repr(replace(case, plant=plant)) == shown


def test_a_task_shows_what_is_unusual():
    assert repr(upright.TaskSpec()) == "TaskSpec()"
    assert repr(upright.TaskSpec("none", "zero", steps=7)) == "TaskSpec(start='zero', steps=7)"


def test_a_result_shows_both_ends_of_its_trials():
    result = Result(3, False, np.arange(1, 1001), 0.123456)
    lengths = "[1, 2, 3, 4, ..., 998, 999, 1000]"
    assert repr(result) == f"Result(run=3, success=False, lengths={lengths}, seconds=0.123)"


def test_a_policy_and_a_row_show_what_they_are_about():
    policy, result = upright.learn("random-search", noise="sensor-5", steps=50, seed=1)
    shown = "Policy('random-search', noise='sensor-5', steps=50, seed=1, run=0)"
    assert repr(policy) == shown
    case = upright.make_case("random-search", noise="sensor-5", steps=50)
    row = upright.summarise(case, 1, [result])
    assert repr(row) == (
        "Row('random-search', 'default', noise='sensor-5', steps=50, runs=1, successes=1, "
        f"mean_trials={float(result.trials)})"
    )


def test_a_store_shows_how_much_it_holds(tmp_path):
    case = upright.make_case("random-search", steps=50)
    path = tmp_path / "runs.sqlite"
    with upright.Store(path) as store:
        assert repr(store) == f"Store({str(path)!r}, 0 cases, 0 runs)"
        upright.study([case], 3, store=store)
        assert repr(store) == f"Store({str(path)!r}, 1 case, 3 runs)"
    assert repr(store) == f"Store({str(path)!r})"
    with upright.Store() as memory:
        assert repr(memory) == "Store(in memory, 0 cases, 0 runs)"
