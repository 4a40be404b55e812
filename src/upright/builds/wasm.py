"""WebAssembly: a module that any browser loads."""

import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

from upright.builds.machine import Machine
from upright.errors import UprightError

WASM = Machine("wasm32-unknown-unknown", features="+bulk-memory")
LINKERS = ("wasm-ld", *(f"wasm-ld-{version}" for version in range(22, 13, -1)))
"""What the linker may be called."""
STACK = 16384
"""For the variables of functions, in bytes; learners have none that grow."""


def find_linker() -> str:
    """Return the linker.

    Raises
    ------
    UprightError
        If it is missing.
    """
    linker = next(filter(None, map(shutil.which, LINKERS)), None)
    if not linker:
        raise UprightError("the linker wasm-ld is missing: it is in the package lld of Debian")
    return linker


def link(code: bytes, exports: Iterable[str]) -> bytes:
    """Return a module that exports some functions of an object file.

    It imports its memory, so that others can lay it out: it must be left alone below
    ``__heap_base``, which is exported too.

    Raises
    ------
    UprightError
        If the linker is missing, or fails.
    """
    linker = find_linker()
    names = [f"--export={name}" for name in ("__heap_base", *exports)]
    options = ["--no-entry", "--import-memory", "--strip-all", "-z", f"stack-size={STACK}"]
    with TemporaryDirectory() as folder:
        source, module = Path(folder, "learner.o"), Path(folder, "learner.wasm")
        source.write_bytes(code)
        command = [linker, *options, *names, str(source), "-o", str(module)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise UprightError(f"{linker} failed: {done.stderr.strip()}")
        return module.read_bytes()
