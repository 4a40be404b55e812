"""The folder of the package's machine code, and whether it holds what a command will run.

Does not import Numba, which takes a second.
"""

import os
import re
import tempfile
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from upright.support.files import PACKAGE, digest, user_cache


def sources_hash() -> str:
    """Return a short digest of all source files of the package."""
    return digest(sorted(PACKAGE.rglob("*.py")), PACKAGE)


@cache
def cache_folder() -> Path:
    """Return the first writable folder for machine code, named after a digest of the sources."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    usual = Path(chosen).expanduser() / "upright" if chosen else user_cache()
    candidates = (usual, Path(tempfile.gettempdir()) / "upright")
    for folder in (root / f"kernels-{sources_hash()}" for root in candidates):
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return Path(tempfile.mkdtemp(prefix="upright-kernels-"))


def _mark(what: str) -> Path:
    return cache_folder() / f"{re.sub(r'[^A-Za-z0-9]+', '-', what)}.compiled"


def lacking(things: Iterable[str]) -> list[str]:
    """Return those of the things, such as "learn reinforce", that were not compiled before."""
    return [thing for thing in things if not _mark(thing).exists()]


def note_compiled(things: Iterable[str]) -> None:
    """Keep in mind that these things have been compiled, so that they are no longer lacking."""
    for thing in things:
        try:
            _mark(thing).touch()
        except OSError:  # it is compiled again, and said again
            return
