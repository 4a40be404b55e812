"""Text from anyone, such as names, written so that a format takes it for nothing but text.

Each function serves one format; for terminals there is `support.terminal.visible`, which all of
them begin with. Pictures need none: their style takes no text for mathematics.
"""

import html
import re
import unicodedata
from functools import lru_cache

from upright.support.terminal import visible

FORMULA = ("=", "+", "-", "@")
"""Beginnings of what spreadsheets take for a formula, also in full width."""
LATEX = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "%": r"\%",
    "_": r"\_",
    "#": r"\#",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    "–": "--",
    # LaTeX would read a bracket at the beginning of a line as an option of the previous line.
    "[": "{[}",
    "]": "{]}",
}
"""How LaTeX writes what it does not take literally."""
MARKDOWN = re.compile(r"[\\`*<~$]|&(?=#?\w+;)|\](?=[(\[:])|(?<![^\W_])_|_(?![^\W_])")
"""What Markdown does not take literally, within a line of text."""


class Markdown(str):
    """Text that is Markdown already."""

    __slots__ = ()


def csv_cell(value: object) -> object:
    """Return a value as a cell of a CSV: text that a spreadsheet would run gets an apostrophe.

    So does text that begins with one, so that whoever reads it can take the first one away.

    Examples
    --------
    >>> csv_cell("=HYPERLINK(1)"), csv_cell("q-learning"), csv_cell(-1.5)
    ("'=HYPERLINK(1)", 'q-learning', -1.5)
    """
    return _csv_text(value) if isinstance(value, str) else value


@lru_cache
def _csv_text(text: str) -> str:
    begins = unicodedata.normalize("NFKC", text.lstrip()[:1])
    return f"'{visible(text)}" if begins in (*FORMULA, "'") else visible(text)


def latex(text: str) -> str:
    r"""Return a text for LaTeX.

    Examples
    --------
    >>> print(latex(r"\input{a} [5 %]"))
    \textbackslash{}input\{a\} {[}5 \%{]}
    """
    return "".join(LATEX.get(sign, sign) for sign in visible(text))


def markdown(text: str) -> Markdown:
    r"""Return a text as Markdown, for a line or, with bars escaped, a cell; or Markdown as it is.

    Examples
    --------
    >>> print(markdown("<b> *x*, half_length=0.3"), markdown(Markdown("**1**")))
    \<b> \*x\*, half_length=0.3 **1**
    """
    if isinstance(text, Markdown):
        return text
    return Markdown(MARKDOWN.sub(r"\\\g<0>", visible(text)))


def markdown_code(text: str) -> Markdown:
    """Return a text as code in Markdown.

    Examples
    --------
    >>> print(markdown_code("upright table"), markdown_code("a`b"))
    `upright table` `` a`b ``
    """
    text = visible(text)
    longest = max(map(len, re.findall("`+", text)), default=0)
    space = " " if longest else ""
    return Markdown(f"{'`' * (longest + 1)}{space}{text}{space}{'`' * (longest + 1)}")


def html_text(text: str) -> str:
    """Return a text for HTML.

    Examples
    --------
    >>> html_text("<script>")
    '&lt;script&gt;'
    """
    return html.escape(visible(text))
