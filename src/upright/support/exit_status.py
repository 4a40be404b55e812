"""Exit statuses of commands, and the one line that explains a failure."""

import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from upright.errors import AgentError, AgentWarning, Stopped, UprightError

FAILED, BAD_USE, AGENT_FAILED, INTERRUPTED = 1, 2, 3, 130
"""Exit statuses besides 0: not balanced, not possible, a custom agent's error, and Ctrl-C."""


def exit_status(work: Callable[[], int]) -> int:
    """Run a command and return its exit status; explain a failure on standard error.

    The explanation is one line, which the traceback of a custom agent's own code may follow.
    """
    try:
        with _plain_warnings():
            return work()
    except UprightError as error:
        print(f"upright: error: {error}", file=sys.stderr)
        return AGENT_FAILED if isinstance(error, AgentError) else BAD_USE
    except (KeyboardInterrupt, Stopped):
        print("upright: stopped", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else its flush fails, too
        return FAILED


@contextmanager
def _plain_warnings() -> Iterator[None]:
    """Show a warning of an agent in one line, without the place in this package that gives it."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", AgentWarning)
        usual = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *place: Any) -> None:
            if issubclass(category, AgentWarning):
                print(f"upright: warning: {message}", file=sys.stderr)
            else:
                usual(message, category, *place)

        warnings.showwarning = show  # type: ignore[assignment]
        yield
