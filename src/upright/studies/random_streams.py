"""The streams of random numbers: every one that a run draws from, in one place."""

from typing import Any

import numpy as np

from upright.studies import matlab_twin

PLANT_STREAM = 3
"""Tells the random numbers that a body draws itself from those of its run."""


def random_numbers(seed: int, run: int) -> np.random.Generator:
    """Return the stream of random numbers that is this run's own."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(run,)))


def twister(number: int) -> np.random.Generator:
    """Return the Mersenne Twister (M. Matsumoto & T. Nishimura, 1998) with this 32-bit seed."""
    seeded: Any = np.random.RandomState(number).get_state(legacy=False)
    bits = np.random.MT19937()
    bits.state = seeded
    return np.random.Generator(bits)


def twister_numbers(seed: int, run: int) -> np.random.Generator:
    """Return the stream that the MATLAB twin draws in its run of number `run + 1`.

    It is what MATLAB's rand gives after rng(10⁶ seed + run + 1).

    Raises
    ------
    UprightError
        If MATLAB has no such stream.
    """
    matlab_twin.check_seed(seed)
    return twister(10**6 * seed + run + 1)


PLAYING_STREAM = 2
"""Tells random numbers for playing from those for learning and for drawing a plant."""
