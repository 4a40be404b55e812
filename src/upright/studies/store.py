"""Stores results in SQLite: a row for every finished run, written as it ends."""

import json
import os
import sqlite3
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any

import numpy as np

from upright import __version__
from upright.core.trials import Result
from upright.errors import UprightError, require_kind
from upright.studies.case import Case
from upright.studies.outcomes import Outcomes, outcomes_of
from upright.studies.records import describe_case, make_frame
from upright.support.words import count

if TYPE_CHECKING:
    import pandas

APPLICATION_ID = 0x55505254
"""Marks a database as a store of this package ("UPRT")."""
PATIENCE = 60.0
"""How long to wait while another process is writing [s]."""
SCHEMA = """
CREATE TABLE IF NOT EXISTS cases (
    id INTEGER PRIMARY KEY,
    key TEXT NOT NULL UNIQUE
);
CREATE TABLE IF NOT EXISTS runs (
    case_id INTEGER NOT NULL REFERENCES cases (id),
    seed INTEGER NOT NULL,
    run INTEGER NOT NULL,
    success INTEGER NOT NULL,
    lengths BLOB NOT NULL,
    seconds REAL NOT NULL,
    ended TEXT NOT NULL DEFAULT (datetime('now')),
    version TEXT,
    PRIMARY KEY (case_id, seed, run)
) WITHOUT ROWID;
"""


class Store:
    """A file of finished runs. Several processes may write to the same one.

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
        self._database: sqlite3.Connection | None = None
        if path is None or Path(path).exists():
            self._open()
        elif must_exist:
            raise UprightError(f"store is {str(path)!r}; there is no such file")
        elif not Path(path).parent.is_dir():
            raise UprightError(f"store is {str(path)!r}; its folder does not exist")
        elif not os.access(Path(path).parent, os.W_OK):
            raise UprightError(f"store is {str(path)!r}; its folder cannot be written to")

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        place = "in memory" if self.path is None else repr(str(self.path))
        try:
            rows = self._rows("SELECT count(DISTINCT case_id), count(*) FROM runs")
        except UprightError:  # it is closed, or another thread's
            return f"Store({place})"
        cases, runs = rows[0] if rows else (0, 0)
        return f"Store({place}, {count(cases, 'case')}, {count(runs, 'run')})"

    @contextmanager
    def _explaining_errors(self) -> Iterator[None]:
        """Turn errors of the database into one-line errors that name the store."""
        try:
            yield
        except sqlite3.Error as error:
            raise UprightError(f"store is {str(self.path)!r}; it cannot be used: {error}") from None

    def _open(self) -> sqlite3.Connection:
        """Open the file, and create it if need be."""
        name = ":memory:" if self.path is None else str(self.path)
        with self._explaining_errors():
            database = sqlite3.connect(name, timeout=PATIENCE, isolation_level=None)
        try:
            with self._explaining_errors():
                self._prepare(database)
        except BaseException:
            database.close()
            raise
        self._database = database
        return database

    def _rows(self, query: str, values: Sequence[object] = ()) -> list[Any]:
        """Return what the file holds, which is nothing while there is none."""
        return list(self._each_row(query, values))

    def _each_row(self, query: str, values: Sequence[object] = ()) -> Iterator[Any]:
        """Yield what `_rows` returns, row by row as it is read."""
        if self._database is None and not Path(str(self.path)).exists():
            return
        database = self._database or self._open()
        with self._explaining_errors():
            # `yield from` would close the cursor of a reader that ends early, which SQLite refuses
            # if the store was closed first.
            for row in database.execute(query, values):  # noqa: UP028
                yield row

    def _prepare(self, database: sqlite3.Connection) -> None:
        ((tables,),) = database.execute("SELECT count(*) FROM sqlite_master")
        ((application,),) = database.execute("PRAGMA application_id")
        if application != APPLICATION_ID:
            if application or tables:
                raise UprightError(
                    f"store is {str(self.path)!r}; it is a database of another program"
                )
            database.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        self._write_ahead(database)
        database.execute("PRAGMA synchronous = NORMAL")
        database.executescript(SCHEMA)

    def _write_ahead(self, database: sqlite3.Connection) -> None:
        """Switch to the write-ahead log, so that a killed process loses nothing.

        While another process does the same, SQLite fails at once instead of waiting.
        """
        until = time.monotonic() + PATIENCE
        while True:
            try:
                database.execute("PRAGMA journal_mode = WAL")
            except sqlite3.OperationalError as error:
                if "locked" not in str(error) or time.monotonic() > until:
                    raise
                time.sleep(0.01)
            else:
                return

    def finished(self, key: str, seed: int) -> set[int]:
        """Return the numbers of the finished runs of a case."""
        query = "SELECT run FROM runs JOIN cases ON id = case_id WHERE key = ? AND seed = ?"
        return {run for (run,) in self._rows(query, (key, seed))}

    def add(self, key: str, seed: int, result: Result) -> None:
        """Store a finished run; a stored run with the same number is kept instead.

        Raises
        ------
        UprightError
            If the disk is full or the file cannot be written.
        """
        lengths = result.lengths.astype("<i4").tobytes()
        row = (seed, result.run, result.success, lengths, result.seconds, __version__, key)
        database = self._database or self._open()
        with self._explaining_errors(), database:
            database.execute("BEGIN IMMEDIATE")
            if not self._names_versions():  # in a store of version 0.2 or earlier
                database.execute("ALTER TABLE runs ADD COLUMN version TEXT")
            database.execute("INSERT OR IGNORE INTO cases (key) VALUES (?)", (key,))
            database.execute(
                "INSERT OR IGNORE INTO runs (case_id, seed, run, success, lengths, seconds, "
                "version) SELECT id, ?, ?, ?, ?, ?, ? FROM cases WHERE key = ?",
                row,
            )

    def _names_versions(self) -> bool:
        """Whether the file has a place for the versions that runs were made with."""
        return bool(self._rows("SELECT 1 FROM pragma_table_info('runs') WHERE name = 'version'"))

    def results(self, key: str, seed: int, runs: int | None = None) -> list[Result]:
        """Return the finished runs of a case in order, or the first `runs` of them."""
        rows = self._rows(
            "SELECT run, success, lengths, seconds FROM runs JOIN cases ON id = case_id "
            "WHERE key = ? AND seed = ? AND run < ? ORDER BY run",
            (key, seed, 2**62 if runs is None else runs),
        )
        return [_result(*row) for row in rows]

    def outcomes(self, key: str, seed: int, runs: int | None = None) -> Outcomes:
        """Return what came out of the finished runs of a case in order, or of its first `runs`."""
        rows = self._each_row(
            "SELECT run, success, lengths, seconds FROM runs JOIN cases ON id = case_id "
            "WHERE key = ? AND seed = ? AND run < ? ORDER BY run",
            (key, seed, 2**62 if runs is None else runs),
        )
        return outcomes_of(_result(*row) for row in rows)

    def runs(self) -> Iterator[tuple[dict[str, Any], Result]]:
        """Yield every run, case by case, as it is read: what is known of it, and its result.

        Yields
        ------
        tuple
            The values of the run that its result does not have, by name (see docs/data.md): what
            identifies it, when it ended and the version that made it. And the result.

        Raises
        ------
        UprightError
            If the file is damaged, or a case is of an agent or plant that is not there.
        """
        version = "coalesce(version, 'unknown')" if self._names_versions() else "'unknown'"
        found = self._each_row(
            f"SELECT case_id, key, strftime('%Y-%m-%dT%H:%M:%SZ', ended), {version}, "
            "seed, run, success, lengths, seconds FROM runs JOIN cases ON id = case_id "
            "ORDER BY case_id, seed, run"
        )
        for (number, key), rows in groupby(found, key=lambda row: row[:2]):
            case = {"case": number, **describe_case(Case.from_data(json.loads(key)))}
            for _, _, ended, made_with, seed, run, *measured in rows:
                about = {"seed": seed, "run": run, "ended": ended, "version": made_with}
                yield case | about, _result(run, *measured)

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
        if not self._names_versions():
            return None
        rows = self._rows(
            "SELECT DISTINCT version FROM runs JOIN cases ON id = case_id "
            "WHERE key = ? AND seed = ? ORDER BY version",
            (key, seed),
        )
        versions = [version for (version,) in rows]
        return None if None in versions or not versions else " and ".join(versions)

    def cases(self) -> list[tuple[dict[str, Any], str, int]]:
        """Return the stored cases: each as a dictionary, its key, and a seed."""
        rows = self._rows(
            "SELECT DISTINCT key, seed FROM runs JOIN cases ON id = case_id ORDER BY case_id, seed"
        )
        return [(json.loads(key), key, seed) for key, seed in rows]

    def close(self) -> None:
        """Close the file."""
        if self._database is not None:
            self._database.close()


def _result(run: int, success: int, lengths: bytes, seconds: float) -> Result:
    """Return the result of a run from its row."""
    return Result(run, bool(success), np.frombuffer(lengths, "<i4").astype(np.int64), seconds)
