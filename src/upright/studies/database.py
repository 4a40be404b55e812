"""Opens SQLite files with care: reading changes nothing, and what a file holds is not trusted."""

import os
import sqlite3
import stat
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from upright.errors import UprightError
from upright.support.terminal import visible

PATIENCE = 60.0
"""How long to wait while another process is writing [s]."""
LARGEST = 2**24
"""The largest value that is read [bytes]; the trials of the longest run take a quarter of it."""
STEPS_A_BYTE, FREE_STEPS, STEPS_AT_ONCE = 20, 10**7, 10**4
"""Steps of SQLite's machine: what a query may take for each byte of its file, and besides; and how
many there are between two looks. A sound file needs fewer; one whose pages lead back to each other
would be read for ever."""
LOGS = ("-wal", "-shm", "-journal")
"""Endings of the names of what SQLite writes beside a file."""
SHARING, READING, WRITING = "mode=rw", "mode=ro", "mode=rwc"
"""How to open a file: to read it, as one of those who may write; to read it; to write it."""
ALONE = "immutable=1"
"""How to open a file that nobody can be writing: without locks, and without files beside it."""
FAULTS = (sqlite3.Error, UnicodeDecodeError)
"""What SQLite and Python's module for it raise for a damaged file."""


class Database:
    """A connection to an SQLite file; each error is one line that names the file.

    Parameters
    ----------
    path
        The file, or None for a database in memory.
    mode
        How to open it.
    name
        What errors call it, if that is not its path.
    """

    def __init__(self, path: Path | None, mode: str = WRITING, name: str = "") -> None:
        self.path, self._name = path, name or str(path)
        self._names = [os.fspath(each) for each in (path, log_of(path))] if path else []
        self._left = self._allowed = 0
        self._files: list[Any] = []
        """Which file is written, and which is its log, as far as that is known."""
        place = ":memory:" if path is None else f"{path.absolute().as_uri()}?{mode}"
        with self._explaining():
            self._connection = sqlite3.connect(
                place, timeout=PATIENCE, isolation_level=None, uri=True
            )
        self._connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST)
        self._connection.set_progress_handler(self._goes_on_too_long, STEPS_AT_ONCE)
        self._unchanged = _state(path) if path and mode == ALONE else None
        settings = ["trusted_schema = OFF", "cell_size_check = ON"]
        if mode != WRITING:
            settings.append("query_only = ON")
        try:
            for setting in settings:
                self.run(f"PRAGMA {setting}")
        except BaseException:
            self.close()
            raise

    def fault(self, text: str) -> UprightError:
        """Return the error which says this of the file."""
        return UprightError(f"store is {self._name!r}; {visible(text)}")

    @contextmanager
    def _explaining(self) -> Iterator[None]:
        """Turn errors of the database into one-line errors that name the file."""
        try:
            yield
        except FAULTS as error:
            raise self._explained(error) from None

    def _explained(self, error: Exception) -> BaseException:
        """Return what is to be raised for an error of the database."""
        if isinstance(error, UnicodeDecodeError):  # SQLite quotes what is damaged
            return self.fault(f"it cannot be used: {error.object.decode(errors='replace')}")
        if getattr(error, "sqlite_errorcode", None) != sqlite3.SQLITE_INTERRUPT:
            return self.fault(f"it cannot be used: {error}")
        if self._left >= 0:  # Ctrl-C, whose exception SQLite took from `_goes_on_too_long`
            return KeyboardInterrupt()
        return self.fault("it is damaged: reading it does not end")

    def _goes_on_too_long(self) -> bool:
        """Count the steps of a query; return whether to end it.

        Where Python is called, it also receives an interrupt.
        """
        self._left -= STEPS_AT_ONCE
        if self._left < 0:  # unless the file has grown
            allowed, self._allowed = self._allowed, self._steps_allowed()
            self._left += self._allowed - allowed
        return self._left < 0

    def _steps_allowed(self) -> int:
        """Return how many steps a query may take, by the size of the file and its log."""
        sizes = [file[2] for file in map(_state, self._names) if file]
        return FREE_STEPS + STEPS_A_BYTE * sum(sizes) if sizes else 2**62

    def each(self, query: str, values: Sequence[object] = ()) -> Iterator[Any]:
        """Yield the rows of a query as they are read."""
        self._left = self._allowed
        try:
            # `yield from` would close the cursor of a reader that ends early, which SQLite refuses
            # if the database was closed first.
            for row in self._connection.execute(query, values):  # noqa: UP028
                yield row
        except FAULTS as error:
            raise self._explained(error) from None
        if self._unchanged and self._unchanged != _state(self._names[0]):
            raise self.fault("it changed while it was read; read it again")

    def rows(self, query: str, values: Sequence[object] = ()) -> list[Any]:
        """Return the rows of a query."""
        return list(self.each(query, values))

    def run(self, statement: str, values: Sequence[object] = ()) -> None:
        """Execute a statement."""
        self.rows(statement, values)

    def define(self, name: str, function: Any) -> None:
        """Let queries call a function of one value."""
        with self._explaining():
            self._connection.create_function(name, 1, function, deterministic=True)

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Keep what is written within the block as a whole, or nothing of it."""
        self.run("BEGIN IMMEDIATE")
        try:
            yield
            self.run("COMMIT")
        except BaseException:
            if self._connection.in_transaction:  # SQLite itself takes some back
                with self._explaining():
                    self._connection.rollback()
            raise
        self._files += self._present_files()[len(self._files) :]

    def write_ahead(self) -> None:
        """Switch to the write-ahead log, so that a killed process loses nothing.

        While another process does the same, SQLite fails at once instead of waiting.
        """
        until = time.monotonic() + PATIENCE
        with self._explaining():
            while True:
                try:
                    self._connection.execute("PRAGMA journal_mode = WAL")
                except sqlite3.OperationalError as error:
                    if "locked" not in str(error) or time.monotonic() > until:
                        raise
                    time.sleep(0.01)
                else:
                    break
        # Already now, before anything is written that could be lost with the name.
        self._files = self._files or self._present_files()[:1]
        self.run("PRAGMA synchronous = NORMAL")

    def is_in_place(self) -> bool:
        """Whether the file that was written still has its name, and so has its log."""
        known = self._files
        return known == self._present_files()[: len(known)] and None not in known[:1]

    def _present_files(self) -> list[Any]:
        """Return which files have the names of the file and its log now."""
        return [(state := _state(path)) and state[:2] for path in self._names]

    def remove_log(self) -> None:
        """Remove the log of a file that has lost its name, as far as it still has its own.

        SQLite would apply it to whatever gets the name next.
        """
        if self.path and self._files[1:] == self._present_files()[1:]:
            with suppress(UprightError):  # where nothing can be changed, nothing is applied
                remove_logs(self.path)

    def close(self) -> None:
        """Close the file."""
        self._connection.close()


def open_to_read(path: Path, name: str) -> Database:
    """Open a file that is only read, and does not change by that; errors call it by this name.

    Raises
    ------
    UprightError
        If the file cannot be read, such as where a killed process left a part of it in a log, which
        cannot be read without permission to write.
    """
    writable = os.access(path, os.W_OK) and os.access(path.parent, os.W_OK)
    log, journal = _state(log_of(path)), _state(Path(f"{path}-journal"))
    if log and log[2]:  # it is being written, or a process was killed
        modes = [READING]
    elif journal:  # a process was killed; what it had not finished is taken back
        modes = [SHARING if writable else READING]
    elif writable:
        modes = [SHARING, ALONE]  # the latter on a full disk
    else:
        modes = [ALONE if _has_log(path) else READING]
    for mode in modes:
        database = Database(path, mode, name)
        try:
            database.run("SELECT count(*) FROM sqlite_master")
        except UprightError as error:
            database.close()
            fault = error
        except BaseException:
            database.close()
            raise
        else:
            return database
    if not writable and (log or journal):
        why = "a process that wrote it was killed, which is mended only where it can be written"
        raise UprightError(f"{fault}; {why}")
    raise fault


def is_there(path: Path | str) -> bool:
    """Whether there is a file of this name, which can be read.

    Raises
    ------
    UprightError
        If it cannot be one, nor have its log beside it, or something else is there.
    """
    name = f"store is {str(path)!r}"
    if not str(path) or "\0" in str(path):
        raise UprightError(f"{name}; it must be the name of a file")
    missing = FileNotFoundError, NotADirectoryError
    try:
        with suppress(*missing):
            os.stat(f"{path}{max(LOGS, key=len)}")  # whose name may be too long
        mode = os.stat(path).st_mode
    except missing:
        return False
    except OSError as error:
        raise UprightError(f"{name}; it cannot be used: {error.strerror}") from None
    if not stat.S_ISREG(mode):
        kind = "a folder" if stat.S_ISDIR(mode) else "not a regular file"
        raise UprightError(f"{name}; it is {kind}, a file is needed")
    if not os.access(path, os.R_OK):
        raise UprightError(f"{name}; it cannot be read: permission denied")
    return True


def check_place(path: Path | str) -> None:
    """Raise UprightError unless a file can be created here; a link is followed."""
    name, folder = f"store is {str(path)!r}", Path(os.path.realpath(path)).parent
    if str(path).endswith(os.sep):
        raise UprightError(f"{name}; it must be the name of a file")
    if not folder.is_dir():
        raise UprightError(f"{name}; its folder does not exist")
    if not os.access(folder, os.W_OK):
        raise UprightError(f"{name}; its folder cannot be written to")


def log_of(path: Path) -> Path:
    """Return the path of a file's write-ahead log."""
    return Path(f"{path}-wal")


def remove_logs(path: Path) -> None:
    """Remove what SQLite writes beside a file, where the file itself is gone.

    Raises
    ------
    UprightError
        If something there cannot be removed.
    """
    for log in (Path(f"{path}{ending}") for ending in LOGS):
        try:
            log.unlink(missing_ok=True)
        except OSError as error:
            why = f"{str(log)!r} is in its way and cannot be removed: {error.strerror}"
            raise UprightError(f"store is {str(path)!r}; {why}") from None


def _has_log(path: Path) -> bool:
    """Whether a file is of the kind that is written with a write-ahead log."""
    with path.open("rb") as file:
        return file.read(20)[18:] == b"\2\2"


def _state(path: Path | str) -> tuple[int, int, int, int] | None:
    """Return device, inode, size [bytes] and time of the last change [ns]; None without a file."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns
