"""Merge stores of several machines into one, and compare the runs that more than one has."""

import os
from collections.abc import Iterable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path

from upright.errors import UprightError
from upright.studies.database import Database, is_there, remove_logs
from upright.studies.differences import Difference, Findings, Progress, case_in_words, is_equal
from upright.studies.schema import put
from upright.studies.store import Store, Version
from upright.studies.stored_run import as_result
from upright.support.files import check_output, creating
from upright.support.words import count


@dataclass
class Merged:
    """What `merge` did and found."""

    added: int = 0
    """Number of runs that the output got."""
    equal: int = 0
    """Number of runs that it had, and that were the same there."""
    differing: Findings[Difference] = field(default_factory=Findings)
    """Runs that came out differently in two places; the output keeps what it had first."""
    damaged: Findings[str] = field(default_factory=Findings)
    """Damaged runs, which were left out."""

    @property
    def is_sound(self) -> bool:
        """Whether no run was damaged or different."""
        return not self.damaged.total and not self.differing.total

    def __str__(self) -> str:
        """Return it in words, on several lines."""
        first = (
            f"{count(self.added, 'run')} added, {self.equal:,} there already and the same, "
            f"{self.differing.total:,} different"
        )
        damaged = self.damaged.told("damaged, and left out")
        return "\n".join([first, *damaged, *self.differing.told("different")])


def merge(
    stores: Iterable[Path | str], output: Path | str, *, on_read: Progress = lambda: None
) -> Merged:
    """Put the runs of several stores into one.

    A run that is in more than one of them must be the same: success and the length of each trial,
    bit for bit, whatever the time it took and the machine. If it is not, one of the machines is
    broken: both versions are reported, and the output keeps the one that it had first.

    Parameters
    ----------
    stores
        The stores, which are only read.
    output
        The store that gets their runs; if it is there, what it holds stays. It is written as a
        whole or not at all.
    on_read
        Called after each run that was read.

    Returns
    -------
    Merged
        What was done and found.

    Raises
    ------
    UprightError
        If a store is missing, cannot be read or is not a store, or the output cannot be written, or
        another process made it at the same time.
    KeyboardInterrupt
        If interrupted; the output is as it was.

    Examples
    --------
    Two machines made five runs each, of which they share two:

    >>> case = upright.make_case("random-search", steps=300)
    >>> for name, first in (("one.sqlite", 0), ("two.sqlite", 3)):
    ...     with upright.Store(name) as store:
    ...         for run in range(first, first + 5):
    ...             store.add(case.key, 0, upright.make_run(case, 0, run)[1])
    >>> merged = upright.merge(["one.sqlite", "two.sqlite"], "both.sqlite")
    >>> merged.added, merged.equal, merged.is_sound
    (8, 2, True)
    """
    stores = [*stores]
    merged = Merged()
    for path in stores:
        Store(path, must_exist=True).close()  # refused before anything is written
    place: AbstractContextManager[Path] = nullcontext(Path(output))
    if not is_there(output):
        check_output(output)
        remove_logs(Path(output))  # of a deleted store: SQLite would apply them to this one
        place = creating(output)
    with place as file, Store(file) as target:
        target.path = output  # for errors
        with target.writing() as database:
            for path in stores:
                with Store(path, must_exist=True) as source:
                    _add_runs(source, target, database, merged, str(output), on_read)
        made = os.stat(file)
    if not os.path.samestat(made, os.stat(output)):
        why = "another process made it at the same time; the same command adds to it what it lacks"
        raise UprightError(f"output is {str(output)!r}; {why}")
    return merged


def _add_runs(
    source: Store,
    target: Store,
    database: Database,
    merged: Merged,
    output: str,
    on_read: Progress,
) -> None:
    """Add the runs of a store to another, in its present transaction."""

    def leave_out(damage: str) -> None:
        merged.damaged.add(f"{damage} of {str(source.path)!r}")

    made_with: dict[int, tuple[str, int]] = {}
    for key, row, lengths in source.each_run(leave_out):
        on_read()
        number = row.environment or 0
        if number not in made_with:  # or written since they were read
            made_with = source.environments()
        theirs = Version(str(source.path), as_result(row, lengths), made_with[number][0])
        ours = target.find(key, row.seed, row.run)
        if ours is None:
            put(database, key, row, lengths, theirs.environment)
            merged.added += 1
        elif is_equal(ours.result, theirs.result):
            merged.equal += 1
        else:
            versions = (ours._replace(place=output), theirs)
            case = case_in_words(source, key)
            merged.differing.add(Difference(case, row.seed, row.run, versions))
