"""What is relied on of Numba: these tests tell what a new version has moved."""

from typing import NamedTuple

import numpy as np
import pytest

from upright.builds import numba_inside
from upright.builds.machine import Function
from upright.builds.memory import Memory
from upright.builds.numba_inside import lower
from upright.core.compiled import compiled
from upright.errors import UprightError

ARRAY = ["ptr", "ptr", "i64", "i64", "ptr"]
"""Of every array: what Python owns, size, size of an element, and data; then shape and strides."""


class Parts(NamedTuple):
    rate: float
    on: bool
    table: np.ndarray
    counts: tuple[int, ...]
    rig: None


def parts(table=None):
    return Parts(0.5, True, np.ones((2, 3)) if table is None else table, (4, 5), None)


@compiled
def total(parts, factor):
    found = 0.0
    for i in range(parts.table.shape[0]):
        for k in range(parts.table.shape[1]):
            found += parts.table[i, k]
    return found * parts.rate * factor


def test_arguments_are_flattened_in_this_order():
    leaves = lower(total, {"parts": parts(), "factor": 3}).leaves
    assert [leaf.kind for leaf in leaves] == [
        *("double", "i8", *ARRAY, "i64", "i64", "i64", "i64"),
        *("i64", "i64", "ptr", "i64"),
    ]
    assert [leaf.value for leaf in leaves if leaf.fixed] == [6, 8, 2, 3, 24, 8]
    named = {leaf.name: leaf.value for leaf in leaves if leaf.kind in ("double", "i8")}
    assert named == {"parts.rate": 0.5, "parts.on": True}
    assert leaves[-1] == ("factor", "i64", 3, False)


def test_the_code_is_text_with_the_function_in_it():
    lowered = lower(total, {"parts": parts(), "factor": 3})
    assert lowered.result == "double"
    assert "target triple" in lowered.text
    assert "target datalayout" in lowered.text
    assert f'@"{lowered.symbol}"(' in lowered.text or f"@{lowered.symbol}(" in lowered.text
    assert " x double>" not in lowered.text  # it is not for the vectors of this processor


def test_another_order_is_noticed(monkeypatch):
    real = numba_inside.leaves_of
    monkeypatch.setattr(numba_inside, "leaves_of", lambda *given: reversed([*real(*given)]))
    with pytest.raises(UprightError, match=r"passes arguments in a way that is not known here"):
        lower(total, {"parts": parts(), "factor": 3})


def test_memory_holds_numbers_then_arrays():
    whole = np.zeros(8)
    view = whole[2:].reshape(2, 3)
    function = Function(lower(total, {"parts": parts(view), "factor": 3}), ("factor",))
    other = lower(total, {"parts": parts(), "factor": 3})
    renamed = [leaf._replace(name=f"other.{leaf.name}") for leaf in other.leaves]
    memory = Memory([*function.leaves(), *renamed])
    assert "factor" not in memory.places
    assert memory.places["parts.table"].shape == (2, 3)
    # Arrays of zeros come last, and a view lies in what it is a view of.
    ones = memory.offset("other.parts.table")
    assert memory.offset("parts.table") == ones + 6 * 8 + 2 * 8
    assert memory.size == ones + 6 * 8 + 8 * 8
    assert np.frombuffer(memory.initial[ones:].ljust(48, b"\0")).tolist() == [1.0] * 6
    assert np.frombuffer(memory.initial[:8]).tolist() == [0.5]
