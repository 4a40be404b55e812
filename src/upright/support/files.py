"""Writing files atomically, and detecting whether files have changed."""

import hashlib
import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from upright.errors import UprightError

PACKAGE = Path(__file__).parents[1]
"""The folder of this package."""
INSTALLED = ("site-packages", "dist-packages")
"""Names of folders of installed packages."""


def digest(paths: Iterable[Path], folder: Path) -> str:
    """Return a short digest of files: of their names relative to a folder, and their contents."""
    sha = hashlib.sha256()
    for path in paths:
        sha.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    return sha.hexdigest()[:12]


def user_cache() -> Path:
    """Return the folder for what can be rebuilt or downloaded again; it need not exist yet."""
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "upright"


def check_output(path: Path | str) -> Path:
    """Return the path of a file to be written later, after checking that it can be written.

    Raises
    ------
    UprightError
        If its folder is missing or not writable, or the path is a folder.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise UprightError(f"output is {str(path)!r}; its folder does not exist")
    if path.is_dir():
        raise UprightError(f"output is {str(path)!r}; it is a folder, a file is needed")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise UprightError(f"output is {str(path)!r}; it cannot be written")
    return path


@contextmanager
def replacing(path: Path | str) -> Iterator[Path]:
    """Yield a temporary file beside `path`, which replaces it if the block raises nothing.

    A program that opens `path` reads the old content or the new, never a part of either.

    Raises
    ------
    UprightError
        If the file cannot be written.
    """
    with _part_of(path) as part:
        yield part
        with _explained(Path(path)):
            os.replace(part, path)


@contextmanager
def creating(path: Path | str) -> Iterator[Path]:
    """Yield a temporary file beside `path`, which becomes it if the block raises nothing.

    If another process has made `path` in the meantime, its file stays and the temporary one goes:
    of several processes that begin at the same moment, all find the same file, and a whole one.

    Raises
    ------
    UprightError
        If the file cannot be written.
    """
    with _part_of(path) as part:
        yield part
        with _explained(Path(path)):
            try:
                os.link(part, path)
            except FileExistsError:
                return
            except OSError:  # a disk that has no links
                if not Path(path).exists():
                    os.replace(part, path)


@contextmanager
def _part_of(path: Path | str) -> Iterator[Path]:
    """Yield a temporary file beside `path`, and remove it at the end if it still has its name."""
    path = check_output(path)
    with _explained(path):
        handle, name = tempfile.mkstemp(path.suffix, f".{path.stem}.", path.parent)
        os.close(handle)
        os.chmod(name, 0o644)
    try:
        yield Path(name)
    finally:
        Path(name).unlink(missing_ok=True)


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Turn an error of the operating system into one that names the file."""
    try:
        yield
    except OSError as error:
        raise UprightError(
            f"output is {str(path)!r}; it cannot be written: {error.strerror}"
        ) from None


def create_file(path: Path | str, text: str) -> None:
    """Write a new file: either all of it or nothing. A file that is already there is left alone.

    Raises
    ------
    UprightError
        If something of this name is already there, or the file cannot be written.
    """
    path = Path(path)
    if path.exists() or path.is_symlink():
        raise UprightError(f"output is {str(path)!r}; it is already there and is not overwritten")
    check_output(path)
    with _explained(path), path.open("x", encoding="utf-8", newline="\n") as file:
        try:
            file.write(text)
            file.flush()
        except BaseException:
            path.unlink()
            raise


def write_file(path: Path | str, data: bytes | str) -> None:
    """Write a file atomically: either all of it or nothing.

    Raises
    ------
    UprightError
        If the file cannot be written.
    """
    with replacing(path) as part, _explained(Path(path)):
        part.write_bytes(data.encode() if isinstance(data, str) else data)
