"""NumPy's random numbers by compiled code alone: the same numbers from the same seed.

`Pcg64` takes the place of NumPy's generator where NumPy is not at hand. A run's stream is that of
``numpy.random.default_rng(SeedSequence(seed, spawn_key=(run,)))``.

The generator is PCG XSL RR 128/64 (M. O'Neill, *PCG: A family of simple fast space-efficient
statistically good algorithms for random number generation*, Harvey Mudd College, 2014). The seeds
are mixed as in M. O'Neill, *Developing a seed_seq alternative*, 2015.
"""

from typing import NamedTuple

import numpy as np

from upright.core.compiled import compiled, guard, inlined
from upright.core.guards import require_array
from upright.errors import require

WORDS = 4
"""Words of 32 bits into which seeds are mixed."""
LARGEST_SEED, LARGEST_RUN = 2**63 - 1, 2**32 - 1
_MULTIPLIER_HIGH, _MULTIPLIER_LOW = np.uint64(0x2360ED051FC65DA4), np.uint64(0x4385DF649FCCF645)
_MASK, _HALF = np.uint64(0xFFFFFFFF), np.uint64(32)
_ONE, _TOP = np.uint64(1), np.uint64(63)
_ROTATION, _BITS = np.uint64(58), np.uint64(64)
_UNUSED, _UNIT = np.uint64(11), 2.0**-53
# The constants of the seeds' mixing, all of 32 bits
_INIT_A, _MULTIPLIER_A = np.uint64(0x43B0D7E5), np.uint64(0x931E8875)
_INIT_B, _MULTIPLIER_B = np.uint64(0x8B51F9DD), np.uint64(0x58F38DED)
_MIX_LEFT, _MIX_RIGHT = np.uint64(0xCA01F9DD), np.uint64(0x4973F715)
_SHIFT = np.uint64(16)


class Pcg64(NamedTuple):
    """A stream of random numbers.

    Examples
    --------
    >>> import numpy as np
    >>> from upright.core.pcg64 import new_stream
    >>> rng = np.random.default_rng(np.random.SeedSequence(7, spawn_key=(3,)))
    >>> new_stream(7, 3).random() == rng.random()
    True
    """

    state: np.ndarray
    """Shape (2,), uint64: the upper and the lower half of a number of 128 bits."""
    increment: np.ndarray
    """Shape (2,), uint64: what is added to it at each draw, and tells streams apart."""
    pool: np.ndarray
    """Shape (WORDS,), uint64: where seeds are mixed."""

    @compiled
    def random(self) -> float:
        """Return a number from 0 to below 1, a multiple of 2⁻⁵³."""
        advance(self)
        high, low = self.state[0], self.state[1]
        mixed, turns = high ^ low, high >> _ROTATION
        mixed = (mixed >> turns) | (mixed << ((_BITS - turns) & _TOP))
        return np.int64(mixed >> _UNUSED) * _UNIT

    @compiled
    def seed(self, seed: int, run: int) -> None:
        """Begin the stream of a run.

        Parameters
        ----------
        seed
            Seed of the study, from 0 to LARGEST_SEED.
        run
            Number of the run, from 0 to LARGEST_RUN.
        """
        mix_seeds(self.pool, np.uint64(seed), np.uint64(run))
        state, increment = self.state, self.increment
        constant = _INIT_B
        high, constant = drawn_word(self.pool, 0, constant)
        low, constant = drawn_word(self.pool, 2, constant)
        stream_high, constant = drawn_word(self.pool, 0, constant)
        stream_low, constant = drawn_word(self.pool, 2, constant)
        increment[0] = (stream_high << _ONE) | (stream_low >> _TOP)
        increment[1] = (stream_low << _ONE) | _ONE
        # The first state is that before the first draw, with the seed added to what 0 becomes.
        state[0], state[1] = increment[0], increment[1]
        state[1] += low
        state[0] += high + (_ONE if state[1] < low else np.uint64(0))
        advance(self)


@inlined
def advance(stream: Pcg64) -> None:
    """Go to the next state: the state times a constant, plus the increment, modulo 2¹²⁸."""
    state, increment = stream.state, stream.increment
    high, low = state[0], state[1]
    # The product of two lower halves has 128 bits; it is found by factors of 32 bits.
    a, b = low >> _HALF, low & _MASK
    c, d = _MULTIPLIER_LOW >> _HALF, _MULTIPLIER_LOW & _MASK
    middle = a * d + ((b * d) >> _HALF)
    other = b * c + (middle & _MASK)
    carried = a * c + (middle >> _HALF) + (other >> _HALF)
    state[1] = low * _MULTIPLIER_LOW + increment[1]
    carried += _ONE if state[1] < increment[1] else np.uint64(0)
    state[0] = high * _MULTIPLIER_LOW + low * _MULTIPLIER_HIGH + carried + increment[0]


@inlined
def mix_seeds(pool: np.ndarray, seed: np.uint64, run: np.uint64) -> None:
    """Mix a seed and the number of a run into a pool."""
    constant = _INIT_A
    for i in range(WORDS):
        word = seed & _MASK if i == 0 else seed >> _HALF if i == 1 else np.uint64(0)
        pool[i], constant = hashed(word, constant)
    for source in range(WORDS):
        for i in range(WORDS):
            if i != source:
                word, constant = hashed(pool[source], constant)
                pool[i] = mixed(pool[i], word)
    for i in range(WORDS):
        word, constant = hashed(run, constant)
        pool[i] = mixed(pool[i], word)


@inlined
def hashed(word: np.uint64, constant: np.uint64) -> tuple[np.uint64, np.uint64]:
    """Return a hashed word, and the constant for the next one."""
    word ^= constant
    constant = (constant * _MULTIPLIER_A) & _MASK
    word = (word * constant) & _MASK
    return word ^ (word >> _SHIFT), constant


@inlined
def mixed(word: np.uint64, other: np.uint64) -> np.uint64:
    """Return what two words become."""
    result = (_MIX_LEFT * word - _MIX_RIGHT * other) & _MASK
    return result ^ (result >> _SHIFT)


@inlined
def drawn_word(pool: np.ndarray, place: int, constant: np.uint64) -> tuple[np.uint64, np.uint64]:
    """Return a word of 64 bits by two places of the pool, and the constant for the next one."""
    result = np.uint64(0)
    for i in range(2):
        word = pool[place + i] ^ constant
        constant = (constant * _MULTIPLIER_B) & _MASK
        word = (word * constant) & _MASK
        result |= (word ^ (word >> _SHIFT)) << (_HALF * np.uint64(i))
    return result, constant


def new_stream(seed: int, run: int) -> Pcg64:
    """Return the stream of a run.

    Raises
    ------
    UprightError
        If a number is out of range.
    """
    stream = Pcg64(np.zeros(2, np.uint64), np.zeros(2, np.uint64), np.zeros(WORDS, np.uint64))
    stream.seed(seed, run)
    return stream


@guard(Pcg64.seed)
def _check_seed(stream: Pcg64, seed: int, run: int) -> None:
    _check_stream(stream)
    require("seed", seed, 0, LARGEST_SEED, whole=True)
    require("run", run, 0, LARGEST_RUN, whole=True)


@guard(Pcg64.random)
def _check_stream(stream: Pcg64) -> None:
    require_array("state", stream.state, np.uint64, 2)
    require_array("increment", stream.increment, np.uint64, 2)
    require_array("pool", stream.pool, np.uint64, WORDS)
