"""Keeping those who wait for each other on one processor core."""

import os
from collections.abc import Iterator
from contextlib import contextmanager


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
