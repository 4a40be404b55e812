"""NumPy's own generator is the reference: states, increments and numbers are equal."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from upright.core.compiled import compiled
from upright.core.pcg64 import LARGEST_RUN, LARGEST_SEED, Pcg64, new_stream
from upright.errors import UprightError
from upright.studies.random_streams import random_numbers

EDGES = [(0, 0), (2**32 - 1, 1), (2**32, 0), (LARGEST_SEED, LARGEST_RUN)]


def whole(halves):
    return (int(halves[0]) << 64) + int(halves[1])


def is_numpys(seed, run, draws):
    stream, rng = new_stream(seed, run), random_numbers(seed, run)
    expected = rng.bit_generator.state["state"]
    found = {"state": whole(stream.state), "inc": whole(stream.increment)}
    return found == expected and [stream.random() for _ in range(draws)] == list(rng.random(draws))


@given(st.integers(0, LARGEST_SEED), st.integers(0, LARGEST_RUN))
def test_the_stream_of_a_run_is_numpys(seed, run):
    assert is_numpys(seed, run, 20)


@pytest.mark.parametrize(("seed", "run"), EDGES)
def test_so_it_is_at_the_edges_and_for_long(seed, run):
    assert is_numpys(seed, run, 10_000)


@compiled
def drawn(rng, numbers):
    for i in range(len(numbers)):
        numbers[i] = rng.random()


def test_compiled_code_draws_the_same_of_either():
    ours, numpys = np.zeros(1000), np.zeros(1000)
    drawn(new_stream(7, 3), ours)
    drawn(random_numbers(7, 3), numpys)
    assert ours.tolist() == numpys.tolist()


def test_other_seeds_and_runs_draw_other_numbers():
    firsts = {new_stream(seed, run).random() for seed in range(20) for run in range(20)}
    assert len(firsts) == 400


@pytest.mark.parametrize(
    ("seed", "run", "words"),
    [
        (-1, 0, "seed is -1"),
        (LARGEST_SEED + 1, 0, "seed is 9223372036854775808"),
        (0.5, 0, "seed is 0.5"),
        (0, -1, "run is -1"),
        (0, LARGEST_RUN + 1, "run is 4294967296"),
    ],
)
def test_impossible_seeds_are_refused(seed, run, words):
    with pytest.raises(UprightError, match=words):
        new_stream(seed, run)


def test_arrays_of_other_sizes_are_refused():
    short = Pcg64(np.zeros(1, np.uint64), np.zeros(2, np.uint64), np.zeros(4, np.uint64))
    with pytest.raises(UprightError, match="state"):
        short.random()
