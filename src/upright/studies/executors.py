"""Where the runs of a study are made: threads, processes, or the workers of a cluster."""

import multiprocessing
import os
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import closing, contextmanager
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, runtime_checkable

from upright.errors import UprightError, require_kind
from upright.support.processes import process_pool

if TYPE_CHECKING:  # what takes a second to import; commands read the names here for their help
    import numpy as np

    from upright.studies.case import Case

EXECUTORS = ("threads", "processes", "dask")
"""Names of what can make runs."""
ADDRESS = "DASK_SCHEDULER_ADDRESS"
"""Environment variable with the address of the scheduler, which dask's own programs read too."""
OUTSTANDING = 1000
"""Pieces of work that are handed over at once to an executor of unknown size."""
EXPECTED = "threads, processes, the address of a scheduler (tcp://HOST:PORT), or an Executor"


@runtime_checkable
class Workers(Protocol):
    """What makes runs."""

    @property
    def most(self) -> int:
        """The most runs that a piece of work may consist of."""

    @property
    def stop(self) -> "np.ndarray | None":
        """Shape (1,), bool: tells threads to end their runs; None where nothing is shared."""

    @property
    def budget(self) -> float:
        """How long a piece of work begins new runs [s]."""

    def window(self) -> int:
        """Return the most pieces of work to be handed over at once."""

    def check(self, cases: Iterable["Case"]) -> None:
        """Raise UprightError if runs of a case cannot be made there."""

    def submit(self, work: Callable[..., Any], cases: Collection["Case"], *arguments: Any) -> Any:
        """Hand over work about some cases, and return its future."""

    def next_ended(self) -> Any:
        """Wait for a piece of work to end, and return its future."""

    def result(self, future: Any) -> Any:
        """Return what a piece of work returned, or raise what it raised.

        Raises
        ------
        BrokenExecutor
            If the work ended the process that it ran in.
        """

    def abandon(self, futures: Iterable[Any]) -> None:
        """Stop work that has not ended, if that is possible."""

    def close(self) -> None:
        """Release what does the work."""


AnyExecutor: TypeAlias = "Executor | Workers | str | None"
"""An executor, one of EXECUTORS but the last, or the address of a scheduler; None for what suits
the cases."""


@contextmanager
def opened(executor: AnyExecutor) -> Iterator[AnyExecutor]:
    """Connect to a cluster for several studies, if an executor is a scheduler's address.

    Raises
    ------
    UprightError
        If it is no executor, or no scheduler answers at the address.
    """
    if executor is None or executor in ("threads", "processes"):
        yield executor
    elif not isinstance(executor, str):
        require_kind("executor", executor, (Executor, Workers), EXPECTED)
        yield executor
    elif "://" not in executor:
        raise UprightError(f"executor is {executor!r}; it must be {EXPECTED}")
    else:
        from upright.studies.cluster import Cluster

        with closing(Cluster(executor)) as cluster:
            yield cluster


def is_elsewhere(executor: AnyExecutor) -> bool:
    """Whether an executor is a cluster."""
    return isinstance(executor, (str, Workers)) and executor not in ("threads", "processes")


@contextmanager
def workers_for(cases: Sequence["Case"], executor: AnyExecutor) -> Iterator[Workers]:
    """Provide what makes the runs of cases within the block."""
    with opened(executor) as chosen:
        if isinstance(chosen, Workers):
            chosen.check(cases)
            yield chosen
        elif isinstance(chosen, Executor):
            yield Local(chosen, own=False)
        else:
            with closing(Local(local_executor(cases, chosen), own=True)) as workers:
                yield workers


def local_executor(cases: Sequence["Case"], kind: str | None = None) -> Executor:
    """Return an executor of this kind on this machine.

    By default, there is one thread per core, or one process per core if custom code is plain
    Python. If only one such plant exists, there is a single thread.
    """
    from upright.studies.custom import definitions_of, is_plain_python
    from upright.studies.definitions import receive

    if any(case.plant.alone for case in cases):
        return ThreadPoolExecutor(1)
    if kind == "processes" or (kind is None and is_plain_python(cases)):
        return process_pool(receive, definitions_of(cases))
    return ThreadPoolExecutor(os.cpu_count())


# ------------------------------------------------------------------------------ on this machine


class Local:
    """Threads or processes of this machine, or any executor that the caller provides.

    Parameters
    ----------
    executor
        Does the work.
    own
        Whether it is to be shut down at the end.
    """

    most, budget = 1, 0.0

    def __init__(self, executor: Executor, *, own: bool) -> None:
        import numpy as np

        self.stop = np.zeros(1, np.bool_)
        self._executor, self._own = executor, own
        self._others = set(multiprocessing.active_children())
        self._ended: SimpleQueue[Any] = SimpleQueue()

    def window(self) -> int:
        """Return the most pieces of work to be handed over at once."""
        return OUTSTANDING

    def check(self, cases: Iterable["Case"]) -> None:
        """Do nothing: every case can be run here."""

    def submit(self, work: Callable[..., Any], _cases: Collection["Case"], *arguments: Any) -> Any:
        """Hand over work, and return its future."""
        future = self._executor.submit(work, *arguments)
        future.add_done_callback(self._ended.put)
        return future

    def next_ended(self) -> Any:
        """Wait for a piece of work to end, and return its future."""
        return self._ended.get()

    def result(self, future: Any) -> Any:
        """Return what a piece of work returned, or raise what it raised."""
        return future.result()

    def abandon(self, futures: Iterable[Any]) -> None:
        """Stop work that has not ended; another executor's processes end their runs themselves."""
        self.stop[0] = True  # threads see it
        processes = set(multiprocessing.active_children()) - self._others if self._own else set()
        for process in processes:
            process.terminate()
        if not processes:  # else the pool itself ends them, and complains of those cancelled
            for future in futures:
                future.cancel()

    def close(self) -> None:
        """Release the threads or processes."""
        if self._own:
            self._executor.shutdown(wait=False)
