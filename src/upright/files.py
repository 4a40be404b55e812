"""Writing files whole or not at all."""

import os
import tempfile
from pathlib import Path

from upright.errors import UprightError


def check_output(path: Path | str) -> Path:
    """Return the path of a file to be written later, having made sure that it can be.

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


def write_file(path: Path | str, data: bytes | str) -> None:
    """Write a file; whoever opens it sees the old content or the new one, never a part.

    Raises
    ------
    UprightError
        If it cannot be written.
    """
    path = check_output(path)
    data = data.encode() if isinstance(data, str) else data
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            os.chmod(name, 0o644)
            os.replace(name, path)
        except BaseException:
            os.unlink(name)
            raise
    except OSError as error:
        raise UprightError(
            f"output is {str(path)!r}; it cannot be written: {error.strerror}"
        ) from None
