"""Report an exception in the code of a custom agent: where it happened, and the agent's frames."""

import sysconfig
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path

from upright.errors import AgentError
from upright.support.files import INSTALLED, PACKAGE

RAISED = (Exception, SystemExit)
"""What an agent's code may raise. SystemExit is one, because it would end a command with 0."""

LIBRARIES = ("numba", "numpy")
"""Installed packages that are never an agent's own code."""
OWN, OTHERS, NEVER = range(3)
"""Whose code a frame runs: the agent's, that of packages it uses, or what says nothing of it."""


def fault(agent: str, what: str, error: BaseException) -> AgentError:
    """Return the error that reports an exception in a custom agent's code.

    Parameters
    ----------
    agent
        Name of the agent.
    what
        What failed and where, such as "act failed in run 0, trial 3, step 17".
    error
        The exception.
    """
    kind, reason = type(error).__name__, str(error).partition("\n")[0]
    first = f"agent is {agent!r}; {what}: {kind}" + (f": {reason}" if reason else "")
    return AgentError(f"{first}\n{own_traceback(error)}")


def place(run: str, trial: int, step: int = 0) -> str:
    """Return where a run is, in words; step 0 is before the first."""
    return f"{run}, trial {trial:,}" + (f", step {step:,}" if step else "")


@contextmanager
def reporting(agent: str, what: str) -> Iterator[None]:
    """Report exceptions in a custom agent's code; errors that are reported already pass.

    Raises
    ------
    AgentError
        If the code in this context raises.
    """
    try:
        yield
    except AgentError:
        raise
    except RAISED as error:
        raise fault(agent, what, error) from error


def own_traceback(error: BaseException) -> str:
    """Return the traceback of an exception, with only the frames of the agent's own files.

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
