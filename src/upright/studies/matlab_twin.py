"""The MATLAB twin: finds GNU Octave or MATLAB, and lets it make runs.

The twin is in the folder `matlab/`. It makes the same runs as the package if both draw the same
random numbers (`random_streams.twister_numbers`). It is run in processes of its own, which print a
line for every run as it ends.
"""

import json
import os
import reprlib
import shutil
import subprocess
from collections import deque
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from upright.errors import UprightError, require, require_kind
from upright.support.files import digest
from upright.support.interrupts import let_interrupts_through
from upright.support.processes import ending_with_us

if TYPE_CHECKING:
    from upright.core.trials import Result  # the loop takes a second to import

AGENTS = ("q-learning", "reinforce", "random-search")
"""Agents that the twin has."""
PROGRAMS = ("matlab", "octave-cli", "octave")
"""Programs that can run the twin; the first that is found is used."""
CHOICE = "UPRIGHT_MATLAB"
"""Environment variable that names another program."""
MOST_SEEDS = 4293
"""The largest seed: a run's stream has the number 10⁶ seed + run, which must fit into 32 bits."""
MARK = "upright "
"""First characters of a line about a run."""


class TwinJob(NamedTuple):
    """Runs of one case for the twin to make, by the names that it knows."""

    agent: str
    label: str
    noise: str
    start: str
    steps: int
    trials: int
    seed: int
    runs: tuple[int, ...]
    """Numbers of the runs, from 0; the twin counts them from 1."""

    def statement(self) -> str:
        """Return the MATLAB statement that makes the runs."""
        runs = " ".join(str(run + 1) for run in self.runs)
        texts = ", ".join(f"'{text}'" for text in self[:4])
        numbers = ", ".join(str(number) for number in self[4:7])
        return f"upright.internal.study({texts}, {numbers}, [{runs}])"


def folder() -> Path:
    """Return the folder to add to MATLAB's path."""
    package = Path(__file__).parents[1]
    installed = package / "matlab_twin"
    return installed if installed.is_dir() else package.parents[1] / "matlab"


@cache
def twin_version() -> str:
    """Return a digest of the twin's sources."""
    paths = sorted(folder().rglob("*"))
    return digest((path for path in paths if path.suffix in (".m", ".c", ".h")), folder())


def find_program() -> str:
    """Return the path of MATLAB or Octave.

    Raises
    ------
    UprightError
        If there is none.
    """
    chosen = os.environ.get(CHOICE)
    for name in (chosen,) if chosen else PROGRAMS:
        if program := shutil.which(name):
            return program
    if chosen:
        raise UprightError(f"{CHOICE} is {chosen!r}; there is no such program")
    raise UprightError(
        "neither MATLAB nor GNU Octave is on the path; Octave is free: apt-get install octave "
        "(Debian, Ubuntu), dnf install octave (Fedora), brew install octave (macOS), or its "
        "installer for Windows"
    )


def command(program: str, statements: str) -> list[str]:
    """Return the command that executes MATLAB statements with the twin on the path."""
    path = str(folder()).replace("'", "''")
    statements = f"addpath('{path}'); {statements}"
    if Path(program).stem.lower() == "matlab":
        return [program, "-batch", statements]
    return [program, "--norc", "--quiet", "--eval", statements]


def check_seed(seed: int) -> None:
    """Raise UprightError unless the twin has streams of random numbers for this seed."""
    require("seed of MATLAB's random numbers", seed, 0, MOST_SEEDS, whole=True)


def make_runs(jobs: Iterable[TwinJob]) -> "Generator[tuple[TwinJob, Result], None, None]":
    """Make runs in one process per core, and yield each result as its run ends.

    Closing the generator terminates the processes.

    Raises
    ------
    UprightError
        If there is neither MATLAB nor Octave, or it fails.
    """
    jobs = list(jobs)
    for job in jobs:
        check_seed(job.seed)
    program = find_program() if jobs else ""
    ended: SimpleQueue[tuple[TwinJob, Result] | Exception | None] = SimpleQueue()
    processes: list[subprocess.Popen[str]] = []

    def work(job: TwinJob) -> None:
        try:
            for result in _runs_of(_start(program, job, processes), job):
                ended.put((job, result))
            ended.put(None)
        except Exception as error:
            ended.put(error)

    workers = ThreadPoolExecutor(os.cpu_count())
    try:
        for job in jobs:
            workers.submit(work, job)
        remaining = len(jobs)
        while remaining:
            with let_interrupts_through():
                message = ended.get()
            if isinstance(message, Exception):
                raise message
            if message is None:
                remaining -= 1
            else:
                yield message
    finally:
        workers.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.kill()


def _start(program: str, job: TwinJob, processes: list["subprocess.Popen[str]"]) -> Iterator[str]:
    """Start a process that makes runs, and yield its lines; raise an error if it fails."""
    process = subprocess.Popen(
        ending_with_us(command(program, job.statement())),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        env=os.environ | {"OMP_NUM_THREADS": "1"},  # the processes share the cores
        start_new_session=True,  # Ctrl-C reaches only this program, which kills the process
    )
    processes.append(process)
    output: deque[str] = deque(maxlen=20)
    with process:
        assert process.stdout is not None
        for line in process.stdout:
            if not line.startswith(MARK):
                output.append(line.rstrip())
            yield line
    if process.returncode != 0:
        errors = [line for line in output if line.startswith("error: ")]
        reason = (errors or [*output] or ["no output"])[0]
        raise UprightError(f"{program} exited with status {process.returncode}: {reason}")


def _runs_of(lines: Iterator[str], job: TwinJob) -> "Iterator[Result]":
    """Yield the results that the twin's lines report."""
    from upright.core.trials import Result

    missing = set(job.runs)
    for line in lines:
        if line.startswith(MARK):
            try:
                run, success, lengths, seconds = _reported(line.removeprefix(MARK), job)
                missing.remove(run)
            except (ValueError, KeyError, RecursionError) as error:
                shown = reprlib.repr(line.rstrip())
                why = f"the MATLAB twin reported a run as {shown}, which cannot be: {error}"
                raise UprightError(why) from error
            yield Result(run, success, np.array(lengths, np.int64), seconds)
    if missing:
        raise UprightError(f"the MATLAB twin exited without making {len(missing)} of its runs")


def _reported(text: str, job: TwinJob) -> tuple[int, bool, list[int], float]:
    """Return the number of a run, its success, the lengths of its trials and its time, checked."""
    values = json.loads(text)
    require_kind("a run", values, dict, "an object")
    run, success, lengths = values["run"], values["success"], values["lengths"]
    lengths = lengths if isinstance(lengths, list) else [lengths]  # as one trial is written
    require("run", run, 1, whole=True)
    require_kind("success", success, bool, "true or false")
    require("the number of trials", len(lengths), 1, job.trials, whole=True)
    for length in lengths:
        require("the length of a trial", length, 1, job.steps, whole=True)
    require("seconds", values["seconds"], 0)
    return run - 1, success, lengths, values["seconds"]
