"""Elementary functions by additions, multiplications, divisions and square roots alone.

The C library's functions differ in their last bit between systems, and even between processors. An
unstable plant or a learner soon amplifies that into a different trajectory. The functions here
return the same bits everywhere. Those that loops over many numbers call do not branch, so that
these loops can be vectorised.
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
_E2, _E3, _E4, _E5, _E6, _E7, _E8, _E9, _E10, _E11, _E12, _E13 = (
    1 / math.factorial(k) for k in range(2, 14)
)
_LARGEST_POWER = 700.0
"""Beyond e to this, and below e to less this, `exponential` stays where it is."""
_NEAR_ZERO = 0.2
"""Where tanh is found by series."""
_CENTRE, _TAIL, _END = 0.46875, 4.0, 26.0
"""Where erfc is found by one rational function and by the next, and beyond which it is 0."""
_ROOT_PI_INVERSE = 1 / math.sqrt(math.pi)
_A = (
    *(3.16112374387056560e00, 1.13864154151050156e02, 3.77485237685302021e02),
    *(3.20937758913846947e03, 1.85777706184603153e-1),
)
_B = (
    *(2.36012909523441209e01, 2.44024637934444173e02),
    *(1.28261652607737228e03, 2.84423683343917062e03),
)
_C = (
    *(5.64188496988670089e-1, 8.88314979438837594e00, 6.61191906371416295e01),
    *(2.98635138197400131e02, 8.81952221241769090e02, 1.71204761263407058e03),
    *(2.05107837782607147e03, 1.23033935479799725e03, 2.15311535474403846e-8),
)
_D = (
    *(1.57449261107098347e01, 1.17693950891312499e02, 5.37181101862009858e02),
    *(1.62138957456669019e03, 3.29079923573345963e03, 4.36261909014324716e03),
    *(3.43936767414372164e03, 1.23033935480374942e03),
)
_P = (
    *(3.05326634961232344e-1, 3.60344899949804439e-1, 1.25781726111229246e-1),
    *(1.60837851487422766e-2, 6.58749161529837803e-4, 1.63153871373020978e-2),
)
_Q = (
    *(2.56852019228982242e00, 1.87295284992346725e00, 5.27905102951428412e-1),
    *(6.05183413124413191e-2, 2.33520497626869185e-3),
)
"""The coefficients of these rational functions: Cody's, of the least degrees for 16 digits."""
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
    """Return e^x, with a relative error of 1e-15 from -700 to 700, and beyond that e^±700.

    x = n log 2 + r with |r| up to log 2 / 2; e^r by its series, then n doublings or halvings by the
    exponent of the result.
    """
    x = np.float64(x)  # also where the other numbers have 32 bits, as on some chips
    x = _LARGEST_POWER if x > _LARGEST_POWER else x
    x = -_LARGEST_POWER if x < -_LARGEST_POWER else x
    shifted = x * (1 / _LOG_2) + _ROUND
    n = shifted - _ROUND
    r = (x - n * _LOG_2_HIGH) - n * _LOG_2_LOW
    z = r * r
    z2 = z * z
    series = (_E2 + r * _E3) + z * (_E4 + r * _E5) + z2 * ((_E6 + r * _E7) + z * (_E8 + r * _E9))
    series += z2 * z2 * ((_E10 + r * _E11) + z * (_E12 + r * _E13))
    mantissa = 1.0 + (r + z * series)
    # The last bits of `shifted` are n; converting it would be undefined where x is not a number.
    doublings = np.float64(shifted).view(np.int64) << _MANTISSA_BITS
    return np.int64(np.float64(mantissa).view(np.int64) + doublings).view(np.float64)


@inlined
def whole_power(base: float, exponent: float) -> float:
    """Return a base to the power of a whole number that is not negative, by repeated squaring.

    Each of about 2 log₂ n roundings may count n times: the relative error is about n 10⁻¹⁶.
    """
    power = 1.0
    n = int(exponent)
    while n > 0:
        if n & 1:
            power *= base
        base *= base
        n >>= 1
    return power


@inlined
def hyperbolic_tangent(x: float) -> float:
    """Return tanh x, with a relative error of 2e-15.

    Near 0 it is the quotient of the series of sinh x and cosh x; elsewhere 1 - 2 / (e^2x + 1).
    """
    if abs(x) < _NEAR_ZERO:
        z = x * x
        sine = x + x * z * (_E3 + z * (_E5 + z * (_E7 + z * (_E9 + z * _E11))))
        return sine / (1.0 + z * (_E2 + z * (_E4 + z * (_E6 + z * (_E8 + z * _E10)))))
    tail = 2.0 / (exponential(2.0 * abs(x)) + 1.0)
    return 1.0 - tail if x > 0.0 else tail - 1.0


@inlined
def error_function_complement(x: float) -> float:
    """Return erfc x, twice the probability that a normal number of variance 1/2 is above x.

    The relative error is 1e-15 up to x = 26, beyond which erfc is 0 (it is below 1e-295).

    By rational functions, where |x| is up to 0.46875, up to 4, and above (W. J. Cody, *Rational
    Chebyshev approximations for the error function*, Math. Comp. 23, 1969).
    """
    x = np.float64(x)
    y = abs(x)
    if y >= _END:
        return 0.0 if x > 0.0 else 2.0
    if y <= _CENTRE:
        z = x * x
        above = (((_A[4] * z + _A[0]) * z + _A[1]) * z + _A[2]) * z + _A[3]
        below = (((z + _B[0]) * z + _B[1]) * z + _B[2]) * z + _B[3]
        return 1.0 - x * (above / below)
    if y <= _TAIL:
        above, below = _C[8] * y, y
        for i in range(7):
            above, below = (above + _C[i]) * y, (below + _D[i]) * y
        tail = (above + _C[7]) / (below + _D[7])
    else:
        z = 1.0 / (y * y)
        above, below = _P[5] * z, z
        for i in range(4):
            above, below = (above + _P[i]) * z, (below + _Q[i]) * z
        tail = (_ROOT_PI_INVERSE - z * (above + _P[4]) / (below + _Q[4])) / y
    tail *= _gaussian(y)
    return 2.0 - tail if x < 0.0 else tail


@inlined
def _gaussian(y: float) -> float:
    """Return e^(-y²) for y from 0 to 26.

    The rounding of y² would count y² times. It is found by a y of few bits, whose square is exact.
    """
    squared = y * y
    few_bits = ((y * 16.0 + _ROUND) - _ROUND) * (1.0 / 16.0)
    rounding = (few_bits * few_bits - squared) + (y - few_bits) * (y + few_bits)
    return exponential(-squared) * (1.0 - rounding)
