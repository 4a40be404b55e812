from typing import NamedTuple

import numpy as np

from upright.support.short_repr import FEW, call, short_list, short_repr


class Inner(NamedTuple):
    table: np.ndarray
    count: np.ndarray


class Outer(NamedTuple):
    inner: Inner
    name: str
    rate: np.float64


def test_arrays_are_shown_by_type_and_shape_also_in_tuples_within():
    outer = Outer(Inner(np.zeros((162, 2)), np.array([7])), "a", np.float64(0.5))
    inner = "Inner(table=float64[162, 2], count=[7])"
    assert short_repr(outer) == f"Outer(inner={inner}, name='a', rate=0.5)"


def test_long_lists_keep_both_ends():
    assert short_list(np.arange(FEW)) == "[0, 1, 2, 3, 4, 5, 6, 7]"
    assert short_list(np.arange(FEW + 1)) == "[0, 1, 2, 3, ..., 6, 7, 8]"
    assert short_list(np.arange(0)) == "[]"


def test_calls():
    assert call("Case", {"steps": 3}, ["a", "b"]) == "Case('a', 'b', steps=3)"
    assert call("Case", {}) == "Case()"
