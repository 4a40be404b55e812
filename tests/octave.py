"""Running statements in GNU Octave, with the MATLAB twin on its path."""

import os
import selectors
import shutil
import subprocess
import tempfile
import time
import uuid
from pathlib import Path

import numpy as np

MATLAB = Path(__file__).parent.parent / "matlab"
IS_THERE = shutil.which("octave-cli") is not None
HAS_COMPILER = all(map(shutil.which, ("octave-cli", "mkoctfile", "gcc")))
COMMAND = ["octave-cli", "--norc", "--quiet"]


class Session:
    """One Octave process that evaluates statements again and again.

    Every evaluation begins as in a fresh Octave: no variables, functions read from disk anew, the
    usual path. A process that dies or is too slow is replaced at the next evaluation.
    """

    def __init__(self) -> None:
        self.process: subprocess.Popen[bytes] | None = None
        self._path = ""

    def evaluate(self, statements: str, timeout: float = 300) -> str:
        """Return what statements print, within `timeout` [s].

        Raises
        ------
        AssertionError
            If they fail, end Octave or take too long; with Octave's message.
        """
        if self.process is None or self.process.poll() is not None:
            self.close()
            self._start()
        self._exchange(
            f"clear('-all'); close('all'); path('{self._path}'); cd('{os.getcwd()}');", timeout
        )
        return self._exchange(statements, timeout)

    def close(self) -> None:
        """End the process, if there is one."""
        if self.process is not None:
            self.process.kill()
            self.process.communicate()
            self.process = None
            self._errors.close()

    def _start(self) -> None:
        # A file: a pipe that nobody reads meanwhile could fill up and block Octave.
        self._errors = tempfile.TemporaryFile("a+b")  # noqa: SIM115 - closed with the process
        self.process = subprocess.Popen(
            COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors
        )
        self._path = self._exchange(f"addpath('{MATLAB}'); printf('%s', path());", 60)

    def _exchange(self, statements: str, timeout: float) -> str:
        mark = uuid.uuid4().hex  # between output, error message and end; not in any of them
        with tempfile.NamedTemporaryFile("w", suffix=".m") as file:
            file.write(statements)
            file.flush()
            self._errors.truncate(0)
            line = (
                f"try, eval(fileread('{file.name}')); fprintf('{mark}'); "
                f"catch problem, fprintf('{mark}error: %s', problem.message); end, "
                f"fprintf('{mark}'); fflush(stdout);\n"
            )
            try:
                output, message = self._answer(line, mark.encode(), timeout)
            except BaseException:  # an answer that comes late must not be taken for the next one
                self.close()
                raise
        if message:
            raise AssertionError(f"{statements}\n{output}\n{message}\n{self._complaints()}")
        return output

    def _answer(self, line: str, mark: bytes, timeout: float) -> tuple[str, str]:
        """Have a line evaluated; return its output and its error message."""
        self.process.stdin.write(line.encode())
        self.process.stdin.flush()
        answer, end = b"", time.monotonic() + timeout
        with selectors.DefaultSelector() as selector:
            selector.register(self.process.stdout, selectors.EVENT_READ)
            while answer.count(mark) < 2:
                if not selector.select(end - time.monotonic()):
                    raise AssertionError(f"{line}{answer.decode()}\nnot done in {timeout} s")
                if not (more := os.read(self.process.stdout.fileno(), 1 << 16)):
                    raise AssertionError(
                        f"{line}{answer.decode()}\nOctave ended\n{self._complaints()}"
                    )
                answer += more
        output, message, _ = answer.decode().split(mark.decode())
        return output, message

    def _complaints(self) -> str:
        """Return what Octave has written to its standard error."""
        self._errors.seek(0)
        return self._errors.read().decode()


SESSION = Session()
"""The Octave that tests share; conftest.py ends it."""
octave = SESSION.evaluate


def octave_numbers(statements: str, values: str) -> np.ndarray:
    """Return an array that Octave computes, to the last bit, as one row, column after column."""
    return np.array(octave(f"{statements}\nprintf('%.17g\\n', {values})").split(), float)


def matrix(values) -> str:
    """Return an array of numbers in Octave's language, to the last bit."""
    rows = [" ".join(map(repr, map(float, row))) for row in np.atleast_2d(values)]
    return f"[{'; '.join(rows)}]"
