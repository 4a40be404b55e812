"""Running statements in GNU Octave, with the MATLAB twin on its path."""

import shutil
import subprocess
from pathlib import Path

import numpy as np

MATLAB = Path(__file__).parent.parent / "matlab"
IS_THERE = shutil.which("octave-cli") is not None
HAS_COMPILER = all(map(shutil.which, ("octave-cli", "mkoctfile", "gcc")))


def octave(statements: str, timeout: float = 300) -> str:
    """Return what Octave prints; raise an error if it fails."""
    command = ["octave-cli", "--norc", "--quiet", "--eval", f"addpath('{MATLAB}'); {statements}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout)
    if done.returncode != 0:
        raise AssertionError(f"{statements}\n{done.stdout}\n{done.stderr}")
    return done.stdout


def octave_numbers(statements: str, values: str) -> np.ndarray:
    """Return an array that Octave computes, to the last bit, as one row, column after column."""
    return np.array(octave(f"{statements}; printf('%.17g\\n', {values})").split(), float)


def matrix(values) -> str:
    """Return an array of numbers in Octave's language, to the last bit."""
    rows = [" ".join(map(repr, map(float, row))) for row in np.atleast_2d(values)]
    return f"[{'; '.join(rows)}]"
