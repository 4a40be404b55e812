"""Trials that a person starts: the cart comes to the middle, and the pole is held still."""

import math
import time
from collections.abc import Callable

from upright.core.parameters import Parameters, State
from upright.errors import UprightError
from upright.plants.ros2.periods import Periods
from upright.plants.ros2.settings import CartSettings

REMINDER = 10.0
"""How often it is said what a trial is waiting for [s]."""
STILL = State(0.02, math.inf, 0.02, math.inf)
"""How far a cart and a pole that are held still may move [m, m/s, rad, rad/s]."""
MIDDLE = State(0.0, 0.0, 0.0, 0.0)
HOME = State(0.02, 0.02, math.inf, math.inf)
"""How near to the middle, and how slow, a cart must come by itself."""
ASTRAY = 0.1
"""How much farther from the middle a cart may come by itself than it was [m]."""
HOMING, BRAKING = 20.0, 0.1
"""How long a cart may take to come to the middle [s]; difference in velocity for full force [m/s].
"""


class Person:
    """Waits for somebody who starts a trial.

    Parameters
    ----------
    settings
        With the force that moves the cart to the middle, and the time for which the pole is held.
    limits
        A trial begins at most half as far from upright and from the middle as these are.
    periods
        The clock of the cart.
    push
        Called with a force [N] to command.
    measure
        Waits for the next measurement, and returns it.
    say
        Called with what the person should know.
    """

    def __init__(
        self,
        settings: CartSettings,
        limits: Parameters,
        periods: Periods,
        push: Callable[[float], None],
        measure: Callable[[], State],
        say: Callable[[str], None],
    ) -> None:
        self._settings, self._periods = settings, periods
        self._angle_limit, self._position_limit = limits.angle_limit / 2, limits.position_limit / 2
        self._push, self._measure, self._say = push, measure, say

    def wait(self) -> None:
        """Wait until the pole has been held still near upright for a while.

        Raises
        ------
        UprightError
            If the cart does not come to the middle.
        """
        self._push(0.0)
        if self._settings.homing_force:
            self._home()
        self._say(f"raise the pole, and hold it still for {self._settings.still:g} s")
        held, reminder = self._measure(), time.monotonic() + REMINDER
        self._periods.begin()
        while self._periods.seconds < self._settings.still:
            state = self._measure()
            if self._is_down(state) or not _near(state, held, STILL):
                if time.monotonic() > reminder:
                    reminder = time.monotonic() + REMINDER
                    self._remind(held, state)
                held = state
                self._periods.begin()

    def _is_down(self, state: State) -> bool:
        """Whether a trial cannot begin in a state, which is too near to the limits."""
        return not (abs(state.x) <= self._position_limit and abs(state.theta) <= self._angle_limit)

    def _remind(self, held: State, state: State) -> None:
        """Say why a trial does not begin, after one state and the next."""
        x, moved = abs(state.x - held.x), abs(state.theta - held.theta)
        self._say(
            f"still waiting: x = {state.x:.3g} m, θ = {math.degrees(state.theta):.3g}°, which must "
            f"be within ±{self._position_limit:.3g} m and ±{math.degrees(self._angle_limit):.3g}°; "
            f"they moved by {x:.3f} m and {math.degrees(moved):.2f}°, and may by {STILL.x:g} m and "
            f"{math.degrees(STILL.theta):.3g}°"
        )

    def _home(self) -> None:
        """Move the cart to the middle of the track, slower the nearer it is."""
        state = self._measure()
        until, start = time.monotonic() + HOMING, abs(state.x)
        while not _near(state, MIDDLE, HOME):
            if time.monotonic() > until:
                raise UprightError(
                    f"the cart did not come to the middle within {HOMING:g} s: it is at "
                    f"{state.x:.3g} m; homing_force is {self._settings.homing_force} N"
                )
            if abs(state.x) > start + ASTRAY:
                raise UprightError(
                    f"the cart moved away from the middle, from {start:.3g} m to "
                    f"{abs(state.x):.3g} m: the sign of position_gain or command_gain may be wrong"
                )
            lacks = -max(-0.2, min(0.2, state.x)) - state.x_dot
            self._push(self._settings.homing_force * max(-1.0, min(1.0, lacks / BRAKING)))
            state = self._measure()
        self._push(0.0)


def _near(state: State, other: State, tolerance: State) -> bool:
    """Whether two states differ in no number by more than the tolerance has."""
    pairs = zip(state, other, tolerance, strict=True)
    return all(abs(one - another) <= most for one, another, most in pairs)
