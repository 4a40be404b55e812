"""The terminal: signs that it cannot show or must not, how wide it is, and lines that go again."""

import codecs
import os
import shutil
import sys
from typing import TextIO

WIDTH = 80
"""Width of what is written where there is no terminal [columns]."""
SIGNS = {
    "█": "#",
    "─": "-",
    "–": "-",
    "−": "-",
    "…": "...",
    "°": " deg",
    "±": "+/-",
    "×": "x",
    "·": "*",
    "←": "<-",
    "→": "->",
    "≤": "<=",
    "≥": ">=",
    "½": "1/2",
    "√": "sqrt ",
    "∇": "grad ",
    "Σ": "sum ",
    "²": "^2",
    "³": "^3",
    "¹": "^1",
    "⁶": "^6",
    "α": "alpha",
    "β": "beta",
    "γ": "gamma",
    "δ": "delta",
    "ε": "epsilon",
    "θ": "theta",
    "λ": "lambda",
    "μ": "mu",
    "π": "pi",
    "ρ": "rho",
    "σ": "sigma",
    "φ": "phi",
    "é": "e",
    "✓": "+",
    "✗": "x",
}
"""What stands for the signs that the package uses, where an encoding lacks them."""
HANDLER = "upright"
"""Name under which Python's codecs know how these signs are replaced."""


def _replace(error: UnicodeError) -> tuple[str, int]:
    """Replace what cannot be encoded; a sign that is not the package's becomes its number."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lost = error.object[error.start : error.end]
    known = (SIGNS.get(sign) or sign.encode("ascii", "backslashreplace").decode() for sign in lost)
    return "".join(known), error.end


codecs.register_error(HANDLER, _replace)


def prepare_streams() -> None:
    """Let what this process prints fit the encoding of its output, so that nothing fails.

    Python writes UTF-8 although ``LC_ALL=C`` asks for ASCII, unless its own variables say what is
    to be written.

    A stream that was closed before the program began is opened: errors go nowhere, and that nothing
    else can be written is an error.
    """
    _open_closed()
    plain = os.environ.get("LC_ALL") in ("C", "POSIX")
    plain &= not any(os.environ.get(name) for name in ("PYTHONIOENCODING", "PYTHONUTF8"))
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a program may have put something else there
            stream.reconfigure(encoding="ascii" if plain else None, errors=HANDLER)


def _open_closed() -> None:
    """Open the standard streams that are closed, before a file of other content gets their number.

    What is opened in place of the output cannot be written to.
    """
    for number, flags in enumerate((os.O_RDONLY, os.O_RDONLY, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, flags)  # it gets the lowest number that is free: this one
    for number, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, "w", encoding="utf-8", closefd=False))  # noqa: SIM115


def visible(text: str, keep: str = "") -> str:
    r"""Return a text of which all characters are seen: others, such as escapes, become their codes.

    Names come from anyone, and a terminal obeys some characters: it moves, hides or answers.

    Parameters
    ----------
    text
        The text.
    keep
        Characters that stay as they are, such as ends of lines.

    Examples
    --------
    >>> print(visible("a\x1b[2Jb\n\u202e"))
    a\x1b[2Jb\n\u202e
    """
    if text.isprintable():
        return text
    return "".join(
        sign if sign.isprintable() or sign in keep else repr(sign)[1:-1] for sign in text
    )


def printable(text: str, stream: TextIO | None = None) -> str:
    """Return a text with the signs replaced that a stream, by default the output, cannot show."""
    encoding = getattr(stream or sys.stdout, "encoding", None) or "utf-8"
    return text.encode(encoding, HANDLER).decode(encoding)


def width(*, to_file: bool = False) -> int:
    """Return how wide lines may be [columns]: as COLUMNS says, else as the terminal is, else 80.

    Parameters
    ----------
    to_file
        Whether they are for a file, whatever the width of the terminal.
    """
    asked = os.environ.get("COLUMNS", "")
    if asked.isdecimal() and int(asked) > 0:
        return int(asked)
    return WIDTH if to_file else shutil.get_terminal_size((WIDTH, 24)).columns


_noticed: list[str] = []


def notice(text: str) -> None:
    """Show a line on standard error until `end_notice`, if a person is watching."""
    if sys.stderr.isatty():
        _noticed.append(printable(text, sys.stderr))
        print(_noticed[-1], end="", file=sys.stderr, flush=True)


def end_notice() -> None:
    """Remove the line that `notice` showed, if any, so that something else may be printed."""
    while _noticed:
        print(f"\r{' ' * len(_noticed.pop())}\r", end="", file=sys.stderr, flush=True)
