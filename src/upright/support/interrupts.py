"""Defer interrupts (Ctrl-C) to points where they do no harm."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that end a program: from another one, and from a terminal that is closed."""
SIGNALS = (signal.SIGINT, *ENDING)
"""Signals that interrupt, if their handler is that of Ctrl-C, which raises KeyboardInterrupt."""


@contextmanager
def ending_like_ctrl_c() -> Iterator[None]:
    """Let the signals that end a program interrupt it, as Ctrl-C does, within the block.

    Those that are ignored, as by nohup, or that the calling program handles, stay so. Nothing
    changes in threads other than the main one.
    """
    main = threading.current_thread() is threading.main_thread()
    numbers = [n for n in ENDING if main and signal.getsignal(n) is signal.SIG_DFL]
    for number in numbers:
        signal.signal(number, signal.default_int_handler)
    try:
        yield
    finally:
        for number in numbers:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def hold_interrupts() -> Iterator[None]:
    """Hold interrupts back, except within `let_interrupts_through`.

    Raised at an arbitrary point, KeyboardInterrupt can leave a lock taken or a database transaction
    open, so that the next user waits for ever; or it is lost in a callback that Python runs as it
    frees an object. An interrupt that was held back or lost is raised where the next of these
    contexts begins or ends. A second interrupt is raised at once.

    Nothing changes in threads other than the main one, or where the calling program has installed
    signal handlers of its own.

    Raises
    ------
    KeyboardInterrupt
        If interrupted.
    """
    if handler := _handler():
        with handler.switched(through=False):
            yield
        return
    main = threading.current_thread() is threading.main_thread()
    usual = signal.default_int_handler
    numbers = [number for number in SIGNALS if main and signal.getsignal(number) is usual]
    handler = _Handler()
    for number in numbers:
        signal.signal(number, handler)
    try:
        with handler.switched(through=False):
            yield
    finally:
        for number in numbers:
            signal.signal(number, usual)


@contextmanager
def let_interrupts_through() -> Iterator[None]:
    """Let interrupts through at once within `hold_interrupts`; meant for a single blocking call.

    Raises
    ------
    KeyboardInterrupt
        If interrupted now, or if an interrupt was held back.
    """
    if handler := _handler():
        with handler.switched(through=True):
            yield
    else:
        yield


class _Handler:
    """A signal handler that counts interrupts and raises them when they are let through."""

    def __init__(self) -> None:
        self._through = True
        self._interrupts = 0

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        self._interrupts += 1
        if self._through or self._interrupts > 1:
            raise KeyboardInterrupt

    @contextmanager
    def switched(self, through: bool) -> Iterator[None]:
        """Let interrupts through, or hold them back, within the block."""
        previous, self._through = self._through, through
        try:
            self._raise_if(previous or through)
            yield
        finally:
            self._through = previous
        self._raise_if(previous or through)

    def _raise_if(self, through: bool) -> None:
        if through and self._interrupts:
            raise KeyboardInterrupt


def _handler() -> _Handler | None:
    """Return the handler that holds interrupts back in this thread, if any."""
    if threading.current_thread() is threading.main_thread():
        for handler in map(signal.getsignal, SIGNALS):
            if isinstance(handler, _Handler):
                return handler
    return None
