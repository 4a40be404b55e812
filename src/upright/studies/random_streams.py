"""The streams of random numbers: every one that a run draws from, in one place.

Streams of different purposes are independent: what one draws never changes another.
"""

from enum import IntEnum
from typing import Any

import numpy as np

from upright.studies import matlab_twin


class Stream(IntEnum):
    """What a stream of random numbers is for, besides the run itself."""

    PARAMETERS = 1
    """Draws the parameters of a plant that varies from run to run."""
    PLAYING = 2
    """Serves a trial in which a learned policy plays."""
    PLANT = 3
    """Seeds a plant that draws random numbers itself."""


def sequence(seed: int, run: int, stream: Stream) -> np.random.SeedSequence:
    """Return what begins a stream of a run, or of a trial that is played."""
    return np.random.SeedSequence(seed, spawn_key=(run, int(stream)))


def random_numbers(seed: int, run: int) -> np.random.Generator:
    """Return the random numbers that a run draws: its agent, its starts, its noise."""
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
