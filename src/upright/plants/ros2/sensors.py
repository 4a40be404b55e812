"""Turns the readings of a cart's sensors into the state of a cart-pole."""

import math

from upright.core.parameters import State
from upright.plants.ros2.settings import DIFFERENCED, CartSettings

TURN = 2 * math.pi


class Sensors:
    """Scales readings, and finds velocities where the cart measures none.

    Parameters
    ----------
    settings
        What the readings mean.
    """

    def __init__(self, settings: CartSettings) -> None:
        self._settings = settings
        self._differences = settings.velocities == DIFFERENCED
        self._stamp = -1  # of the last reading [ns]
        self._last = State(0.0, 0.0, 0.0, 0.0)

    def state(self, stamp: int, read: State) -> State:
        """Return the state for the readings with this time stamp [ns], which must increase."""
        s = self._settings
        x = s.position_gain * (read.x - s.position_zero)
        theta = s.angle_gain * (read.theta - s.angle_zero)
        if s.whole_turns and not -math.pi <= theta <= math.pi and math.isfinite(theta):
            theta = math.remainder(theta, TURN)
        if not self._differences:
            return State(x, s.position_gain * read.x_dot, theta, s.angle_gain * read.theta_dot)
        self._last = self._differenced(stamp, x, theta)
        self._stamp = stamp
        return self._last

    def forget(self) -> None:
        """Begin again: the next reading has no velocity, as the clock was set."""
        self._stamp = -1

    def _differenced(self, stamp: int, x: float, theta: float) -> State:
        """Return the state with velocities that follow the differences, as a low-pass filter."""
        if self._stamp < 0:
            return State(x, 0.0, theta, 0.0)
        last, seconds = self._last, (stamp - self._stamp) * 1e-9
        turned = theta - last.theta
        if self._settings.whole_turns and math.isfinite(turned):
            turned = math.remainder(turned, TURN)
        share = seconds / (seconds + self._settings.smoothing)
        return State(
            x,
            last.x_dot + share * ((x - last.x) / seconds - last.x_dot),
            theta,
            last.theta_dot + share * (turned / seconds - last.theta_dot),
        )
