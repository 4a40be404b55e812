"""Other processes: workers of a study, and how programs are ended."""

import multiprocessing
import signal
from concurrent.futures import ProcessPoolExecutor
from os import cpu_count
from subprocess import Popen, TimeoutExpired
from typing import Any

PATIENCE = 5.0
"""How long a program may take to end when it is asked to [s]."""


def process_pool() -> ProcessPoolExecutor:
    """Return a process for every core.

    They are new ones, as a copy of one that has threads may hang. Ctrl-C reaches them too: they end
    at once and say nothing.
    """
    spawn = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(cpu_count(), spawn, signal.signal, (signal.SIGINT, signal.SIG_DFL))


def end_process(process: "Popen[Any]") -> None:
    """Ask a program to end, and kill it if it does not."""
    process.terminate()
    try:
        process.wait(PATIENCE)
    except TimeoutExpired:
        process.kill()
        process.wait()
