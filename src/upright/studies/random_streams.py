"""All streams of random numbers that runs draw from.

Streams with different purposes are independent: drawing from one never changes another.
"""

from enum import IntEnum
from typing import Any

import numpy as np

from upright.studies import matlab_twin


class Stream(IntEnum):
    """Purposes of streams of random numbers, besides the run itself."""

    PARAMETERS = 1
    """Parameters of a plant that varies from run to run."""
    PLAYING = 2
    """Trials in which a learned policy is played."""
    PLANT = 3
    """Seed of a plant that draws random numbers itself."""


def sequence(seed: int, run: int, stream: Stream) -> np.random.SeedSequence:
    """Return the seed sequence of a stream of a run, or of a trial that is played."""
    return np.random.SeedSequence(seed, spawn_key=(run, int(stream)))


def random_numbers(seed: int, run: int) -> np.random.Generator:
    """Return the random numbers of a run, for its agent, its starts and its noise."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(run,)))


def twister(number: int) -> np.random.Generator:
    """Return the Mersenne Twister (M. Matsumoto & T. Nishimura, 1998) with this 32-bit seed."""
    seeded: Any = np.random.RandomState(number).get_state(legacy=False)
    bits = np.random.MT19937()
    bits.state = seeded
    return np.random.Generator(bits)


def twister_numbers(seed: int, run: int) -> np.random.Generator:
    """Return the random numbers that the MATLAB twin draws in its run number `run + 1`.

    They are those of MATLAB's rand after rng(10⁶ seed + run + 1).

    Raises
    ------
    UprightError
        If the seed is too large for MATLAB.
    """
    matlab_twin.check_seed(seed)
    return twister(10**6 * seed + run + 1)
