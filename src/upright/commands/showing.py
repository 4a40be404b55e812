"""How commands show what came out: tables, settings, and what an interrupt left."""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any


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


def print_settings(named: Mapping[str, Any]) -> None:
    """Print each setting with its meaning, and its value in each of the settings by name."""
    from upright.support.settings import describe_settings

    for setting, text in describe_settings(next(iter(named.values()))).items():
        values = ", ".join(f"{label} {getattr(s, setting)!r}" for label, s in named.items())
        print(f"  {setting}: {text}\n      {values}")


@contextmanager
def telling_what_is_kept(place: str | None, what: str = "finished runs") -> Iterator[None]:
    """Say, when interrupted, where the finished runs are."""
    try:
        yield
    except KeyboardInterrupt:
        kept = f"{what} are kept in {place}; the same command goes on from there"
        lost = "nothing was kept; with --store FILE finished runs would be"
        print(f"upright: {kept if place else lost}", file=sys.stderr)
        raise
