"""Exit statuses of commands, and the one line that explains a failure."""

import os
import sys
from collections.abc import Callable

from upright.errors import Stopped, UprightError

FAILED, BAD_USE, INTERRUPTED = 1, 2, 130
"""Exit statuses besides 0."""


def exit_status(work: Callable[[], int]) -> int:
    """Run a command and return its exit status; explain a failure in one line on standard error."""
    try:
        return work()
    except UprightError as error:
        print(f"upright: error: {error}", file=sys.stderr)
        return BAD_USE
    except (KeyboardInterrupt, Stopped):
        print("upright: stopped", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else its flush fails, too
        return FAILED
