import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from upright.core.compiled import compiled
from upright.core.portable_math import (
    SMALL,
    cosine_of_turns,
    error_function_complement,
    exponential,
    hyperbolic_tangent,
    logarithm,
    sine_cosine,
    small_sine_cosine,
    whole_power,
)


def number(low, high):
    return st.floats(low, high, allow_subnormal=False)


def test_sine_and_cosine_agree_with_the_library():
    for angle in np.linspace(-10, 10, 10_001).tolist():
        sine, cosine = sine_cosine(angle)
        assert abs(sine - math.sin(angle)) <= 2e-15
        assert abs(cosine - math.cos(angle)) <= 2e-15


@given(number(-1e6, 1e6))
def test_sine_and_cosine_of_large_angles_are_as_good_as_the_angle(angle):
    error = 2e-15 + np.spacing(abs(angle))
    assert sine_cosine(angle) == pytest.approx((math.sin(angle), math.cos(angle)), rel=0, abs=error)


@pytest.mark.parametrize("exponent", range(-300, 1, 20))
def test_sine_of_small_angles_has_a_small_relative_error(exponent):
    for angle in (10.0**exponent, 0.7 * 10.0**exponent):
        assert sine_cosine(angle)[0] == pytest.approx(math.sin(angle), rel=1e-15, abs=0)


def test_sine_and_cosine_of_zero_are_exact():
    assert sine_cosine(0.0) == (0.0, 1.0)


def test_the_small_angle_branch_joins_the_other_smoothly():
    for angle in (SMALL, np.nextafter(SMALL, 1), -SMALL, np.nextafter(-SMALL, -1)):
        expected = (math.sin(angle), math.cos(angle))
        assert sine_cosine(angle) == pytest.approx(expected, rel=0, abs=3e-16)


@given(number(-SMALL, SMALL))
def test_sine_and_cosine_of_small_angles_are_the_series(angle):
    sine, one_less_cosine = small_sine_cosine(angle)
    assert sine_cosine(angle) == (sine, 1.0 - one_less_cosine)


def test_the_sine_of_nan_is_nan():
    assert all(map(math.isnan, sine_cosine(math.nan)))


@given(number(0, 1))
def test_cosine_of_turns_agrees_with_the_library(turns):
    expected = math.cos(2 * math.pi * turns)
    assert cosine_of_turns(turns) == pytest.approx(expected, rel=0, abs=2e-15)


@given(number(2.0**-60, 2.0**60))
def test_logarithm_agrees_with_the_library(x):
    assert logarithm(x) == pytest.approx(math.log(x), rel=1e-15, abs=1e-18)


@pytest.mark.parametrize("x", [1.0, 1 - 2.0**-53, 2.0**-53, 2.0, math.sqrt(0.5), math.sqrt(2.0)])
def test_logarithm_at_branch_boundaries(x):
    assert logarithm(x) == pytest.approx(math.log(x), rel=1e-15, abs=0)


@compiled
def compiled_cosine_of_turns(turns):
    return cosine_of_turns(turns)


@compiled
def compiled_logarithm(x):
    return logarithm(x)


def test_compiled_and_plain_results_have_the_same_bits():
    for u in np.random.default_rng(1).random(1000).tolist():
        assert compiled_logarithm(1.0 - u) == logarithm(1.0 - u)
        assert compiled_cosine_of_turns(u) == cosine_of_turns(u)


@compiled
def compiled_exponential(x):
    return exponential(x)


@given(number(-700, 700))
def test_exponential_agrees_with_the_library(x):
    assert compiled_exponential(x) == pytest.approx(math.exp(x), rel=1e-15, abs=0)
    assert compiled_exponential(x) == exponential(x)


def test_exponential_of_zero_is_exact():
    assert exponential(0.0) == exponential(-0.0) == 1.0


@pytest.mark.parametrize("x", [700.1, 1e300, math.inf])
def test_exponential_stays_where_it_is_beyond_its_range(x):
    assert compiled_exponential(x) == exponential(700.0)
    assert compiled_exponential(-x) == exponential(-700.0) > 0.0


def test_exponential_of_nan_is_nan():
    assert math.isnan(compiled_exponential(math.nan))


# ---- Power, tanh and erfc, as compiled code calls them -------------------------------------------


@compiled
def compiled_power(base, exponent):
    return whole_power(base, exponent)


@compiled
def compiled_tangent(x):
    return hyperbolic_tangent(x)


@compiled
def compiled_complement(x):
    return error_function_complement(x)


@given(number(-2, 2), st.integers(0, 1000))
def test_whole_powers_agree_with_exact_ones(base, exponent):
    exact = float(Fraction(base) ** exponent) if abs(base) > 1e-3 or exponent < 50 else 0.0
    error = 1.2e-16 * (exponent + 1)
    assert compiled_power(base, exponent) == pytest.approx(exact, rel=error, abs=1e-150)


def test_the_power_of_0_is_1_and_the_first_is_the_base():
    assert compiled_power(0.0, 0.0) == compiled_power(math.nan, 0.0) == 1.0
    assert compiled_power(0.3, 1.0) == 0.3


@given(number(-30, 30))
def test_tanh_agrees_with_the_library(x):
    assert compiled_tangent(x) == pytest.approx(math.tanh(x), rel=2e-15, abs=0)
    assert compiled_tangent(-x) == -compiled_tangent(x)


@pytest.mark.parametrize("x", [0.2, np.nextafter(0.2, 0), 20.0, 1e-300, 1e300, math.inf, 0.0])
def test_tanh_at_branch_boundaries(x):
    assert compiled_tangent(x) == pytest.approx(math.tanh(x), rel=2e-15, abs=0)
    assert hyperbolic_tangent(x) == compiled_tangent(x)


@given(number(-30, 25.9))
def test_erfc_agrees_with_the_library(x):
    assert compiled_complement(x) == pytest.approx(math.erfc(x), rel=1e-15, abs=0)


@pytest.mark.parametrize("edge", [0.0, 0.46875, 4.0, 26.0, 1e300, math.inf])
def test_erfc_at_branch_boundaries(edge):
    for x in (edge, np.nextafter(edge, 100.0), np.nextafter(edge, -100.0)):
        for signed in (x, -x):
            expected = pytest.approx(math.erfc(signed), rel=1e-15, abs=1e-295)
            assert compiled_complement(signed) == expected
            assert error_function_complement(signed) == compiled_complement(signed)


@pytest.mark.parametrize("function", [compiled_tangent, compiled_complement])
def test_of_nan_there_is_only_nan(function):
    assert math.isnan(function(math.nan))
