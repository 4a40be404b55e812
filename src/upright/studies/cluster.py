"""A cluster of machines that makes the runs of studies, with dask.distributed.

One process owns the store; workers only make runs. They must have this very version of the package,
and receive custom code with every piece of work, so that a worker may come, go or start anew at any
time.
"""

import asyncio
import importlib
import math
import pickle
import platform
import sys
import tempfile
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Condition, Lock
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from upright import __version__
from upright.errors import UprightError, require_module
from upright.studies.case import Case
from upright.studies.custom import changeable, definitions_of, has_changed, is_plain_python
from upright.studies.definitions import Definitions, define, is_in_main, load
from upright.studies.fingerprint import custom_files
from upright.support.machine_code import sources_hash

ANSWERING = 10.0
"""How long a scheduler may take to answer [s]."""
LEAST, A_SECOND = 2.0, 100
"""A worker hands back the runs of a piece of work that it has not begun after this time [s], and
later on a cluster so large that more pieces than this would end in a second.

A scheduler spends some milliseconds on each, and a cancelled one ends only between runs.
"""
ARRIVING = 600.0
"""How long to wait for a worker while there is none [s]."""


Files = tuple[tuple[str, bytes], ...]
"""Paths below a folder, and the contents of these files."""


class Code(NamedTuple):
    """Custom code for other machines."""

    definitions: bytes
    """What a script or notebook defines, as `pack` returns it; empty if nothing."""
    folders: tuple[Files, ...]
    """For each folder that modules are imported from: the path and the content of each file."""
    is_plain_python: bool
    """Whether any of it is not compiled."""


class Cluster:
    """A connection to the scheduler of a dask cluster, which hands work to its workers.

    Parameters
    ----------
    address
        Of the scheduler: ``tcp://HOST:PORT``.

    Raises
    ------
    UprightError
        If dask.distributed is missing, or no scheduler answers.
    """

    most = 1000
    stop = None

    def __init__(self, address: str) -> None:
        distributed = require_module("distributed", "a cluster needs dask.distributed", "cluster")
        _silence()
        self.address = address
        try:
            self._client = _bounded(distributed.Client)(
                address, timeout=ANSWERING, set_as_default=False
            )
        except Exception as error:  # of many kinds: of names, networks, certificates
            silent = f"nothing was said for {ANSWERING:g} s"
            why = " ".join(str(error).split()) or silent
            raise UprightError(
                f"address is {address!r}; no dask scheduler answers there: {why}"
            ) from None
        self._ended: SimpleQueue[Any] = SimpleQueue()
        self._codes: dict[frozenset[tuple[str, str]], Code] = {}
        self._threads, self._counted = 0, -math.inf

    def check(self, cases: Iterable[Case]) -> None:
        """Raise UprightError if runs of a case cannot be made there."""
        for case in cases:
            if case.plant.alone:
                why = "its runs are made on this machine alone, without --executor dask"
                raise UprightError(f"plant is {case.plant.name!r}; {why}")

    @property
    def budget(self) -> float:
        """How long a piece of work begins new runs [s]."""
        return max(LEAST, self._threads / A_SECOND)

    def window(self) -> int:
        """Return the most pieces of work to be handed over at once: two a thread."""
        now = time.monotonic()
        if now - self._counted > 1:
            with self._explaining_loss():
                self._threads, self._counted = sum(self._client.nthreads().values()), now
        return max(2 * self._threads, 2)

    def submit(self, work: Callable[..., Any], cases: Collection[Case], *arguments: Any) -> Any:
        """Hand over work about some cases, and return its future."""
        packed = pickle.dumps((work, list(cases), arguments))
        with self._explaining_loss():
            future = self._client.submit(
                _on_worker, environment(), self._code_of(cases), packed, pure=False
            )
        future.add_done_callback(self._ended.put)
        return future

    def _code_of(self, cases: Collection[Case]) -> Code:
        """Return the custom code of cases, as it was when it was first sent."""
        names = frozenset((case.agent, case.plant.name) for case in cases)
        if names not in self._codes:
            files: dict[Path, set[Path]] = {}
            for agent, plant in sorted(names):
                for root, paths in custom_files(agent, plant).items():
                    files.setdefault(root, set()).update(paths)
            in_main = any(is_in_main(name) for pair in names for name in pair)
            self._codes[names] = Code(
                definitions_of(cases) if in_main else b"",
                tuple(_contents(root, paths) for root, paths in files.items()),
                is_plain_python(cases),
            )
        return self._codes[names]

    def next_ended(self) -> Any:
        """Wait for a piece of work to end, and return its future.

        Raises
        ------
        UprightError
            If there is no worker for a long time.
        """
        since = None
        while True:
            with suppress(Empty):
                return self._ended.get(timeout=1.0)
            if self.window() and self._threads:
                since = None
            elif since is None:
                since = time.monotonic()
                print(f"upright: waiting for workers at {self.address}", file=sys.stderr)
            elif time.monotonic() - since > ARRIVING:
                raise UprightError(
                    f"address is {self.address!r}; no worker has come for {ARRIVING:g} s"
                )

    def result(self, future: Any) -> Any:
        """Return what the work returned, or raise what it raised.

        Raises
        ------
        UprightError
            If the worker was refused, or the scheduler is gone.
        BrokenExecutor
            If the work ended several workers.
        """
        from distributed import KilledWorker

        try:
            with self._explaining_loss():
                status, *found = future.result()
        except KilledWorker as error:
            raise BrokenExecutor(str(error)) from None
        if status == "refused":
            where, why = found
            raise UprightError(f"worker is {where!r}; {why}")
        return found[0]

    @contextmanager
    def _explaining_loss(self) -> Iterator[None]:
        """Turn an error of a lost connection into one line."""
        try:
            yield
        except (CancelledError, OSError, TimeoutError):
            if self._client.status == "running":
                raise
            raise UprightError(
                f"address is {self.address!r}; the scheduler is gone; runs that had ended are in "
                "the store, if there is one, and the same command goes on from there"
            ) from None

    def abandon(self, futures: Iterable[Any]) -> None:
        """Cancel work that has not ended; workers finish the run that each is making."""
        with suppress(Exception):  # the scheduler may be gone
            self._client.cancel(list(futures), force=True)

    def close(self) -> None:
        """Disconnect."""
        with suppress(Exception):
            self._client.close(timeout=1)


def _bounded(client: Any) -> Any:
    """Return a class of clients that do not wait for ever for what is no scheduler."""

    class Client(client):  # type: ignore[misc]
        async def _ensure_connected(self, timeout: float | None = None) -> None:
            """Connect; dask itself bounds only the time to open the connection."""
            await asyncio.wait_for(super()._ensure_connected(timeout), timeout)

        def __del__(self) -> None:
            """Do nothing: a client that failed would wait; others are closed by `Cluster`."""

    return Client


def _contents(root: Path, paths: Iterable[Path]) -> Files:
    """Return the path below a folder and the content of each file."""
    return tuple((path.relative_to(root).as_posix(), path.read_bytes()) for path in sorted(paths))


def _silence() -> None:
    """Keep dask from writing about lost connections, which are reported in one line."""
    import logging

    for name in ("distributed", "distributed.client", "tornado"):
        logging.getLogger(name).setLevel(logging.CRITICAL)


# ------------------------------------------------------------------------------ on a worker


def _on_worker(ours: dict[str, str], code: Any, packed: bytes) -> tuple[Any, ...]:
    """Do a piece of work on a worker, which may lack this package or have another version of it.

    Returns
    -------
    tuple
        "done" and what the work returned; or "refused", the worker's address, and why.
    """
    from distributed import get_worker

    where = get_worker().address
    try:
        from upright.studies.cluster import Refused, perform
    except ImportError as error:
        return "refused", where, f"it does not have this version of upright: {error}"
    try:
        return "done", perform(ours, code, packed)
    except Refused as error:
        return "refused", where, str(error)


_on_worker.__module__ = "__main__"  # so that it is sent by value, not by a name to be imported


class Refused(Exception):  # noqa: N818 - an answer, not an error
    """A worker cannot take part, and says why."""


@cache
def environment() -> dict[str, str]:
    """Return the versions that must be the same everywhere, as they decide what a run gives."""
    import numba

    return {
        "upright": f"{__version__} ({sources_hash()})",
        "Python": ".".join(platform.python_version_tuple()[:2]),
        "NumPy": ".".join(np.__version__.split(".")[:2]),
        "Numba": ".".join(numba.__version__.split(".")[:2]),
    }


def perform(ours: dict[str, str], code: Code, packed: bytes) -> Any:
    """Do a piece of work, if this worker is like the process that it comes from.

    Raises
    ------
    Refused
        If it is not.
    """
    theirs = environment()
    for name, version in ours.items():
        if theirs.get(name) != version:
            raise Refused(f"it has {name} {theirs.get(name)}; it must be {version}, as here")
    work, all_cases, arguments = pickle.loads(packed)
    cases = [case for case in all_cases if changeable(case)]
    if not (code.folders or code.definitions):
        _require_same(cases)
        return work(*arguments)
    with _turn(code):
        _receive(code, cases)
        return work(*arguments)


def _require_same(cases: Iterable[Case]) -> None:
    """Raise Refused unless what may change of cases is here as in the process that they come from.

    That is custom code, or the simulator and the files of a plant.
    """
    for case in cases:
        try:
            differs = has_changed(case)
            why = f"{changeable(case)}, of which it has another version"
        except UprightError as error:  # without the traceback of custom code, which would follow
            differs, why = True, str(error).partition("\n")[0]
        if differs:
            files = [getattr(case.plant, name) for name in getattr(case.plant, "FILES", ())]
            need = "; workers need the same file at the same path" if any(files) else ""
            raise Refused(why + need)


# ------------------------------------------------------------------------------ custom code there


_door, _change = Lock(), Condition()
_at_work: list[Code] = []


@contextmanager
def _turn(code: Code) -> Iterator[None]:
    """Wait until no other code is at work: there is one module of a name in a process.

    Plain Python waits for its own, too: it uses one core anyway, and may count on a process of its
    own.
    """
    with _door, _change:  # whoever comes later waits behind
        _change.wait_for(lambda: not _at_work or (code == _at_work[0] and not code.is_plain_python))
        _at_work.append(code)
    try:
        yield
    finally:
        with _change:
            _at_work.remove(code)
            _change.notify_all()


class Folder(NamedTuple):
    """Where the files of custom code are on this worker."""

    place: str
    """Its path."""
    modules: dict[str, ModuleType]
    """Modules that were imported from it, as long as others of their names take their place."""


_present: list[Code] = []
"""The code whose modules are those that are imported; empty if none was received yet."""
_folders: dict[Files, Folder] = {}
_owners: dict[str, Folder] = {}
"""The folder that modules of a name come from."""
_definitions: dict[Code, Definitions] = {}


def _receive(code: Code, cases: Sequence[Case]) -> None:
    """Make the custom code of cases importable here, unless this worker has the same already.

    What was imported before is kept, so that studies which take turns do not compile anew.
    """
    if [code] == _present or (not _folders and all(map(_is_here, cases))):
        return
    _present.clear()
    for files in code.folders:
        _import_from(files)
    try:
        if code.definitions:
            if code not in _definitions:
                _definitions[code] = load(code.definitions)
            define(_definitions[code])
    except UprightError as error:
        raise Refused(str(error).partition("\n")[0]) from None
    _require_same(cases)
    _present.append(code)


def _is_here(case: Case) -> bool:
    with suppress(UprightError):
        return not has_changed(case)
    return False


def _import_from(files: Files) -> None:
    """Import modules from these files from now on, and put others of their names away."""
    if files not in _folders:
        _folders[files] = Folder(_written(files), {})
    folder = _folders[files]
    sys.path[:] = [folder.place, *(path for path in sys.path if path != folder.place)]
    importlib.invalidate_caches()
    tops = {name.partition("/")[0].removesuffix(".py") for name, _ in files}
    for name in [name for name in sys.modules if name.partition(".")[0] in tops]:
        module = sys.modules.pop(name)
        if owner := _owners.get(name.partition(".")[0]):
            owner.modules[name] = module
    sys.modules.update(folder.modules)
    _owners.update(dict.fromkeys(tops, folder))


def _written(files: Files) -> str:
    """Return the path of a new folder with these files."""
    from distributed import get_worker

    place = get_worker().local_directory  # which dask removes, however the worker ends
    folder = tempfile.mkdtemp(prefix="upright-", dir=place)
    for name, content in files:
        path = Path(folder, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return folder
