"""Advise how to name custom code whose file was named instead: `mine.py:Pd` is `mine:Pd`."""

import ast
import os
from collections.abc import Callable
from pathlib import Path

LISTED = 5
"""At most this many things of a file are named."""


def advice(name: str, kind: str, found_in: Callable[[Path], list[str]]) -> str:
    """Return what to write in place of a name that looks like the file of custom code.

    Nothing is imported: the file is only read.

    Parameters
    ----------
    name
        What was given as the name.
    kind
        What the code makes: "agent" or "plant".
    found_in
        Returns the names in a file that look like such code.

    Returns
    -------
    str
        The advice, such as "write 'mine:Pd'"; empty if the name looks like no file.
    """
    file, made = _split(name)
    path = Path(file if file.endswith(".py") else f"{file}.py")
    is_file = os.path.isfile(path)  # unlike Path.is_file, it raises nothing for any name
    if not (file.endswith(".py") or os.sep in file or is_file):
        return ""
    if not is_file:
        return f"there is no file {str(path)!r}; a custom {kind} is named module:name"
    found = [made] if made else found_in(path)
    parts = module_parts(path)
    folder = ""
    if os.pardir in parts:
        parts, folder = [path.stem], f" in the folder {str(path.resolve().parent)!r}"
    unusable = next((part for part in parts if not part.isidentifier()), None)
    if unusable:
        return (
            f"{unusable!r} is not the name of a module; rename it so that it has only letters, "
            f"digits and underscores, and name the {kind} module:name"
        )
    module = ".".join(parts)
    if len(found) == 1:
        return f"write {f'{module}:{found[0]}'!r}{folder}"
    which = f", where NAME is one of {', '.join(found[:LISTED])}" if found else ""
    return f"write '{module}:NAME'{folder}{which}"


def statements(path: Path) -> list[ast.stmt] | None:
    """Return the statements at the top level of a file; None if it is not one of Python."""
    try:
        return ast.parse(path.read_bytes()).body
    except (OSError, ValueError, SyntaxError, RecursionError, MemoryError):
        return None  # the last two are raised of code that is nested too deep


def module_parts(path: Path) -> list[str]:
    """Return the parts of the name of a file's module, as it is imported from this folder."""
    return os.path.relpath(path).removesuffix(".py").split(os.sep)


def _split(name: str) -> tuple[str, str]:
    """Return the file and what follows its colon, if anything; a drive's colon is not one."""
    name = name.replace("\\", "/").replace("/", os.sep)
    file, colon, made = name.rpartition(":")
    if not colon or os.sep in made or made.endswith(".py"):
        return name, ""
    return file, made
