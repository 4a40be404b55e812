"""Runs that should be equal and are not, as `verify` and `merge` find them."""

from collections.abc import Callable
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from upright.core.trials import Result
from upright.errors import UprightError
from upright.studies.recorded_environment import in_words
from upright.studies.store import Store, Version
from upright.support.terminal import visible
from upright.support.words import count

T = TypeVar("T")
Progress = Callable[[], object]
"""Called after each run that was read."""
MOST = 100
"""How many findings are kept; the others are only counted, as a whole store may be wrong."""


class Findings(Generic[T]):
    """The first findings of a kind, and their number."""

    def __init__(self) -> None:
        self.first: list[T] = []
        """The first MOST of them."""
        self.total = 0
        """The number of all."""

    def add(self, finding: T) -> None:
        """Count a finding, and keep it if there are few."""
        self.total += 1
        if len(self.first) < MOST:
            self.first.append(finding)

    def told(self, title: str) -> list[str]:
        """Return lines with a title and the first findings; none if there are none."""
        if not self.total:
            return []
        lines = [f"  {visible(line)}" for each in self.first for line in str(each).split("\n")]
        more = [f"  and {self.total - MOST:,} more"] if self.total > MOST else []
        return [f"{title}:", *lines, *more]


class Difference(NamedTuple):
    """A run that two places have, but not the same trials."""

    case: str
    """The case, in words."""
    seed: int
    """Seed of the study."""
    run: int
    """Number of the run."""
    versions: tuple[Version, Version]
    """What each place has."""

    def __str__(self) -> str:
        """Return what differs, on one line, and both environments, each on another."""
        first, second = (version.result for version in self.versions)
        trials = min(first.trials, second.trials)
        differ = np.flatnonzero(first.lengths[:trials] != second.lengths[:trials])
        if len(differ):
            trial = int(differ[0])
            what = [
                f"{int(each.lengths[trial])} steps in trial {trial + 1}" for each in (first, second)
            ]
        elif first.trials != second.trials:
            what = [count(each.trials, "trial") for each in (first, second)]
        else:
            what = ["success" if each.success else "no success" for each in (first, second)]
        lines = [f"run {self.run} of seed {self.seed} of {self.case}:"]
        for version, found in zip(self.versions, what, strict=True):
            lines.append(f"  {found} in {version.place}: {in_words(version.environment)}")
        return "\n".join(lines)


def is_equal(first: Result, second: Result) -> bool:
    """Whether two results have the same success and the same trials, bit for bit."""
    return first.success == second.success and np.array_equal(first.lengths, second.lengths)


def case_in_words(store: Store, key: str) -> str:
    """Return the case of a key as `make_case` takes it, or the key if it cannot be read."""
    try:
        return repr(store.case(key))
    except UprightError:
        return key if len(key) < MOST else f"{key[:MOST]}…"
