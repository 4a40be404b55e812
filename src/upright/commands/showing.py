"""How commands show what came out: tables, settings, and what an interrupt left."""

import argparse
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from upright.agents import AGENTS
from upright.support import terminal

if TYPE_CHECKING:
    from upright.reports.statistics import Row
    from upright.studies.case import Case


def put(text: str, output: str | None) -> None:
    """Write a text to a file, or to the screen.

    Raises
    ------
    UprightError
        If the file cannot be written.
    """
    from upright.support.files import write_file

    if output:
        write_file(output, text)
    else:
        print(text, end="")


def put_table(rows: "Sequence[Row]", options: argparse.Namespace) -> None:
    """Write a table as the options --format, --sources and --output say.

    Raises
    ------
    UprightError
        If the file cannot be written.
    """
    from upright.reports.tables import render

    width = terminal.width(to_file=options.output is not None)
    put(render(rows, options.format, width=width, sources=options.sources), options.output)


def tell_file(what: str, path: Path | str, stream: TextIO | None = None) -> None:
    """Say where something was written, on standard output or another stream."""
    print(f"{what}: {terminal.visible(str(path))}", file=stream)


@contextmanager
def telling_of_compilation(agents: Iterable[str], work: str = "learn") -> Iterator[None]:
    """Say that agents are compiled now, if they have not been before.

    Parameters
    ----------
    agents
        Names of the agents; those of custom ones do not matter, as their machine code is not kept.
    work
        What they do, for which they are compiled apart.
    """
    from upright.support.machine_code import lacking, note_compiled

    things = [work, *(f"{work} {agent}" for agent in agents if agent in AGENTS.built_in)]
    if lacking(things):
        terminal.notice("compiling, once per version …")
    yield
    note_compiled(things)


def print_settings(named: Mapping[str, Any]) -> None:
    """Print each setting with its meaning, and its value in each of the settings by name."""
    from upright.support.settings import describe_settings

    for setting, text in describe_settings(next(iter(named.values()))).items():
        values = ", ".join(f"{label} {getattr(s, setting)!r}" for label, s in named.items())
        print(f"  {setting}: {text}\n      {values}")


def tell_what_was_found(case: "Case") -> None:
    """Say on standard error what was found in a model of the user's own, if a case has one."""
    if not (found := getattr(case.plant, "found", None)):
        return
    if told := "; ".join(f"{what}: {text}" for what, text in found(case.spec.parameters).items()):
        print(f"upright: found in the model: {terminal.visible(told)}", file=sys.stderr)


@contextmanager
def telling_what_is_kept(place: str | None, what: str = "finished runs") -> Iterator[None]:
    """Say, when interrupted, where the finished runs are."""
    try:
        yield
    except KeyboardInterrupt:
        kept = f"{what} are kept in {place}; the same command goes on from there"
        lost = "nothing was kept; with --store FILE finished runs would be"
        print(f"upright: {terminal.visible(kept if place else lost)}", file=sys.stderr)
        raise
