"""Measurements are matched to periods by their time stamps, and readings to states."""

import math

import numpy as np
import pytest

from upright.core.parameters import State
from upright.errors import UprightError
from upright.plants.ros2.periods import Periods
from upright.plants.ros2.sensors import Sensors
from upright.plants.ros2.settings import CartSettings

MS = 10**6
PERIOD = 0.02


def ends(stamps, periods=None, arrivals=None):
    """Return the stamps [ms] with which periods end; the trial begins with the first."""
    periods = periods or Periods(PERIOD, 0.5)
    found = []
    for number, stamp in enumerate(stamps):
        now = arrivals[number] if arrivals else stamp
        if periods.take(round(stamp * MS), round(now * MS)):
            if periods._end < 0:
                periods.begin()
            elif periods.is_over():
                found.append(stamp)
    return found


def test_a_cart_with_the_period_of_the_policy_ends_a_period_with_each_measurement():
    periods = Periods(PERIOD, 0.5)
    assert ends(range(0, 2001, 20), periods) == list(range(20, 2001, 20))
    assert (periods.missed, periods.seconds, periods.interval) == (0, 2.0, PERIOD)


@pytest.mark.parametrize("rate", [100, 150, 250, 333, 500, 1000])
def test_of_a_faster_cart_the_nearest_to_the_end_is_taken(rate):
    interval = 1e3 / rate
    found = ends([number * interval for number in range(10 * rate)])
    assert len(found) == pytest.approx(500, abs=1)
    for number, stamp in enumerate(found, 1):
        assert stamp == pytest.approx(20 * number, abs=interval / 2 + 1e-6)


def test_irregular_stamps_do_not_add_up():
    late = [0.0, 1.5, -2.0, 3.0, -1.0]
    stamps = [2 * number + late[number % 5] / 4 for number in range(5000)]
    found = ends(stamps)
    assert len(found) == 499
    assert found[-1] == pytest.approx(20 * len(found), abs=2)


def test_a_period_without_a_measurement_is_missed():
    periods = Periods(PERIOD, 0.5)
    stamps = [stamp for stamp in range(0, 2001, 20) if not 500 <= stamp < 600]
    assert ends(stamps, periods)[-1] == 2000
    assert periods.missed == 5


def test_late_and_doubled_measurements_are_not_taken():
    periods = Periods(PERIOD, 0.5)
    stamps = [0, 20, 20, 40, 30, 60, 80, 60, 40, 100]
    assert ends(stamps, periods) == [20, 40, 60, 80, 100]
    assert not periods.jumps


@pytest.mark.parametrize("jump", [3_600_000, -3_600_000, -500])
def test_a_clock_that_is_set_is_no_missed_period(jump):
    periods = Periods(PERIOD, 0.5)
    times = range(5_000_000, 5_004_001, 20)
    stamps = [time + jump * (time > 5_002_000) for time in times]
    taken = ends(stamps, periods, arrivals=times)
    lost = 2 * (jump < 0)  # until it is known that they are not late
    assert len(taken) == 200 - lost
    assert periods.missed == lost
    assert periods.jumps == [pytest.approx(jump / 1e3)]


@pytest.mark.parametrize("jump", [3_600_000, -3_600_000])
def test_a_clock_may_be_set_where_each_measurement_comes_twice(jump):
    times = [time for time in range(5_000_000, 5_004_001, 20) for _ in "ab"]
    stamps = [time + jump * (time > 5_002_000) for time in times]
    periods = Periods(PERIOD, 0.5)
    ends(stamps, periods, arrivals=times)
    assert periods.jumps == [pytest.approx(jump / 1e3)]


def test_stamps_that_jitter_are_no_clock_that_is_set():
    rng = np.random.default_rng(0)
    times = range(5_000_000, 5_010_000)
    periods = Periods(PERIOD, 0.5)
    found = ends(times + rng.uniform(-5, 5, len(times)), periods, arrivals=times)
    assert not periods.jumps
    assert len(found) == pytest.approx(500, abs=2)


def test_a_silent_cart_has_not_set_its_clock():
    periods = Periods(PERIOD, 0.5)
    ends([0, 20, 40, 60, 80, 100, 6100, 6120], periods)
    assert not periods.jumps


@pytest.mark.parametrize("interval", [14, 30, 50, 13.0])
def test_a_rate_that_does_not_fit_is_refused(interval):
    message = r"the cart measures every .* ms, which does not fit a control period of 20 ms; .*"
    with pytest.raises(UprightError, match=message + r"parameter time_step=[\d., ]+ fits$"):
        ends([number * interval for number in range(20)])


@pytest.mark.parametrize(
    ("rate", "jitter", "lost"), [(50, 4, 0), (50, 3, 0.1), (50, 0, 0.2), (200, 2, 0), (100, 3, 0)]
)
def test_a_rate_that_fits_is_not_refused_if_measurements_are_irregular(rate, jitter, lost):
    for seed in range(10):
        rng = np.random.default_rng(seed)
        times = np.arange(10_000, 40_000, 1e3 / rate)
        times = times[rng.random(len(times)) >= lost]
        stamps = times + rng.uniform(-jitter, jitter, len(times))
        periods = Periods(PERIOD, 0.5)
        assert len(ends(stamps, periods, arrivals=times.tolist())) + periods.missed > 1480


def test_the_periods_of_a_restarted_cart_begin_again():
    periods = Periods(PERIOD, 0.5)
    ends(range(0, 1000, 20), periods)
    periods.restart()
    assert periods.take(20 * MS, 5_000 * MS)
    periods.begin()
    assert ends(range(40, 200, 20), periods, arrivals=range(5_020, 5_180, 20)) == list(
        range(40, 200, 20)
    )
    assert (periods.missed, periods.jumps) == (0, [])


# ---- Sensors -------------------------------------------------------------------------------------


def test_readings_of_the_usual_cart_are_the_state():
    state = State(0.1, -0.2, 0.3, 4.0)
    assert Sensors(CartSettings()).state(0, state) == state


def test_readings_have_a_zero_and_a_gain():
    settings = CartSettings(
        position_zero=7.0, position_gain=-0.01, angle_zero=90.0, angle_gain=-math.pi / 180
    )
    state = Sensors(settings).state(0, State(107.0, 50.0, 93.0, -2.0))
    assert state == pytest.approx((-1.0, -0.5, -math.radians(3), math.radians(2)))


@pytest.mark.parametrize("turns", [-3, -1, 1, 1000])
def test_whole_turns_are_taken_off(turns):
    read = State(0.0, 0.0, 0.1 + turns * 2 * math.pi, 0.0)
    assert Sensors(CartSettings()).state(0, read).theta == pytest.approx(0.1, abs=1e-9)
    assert Sensors(CartSettings(whole_turns=False)).state(0, read).theta == read.theta


def test_differences_are_velocities():
    sensors = Sensors(CartSettings(velocities="differenced"))
    assert sensors.state(0, State(0.0, 9.0, 3.1, 9.0)) == (0.0, 0.0, 3.1, 0.0)
    state = sensors.state(20 * MS, State(0.1, 9.0, -3.1, 9.0))  # over the lowest point
    assert state.x_dot == pytest.approx(5.0)
    assert state.theta_dot == pytest.approx((2 * math.pi - 6.2) / 0.02)
    sensors.forget()
    assert sensors.state(0, State(5.0, 9.0, 0.0, 9.0)) == (5.0, 0.0, 0.0, 0.0)


def test_smoothed_velocities_follow_with_their_time_constant():
    sensors = Sensors(CartSettings(velocities="differenced", smoothing=0.1))
    for number in range(101):
        state = sensors.state(number * MS, State(2e-3 * number, 0.0, 0.0, 0.0))
        last = state.x_dot
    assert last == pytest.approx(2 * (1 - math.exp(-1)), rel=0.01)


def test_a_reading_that_is_none_stays_none():
    for settings in (CartSettings(), CartSettings(velocities="differenced")):
        state = Sensors(settings).state(0, State(0.0, 0.0, math.nan, 0.0))
        assert math.isnan(state.theta)
