"""How fast an observed run goes on, which the keys of its window change."""

import math
import threading
import time

import numpy as np

from upright.errors import Stopped

SPEEDS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, math.inf)
"""Speeds relative to real time, those of the MATLAB twin; the last is as fast as possible."""
NAP = 0.01
"""Longest sleep without looking whether anything has changed [s]."""
LATENESS = 0.25
"""A run that is this late does not catch up [s]."""


class Pace:
    """How fast a run goes on: `wait` is called by the run, all else by whoever watches it.

    Parameters
    ----------
    stop
        Shape (1,), bool. Once it is set, the run stops at its next step, even while paused.
    """

    def __init__(self, stop: np.ndarray) -> None:
        self.speed, self.paused = 1.0, False
        self._stop = stop
        self._due = time.perf_counter()
        self._steps = threading.Semaphore(0)
        """Steps that a paused run may make."""

    def obey(self, command: str) -> None:
        """Do what a key asks for: "faster", "slower", "pause" (or go on), or "step"."""
        if command == "faster":
            self.speed = min([speed for speed in SPEEDS if speed > self.speed], default=math.inf)
        elif command == "slower":
            self.speed = max([each for each in SPEEDS if each < self.speed], default=SPEEDS[0])
        elif command == "pause":
            self.paused = not self.paused
        elif command == "step" and self.paused:
            self._steps.release()
        self._due = time.perf_counter()

    def let_go(self) -> None:
        """Let the run go on as fast as possible."""
        self.speed, self.paused = math.inf, False

    def __str__(self) -> str:
        """Return the speed in words."""
        if self.paused:
            return "paused"
        return "as fast as possible" if self.speed == math.inf else f"{self.speed:g}× real time"

    def wait(self, seconds: float) -> None:
        """Wait until simulated time may go on by this many seconds.

        Raises
        ------
        Stopped
            If the run is to stop.
        """
        if self.speed == math.inf and not self.paused:
            return
        self._due = max(self._due + seconds / self.speed, time.perf_counter() - LATENESS)
        while self.paused or self._due - time.perf_counter() > 0.001:  # shorter sleeps are longer
            if self._stop[0]:
                raise Stopped
            if not self.paused:
                time.sleep(min(NAP, max(0.0, self._due - time.perf_counter())))
            elif self._steps.acquire(timeout=NAP):
                break
