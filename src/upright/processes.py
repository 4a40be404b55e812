"""Ending other programs."""

from subprocess import Popen, TimeoutExpired
from typing import Any

PATIENCE = 5.0
"""How long a program may take to end when it is asked to [s]."""


def end_process(process: "Popen[Any]") -> None:
    """Ask a program to end, and kill it if it does not."""
    process.terminate()
    try:
        process.wait(PATIENCE)
    except TimeoutExpired:
        process.kill()
        process.wait()
