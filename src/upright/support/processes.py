"""Processes: the workers of a study, ending programs, sharing a core in lock-step."""

import multiprocessing
import os
import signal
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
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


@contextmanager
def share_core(number: int) -> Iterator[None]:
    """Keep this thread, and the threads and processes it starts, on the core that a number picks.

    In lock-step one side waits while the other works. To wake one that is on the same core takes
    two thirds of the time.
    """
    if not hasattr(os, "sched_setaffinity"):  # it is Linux that has it
        yield
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {sorted(cores)[number % len(cores)]})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)
