"""Report an exception in the code of a custom agent or plant: where it happened, its frames."""

import sysconfig
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import TypeVar

from upright.errors import CodeError
from upright.support.files import INSTALLED, PACKAGE

E = TypeVar("E", bound=CodeError)

RAISED = BaseException
"""What custom code may raise: SystemExit, for example, would end a command with 0. Whatever is
caught is given to `fault`, which lets Ctrl-C pass.
"""

LIBRARIES = ("numba", "numpy")
"""Installed packages that are never custom code."""
OWN, OTHERS, NEVER = range(3)
"""Whose code a frame runs: the custom one, that of packages it uses, or what says nothing of it."""


def fault(kind: type[E], name: str, what: str, error: BaseException) -> E:
    """Return the error that reports an exception in custom code.

    Parameters
    ----------
    kind
        Class of the error: whose code it is.
    name
        Name of the agent or the plant.
    what
        What failed and where, such as "act failed in run 0, trial 3, step 17".
    error
        The exception. KeyboardInterrupt is raised again.
    """
    if isinstance(error, KeyboardInterrupt):
        raise error
    raised, reason = type(error).__name__, _said(error).partition("\n")[0]
    first = f"{kind.owner} is {name!r}; {what}: {raised}" + (f": {reason}" if reason else "")
    frames = own_traceback(error)
    return kind(f"{first}\n{frames}" if "\n" in frames else first)


def _said(error: BaseException) -> str:
    """Return the message of an exception, whose own code makes it."""
    try:
        return str(error)
    except Exception:
        return "its message cannot be shown"


def place(run: str, trial: int, step: int = 0) -> str:
    """Return where a run is, in words; step 0 is before the first."""
    return f"{run}, trial {trial:,}" + (f", step {step:,}" if step else "")


@contextmanager
def reporting(kind: type[CodeError], name: str, what: str) -> Iterator[None]:
    """Report exceptions in custom code, as `fault` does; errors that are reported already pass.

    Raises
    ------
    CodeError
        Of this kind, if the code in this context raises.
    """
    try:
        yield
    except CodeError:
        raise
    except RAISED as error:
        raise fault(kind, name, what, error) from error


def own_traceback(error: BaseException) -> str:
    """Return the traceback of an exception, with only the frames of custom files.

    If there are none, as for an agent that is part of an installed package, all frames of installed
    packages are shown.
    """
    report = traceback.TracebackException.from_exception(error)
    parts = list(_parts(report))
    shown = min((_owner(f.filename) for part in parts for f in part.stack), default=OWN)
    for part in parts:
        frames = [f for f in part.stack if _owner(f.filename) <= min(shown, OTHERS)]
        part.stack = traceback.StackSummary.from_list(frames)
    return "".join(report.format()).rstrip()


def _parts(report: traceback.TracebackException) -> Iterator[traceback.TracebackException]:
    """Yield the report of an exception, and of those that led to it or are grouped in it."""
    yield report
    others = (report.__cause__, report.__context__, *(report.exceptions or ()))
    yield from chain.from_iterable(_parts(other) for other in others if other is not None)


def _owner(filename: str) -> int:
    path = Path(filename)
    if folder := next((name for name in INSTALLED if name in path.parts), None):
        package = path.parts[path.parts.index(folder) + 1]
        return NEVER if package in (*LIBRARIES, PACKAGE.name) else OTHERS
    unshown = (PACKAGE, Path(sysconfig.get_path("stdlib")))
    is_unshown = any(path.is_relative_to(folder) for folder in unshown)
    return NEVER if is_unshown or filename.startswith(("<frozen ", "<__array_")) else OWN
