"""The folder of the package's machine code, and whether it holds what a command will run.

What lies there is executed, so the folder must be one that no other user can change. Where there is
none, or the disk is full, or what lies there is damaged, functions are compiled anew: that takes a
while, but nothing fails. Does not import Numba, which takes a second.
"""

import hashlib
import os
import re
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

from upright.errors import UprightError
from upright.support.files import PACKAGE, digest, home, user_cache
from upright.support.private_folders import changeable, is_ours, make_private
from upright.support.terminal import end_notice

if sys.platform != "win32":
    import fcntl

FOLDERS = "kernels-*"
"""Names of folders of machine code, one for each version of the sources."""
IN_USE = "in-use"
"""A file in such a folder: processes that use the folder hold a shared lock on it, and its date is
when the last of them began."""
UNUSED_FOR = 30 * 24 * 3600.0
"""Folders that have not been used for longer are removed [s]."""
MOST = 20
"""Number of other versions' folders that are kept at most: each edit of the sources makes one."""
DIGEST = hashlib.sha256().digest_size


def sources_hash() -> str:
    """Return a short digest of all source files of the package."""
    return digest(sorted(PACKAGE.rglob("*.py")), PACKAGE)


def checks_bounds() -> bool:
    """Whether functions are compiled such that an index outside an array is an IndexError.

    Numba itself reads the variable, and compiles so.
    """
    return os.environ.get("NUMBA_BOUNDSCHECK", "0") not in ("", "0")


@cache
def cache_folder() -> Path | None:
    """Return the folder for machine code, named after a digest of the sources; None if none serves.

    It is the first that can be written and that no other user can change.
    """
    name = FOLDERS.replace("*", sources_hash()) + ("-checked" if checks_bounds() else "")
    for root in _roots():
        with suppress(OSError):
            is_new = not (root / name).exists()
            folder = make_private(root / name)
            if other := changeable(folder):
                _say(f"others may change {str(other)!r}; machine code is not kept in {str(root)!r}")
                continue
            _hold(folder)
            if is_new:
                _remove_unused(folder)
            return folder
    return None


def _roots() -> Iterator[Path]:
    """Yield the folders for machine code of all versions, the preferred one first."""
    with suppress(UprightError):  # there is no home
        chosen = os.environ.get("NUMBA_CACHE_DIR")
        yield home(chosen).absolute() / "upright" if chosen else user_cache()
    user = os.getuid() if hasattr(os, "getuid") else "user"
    with suppress(OSError):  # there is no temporary folder
        yield Path(tempfile.gettempdir()).absolute() / f"upright-{user}"


def _hold(folder: Path) -> None:
    """Let other processes know, until this one ends, that the folder is in use.

    Raises
    ------
    OSError
        If the folder cannot be written.
    """
    handle = os.open(folder / IN_USE, os.O_RDWR | os.O_CREAT, 0o600)
    os.utime(folder / IN_USE)
    if sys.platform == "win32":
        return
    with suppress(OSError):  # another process uses the folder, or this disk has no locks
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        for part in folder.glob("*.part"):  # of a process that was killed
            part.unlink()
    with suppress(OSError):
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)


def _remove_unused(present: Path) -> None:
    """Remove folders of other versions that have not been used for long, or are too many."""
    if sys.platform == "win32":
        return
    others = [folder for folder in present.parent.glob(FOLDERS) if folder != present]
    last_uses = sorted(((_last_use(folder), folder) for folder in others), reverse=True)
    for place, (last_use, folder) in enumerate(last_uses):
        if place >= MOST or last_use < time.time() - UNUSED_FOR:
            with suppress(OSError):
                handle = os.open(folder / IN_USE, os.O_RDWR | os.O_CREAT, 0o600)
                try:
                    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)  # refused if it is in use
                    shutil.rmtree(folder)
                finally:
                    os.close(handle)


def _last_use(folder: Path) -> float:
    """Return when a process began to use a folder [s]; 0 if that cannot be found out."""
    mark = folder / IN_USE
    try:
        return (mark if mark.exists() else folder).stat().st_mtime
    except OSError:
        return 0.0


def kept(name: str) -> bytes | None:
    """Return the machine code that is kept under a name; None if there is none that can be used.

    What is damaged, or might be another user's, is removed.
    """
    folder = cache_folder()
    if folder is None:
        return None
    try:
        with open(folder / name, "rb", opener=_opened) as file:
            status = os.fstat(file.fileno())
            data = file.read() if stat.S_ISREG(status.st_mode) and is_ours(status) else b""
    except FileNotFoundError:
        return None
    except OSError:  # a folder, or a file that may not be read
        data = b""
    code = data[DIGEST:]
    if code and hashlib.sha256(code).digest() == data[:DIGEST]:
        return code
    discard(name)
    return None


def _opened(path: str, flags: int) -> int:
    """Open a file, without waiting where it is a FIFO that nobody writes to."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def keep(name: str, code: bytes) -> None:
    """Keep machine code under a name, if the disk takes it.

    Each has a file of its own, which is there as a whole or not at all: processes that compile at
    the same time do not disturb each other.
    """
    folder = cache_folder()
    if folder is None:
        return
    part = folder / f"{name}.{os.getpid()}.part"
    try:
        part.touch(0o600)
        part.write_bytes(hashlib.sha256(code).digest() + code)
        os.replace(part, folder / name)
    except OSError as error:
        with suppress(OSError):
            part.unlink()
        _say(f"machine code cannot be kept in {str(folder)!r}: {error.strerror}")


def discard(name: str) -> None:
    """Remove damaged machine code, so that it is compiled anew, and say so."""
    folder = cache_folder()
    if folder is None:
        return
    path = folder / name
    with suppress(OSError):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()
    _say(f"machine code in {str(folder)!r} is damaged; it is compiled anew")


@cache  # once in a process
def _say(text: str) -> None:
    with suppress(OSError, ValueError):  # standard error may be closed
        end_notice()
        print(f"upright: {text}", file=sys.stderr, flush=True)


def _mark(folder: Path, what: str) -> Path:
    return folder / f"{re.sub(r'[^A-Za-z0-9]+', '-', what)}.compiled"


def lacking(things: Iterable[str]) -> list[str]:
    """Return those of the things, such as "learn reinforce", that were not compiled before."""
    folder = cache_folder()
    return [thing for thing in things if folder is None or not _mark(folder, thing).exists()]


def note_compiled(things: Iterable[str]) -> None:
    """Keep in mind that these things have been compiled, so that they are no longer lacking."""
    folder = cache_folder()
    if folder is None:
        return
    for thing in things:
        with suppress(OSError):  # otherwise it is said again
            _mark(folder, thing).touch()
