"""A progress bar for notebooks: plain HTML, which needs no widgets."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape

from upright.support.terminal import visible

INTERVAL = 0.1
"""Shortest time between two updates, each of which is a message to the browser [s]."""


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


@contextmanager
def notebook_bar(total: int, kept: str) -> Iterator[Callable[[str, str], None]]:
    """Show a bar below the cell, and at the end one line in its place.

    Parameters
    ----------
    total
        Number of runs to be made.
    kept
        What is said after an interrupt about the runs that have ended.

    Yields
    ------
    callable
        To be called after each run with its name and with the speed so far.
    """
    from IPython.display import HTML, display

    began = shown = time.monotonic()
    done = 0
    handle = display(HTML(_bar(0, total, f"0/{total:,} runs")), display_id=True)

    def advance(name: str, speed: str) -> None:
        nonlocal done, shown
        done += 1
        now = time.monotonic()
        if now - shown >= INTERVAL:
            shown = now
            left = (now - began) / done * (total - done)
            text = f"{done:,}/{total:,} runs, {name}, {speed}, {left:,.0f} s left"
            handle.update(HTML(_bar(done, total, text)))

    ending = f"stopped after {{}} of {total:,} runs; {kept}"
    try:
        yield advance
        ending = "{} runs"
    finally:
        seconds = time.monotonic() - began
        handle.update(HTML(_small(f"{ending.format(f'{done:,}')}, {seconds:,.1f} s")))


def _bar(done: int, total: int, text: str) -> str:
    return f'<progress value="{done}" max="{total}"></progress> {_small(text)}'


def _small(text: str) -> str:
    return f"<small>{escape(visible(text))}</small>"
