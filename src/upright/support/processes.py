"""Processes: a pool of workers, terminating programs, pinning lock-step partners to one core."""

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
"""How long a terminated program may take to exit before it is killed [s]."""


def process_pool() -> ProcessPoolExecutor:
    """Return a pool with one worker process per core.

    The workers are spawned, because a fork of a process with threads may hang. Ctrl-C reaches them
    too: they exit at once, without a traceback.
    """
    spawn = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(cpu_count(), spawn, signal.signal, (signal.SIGINT, signal.SIG_DFL))


def end_process(process: "Popen[Any]") -> None:
    """Terminate a program, and kill it if it does not exit in time."""
    process.terminate()
    try:
        process.wait(PATIENCE)
    except TimeoutExpired:
        process.kill()
        process.wait()


@contextmanager
def share_core(number: int) -> Iterator[None]:
    """Pin this thread, and the threads and processes it starts, to one core.

    In lock-step, one side waits while the other works. Waking a partner on the same core takes two
    thirds of the time.

    Parameters
    ----------
    number
        Selects the core: partners with the same number share one.
    """
    if not hasattr(os, "sched_setaffinity"):  # only Linux has it
        yield
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {sorted(cores)[number % len(cores)]})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)
