"""Measures how punctual a real-time cart is."""

from array import array

import numpy as np

from upright.support.words import count


class Punctuality:
    """Statistics of the control periods of a trial, from the first command to the last."""

    def __init__(self) -> None:
        self._delays = array("d")  # time by which the end of each period was late [s]
        self._latencies = array("d")  # time from a measurement to the command it led to [s]
        self.missed = 0
        """Number of periods without a new command."""
        self._since_command = 0  # periods since the last command
        self._published = 0.0  # time at which the last measurement was published [s]

    def period(self, late: float, now: float) -> None:
        """Record the end of a period.

        Parameters
        ----------
        late
            By how much the end was late [s].
        now
            Time at which its measurement was published [s].
        """
        self._delays.append(late)
        self._since_command += 1
        self._published = now

    def command(self, now: float) -> None:
        """Record the arrival of a command at the time `now` [s]."""
        self.missed += max(0, self._since_command - 1)
        if self._since_command:
            self._latencies.append(now - self._published)
        self._since_command = 0

    def summary(self) -> str:
        """Return the statistics in one line, or an empty string if there are none."""
        if not self._latencies:
            return ""
        delays = np.array(self._delays[: len(self._delays) - self._since_command or None])
        p50, p99, worst = 1e3 * np.quantile(np.abs(delays), (0.5, 0.99, 1.0))
        latency50, latency99 = 1e3 * np.quantile(np.array(self._latencies), (0.5, 0.99))
        return (
            f"{count(len(delays), 'period')}, {self.missed:,} missed; jitter: p50 {p50:.2f} ms, "
            f"p99 {p99:.2f} ms, max {worst:.2f} ms; command latency: p50 {latency50:.2f} ms, "
            f"p99 {latency99:.2f} ms"
        )
