"""Results in SQLite: a row for every finished run, written as it ends."""

import json
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from upright.errors import UprightError

APPLICATION_ID = 0x55505254
"""Marks a database as one of ours ("UPRT")."""
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


class Result(NamedTuple):
    """What came of one run."""

    run: int
    """Number of the run within its study."""
    success: bool
    """Whether its last trial lasted N steps."""
    lengths: np.ndarray
    """Steps of each trial, in order; every trial is counted."""
    seconds: float
    """Wall time."""

    @property
    def trials(self) -> int:
        """How many trials were made."""
        return len(self.lengths)


class Store:
    """A file of finished runs. Several processes may write to the same one.

    Parameters
    ----------
    path
        The database; made if missing, but for its folder. Without one, results stay in memory.

    Raises
    ------
    UprightError
        If the file cannot be opened or written, is damaged, or is not a store.
    """

    def __init__(self, path: Path | str | None = None, *, must_exist: bool = False) -> None:
        self.path = path
        name = ":memory:" if path is None else str(path)
        if path is not None and must_exist and not Path(path).is_file():
            raise UprightError(f"store is {name!r}; there is no such file")
        if path is not None and not Path(path).parent.is_dir():
            raise UprightError(f"store is {name!r}; its folder does not exist")
        try:
            self._database = sqlite3.connect(name, timeout=60, isolation_level=None)
            self._prepare(name)
        except sqlite3.Error as error:
            raise UprightError(f"store is {name!r}; it cannot be used: {error}") from None

    def _prepare(self, name: str) -> None:
        ((tables,),) = self._database.execute("SELECT count(*) FROM sqlite_master")
        ((application,),) = self._database.execute("PRAGMA application_id")
        if application != APPLICATION_ID and tables:
            raise UprightError(f"store is {name!r}; it is a database of another program")
        if application != APPLICATION_ID:
            self._database.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        self._database.execute("PRAGMA journal_mode = WAL")
        self._database.execute("PRAGMA synchronous = NORMAL")
        self._database.executescript(SCHEMA)

    def finished(self, key: str, seed: int) -> set[int]:
        """Return the numbers of the runs of a case that are done."""
        rows = self._database.execute(
            "SELECT run FROM runs JOIN cases ON id = case_id WHERE key = ? AND seed = ?",
            (key, seed),
        )
        return {run for (run,) in rows}

    def add(self, key: str, seed: int, result: Result) -> None:
        """Write a finished run down; one that is there already stays.

        Raises
        ------
        UprightError
            If the disk is full or the file cannot be written.
        """
        lengths = result.lengths.astype("<i4").tobytes()
        row = (seed, result.run, result.success, lengths, result.seconds, key)
        try:
            with self._database:
                self._database.execute("BEGIN IMMEDIATE")
                self._database.execute("INSERT OR IGNORE INTO cases (key) VALUES (?)", (key,))
                self._database.execute(
                    "INSERT OR IGNORE INTO runs (case_id, seed, run, success, lengths, seconds) "
                    "SELECT id, ?, ?, ?, ?, ? FROM cases WHERE key = ?",
                    row,
                )
        except sqlite3.Error as error:
            raise UprightError(f"store is {str(self.path)!r}; writing failed: {error}") from None

    def results(self, key: str, seed: int, runs: int | None = None) -> list[Result]:
        """Return the finished runs of a case in order, up to number `runs` if given."""
        rows = self._database.execute(
            "SELECT run, success, lengths, seconds FROM runs JOIN cases ON id = case_id "
            "WHERE key = ? AND seed = ? AND run < ? ORDER BY run",
            (key, seed, 2**62 if runs is None else runs),
        )
        return [
            Result(run, bool(success), np.frombuffer(lengths, "<i4").astype(np.int64), seconds)
            for run, success, lengths, seconds in rows
        ]

    def cases(self) -> Iterator[tuple[dict[str, Any], str, int]]:
        """Yield what is held: each case as a dictionary, its key, and a seed."""
        rows = self._database.execute(
            "SELECT DISTINCT key, seed FROM runs JOIN cases ON id = case_id ORDER BY case_id, seed"
        )
        for key, seed in rows.fetchall():
            yield json.loads(key), key, seed

    def close(self) -> None:
        """Close the file."""
        self._database.close()
