"""A progress bar for stores that are read run by run."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import count as count_up
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from upright.studies.store import Store
from upright.support.terminal import end_notice

SELDOM = 1000
"""How many runs are read between two changes of the bar, which take longer than reading a run."""


@contextmanager
def reading_bar(paths: Iterable[Path | str], what: str) -> Iterator[Callable[[], None]]:
    """Show a bar in the terminal while stores are read; yield what is called after each run.

    Raises
    ------
    UprightError
        If a store is missing, cannot be read, or is not a store.
    """
    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    total = 0
    for path in paths:
        with Store(path, must_exist=True) as store:
            total += store.count()
    end_notice()
    console = Console(stderr=True)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task, numbers = bar.add_task("", total=total), count_up(1)

        def advance() -> None:
            if (number := next(numbers)) % SELDOM == 0:
                bar.update(task, completed=number)

        yield advance
