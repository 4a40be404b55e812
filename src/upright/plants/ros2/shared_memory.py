"""Removes the shared memory that ended processes of ROS 2 have left, which fills the machine's.

Fast DDS leaves half a megabyte of each process that was killed or did not shut down. Beside each
such segment lies a file that its process keeps locked as long as it lives. Ports are left alone:
they are few, and another process may be about to use one again.
"""

import re
import time
from contextlib import suppress
from pathlib import Path

FOLDER = Path("/dev/shm")
LOCK = re.compile(r"(fast(?:dds|rtps)_[0-9a-f]{16})_el")
"""The name of a file that is locked, which begins with that of its segment."""
AGE = 10.0
"""A younger file may not be locked yet [s]."""


def remove_left_over() -> None:
    """Remove segments that belong to no process any more, of those that this user may remove."""
    for lock in FOLDER.glob("fast*_el"):
        segment = LOCK.fullmatch(lock.name)
        # Somebody else may remove it first, or may alone be allowed to.
        with suppress(OSError):
            if segment and time.time() - lock.stat().st_mtime > AGE and not _is_locked(lock):
                (FOLDER / segment[1]).unlink(missing_ok=True)
                lock.unlink()


def _is_locked(path: Path) -> bool:
    import fcntl  # not on Windows

    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False
