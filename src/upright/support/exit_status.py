"""Exit statuses of commands, and the line that explains a failure."""

import errno
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO

from upright.errors import AgentWarning, CodeError, Stopped, UprightError
from upright.support.interrupts import ending_like_ctrl_c
from upright.support.terminal import end_notice, prepare_streams, visible

FAILED, BAD_USE, AGENT_FAILED, UNWRITTEN, INTERRUPTED = 1, 2, 3, 74, 130
"""Exit statuses besides 0: not balanced, not possible, the error of a custom agent
or plant, output that cannot be written (EX_IOERR of sysexits.h), and Ctrl-C, SIGTERM or SIGHUP."""
UNWRITABLE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)
"""Errors of a disk or a device that takes no more, and of an output that was closed."""


def exit_status(work: Callable[[], int]) -> int:
    """Run a command and return its exit status; explain a failure on standard error.

    The explanation is one line, which the traceback of custom code may follow.
    """
    prepare_streams()
    try:
        try:
            with ending_like_ctrl_c(), _plain_warnings():
                return work()
        finally:
            end_notice()
            sys.stdout.flush()  # fails here, where it can be explained, not as Python ends
    except UprightError as error:
        is_code = isinstance(error, CodeError)
        _explain(f"error: {error}", keep="\n" if is_code else "")
        return AGENT_FAILED if is_code else BAD_USE
    except (KeyboardInterrupt, Stopped):
        _explain("stopped")
        return INTERRUPTED
    except BrokenPipeError:
        _abandon(sys.stdout)
        return FAILED
    except OSError as error:
        if error.errno not in UNWRITABLE:
            raise
        _abandon(sys.stdout)
        _explain(f"error: the output cannot be written: {error.strerror}")
        return UNWRITTEN


@contextmanager
def _plain_warnings() -> Iterator[None]:
    """Show a warning of an agent in one line, without the place in this package that gives it."""
    with warnings.catch_warnings():
        warnings.simplefilter("default", AgentWarning)  # the same one once
        usual = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *place: Any) -> None:
            if issubclass(category, AgentWarning):
                _explain(f"warning: {message}", keep="\n")
            else:
                usual(message, category, *place)

        warnings.showwarning = show  # type: ignore[assignment]
        yield


def _explain(text: str, keep: str = "") -> None:
    """Print a line about the command on standard error, if that can be written."""
    try:
        print(f"upright: {visible(text, keep)}", file=sys.stderr, flush=True)
    except OSError:
        _abandon(sys.stderr)


def _abandon(stream: TextIO) -> None:
    """Discard what a stream still holds; otherwise its last flush fails as Python ends."""
    with suppress(OSError, ValueError):  # a stream without a file needs nothing
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
