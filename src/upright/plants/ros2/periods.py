"""Matches the measurements of a cart to the control periods of a policy, by their time stamps.

A cart may measure more often than a policy acts. The periods follow each other without a gap from
the start of a trial, and each ends with the measurement that is nearest to its end. So a trial of N
steps takes N periods of the cart's time, however often it measures.
"""

from collections import deque
from statistics import median

from upright.errors import UprightError

KEPT = 32
"""Number of intervals between measurements that are kept."""
ENOUGH = 5
"""Number of intervals after which the cart's rate is known."""
MISFIT = 0.1
"""Greatest difference between a period and whole intervals, as a share of the period."""
JUMP = 10**9
"""A step of the time stamps that is greater, by this, than what has passed here and than the
watchdog is that of a clock which was set [ns]."""
BACK = 3
"""Number of measurements in a row, each older than the newest, after which the clock was set
back if they took a control period to arrive; fewer were late on their way, or their stamps
jitter."""


class Periods:
    """The control periods of a cart.

    Parameters
    ----------
    period
        Length of a period [s].
    watchdog
        Longest time between two measurements that the run survives [s].
    """

    def __init__(self, period: float, watchdog: float) -> None:
        self.stamp = -1
        """Time stamp of the newest measurement [ns]; -1 before the first."""
        self.missed = 0
        """Number of periods of trials that ended without a measurement."""
        self.jumps: list[float] = []
        """By how much the cart's clock was set while it measured [s]."""
        self._period, self._watchdog = round(1e9 * period), round(1e9 * watchdog)
        self._arrived = 0  # when the newest measurement did [ns]
        self._intervals: deque[int] = deque(maxlen=KEPT)
        self._interval = self._period  # the usual one [ns]
        self._start = self._end = -1  # of the trial, and of its last whole period [ns]
        self._older, self._oldest = 0, -1  # how many in a row are older, and the last one's stamp
        self._older_since = 0  # when the first of them arrived [ns]

    def take(self, stamp: int, now: int) -> bool:
        """Return whether a measurement is newer than those before it, and remember it if so.

        Parameters
        ----------
        stamp
            Its time stamp [ns].
        now
            When it arrived, by a clock that nobody sets [ns].
        """
        step = stamp - self.stamp
        if step <= 0 and not self._set_back(stamp, now):
            return False
        waited, self._arrived = now - self._arrived, now
        if self.stamp >= 0 and not 0 < step <= max(self._watchdog, waited) + JUMP:
            jump = step - waited
            self.jumps.append(jump * 1e-9)
            self._start, self._end = self._start + jump, self._end + jump
        elif self.stamp >= 0:
            self._intervals.append(step)
            if len(self._intervals) <= ENOUGH or step != self._interval:
                self._interval = round(median(self._intervals))
        self.stamp, self._older = stamp, 0
        return True

    def _set_back(self, stamp: int, now: int) -> bool:
        """Whether a stamp that is not newer is one of several in a row, which increase."""
        if stamp == self.stamp or (self._older and stamp == self._oldest):
            return False  # the same measurement again
        if not self._older or stamp < self._oldest:
            self._older, self._older_since = 0, now
        self._older, self._oldest = self._older + 1, stamp
        return self._older >= BACK and now - self._older_since >= self._period

    def restart(self) -> None:
        """Forget the cart's clock and rate, as the cart was started again."""
        self.stamp, self._older = -1, 0
        self._intervals.clear()

    def begin(self) -> None:
        """Begin a trial with the newest measurement."""
        self._start = self._end = self.stamp

    def is_over(self) -> bool:
        """Whether the period ends with the newest measurement; if so, the next one begins.

        Raises
        ------
        UprightError
            If the cart's rate does not fit the period.
        """
        self.check_rate()
        due = self._end + self._period
        if self.stamp < due - min(self._interval, self._period) // 2:
            return False
        periods = max(1, round((self.stamp - self._end) / self._period))
        self._end += periods * self._period
        self.missed += periods - 1
        return True

    def check_rate(self) -> None:
        """Raise UprightError if the rate is known, and does not fit the period."""
        if not self.knows_rate or self._interval == self._period:
            return
        number = max(1, round(self._period / self._interval))
        # Of irregular measurements the rate is uncertain, and no other would fit better.
        deviation = median(abs(each - self._interval) for each in self._intervals)
        doubt = number * deviation * KEPT / len(self._intervals)
        if abs(number * self._interval - self._period) > MISFIT * self._period + doubt:
            near = ", ".join(f"{number * self.interval:.4g}" for number in self._fitting())
            raise UprightError(
                f"the cart measures every {1e3 * self.interval:.3g} ms, which does not fit a "
                f"control period of {1e-6 * self._period:.3g} ms; change the cart's rate, or the "
                f"period: parameter time_step={near} fits"
            )

    def _fitting(self) -> list[int]:
        """Return how many intervals make up the fitting periods next to this one."""
        below = self._period // self._interval
        return [number for number in (below, below + 1) if number]

    @property
    def knows_rate(self) -> bool:
        """Whether the cart has measured often enough to know its rate."""
        return len(self._intervals) >= ENOUGH

    @property
    def interval(self) -> float:
        """The usual time between two measurements [s]."""
        return self._interval * 1e-9

    @property
    def jitter(self) -> float:
        """The greatest difference between the last intervals and the usual one [s]."""
        return max((abs(each - self._interval) for each in self._intervals), default=0) * 1e-9

    @property
    def seconds(self) -> float:
        """Time since the start of the trial, by the cart's clock [s]."""
        return (self.stamp - self._start) * 1e-9
