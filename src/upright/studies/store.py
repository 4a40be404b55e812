"""Stores results in SQLite: a row for every finished run, written as it ends."""

import json
import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from upright.core.trials import Result
from upright.errors import UprightError
from upright.support.short_repr import counted

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
    PRIMARY KEY (case_id, seed, run)
) WITHOUT ROWID;
"""


class Store:
    """A file of finished runs. Several processes may write to the same one.

    Parameters
    ----------
    path
        Path of the database; created if missing (its folder must exist). Without one, results are
        kept in memory.

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
        self.path = path
        name = ":memory:" if path is None else str(path)
        if path is not None and must_exist and not Path(path).is_file():
            raise UprightError(f"store is {name!r}; there is no such file")
        if path is not None and not Path(path).parent.is_dir():
            raise UprightError(f"store is {name!r}; its folder does not exist")
        with self._explaining_errors():
            self._database = sqlite3.connect(name, timeout=PATIENCE, isolation_level=None)
        try:
            with self._explaining_errors():
                self._prepare()
        except BaseException:
            self._database.close()
            raise

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        place = "in memory" if self.path is None else repr(str(self.path))
        try:
            ((cases, runs),) = self._database.execute(
                "SELECT count(DISTINCT case_id), count(*) FROM runs"
            )
        except sqlite3.Error:  # it is closed, or another thread's
            return f"Store({place})"
        return f"Store({place}, {counted(cases, 'case')}, {counted(runs, 'run')})"

    @contextmanager
    def _explaining_errors(self) -> Iterator[None]:
        """Turn errors of the database into one-line errors that name the store."""
        try:
            yield
        except sqlite3.Error as error:
            raise UprightError(f"store is {str(self.path)!r}; it cannot be used: {error}") from None

    def _prepare(self) -> None:
        ((tables,),) = self._database.execute("SELECT count(*) FROM sqlite_master")
        ((application,),) = self._database.execute("PRAGMA application_id")
        if application != APPLICATION_ID:
            if application or tables:
                raise UprightError(
                    f"store is {str(self.path)!r}; it is a database of another program"
                )
            self._database.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        self._write_ahead()
        self._database.execute("PRAGMA synchronous = NORMAL")
        self._database.executescript(SCHEMA)

    def _write_ahead(self) -> None:
        """Switch to the write-ahead log, so that a killed process loses nothing.

        While another process does the same, SQLite fails at once instead of waiting.
        """
        until = time.monotonic() + PATIENCE
        while True:
            try:
                self._database.execute("PRAGMA journal_mode = WAL")
            except sqlite3.OperationalError as error:
                if "locked" not in str(error) or time.monotonic() > until:
                    raise
                time.sleep(0.01)
            else:
                return

    def finished(self, key: str, seed: int) -> set[int]:
        """Return the numbers of the finished runs of a case."""
        with self._explaining_errors():
            rows = self._database.execute(
                "SELECT run FROM runs JOIN cases ON id = case_id WHERE key = ? AND seed = ?",
                (key, seed),
            )
            return {run for (run,) in rows}

    def add(self, key: str, seed: int, result: Result) -> None:
        """Store a finished run; a stored run with the same number is kept instead.

        Raises
        ------
        UprightError
            If the disk is full or the file cannot be written.
        """
        lengths = result.lengths.astype("<i4").tobytes()
        row = (seed, result.run, result.success, lengths, result.seconds, key)
        with self._explaining_errors(), self._database:
            self._database.execute("BEGIN IMMEDIATE")
            self._database.execute("INSERT OR IGNORE INTO cases (key) VALUES (?)", (key,))
            self._database.execute(
                "INSERT OR IGNORE INTO runs (case_id, seed, run, success, lengths, seconds) "
                "SELECT id, ?, ?, ?, ?, ? FROM cases WHERE key = ?",
                row,
            )

    def results(self, key: str, seed: int, runs: int | None = None) -> list[Result]:
        """Return the finished runs of a case in order, or the first `runs` of them."""
        with self._explaining_errors():
            rows = self._database.execute(
                "SELECT run, success, lengths, seconds FROM runs JOIN cases ON id = case_id "
                "WHERE key = ? AND seed = ? AND run < ? ORDER BY run",
                (key, seed, 2**62 if runs is None else runs),
            ).fetchall()
        return [
            Result(run, bool(success), np.frombuffer(lengths, "<i4").astype(np.int64), seconds)
            for run, success, lengths, seconds in rows
        ]

    def cases(self) -> list[tuple[dict[str, Any], str, int]]:
        """Return the stored cases: each as a dictionary, its key, and a seed."""
        with self._explaining_errors():
            rows = self._database.execute(
                "SELECT DISTINCT key, seed FROM runs JOIN cases ON id = case_id "
                "ORDER BY case_id, seed"
            ).fetchall()
        return [(json.loads(key), key, seed) for key, seed in rows]

    def close(self) -> None:
        """Close the file."""
        self._database.close()
