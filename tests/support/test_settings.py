import doctest
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from upright.agents.ase_ace import AseAce
from upright.agents.q_learning import QLearning
from upright.agents.reinforce import Reinforce
from upright.errors import UprightError
from upright.support import settings
from upright.support.settings import (
    change_settings,
    combinations,
    numbers_in,
    pairs,
    sweep_settings,
    with_values,
)


def test_the_examples_are_true():
    found = doctest.testmod(settings)
    assert found.attempted
    assert not found.failed


def test_a_sweep_has_every_combination_in_the_order_of_the_values():
    found = sweep_settings(QLearning(), {"learning_rate": "0.3, 0.1", "mirrored": "True,False"})
    chosen = [(each.learning_rate, each.mirrored) for each in found]
    assert chosen == [(0.3, True), (0.3, False), (0.1, True), (0.1, False)]
    assert sweep_settings(QLearning(), {}) == [QLearning()]


@dataclass(frozen=True)
class Nothing:
    """Settings without any."""


def test_where_there_are_no_settings_the_error_says_so():
    with pytest.raises(UprightError, match="setting is 'speed'; there is none that could be named"):
        with_values(Nothing(), {"speed": 1})


def test_names_can_be_swept():
    found = sweep_settings(Reinforce(), {"baseline": "mean,fitted"})
    assert [each.baseline for each in found] == ["mean", "fitted"]


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("(-1.0, 1.0)", [(-1.0, 1.0)]),
        ("-1.0, 1.0", [(-1.0, 1.0)]),
        ("(-1.0,1.0),(-2.0, 2.0)", [(-1.0, 1.0), (-2.0, 2.0)]),
        ("0.0", [(0.0,)]),
        ("(0.0,)", [(0.0,)]),
    ],
)
def test_tuples_have_commas_of_their_own(text, values):
    assert [each.x_edges for each in sweep_settings(AseAce(), {"x_edges": text})] == values


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("0.25:2:8", ["0.25", "0.5", "0.75", "1", "1.25", "1.5", "1.75", "2"]),
        ("1:3:2", ["1", "3"]),
        ("0.1,0.25:2:2", ["0.1", "0.25", "2"]),
        (" 1 : 100 : 3 : log , 7", ["1", "10", "100", "7"]),
        ("-0.3:0.3:7", ["-0.3", "-0.2", "-0.1", "0", "0.1", "0.2", "0.3"]),
        ("0:1:4", ["0", "0.333333", "0.666667", "1"]),
        ("0.1234567:2e7:3:log", ["0.1234567", "1571.35", "2e7"]),
        ("1,x", ["1", "x"]),
    ],
)
def test_a_range_has_both_ends_as_they_are_given_and_six_digits_between(text, numbers):
    assert numbers_in("size", text) == numbers


@pytest.mark.parametrize(
    ("low", "high", "count"), [(1e-9, 1e9, 1000), (0.25, 2.0, 8), (3.0, 3.1, 50)]
)
@pytest.mark.parametrize("scale", ["", ":log"])
def test_numbers_of_a_range_ascend_by_equal_differences_or_ratios(low, high, count, scale):
    numbers = [float(text) for text in numbers_in("size", f"{low!r}:{high!r}:{count}{scale}")]
    space = np.geomspace if scale else np.linspace
    assert (numbers[0], numbers[-1]) == (low, high)
    np.testing.assert_allclose(numbers, space(low, high, count), rtol=1e-5)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0.25:2", "a range is LOW:HIGH:COUNT or"),
        ("0.25:2:8:linear", "a range is LOW:HIGH:COUNT or"),
        ("0.25:2:8:log:log", "a range is LOW:HIGH:COUNT or"),
        ("short:2:8", "LOW and HIGH must be numbers"),
        ("1:1:8", "LOW must be below HIGH"),
        ("2:1:8", "LOW must be below HIGH"),
        ("1:inf:8", "LOW must be below HIGH"),
        ("nan:1:8", "LOW must be below HIGH"),
        ("0:1:8:log", "equal ratios need LOW above 0"),
        ("1:2:1", "COUNT must be a whole number from 2 to 1,000"),
        ("1:2:2.5", "COUNT must be a whole number from 2 to 1,000"),
        ("1:2:-3", "COUNT must be a whole number from 2 to 1,000"),
        ("1:2:1001", "COUNT must be a whole number from 2 to 1,000"),
        ("1:2:9999999999", "COUNT must be a whole number from 2 to 1,000"),
        ("1:1.00001:100", "LOW and HIGH are too close for so many numbers of six digits"),
    ],
)
def test_a_range_that_cannot_be_is_refused_by_name(text, said):
    with pytest.raises(UprightError, match=f"^size is '{text}'; {said}"):
        numbers_in("size", f"3,{text}")


def test_ranges_are_for_numbers_and_whole_where_settings_are():
    found = sweep_settings(QLearning(), {"learning_rate": "0.1:0.3:3", "mirrored": "True,False"})
    assert [each.learning_rate for each in found] == [0.1, 0.1, 0.2, 0.2, 0.3, 0.3]
    assert [each.epochs for each in sweep_settings(Reinforce(), {"epochs": "1:7:3"})] == [1, 4, 7]
    with pytest.raises(UprightError, match=r"epochs is '2.5'; it must be a whole number"):
        sweep_settings(Reinforce(), {"epochs": "1:4:3"})
    with pytest.raises(UprightError, match=r"mirrored is '0:1:2'; it must be like"):
        sweep_settings(QLearning(), {"mirrored": "0:1:2"})
    with pytest.raises(UprightError, match=r"baseline is 'mean:fitted:2'"):
        sweep_settings(Reinforce(), {"baseline": "mean:fitted:2"})


def test_a_sweep_is_bounded():
    values = {name: range(100) for name in "abc"}
    with pytest.raises(UprightError, match="the sweep has 1,000,000 cases; at most 1,000 are"):
        combinations(values)
    assert len(combinations({"a": range(10), "b": range(100)})) == 1000


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"learning_rate": "0.1,"}, "learning_rate is ''"),
        ({"learning_rate": "0.1,fast"}, "learning_rate is 'fast'"),
        ({"learning_rate": "0.1,2"}, "learning_rate is 2.0"),
        ({"tempo": "1,2"}, "setting is 'tempo'"),
        ({"trace": "1,2"}, "trace is now called trace_decay"),
    ],
)
def test_a_wrong_value_in_a_sweep_is_refused_by_itself(changes, said):
    with pytest.raises(UprightError, match=said):
        sweep_settings(QLearning(), changes)


def test_a_name_given_twice_is_refused():
    texts = ["learning_rate=0.1", "learning-rate=0.3"]
    with pytest.raises(UprightError, match=r"'learning-rate=0.3'; learning_rate is given twice"):
        list(pairs("--set", texts))


def test_values_may_be_numbers_of_numpy_and_lists():
    changed = with_values(QLearning(), {"learning_rate": np.float64(0.5), "x_edges": [-1.0, 1.0]})
    assert changed == QLearning(learning_rate=0.5, x_edges=(-1.0, 1.0))
    assert type(changed.learning_rate) is float


@pytest.mark.parametrize(
    "text", ["-" * 3000 + "1", "(" * 3000, "[" * 90 + "]" * 90, "1+" * 3000 + "1"]
)
def test_values_nested_deep_are_refused_in_one_short_line(text):
    for name, like in (("x_edges", r"\(-1.6, 1.6\)"), ("mirrored", "True")):
        with pytest.raises(
            UprightError, match=rf"^{name} is '.*'; it must be like {like}$"
        ) as error:
            change_settings(QLearning(), {name: text})
        assert len(str(error.value)) < 300


def test_texts_of_values_are_bounded():
    with pytest.raises(
        UprightError, match=r"^--set is 'x=0,0.*'; it has 10,003 characters; at most"
    ):
        list(pairs("--set", ["x=" + "0," * 5000 + "0"]))


@given(st.text(max_size=30) | st.integers().map(str) | st.floats().map(str))
def test_any_text_is_a_value_or_refused(text):
    for name in ("learning_rate", "replay_size", "mirrored", "x_edges"):
        try:
            found = change_settings(QLearning(), {name: text})
        except UprightError:
            found = QLearning()
        assert type(getattr(found, name)) is type(getattr(QLearning(), name))
