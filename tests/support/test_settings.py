import doctest

import numpy as np
import pytest

from upright.agents.ase_ace import AseAce
from upright.agents.q_learning import QLearning
from upright.agents.reinforce import Reinforce
from upright.errors import UprightError
from upright.support import settings
from upright.support.settings import combinations, pairs, sweep_settings, with_values


def test_the_examples_are_true():
    found = doctest.testmod(settings)
    assert found.attempted
    assert not found.failed


def test_a_sweep_has_every_combination_in_the_order_of_the_values():
    found = sweep_settings(QLearning(), {"learning_rate": "0.3, 0.1", "mirrored": "True,False"})
    chosen = [(each.learning_rate, each.mirrored) for each in found]
    assert chosen == [(0.3, True), (0.3, False), (0.1, True), (0.1, False)]
    assert sweep_settings(QLearning(), {}) == [QLearning()]


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
