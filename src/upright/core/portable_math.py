"""Sine, cosine, logarithm and exponential by additions, multiplications and divisions alone.

The C library's functions differ in their last bit between systems, which an unstable plant soon
amplifies into a different trajectory, and loops that call them cannot be vectorised. The functions
here return the same bits everywhere, and only `sine_cosine` branches.
"""

import math

import numpy as np

from upright.core.compiled import compiled, inlined

SMALL = math.pi / 8
"""Angles up to this [rad] need no range reduction; a pole that has not fallen leans less."""
_ROUND = 1.5 * 2.0**52
"""Adding and then subtracting this rounds a float64 to the nearest integer."""
_TURN, _TURN_REST = 2 * math.pi, 2.4492935982947064e-16
"""A full turn [rad], as the sum of two floats."""
_S1, _S2, _S3, _S4, _S5, _S6 = ((-1) ** k / math.factorial(2 * k + 1) for k in range(1, 7))
_C1, _C2, _C3, _C4, _C5, _C6 = ((-1) ** (k + 1) / math.factorial(2 * k) for k in range(1, 7))
_L1, _L2, _L3, _L4, _L5, _L6, _L7, _L8, _L9 = (1 / (2 * k + 1) for k in range(1, 10))
_LOG_2 = math.log(2.0)
_LOG_2_HIGH, _LOG_2_LOW = 0.6931471803691238, 1.9082149292705877e-10
"""log 2 as the sum of two floats; products of the first with small integers are exact."""
_ROOT_HALF_BITS = int(np.float64(math.sqrt(0.5)).view(np.int64))
_MANTISSA_BITS = 52


@inlined
def small_sine_cosine(angle: float) -> tuple[float, float]:
    """Return sin and 1 - cos of an angle up to SMALL [rad] by Taylor series, accurate to 1e-16."""
    z = angle * angle
    z2 = z * z
    z4 = z2 * z2
    series = (_S1 + z * _S2) + z2 * (_S3 + z * _S4) + z4 * (_S5 + z * _S6)
    sine = angle + angle * z * series
    return sine, z * ((_C1 + z * _C2) + z2 * (_C3 + z * _C4) + z4 * (_C5 + z * _C6))


@compiled
def sine_cosine(angle: float) -> tuple[float, float]:
    """Return sin and cos of an angle [rad], accurate to 2e-15.

    Beyond SMALL, whole turns are removed, the series is evaluated at an eighth of the remainder,
    and the angle is doubled three times.
    """
    if abs(angle) <= SMALL:
        sine, one_less_cosine = small_sine_cosine(angle)
        return sine, 1.0 - one_less_cosine
    turns = (angle * (1 / _TURN) + _ROUND) - _ROUND
    eighth = 0.125 * ((angle - turns * _TURN) - turns * _TURN_REST)
    sine, one_less_cosine = small_sine_cosine(eighth)
    for _ in range(3):
        sine, one_less_cosine = 2.0 * sine * (1.0 - one_less_cosine), 2.0 * sine * sine
    return sine, 1.0 - one_less_cosine


@inlined
def cosine_of_turns(turns: float) -> float:
    """Return the cosine of an angle of 0 to 1 turns, accurate to 2e-15."""
    _, one_less_cosine = small_sine_cosine((2.0 * SMALL) * (turns - 0.5))
    for _ in range(3):
        one_less_cosine *= 2.0 * (2.0 - one_less_cosine)
    return one_less_cosine - 1.0


@inlined
def logarithm(x: float) -> float:
    """Return the natural logarithm of a positive normal number, with a relative error of 1e-15.

    x = m 2^e with m from √½ to √2; log m = 2 artanh s by its series, with s = (m - 1) / (m + 1).
    """
    bits = np.float64(x).view(np.int64)
    exponent = (bits - _ROOT_HALF_BITS) >> _MANTISSA_BITS
    m = np.int64(bits - (exponent << _MANTISSA_BITS)).view(np.float64)
    s = (m - 1.0) / (m + 1.0)
    z = s * s
    z2 = z * z
    z4 = z2 * z2
    series = (_L1 + z * _L2) + z2 * (_L3 + z * _L4)
    series += z4 * ((_L5 + z * _L6) + z2 * (_L7 + z * _L8) + z4 * _L9)
    return exponent * _LOG_2 + 2.0 * s * (1.0 + z * series)


@inlined
def exponential(x: float) -> float:
    """Return e to the power of a number from -700 to 700, with a relative error of 1e-15.

    x = n log 2 + r with |r| up to log 2 / 2; e^r by its series, then n doublings or halvings by the
    exponent of the result.
    """
    n = (x * (1 / _LOG_2) + _ROUND) - _ROUND
    r = (x - n * _LOG_2_HIGH) - n * _LOG_2_LOW
    series = 1.0
    for k in range(14, 0, -1):
        series = 1.0 + series * r * (1.0 / k)
    bits = np.float64(series).view(np.int64) + (np.int64(n) << _MANTISSA_BITS)
    return np.int64(bits).view(np.float64)
