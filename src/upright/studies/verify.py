"""Verify a store: check all that it holds, make a sample of its runs again, and compare."""

from array import array
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from upright.core.trials import Result
from upright.errors import UprightError, require
from upright.studies.case import Case
from upright.studies.differences import Difference, Findings, Progress, case_in_words, is_equal
from upright.studies.recorded_environment import differences, present_environment
from upright.studies.store import Store, Version
from upright.studies.study import MOST_RUNS, study
from upright.support.words import count

SAMPLE = 100
"""How many runs are made again unless another number is given."""
OTHER_CODE = "other code made them than that of this version of Upright or of their agent"
"""Why runs of another key are not made again."""
BEYOND = f"their numbers are beyond those of any study, of at most {MOST_RUNS:,} runs"
"""Why runs of such numbers are not made again."""


@dataclass
class Verification:
    """What `verify` found."""

    runs: int = 0
    """Number of sound runs in the store."""
    compared: int = 0
    """How many of them were made again."""
    differing: Findings[Difference] = field(default_factory=Findings)
    """Those that came out differently."""
    damaged: Findings[str] = field(default_factory=Findings)
    """What is damaged in the file."""
    not_comparable: Counter[str] = field(default_factory=Counter)
    """Numbers of runs that cannot be made again here, by the reason."""
    environments: dict[str, int] = field(default_factory=dict)
    """Numbers of runs by what they were made with, as JSON; empty where it is not known."""

    @property
    def is_sound(self) -> bool:
        """Whether nothing is damaged, and every run that was made again came out the same."""
        return not self.damaged.total and not self.differing.total

    def __str__(self) -> str:
        """Return it in words, on several lines."""
        same = self.compared - self.differing.total
        again = (
            f"{self.compared:,} of them made again: {same:,} the same bit for bit, "
            f"{self.differing.total:,} different"
        )
        lines = [f"{count(self.runs, 'run')} read, {again if self.compared else 'none made again'}"]
        for why, runs in self.not_comparable.items():
            lines.append(f"{count(runs, 'run')} not comparable: {why}")
        for recorded, runs in self.environments.items():
            if changes := differences(recorded, present_environment()):
                lines.append(
                    f"environment of {count(runs, 'run')}, where it differs from this one:"
                )
                lines += [f"  {change}" for change in changes if recorded] or ["  not recorded"]
        return "\n".join([*lines, *self.damaged.told("damaged"), *self.differing.told("different")])


def verify(
    path: Path | str,
    sample: int | None = SAMPLE,
    seed: int = 0,
    *,
    make: Callable[..., Any] = study,
    on_read: Progress = lambda: None,
) -> Verification:
    """Check a store, make some of its runs again, and compare them bit for bit.

    First the file is checked: its structure, and the checksum and the values of each run. Then a
    sample is drawn of those runs whose code is the present one, and made again, here, on whatever
    machine this is; of a custom agent or plant, the code is imported and executed. The file is not
    changed.

    Parameters
    ----------
    path
        The store.
    sample
        How many runs to make again; None for all.
    seed
        Seed of the sample.
    make
        Makes the runs, as `study` does.
    on_read
        Called after each run that was checked.

    Returns
    -------
    Verification
        What was found.

    Raises
    ------
    UprightError
        If there is no such file, it is not a store or cannot be read, or `sample` or `seed` is not
        a whole number in its range.
    KeyboardInterrupt
        If interrupted.

    Examples
    --------
    >>> case = upright.make_case("random-search", steps=300)
    >>> with upright.Store("verified.sqlite") as store:
    ...     results = upright.study([case], runs=10, store=store)
    >>> found = upright.verify("verified.sqlite", sample=5)
    >>> found.compared, found.is_sound
    (5, True)
    """
    if sample is not None:
        require("sample", sample, 0, 10**9, whole=True)
    require("seed", seed, 0, 2**63 - 1, whole=True)
    found = Verification()
    with Store(path, must_exist=True) as store:
        runs = _check(store, found, on_read)
        again = _sampled(_comparable(store, runs, found), sample, seed)
        for each in sorted({each for _, each in again}):
            wanted = {case: again[case, of] for case, of in again if of == each}
            with _Again(store, wanted, each, found) as place:
                make(list(wanted), place.most, each, place)
    return found


def _check(store: Store, found: Verification, on_read: Progress) -> dict[tuple[str, int], Any]:
    """Check a store; return the numbers of its sound runs by key and seed."""
    sound: dict[tuple[str, int], Any] = defaultdict(lambda: array("q"))
    try:
        for damage in store.damage():
            found.damaged.add(damage)
        for key, row, _ in store.each_run(found.damaged.add):
            sound[key, row.seed].append(row.run)
            found.runs += 1
            on_read()
        found.environments = dict(store.environments().values())
    except UprightError as error:  # no more can be read
        found.damaged.add(str(error))
    return sound


def _comparable(
    store: Store, runs: dict[tuple[str, int], Any], found: Verification
) -> dict[tuple[Case, int], np.ndarray]:
    """Return those of the runs which the present code can make again, by case and seed."""
    comparable = {}
    for (key, seed), numbers in runs.items():
        try:
            case = store.case(key)
            why = "" if case.key == key else OTHER_CODE
        except UprightError as error:
            why = str(error).partition("\n")[0]
        if why:
            found.not_comparable[why] += len(numbers)
        else:
            every = np.array(numbers)
            comparable[case, seed] = every[every < MOST_RUNS]
            if beyond := np.count_nonzero(every >= MOST_RUNS):
                found.not_comparable[BEYOND] += int(beyond)
    return comparable


def _sampled(
    runs: dict[tuple[Case, int], np.ndarray], sample: int | None, seed: int
) -> dict[tuple[Case, int], list[int]]:
    """Return a sample of runs by case and seed, or all of them."""
    ends = np.cumsum([len(numbers) for numbers in runs.values()], dtype=np.int64)
    total = int(ends[-1]) if len(ends) else 0
    size = total if sample is None else min(sample, total)
    drawn = np.sort(np.random.default_rng(seed).permutation(total)[:size])
    pieces = np.split(drawn, np.searchsorted(drawn, ends))
    chosen = {}
    for (place, numbers), piece, end in zip(runs.items(), pieces, ends, strict=False):
        if len(piece):
            chosen[place] = numbers[piece - (end - len(numbers))].tolist()
    return chosen


class _Again(Store):
    """For `study`, a store that lacks just the runs to be made again, and compares what comes.

    Parameters
    ----------
    original
        The store to be verified.
    runs, seed
        The numbers of the runs by case, and the seed of the study that made them.
    found
        Where differences are noted.
    """

    def __init__(
        self, original: Store, runs: dict[Case, list[int]], seed: int, found: Verification
    ) -> None:
        super().__init__()
        self.most = 1 + max(number for numbers in runs.values() for number in numbers)
        self._original, self._found = original, found
        self._missing = {(case.key, seed): set(numbers) for case, numbers in runs.items()}

    def finished(self, key: str, seed: int) -> set[int]:
        """Return the numbers of the runs that are not to be made."""
        return set(range(self.most)) - self._missing[key, seed]

    def add_several(
        self, runs: Iterable[tuple[str, Result]], seed: int, environment: str | None = None
    ) -> None:
        """Compare runs with the stored ones."""
        for key, result in runs:
            self._compare(key, seed, result, environment)

    def _compare(self, key: str, seed: int, result: Result, environment: str | None) -> None:
        self._missing[key, seed].discard(result.run)
        self._found.compared += 1
        stored = self._original.find(key, seed, result.run)
        if stored is None:
            raise self._original.fault("it changed while it was verified")
        if not is_equal(stored.result, result):
            here = Version("this run", result, environment or present_environment())
            case = case_in_words(self._original, key)
            self._found.differing.add(Difference(case, seed, result.run, (stored, here)))
