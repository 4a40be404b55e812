import doctest

import pytest

import upright
from upright.core.parameters import Parameters
from upright.core.task import TaskSpec
from upright.errors import UprightError
from upright.reports import sweeps
from upright.reports.sweeps import UNITS, choose_swept, swept


def tasks(**parameters):
    """Return a task for each value of these parameters, which all have as many."""
    names = list(parameters)
    every = zip(*parameters.values(), strict=True)
    return [TaskSpec(parameters=dict(zip(names, values, strict=True))) for values in every]


def test_the_examples_are_true():
    found = doctest.testmod(sweeps, extraglobs={"upright": upright})
    assert found.attempted
    assert not found.failed


def test_every_parameter_has_a_unit():
    assert list(UNITS) == list(Parameters._fields)
    assert UNITS["half_length"] == "m"
    assert all(UNITS.values())


def test_what_is_swept_is_what_differs_the_usual_value_included():
    assert swept([]) == swept([TaskSpec()]) == swept(tasks(force=[5, 5])) == []
    assert swept([*tasks(force=[5]), TaskSpec()]) == ["force"]
    assert swept(tasks(force=[5, 6], cart_mass=[1, 2])) == ["cart_mass", "force"]


def test_one_parameter_is_found_and_of_several_one_is_chosen():
    assert choose_swept(tasks(force=[5, 6]), None) == "force"
    several = tasks(force=[5, 6], cart_mass=[1, 2])
    assert choose_swept(several, "cart_mass") == "cart_mass"
    with pytest.raises(UprightError, match=r"^runs differ in cart_mass and force; choose one"):
        choose_swept(several, None)
    with pytest.raises(
        UprightError, match=r"^parameter of a sweep is 'gravity'; it must be one of"
    ):
        choose_swept(several, "gravity")


@pytest.mark.parametrize("name", [None, "force"])
def test_without_a_sweep_the_error_says_how_to_make_one(name):
    with pytest.raises(UprightError, match=r"upright table --parameter half_length=0.25:2:8"):
        choose_swept([TaskSpec(), TaskSpec(noise="sensor-5")], name)
