"""Writing files whole, telling files apart, and detecting whether files have changed."""

import errno
import hashlib
import io
import os
import shutil
import stat
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from itertools import combinations
from pathlib import Path
from typing import IO, TYPE_CHECKING, BinaryIO

from upright.errors import UprightError, said

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer as Buffer

try:
    import fcntl
except ImportError:  # Windows, which removes no file that a program has open
    fcntl = None  # type: ignore[assignment]

PACKAGE = Path(__file__).parents[1]
"""The folder of this package."""
INSTALLED = ("site-packages", "dist-packages")
"""Names of folders of installed packages."""
OPEN_FILES = "/proc/self/fd"
"""Where Linux has the open files of a process, also those that have no name."""
NAMED_ONLY = (errno.EOPNOTSUPP, errno.EISDIR, errno.EINVAL)
"""Errors of a disk, or of a kernel, on which every file has a name."""
COMPANIONS = ("-wal", "-shm", "-journal")
"""Endings of the files that SQLite keeps beside a database."""

Named = tuple[str, Path | str | None]
"""What a file is called, such as an option; and its path, or None if it is not given."""


def digest(paths: Iterable[Path], folder: Path) -> str:
    """Return a short digest of files: of their names relative to a folder, and their contents."""
    sha = hashlib.sha256()
    for path in paths:
        sha.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    return sha.hexdigest()[:12]


def home(path: str) -> Path:
    """Return a path with the home of a user in place of a ~ at its beginning.

    Raises
    ------
    UprightError
        If it is not known where that is.
    """
    try:
        return Path(path).expanduser()
    except RuntimeError:
        place = os.environ.get("HOME")
        raise UprightError(
            f"path is {path!r}; it begins in a home folder that is not known, as HOME is {place!r}"
        ) from None


def user_cache() -> Path:
    """Return the folder for what can be rebuilt or downloaded again; it need not exist yet.

    Raises
    ------
    UprightError
        If the user has no home, and XDG_CACHE_HOME names no folder instead.
    """
    return home(os.environ.get("XDG_CACHE_HOME") or "~/.cache").absolute() / "upright"


# ------------------------------------------------------------------------------ before the work


def check_name(name: str, path: Path | str) -> None:
    """Raise UprightError unless the system takes this for the name of a file, which may be missing.

    Parameters
    ----------
    name
        What the file is called, for the error.
    path
        The name of the file.
    """
    if not os.fspath(path):
        raise UprightError(f"{name} is ''; the name of a file is needed")
    try:
        _status(path)
    except PermissionError:
        return  # of a folder: what opens the file says so
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise UprightError(
            f"{name} is {said(str(path))}; it cannot be a file's name: {why}"
        ) from None


def check_output(path: Path | str) -> Path:
    """Return the path of a file to be written later, after checking that it can be written.

    Raises
    ------
    UprightError
        If no file can have this name, its folder is missing or not writable, or it is a folder.
    """
    check_name("output", path)
    if str(path).endswith(("/", os.sep)):  # which Path takes away
        raise UprightError(f"output is {str(path)!r}; it is the name of a folder, a file is needed")
    path = Path(path)
    with _explained(path):
        if (number := _descriptor(path)) is not None:
            os.fstat(number)
            return path
        found, target = _status(path), _target(path)
        if not target.parent.is_dir():
            raise UprightError(f"output is {str(path)!r}; its folder does not exist")
        if found and stat.S_ISDIR(found.st_mode):
            raise UprightError(f"output is {str(path)!r}; it is a folder, a file is needed")
        if found and not os.access(path, os.W_OK):
            raise UprightError(f"output is {str(path)!r}; it cannot be written")
        if _is_whole(found):
            _Part(target).discard()  # the system alone knows whether it can be done
    return path


def require_apart(written: Iterable[Named], read: Iterable[Named] = ()) -> None:
    """Raise UprightError if two files of a command are the same, and at least one is written.

    Links are followed. What SQLite keeps beside a database belongs to it. Devices do not matter.

    Examples
    --------
    >>> from upright.support.files import require_apart
    >>> require_apart([("output", "a.csv")], [("store", "a.sqlite")])
    >>> require_apart([("output", "a.sqlite")], [("store", "./a.sqlite")])
    Traceback (most recent call last):
    upright.errors.UprightError: output is 'a.sqlite'; it is the same file as store './a.sqlite'
    """
    outputs = [(name, str(path)) for name, path in written if path]
    inputs = [(name, str(path)) for name, path in read if path]
    pairs = [*combinations(outputs, 2), *((one, other) for one in outputs for other in inputs)]
    for (name, path), (other, place) in pairs:
        if _is_same(path, place):
            raise UprightError(f"{name} is {path!r}; it is the same file as {other} {place!r}")
        if any(_is_same(path, place + end) for end in COMPANIONS):
            raise UprightError(f"{name} is {path!r}; it belongs to {other} {place!r}")
        if any(_is_same(path + end, place) for end in COMPANIONS):
            raise UprightError(f"{name} is {path!r}; {other} {place!r} belongs to it")


def _is_same(path: str, other: str) -> bool:
    """Whether two paths lead to one regular file, or would if there were one."""
    try:
        found, another = _status(path), _status(other)
    except (OSError, ValueError):  # it will be explained where it is opened
        return False
    if found and another:
        return stat.S_ISREG(found.st_mode) and os.path.samestat(found, another)
    return not found and not another and _target(Path(path)) == _target(Path(other))


# ------------------------------------------------------------------------------ writing


@contextmanager
def writing(path: Path | str) -> Iterator[BinaryIO]:
    """Yield a file that becomes `path` if the block raises nothing.

    Where a regular file is, or nothing, a program that opens `path` reads the old content or the
    new, never a part of either, even after a power cut. The file keeps its mode, and a symbolic
    link its place: its target is written. A process that is killed leaves nothing behind.

    Anything else, such as a device, a FIFO or /dev/stdout, is written to in place.

    Raises
    ------
    UprightError
        If the file cannot be written.
    BrokenPipeError
        If whoever reads it has ended.
    """
    path = check_output(path)
    with _explained(path):
        number, found = _descriptor(path), _status(path)
        is_whole = number is None and _is_whole(found)
        part = _Part(_target(path)) if is_whole else None
        output = _Output(part.number if part else _opened(path, number), path, owned=not part)
    file = io.BufferedWriter(output)
    try:
        yield file
        file.flush()
        if part:
            with _explained(path):
                part.put()
    finally:
        output.close()  # what an error has left in the buffer goes nowhere
        if part:
            part.discard()


def write_file(path: Path | str, data: bytes | str) -> None:
    """Write a file: all of it or nothing, as `writing` does.

    Raises
    ------
    UprightError
        If the file cannot be written.
    """
    with writing(path) as file:
        file.write(data.encode() if isinstance(data, str) else data)


def create_file(path: Path | str, text: str) -> None:
    """Write a new file: either all of it or nothing. A file that is already there is left alone.

    Raises
    ------
    UprightError
        If something of this name is already there, or the file cannot be written.
    """
    check_name("output", path)
    there = UprightError(f"output is {str(path)!r}; it is already there and is not overwritten")
    if os.path.lexists(path):
        raise there
    path = check_output(path)
    with _explained(path):
        part = _Part(path)
        try:
            with io.BufferedWriter(_Output(part.number, path, owned=False)) as file:
                file.write(text.encode())
            part.put(replace=False)
        except FileExistsError:
            raise there from None
        finally:
            part.discard()


def make_folder(folder: Path | str) -> Path:
    """Return the path of a folder for output, created if it is missing.

    Raises
    ------
    UprightError
        If it cannot be created.
    """
    path = Path(folder)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise UprightError(
            f"output is {said(str(folder))}; the folder cannot be created: {why}"
        ) from None
    return path


@contextmanager
def creating(path: Path | str) -> Iterator[Path]:
    """Yield an empty file beside `path`, which becomes it if the block raises nothing.

    It has a name, for what is not written from its beginning to its end, such as a database. If
    another process has made `path` in the meantime, its file stays and this one goes: of several
    processes that begin at the same moment, all find the same file, and a whole one.

    Raises
    ------
    UprightError
        If the file cannot be written.
    """
    path = check_output(path)
    with _explained(path):
        part = _Part(_target(path), named=True)
    try:
        assert part.name is not None
        yield part.name
        with _explained(path), suppress(FileExistsError):
            part.put(replace=False)
    finally:
        part.discard()


@contextmanager
def scratch() -> Iterator[tuple[IO[bytes], str]]:
    """Yield a temporary file that other programs can open, and its name for them.

    On Linux it is in no folder, so a process that is killed leaves nothing behind.
    """
    import tempfile  # imported late: commands start sooner without it

    if os.path.isdir(OPEN_FILES):
        with tempfile.TemporaryFile() as unnamed:
            yield unnamed, f"/proc/{os.getpid()}/fd/{unnamed.fileno()}"
    else:
        with tempfile.NamedTemporaryFile() as named:
            yield named, named.name


def _target(path: Path) -> Path:
    """Return where the links of a path lead."""
    return Path(os.path.realpath(path))


def _status(path: Path | str) -> os.stat_result | None:
    """Return the status of a file, or None if there is none."""
    try:
        return os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        return None


def _is_whole(found: os.stat_result | None) -> bool:
    """Whether what has this status is written whole, and put in its place in the end."""
    return found is None or stat.S_ISREG(found.st_mode)


def _descriptor(path: Path) -> int | None:
    """Return the number of the open file that /dev/stdout or another such path names."""
    folder = os.path.realpath("/dev/fd")
    for _ in range(40):  # as many links as Linux follows
        if path.name.isdecimal() and os.path.realpath(path.parent) == folder:
            return int(path.name)
        try:
            path = path.parent / os.readlink(path)
        except OSError:
            break
    return None


def _opened(path: Path, number: int | None) -> int:
    """Open what is written to in place; of an open file, go on where it is."""
    if number is None:
        return os.open(path, os.O_WRONLY | getattr(os, "O_NOCTTY", 0))
    if sys.stdout:
        sys.stdout.flush()  # what was printed comes first
    return os.dup(number)


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Turn an error of the operating system into one that names the file."""
    try:
        yield
    except (BrokenPipeError, FileExistsError):
        raise
    except OSError as error:
        raise UprightError(
            f"output is {str(path)!r}; it cannot be written: {error.strerror}"
        ) from None


class _Output(io.FileIO):
    """An open file, whose errors name the path that it is for."""

    def __init__(self, number: int, path: Path, *, owned: bool) -> None:
        super().__init__(number, "wb", closefd=owned)
        self._path = path

    def write(self, data: "Buffer") -> int:
        """Write bytes."""
        with _explained(self._path):
            return super().write(data)


class _Part:
    """An open file in the folder of the one that it is to become, which need not be there yet.

    It gets its name at the end, where the system allows that. Until then, or for a moment, it is
    hidden under a name of its own, which is short enough for every disk, and locked while its
    writer lives: what a killed process left is removed by the next that writes the same file.
    """

    def __init__(self, target: Path, *, named: bool = False) -> None:
        self.target = target
        self.name: Path | None = None
        # Until it is given the mode of the present file, it is for its owner alone.
        self._mode = 0o600 if target.exists() else 0o666
        self._remove_old()
        unnamed = None if named else self._open_unnamed()
        self.number = self._open_named() if unnamed is None else unnamed

    def put(self, *, replace: bool = True) -> None:
        """Let it become its target.

        Raises
        ------
        FileExistsError
            If it is not to replace what is there.
        """
        os.fsync(self.number)
        if self.name is None:
            if not (replace and self.target.exists()):
                try:
                    return self._link(self.target)
                except FileExistsError:
                    if not replace:
                        raise
            name = self._hidden()
            self._link(name)
            self.name = name
        return self._replace() if replace else self._take(self.name)

    def discard(self) -> None:
        """Close it, and remove it if it is still hidden."""
        if self.name is not None:
            _remove(self.name)
        if self.number >= 0:
            os.close(self.number)

    def _open_unnamed(self) -> int | None:
        """Open a file without a name, or return None where the system has none."""
        if not (hasattr(os, "O_TMPFILE") and os.path.isdir(OPEN_FILES)):
            return None
        try:
            number = os.open(self.target.parent, os.O_TMPFILE | os.O_RDWR, self._mode)
        except OSError as error:
            if error.errno in NAMED_ONLY:
                return None
            raise
        _lock(number)
        return number

    def _open_named(self) -> int:
        """Open a file that is hidden."""
        while True:
            name = self._hidden()
            flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
            number = os.open(name, flags, self._mode)
            _lock(number)
            if name.exists():  # another process may have found it before it was locked
                self.name = name
                return number
            os.close(number)

    def _hidden(self) -> Path:
        return self.target.with_name(f"{self._prefix()}{os.urandom(6).hex()}.part")

    def _prefix(self) -> str:
        """Return how hidden names for this target begin."""
        mark = hashlib.sha256(os.fsencode(self.target.name)).hexdigest()[:8]
        return f".upright-{mark}-"

    def _remove_old(self) -> None:
        """Remove what processes have left that were killed while they wrote the same file."""
        for old in self.target.parent.glob(f"{self._prefix()}*.part"):
            with suppress(OSError):  # another's, or just gone
                number = os.open(old, os.O_RDWR)
                try:
                    _lock(number, wait=False)
                    _remove(old)
                finally:
                    os.close(number)

    def _link(self, path: Path) -> None:
        """Give a file without a name one."""
        # Python follows a link only if it is told of a folder, which does not matter here.
        os.link(f"{OPEN_FILES}/{self.number}", path, src_dir_fd=self.number)

    def _take(self, name: Path) -> None:
        """Give a hidden file the name of its target, unless that is there."""
        try:
            os.link(name, self.target)
        except FileExistsError:
            raise
        except OSError:  # a disk that has no links
            if self.target.exists():
                raise FileExistsError from None
            os.replace(name, self.target)

    def _replace(self) -> None:
        """Let a hidden file replace its target, with the owner and the mode of that."""
        assert self.name is not None
        if found := _status(self.target):
            if hasattr(os, "chown"):
                with suppress(OSError):  # only root may
                    os.chown(self.name, found.st_uid, found.st_gid)
            os.chmod(self.name, found.st_mode & 0o777)
        if fcntl is None:  # Windows moves no file that is open
            os.close(self.number)
            self.number = -1
        try:
            os.replace(self.name, self.target)
        except OSError as error:
            if error.errno != errno.EBUSY:
                raise
            # A file that another is mounted on, as containers do, can only be written to in place.
            shutil.copyfile(self.name, self.target)


def _remove(path: Path) -> None:
    """Remove a hidden file, and before it what SQLite has left beside it, as on a full disk."""
    for end in (*COMPANIONS, ""):
        Path(f"{path}{end}").unlink(missing_ok=True)


def _lock(number: int, *, wait: bool = True) -> None:
    """Lock an open file, where there are locks.

    Raises
    ------
    OSError
        If it is not to wait, and another process has locked the file.
    """
    if fcntl is None:
        return
    with suppress(OSError) if wait else nullcontext():
        fcntl.flock(number, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
