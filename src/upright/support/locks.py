"""Locks between processes, which leave nothing behind."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from upright.errors import UprightError
from upright.support.interrupts import let_interrupts_through


@contextmanager
def locked(path: Path | str) -> Iterator[None]:
    """Lock a file within the block, after waiting until no one else has locked it.

    The file itself does not change. The lock is the system's, and goes with the process that holds
    it, however that ends. Where the system or the disk has no such locks, nothing is locked.

    Raises
    ------
    UprightError
        If the file is missing or cannot be opened.
    KeyboardInterrupt
        If interrupted while waiting.
    """
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError as error:
        raise UprightError(
            f"file is {str(path)!r}; it cannot be opened: {error.strerror}"
        ) from None
    try:
        _wait_for(handle)
        yield
    finally:
        os.close(handle)


def _wait_for(handle: int) -> None:
    try:
        import fcntl  # not on Windows

        with let_interrupts_through():
            fcntl.flock(handle, fcntl.LOCK_EX)
    except (ImportError, OSError):
        return
