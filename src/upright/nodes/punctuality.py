"""How punctual a cart is that moves by the wall clock."""

from array import array

import numpy as np


class Punctuality:
    """Statistics of the periods of a trial, from the first command to the last."""

    def __init__(self) -> None:
        self._late = array("d")  # how long after its time each period ended [s]
        self._answers = array("d")  # how long after a measurement its command came [s]
        self._missed = 0
        self._without = 0  # periods since the last command
        self._told = 0.0  # when the last measurement was published [s]

    def period(self, late: float, now: float) -> None:
        """Note that a period has ended, so much too late [s], and was told of `now` [s]."""
        self._late.append(late)
        self._without += 1
        self._told = now

    def command(self, now: float) -> None:
        """Note that a command came [s]."""
        self._missed += max(0, self._without - 1)
        if self._without:
            self._answers.append(now - self._told)
        self._without = 0

    def summary(self) -> str:
        """Return the statistics in a line; nothing if there are none."""
        if not self._answers:
            return ""
        late = np.array(self._late[: len(self._late) - self._without or None])
        p50, p99, worst = 1e3 * np.quantile(np.abs(late), (0.5, 0.99, 1.0))
        answer50, answer99 = 1e3 * np.quantile(np.array(self._answers), (0.5, 0.99))
        return (
            f"{len(late):,} periods, {self._missed:,} missed; jitter: p50 {p50:.2f} ms, "
            f"p99 {p99:.2f} ms, at most {worst:.2f} ms; commands came after {answer50:.2f} ms "
            f"(p50), {answer99:.2f} ms (p99)"
        )
