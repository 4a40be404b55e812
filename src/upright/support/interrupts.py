"""Interrupts (Ctrl-C) that come when they do no harm."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)
"""What interrupts, where its handler is the one that raises KeyboardInterrupt."""


@contextmanager
def hold_interrupts() -> Iterator[None]:
    """Hold interrupts back, save where `let_interrupts_through`.

    Raised anywhere, KeyboardInterrupt can leave a lock taken or a transaction of a database open,
    and whoever comes next waits for ever; or it is lost in a callback that Python calls as it frees
    an object. One that was held back or lost is raised where the next of these contexts begins or
    ends. A second is raised at once.

    In threads besides the main one, and where another program has its own way with interrupts, all
    stays as it is.

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
    """Let interrupts come at once, where they are held back otherwise: best around one wait.

    Raises
    ------
    KeyboardInterrupt
        If interrupted, or one was held back.
    """
    if handler := _handler():
        with handler.switched(through=True):
            yield
    else:
        yield


class _Handler:
    """Of signals."""

    def __init__(self) -> None:
        self._through = True
        self._came = 0

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        self._came += 1
        if self._through or self._came > 1:
            raise KeyboardInterrupt

    @contextmanager
    def switched(self, through: bool) -> Iterator[None]:
        """Let interrupts through, or not."""
        before, self._through = self._through, through
        try:
            self._raise_if(before or through)
            yield
        finally:
            self._through = before
        self._raise_if(before or through)

    def _raise_if(self, through: bool) -> None:
        if through and self._came:
            raise KeyboardInterrupt


def _handler() -> _Handler | None:
    """Return what holds interrupts back in this thread."""
    if threading.current_thread() is threading.main_thread():
        for handler in map(signal.getsignal, SIGNALS):
            if isinstance(handler, _Handler):
                return handler
    return None
