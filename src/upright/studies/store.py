"""Stores results in SQLite: a row for every finished run, written as it ends."""

import json
import os
import reprlib
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from itertools import count as count_up
from itertools import groupby
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from upright import __version__
from upright.core.trials import Result
from upright.errors import CodeError, UprightError, require_kind
from upright.studies.case import Case
from upright.studies.database import Database, check_place, is_there, log_of, open_to_read
from upright.studies.outcomes import Outcomes, make_outcomes
from upright.studies.recorded_environment import present_environment
from upright.studies.records import describe_case, make_frame
from upright.studies.schema import FORMS, NEWEST, Form, form_of, prepare, put
from upright.studies.stored_run import StoredRun, as_result, as_stored, key_checksum
from upright.support import words

if TYPE_CHECKING:
    import pandas

COLUMNS = ", ".join(StoredRun._fields)
"""The columns of a run but for the lengths of its trials, for queries."""


class Version(NamedTuple):
    """A run as it is in one place."""

    place: str
    """Where that is, such as the path of a store."""
    result: Result
    """What came out."""
    environment: str
    """What it was made with, as JSON; empty if that is not known."""


class Store:
    """A file of finished runs. Several processes may write to the same one.

    A file is opened for reading, which never changes it, until the first run is added. A file of an
    earlier version then gets its present form.

    Parameters
    ----------
    path
        Path of the database; if there is none, it is created when the first run is stored (its
        folder must exist). Without a path, results are kept in memory.

    Raises
    ------
    UprightError
        If the file cannot be opened or written, is damaged, or is not a store.

    Examples
    --------
    The second study finds ten runs in the store, and makes ten more:

    >>> case = upright.make_case("random-search", steps=300)
    >>> with upright.Store("runs.sqlite") as store:
    ...     results = upright.study([case], runs=10, store=store)
    ...     results = upright.study([case], runs=20, store=store)
    >>> len(results[case])
    20
    """

    def __init__(self, path: Path | str | None = None, *, must_exist: bool = False) -> None:
        require_kind("store", path, (str, Path, NoneType), "the path of a file")
        self.path = path
        self._place = None if path is None else Path(path).absolute()  # an agent may go elsewhere
        self._database: Database | None = None
        self._form: Form | None = None
        """The form of the file; None while it holds nothing."""
        self._is_written = False
        if path is None or self._place is None:
            self._open_to_write()
        elif is_there(path):
            self._open_to_read(self._place)
        elif must_exist:
            raise UprightError(f"store is {str(path)!r}; there is no such file")
        else:
            check_place(path)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        place = "in memory" if self.path is None else repr(str(self.path))
        try:
            rows = self._rows("SELECT count(DISTINCT case_id), count(*) FROM {runs}")
        except UprightError:  # it is closed, or another thread's
            return f"Store({place})"
        cases, runs = rows[0] if rows else (0, 0)
        return f"Store({place}, {words.count(cases, 'case')}, {words.count(runs, 'run')})"

    def _open_to_read(self, path: Path) -> None:
        database = open_to_read(path, str(self.path))
        try:
            form = form_of(database)
        except BaseException:
            database.close()
            raise
        self._database, self._form = database, form

    def _open_to_write(self) -> Database:
        """Return the database, which can be written to from now on."""
        if self._database and self._is_written:
            return self._database
        path = self._place
        if path and not all(
            os.access(each, os.W_OK) for each in (path, path.parent) if each.exists()
        ):
            raise UprightError(f"store is {str(self.path)!r}; it cannot be written to, only read")
        if self._database:
            self._database.close()
        database = Database(path, name=str(self.path))
        try:
            prepare(database)
        except BaseException:
            database.close()
            raise
        self._database, self._form, self._is_written = database, FORMS[NEWEST], True
        return database

    def _rows(self, query: str, values: Iterable[object] = ()) -> list[Any]:
        """Return what a query finds, which is nothing while there is no file.

        In the query, {runs} and {environments} stand for tables with the columns of the present
        form.
        """
        return list(self._each_row(query, values))

    def _each_row(self, query: str, values: Iterable[object] = ()) -> Iterator[Any]:
        """Yield what `_rows` returns, row by row as it is read."""
        if self._form is None and self._place is not None and is_there(self._place):
            self.close()
            self._open_to_read(self._place)  # another process may have made it a store
        if self._database and self._form:
            names = {"runs": self._form.runs, "environments": self._form.environments}
            yield from self._database.each(query.format(**names), tuple(values))

    @contextmanager
    def writing(self) -> Iterator[Database]:
        """Let the block write, and keep what it has written as a whole or not at all.

        Raises
        ------
        UprightError
            If the disk is full, the file cannot be written, or it was deleted or replaced; then
            all runs are in a new file, which the error names.
        """
        database = self._open_to_write()
        with database.transaction():
            yield database
        self._require_in_place()

    def _require_in_place(self) -> None:
        """Raise UprightError if the file was deleted or replaced, after saving what is in it."""
        database = self._database
        if database is None or not self._is_written or database.is_in_place():
            return
        self._database, self._form, self._is_written = None, None, False
        path = Path(str(self._place))
        why = "it was deleted, moved or replaced by another program as runs were made"
        try:
            for folder in (path.parent, Path(tempfile.gettempdir())):
                place = _free_name(folder / path.name)
                try:
                    database.run("VACUUM INTO ?", (str(place),))
                except UprightError as error:
                    fault = error
                else:
                    database.remove_log()
                    raise database.fault(f"{why}; all its runs are in {str(place)!r}")
            raise database.fault(f"{why}, and its runs could not be kept elsewhere: {fault}")
        finally:
            database.close()

    def finished(self, key: str, seed: int) -> set[int]:
        """Return the numbers of the finished runs of a case."""
        query = "SELECT run FROM {runs} JOIN cases ON id = case_id WHERE key = ? AND seed = ?"
        return {run for (run,) in self._rows(query, (key, seed))}

    def add(self, key: str, seed: int, result: Result, environment: str | None = None) -> None:
        """Store a finished run; a stored run with the same number is kept instead.

        Parameters
        ----------
        key, seed
            Key of its case, and seed of its study.
        result
            The run.
        environment
            What it was made with, as `present_environment` returned it on its machine; unless
            given, that of this process.

        Raises
        ------
        UprightError
            If the disk is full, the file cannot be written, or it was deleted or replaced.
        """
        self.add_several([(key, result)], seed, environment)

    def add_several(
        self, runs: Iterable[tuple[str, Result]], seed: int, environment: str | None = None
    ) -> None:
        """Store finished runs, each with the key of its case, as `add` does: all or none of them.

        That is several times as fast as to store them one by one.
        """
        ended = datetime.now(UTC).replace(tzinfo=None)
        with self.writing() as database:
            for key, result in runs:
                row, lengths = as_stored(seed, result, ended, __version__)
                put(database, key, row, lengths, environment or present_environment())

    def recover(self) -> None:
        """Take into the file what a killed process left beside it, which reading alone does not."""
        if self._place and not self._is_written and log_of(self._place).exists():
            self._open_to_write()

    def results(self, key: str, seed: int, runs: int | None = None) -> list[Result]:
        """Return the finished runs of a case in order, or the first `runs` of them."""
        return [as_result(row, lengths) for _, row, lengths in self._of_case(key, seed, runs)]

    def outcomes(self, key: str, seed: int, runs: int | None = None) -> Outcomes:
        """Return what came out of the finished runs of a case in order, or of its first `runs`."""
        found = self._of_case(key, seed, runs, with_lengths=False)
        return make_outcomes(
            (row.run, bool(row.success), row.trials, row.steps, row.seconds) for _, row, _ in found
        )

    def _of_case(
        self, key: str, seed: int, runs: int | None, *, with_lengths: bool = True
    ) -> Iterator[tuple[int, StoredRun, bytes]]:
        """Yield the finished runs of a case in order, or the first `runs` of them."""
        where, values = "WHERE case_id = ? AND seed = ?", [seed]
        if runs is not None:
            where, values = f"{where} AND run < ?", [seed, runs]
        for (case,) in self._rows("SELECT id FROM cases WHERE key = ?", (key,)):
            yield from self._checked({case: key}, where, (case, *values), with_lengths)

    def _checked(
        self,
        keys: dict[int, str],
        where: str = "",
        values: Iterable[object] = (),
        with_lengths: bool = True,
        on_damage: Callable[[str], None] | None = None,
    ) -> Iterator[tuple[int, StoredRun, bytes]]:
        """Yield the runs of some cases, whose keys are given by number, as they are read.

        Keys that were written since are added to those given.

        Raises
        ------
        UprightError
            If a run is damaged, unless something else is to be done then.
        """
        checksums = {case: key_checksum(key) for case, key in keys.items()}
        columns = COLUMNS + ", lengths" * with_lengths
        query = f"SELECT case_id, {columns} FROM {{runs}} {where} ORDER BY case_id, seed, run"
        previous: tuple[int, ...] = ()
        for case, *cells in self._each_row(query, values):
            if case not in checksums:
                keys.update(self._keys())
                checksums = {case: -1} | {each: key_checksum(key) for each, key in keys.items()}
            lengths = cells.pop() if with_lengths else b""
            row = StoredRun._make(cells)
            place = case, row.seed, row.run
            if (
                row.is_sound(checksums.get(case, -1))
                and (not with_lengths or row.has(lengths))
                and place > previous  # else a damaged file could go on for ever
            ):
                previous = place
                yield case, row, lengths
            else:
                run, seed, number = map(reprlib.repr, (row.run, row.seed, case))
                (on_damage or self._refuse)(f"run {run} of seed {seed} of case {number}")

    def _refuse(self, damage: str) -> None:
        advice = "upright verify lists all that is damaged, and upright merge saves the rest"
        raise self.fault(f"it is damaged in {damage}; {advice}")

    def fault(self, text: str) -> UprightError:
        """Return the error which says this of the file."""
        assert self._database is not None
        return self._database.fault(text)

    def _keys(self) -> dict[int, str]:
        """Return the keys of all cases by their numbers."""
        keys = dict(self._rows("SELECT id, key FROM cases"))
        if not all(isinstance(key, str) for key in keys.values()):
            raise self.fault("it is damaged: the key of a case is not text")
        return keys

    def count(self) -> int:
        """Return the number of all runs."""
        return sum(number for (number,) in self._rows("SELECT count(*) FROM {runs}"))

    def find(self, key: str, seed: int, run: int) -> Version | None:
        """Return a finished run, with what it was made with; None if it is not there."""
        for (case,) in self._rows("SELECT id FROM cases WHERE key = ?", (key,)):
            where = "WHERE case_id = ? AND seed = ? AND run = ?"
            for _, row, lengths in self._checked({case: key}, where, (case, seed, run)):
                query = "SELECT description FROM {environments} WHERE id = ?"
                known = self._rows(query, (row.environment,))
                made_with = str(known[0][0]) if known else ""
                return Version(str(self.path), as_result(row, lengths), made_with)
        return None

    def damage(self) -> Iterator[str]:
        """Yield what is damaged in the structure of the file, in words."""
        for (text,) in self._rows("PRAGMA integrity_check"):
            if text != "ok":
                yield str(text)

    def each_run(
        self, on_damage: Callable[[str], None] | None = None
    ) -> Iterator[tuple[str, StoredRun, bytes]]:
        """Yield every run, case by case, as it is read: the key of its case, and what is stored.

        Parameters
        ----------
        on_damage
            Called with the place of each damaged run, which is left out.

        Raises
        ------
        UprightError
            If a run is damaged and `on_damage` is not given, or the file cannot be read.
        """
        keys = self._keys()
        for case, row, lengths in self._checked(keys, on_damage=on_damage):
            yield keys[case], row, lengths

    def runs(self) -> Iterator[tuple[dict[str, Any], Result]]:
        """Yield every run, case by case, as it is read: what is known of it, and its result.

        Yields
        ------
        tuple
            The values of the run that its result does not have, by name (see docs/data.md): what
            identifies it, when it ended, the version that made it and the number of its
            environment. And the result.

        Raises
        ------
        UprightError
            If the file is damaged, or a case is of an agent or plant that is not there.
        """
        keys = self._keys()
        for number, found in groupby(self._checked(keys), key=lambda each: each[0]):
            case = {"case": number, **describe_case(self.case(keys[number]))}
            for _, row, lengths in found:
                yield case | row.about(), as_result(row, lengths)

    def frame(self, each: str = "run") -> "pandas.DataFrame":
        """Return all runs as a tidy pandas DataFrame.

        Parameters
        ----------
        each
            "run" for a row for each run, or "trial" for a row for each trial. The columns are those
            of `upright show --each`, which docs/data.md describes: what identifies the run, then
            `success`, `trials`, `steps` and others, or `trial`, `steps` and `fallen`. Names are
            categories.

        Raises
        ------
        UprightError
            If pandas is missing, the file is damaged, or a case is of an agent or plant that is
            not there.

        Examples
        --------
        >>> case = upright.make_case("random-search", steps=300)
        >>> with upright.Store() as store:
        ...     results = upright.study([case], runs=10, store=store)
        ...     runs, trials = store.frame(), store.frame("trial")
        >>> len(runs), len(trials) == runs["trials"].sum()
        (10, True)
        """
        return make_frame(self.runs(), each)

    def version(self, key: str, seed: int) -> str | None:
        """Return the version of this package that made the runs of a case, or all such versions.

        Returns
        -------
        str or None
            None if the version of any run is not known.
        """
        rows = self._rows(
            "SELECT DISTINCT version FROM {runs} JOIN cases ON id = case_id "
            "WHERE key = ? AND seed = ? ORDER BY version",
            (key, seed),
        )
        versions = [version for (version,) in rows]
        return None if None in versions or not versions else " and ".join(map(str, versions))

    def cases(self) -> list[tuple[dict[str, Any], str, int]]:
        """Return the stored cases: each as a dictionary, its key, and a seed."""
        rows = self._rows("SELECT DISTINCT case_id, seed FROM {runs} ORDER BY case_id, seed")
        keys = self._keys()  # afterwards, as others may be writing
        for case, seed in rows:  # looked up as `results` does: an index may be damaged by itself
            first = (
                self._of_case(keys[case], seed, None, with_lengths=False) if case in keys else ()
            )
            if not any(True for _ in first):
                raise self.fault("it is damaged: the runs of a case are not found")
        return [(self._values(keys[case]), keys[case], seed) for case, seed in rows]

    def case(self, key: str) -> Case:
        """Return the case of a key of this store.

        Raises
        ------
        UprightError
            If the key is damaged, or its agent or plant is not there.
        """
        try:
            return Case.from_data(self._values(key))
        except CodeError:
            raise
        except UprightError as error:
            raise self.fault(f"a case in it cannot be read: {error}") from None

    def _values(self, key: str) -> dict[str, Any]:
        """Return a key as data."""
        try:
            values = json.loads(key)
        except (ValueError, RecursionError):
            values = None
        if not isinstance(values, dict):
            raise self.fault("it is damaged: the key of a case is not the JSON of one")
        return values

    def environments(self) -> dict[int, tuple[str, int]]:
        """Return what the runs were made with, by number: its description, and how many runs.

        Number 0, with an empty description, stands for what earlier versions did not record.
        """
        found = self._rows(
            "SELECT environment, description, count(*) FROM {runs} LEFT JOIN {environments} "
            "ON id = environment GROUP BY environment ORDER BY environment"
        )
        return {number or 0: (description or "", runs) for number, description, runs in found}

    def close(self) -> None:
        """Close the file.

        Raises
        ------
        UprightError
            If it was deleted or replaced since runs were added to it; then they are in a new file,
            which the error names.
        """
        if self._database is not None:
            try:
                self._require_in_place()
            finally:
                if self._database:
                    self._database.close()


def _free_name(path: Path) -> Path:
    """Return a path like this one where nothing is yet, to keep the runs of a lost store."""
    names = (f"{path.stem}.rescued-{number}{path.suffix}" for number in count_up(1))
    return next(place for name in names if not (place := path.with_name(name)).exists())
