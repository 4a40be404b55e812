"""Processes: a pool of workers, terminating programs, pinning lock-step partners to one core."""

import multiprocessing.util
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.context import SpawnContext, SpawnProcess
from os import cpu_count
from subprocess import Popen, TimeoutExpired
from types import ModuleType
from typing import Any

PATIENCE = 5.0
"""How long a terminated program may take to exit before it is killed [s]."""


class _Worker(SpawnProcess):
    """A new process that does not import the main module of this one.

    Python would execute the user's script again in every process, without an end if the script has
    no `if __name__ == "__main__":`.
    """

    @staticmethod
    def _Popen(process_obj: Any) -> Any:  # noqa: N802 - its name in multiprocessing
        main = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")  # one without a file or a name to import
        try:
            return SpawnProcess._Popen(process_obj)
        finally:
            sys.modules["__main__"] = main


class _Workers(SpawnContext):
    Process = _Worker


def process_pool(
    prepare: Callable[..., object] | None = None, *arguments: Any
) -> ProcessPoolExecutor:
    """Return a pool with one worker process per core.

    The workers are spawned, because a fork of a process with threads may hang. Ctrl-C reaches them
    too: they exit at once, without a traceback; and they exit if this process is gone, however it
    ended. They do not import this process's main module.

    Parameters
    ----------
    prepare, *arguments
        What each worker calls first, if anything, and with what.
    """
    return ProcessPoolExecutor(cpu_count(), _Workers(), _begin, (prepare, *arguments))


def _begin(prepare: Callable[..., object] | None, *arguments: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if prepare:
        prepare(*arguments)


def _end_with_parent() -> None:
    """Exit once the parent process is gone: a worker that waits for work would wait for ever."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def release_semaphores() -> None:
    """Remove the semaphores of pools, which Python does at its end; call before `os._exit`.

    Otherwise a process that outlives this one removes them, and complains on standard error.
    """
    util: Any = multiprocessing.util
    util._run_finalizers(0)


_LAUNCHER = """\
import ctypes, os, signal, sys
PR_SET_PDEATHSIG = 1
ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
if os.getppid() == int(sys.argv[1]):
    os.execv(sys.argv[2], sys.argv[2:])
"""


def ending_with_us(command: list[str]) -> list[str]:
    """Return a command that runs a program which is killed if this process ends without doing so.

    Linux does that when the thread that starts the program ends. Elsewhere, the program goes on.

    Parameters
    ----------
    command
        The path of the program, and its arguments.
    """
    if sys.platform != "linux":
        return command
    return [sys.executable, "-I", "-S", "-c", _LAUNCHER, str(os.getpid()), *command]


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
    with _pinned(lambda cores: {_chosen(cores, number)}):
        yield


@contextmanager
def leave_core(number: int) -> Iterator[None]:
    """Keep this thread, and what it starts, off the core that `share_core` selects.

    Where there is one core alone, it is used.
    """
    with _pinned(lambda cores: cores - {_chosen(cores, number)} or cores):
        yield


def _chosen(cores: set[int], number: int) -> int:
    return sorted(cores)[number % len(cores)]


@contextmanager
def _pinned(choose: Callable[[set[int]], set[int]]) -> Iterator[None]:
    if not hasattr(os, "sched_setaffinity"):  # only Linux has it
        yield
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, choose(cores))
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)
