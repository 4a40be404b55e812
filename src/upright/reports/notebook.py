"""How results look in a notebook: tables in HTML, and figures that are displayed."""

import io
from collections.abc import Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from upright.reports.escaping import html_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESOLUTION = 100
"""Resolution of figures in a notebook [dots per inch]."""


def html_table(
    head: Sequence[str], body: Iterable[Sequence[str]], notes: Iterable[str], texts: Iterable[str]
) -> str:
    """Return a table in HTML, escaped.

    Parameters
    ----------
    head, body
        Its cells as text.
    notes
        Lines below the table.
    texts
        Heads of the columns that hold words, which are aligned to the left; others hold numbers.
    """
    words = {*texts}
    sides = ["left" if name in words else "right" for name in head]

    def line(tag: str, cells: Sequence[str]) -> str:
        drawn = zip(cells, sides, strict=True)
        return "".join(
            f'<{tag} style="text-align: {side}">{html_text(cell)}</{tag}>' for cell, side in drawn
        )

    rows = "".join(f"<tr>{line('td', cells)}</tr>" for cells in body)
    below = "".join(f"<div><small>{html_text(note)}</small></div>" for note in notes)
    return f"<table><thead><tr>{line('th', head)}</tr></thead><tbody>{rows}</tbody></table>{below}"


def displayed(figure: "Figure") -> "Figure":
    """Return a figure that a notebook shows as a picture, also if pyplot is not in use."""
    setattr(figure, "_repr_png_", partial(_png, figure))  # noqa: B010 - not an attribute of Figure
    return figure


def _png(figure: "Figure") -> bytes:
    output = io.BytesIO()
    figure.savefig(output, format="png", dpi=RESOLUTION)
    return output.getvalue()
