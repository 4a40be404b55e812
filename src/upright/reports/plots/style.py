"""How all pictures look: fonts, colours, lines, ticks, and the files that they are saved to."""

import io
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from itertools import cycle
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullFormatter

from upright.core.trials import Result
from upright.errors import require_one_of
from upright.studies.case import Case
from upright.support.files import check_output, write_file
from upright.support.terminal import visible

Learned = Sequence[tuple[Case, Sequence[Result]]]
"""Cases with the results of their runs."""
FORMATS = (".png", ".pdf", ".svg")
"""Endings of picture files."""
UNDATED = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
"""Leaves the time out of pictures, so that the same runs give the same file."""
WIDTH = 8.3
"""Width of a full picture [inch]; the width of a page of documents, where 10 points can be read."""
LINES_OF_TEXT = 8
"""Most lines of a text; more would leave no room for what is drawn."""
LETTER = 0.0745
"""Width of a letter of a title [inch]."""
PIXELS = 200
"""Pixels per inch of a .png: twice those of such a page, for screens of high resolution."""
INK, MUTED, FAINT = "#222222", "#666666", "#e3e3e3"
"""Colours of text and marks, of what is secondary, and of lines and areas behind the data."""
STYLE: Any = {
    "axes.axisbelow": True,
    "axes.edgecolor": MUTED,
    "axes.facecolor": "white",
    "axes.grid": True,
    "axes.labelcolor": INK,
    "axes.labelsize": 10,
    "axes.linewidth": 0.8,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlecolor": INK,
    "axes.titlelocation": "left",
    "axes.titlesize": 10,
    "axes.titleweight": "normal",
    "figure.constrained_layout.h_pad": 0.06,
    "figure.constrained_layout.w_pad": 0.06,
    "figure.dpi": 100,
    "figure.facecolor": "white",
    "figure.titlesize": 12,
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "grid.alpha": 1.0,
    "grid.color": FAINT,
    "grid.linestyle": "-",
    "grid.linewidth": 0.6,
    "legend.edgecolor": FAINT,
    "legend.fontsize": 9,
    "legend.frameon": False,
    "lines.linewidth": 1.8,
    "pdf.fonttype": 42,
    "svg.hashsalt": "upright",
    "text.color": INK,
    "text.parse_math": False,  # a name may have dollar signs
    "xtick.color": MUTED,
    "xtick.labelcolor": INK,
    "xtick.labelsize": 9,
    "ytick.color": MUTED,
    "ytick.labelcolor": INK,
    "ytick.labelsize": 9,
}
"""Matplotlib's settings for all pictures."""
AGENT_COLOURS = {
    "adaptive-lqr": "#009e73",
    "reinforce": "#0072b2",
    "ndp": "#882255",
    "q-learning": "#d55e00",
    "ase-ace": "#e69f00",
    "random-search": "#999999",
}
"""A colour an agent, after M. Okabe and K. Ito (2008): distinct for people of any colour vision."""
CUSTOM_COLOURS = ("#332288", "#56b4e9", "#111111", "#9218f2", "#996633", "#d4c35a")
"""Colours of custom agents, in the order in which a picture shows them; then paler ones."""
LINES: tuple[Any, ...] = (":", "-.", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1)), (0, (8, 3)))
"""Lines of settings that have no line of their own."""
SHADES = (0.0, -0.35, 0.35)
"""Changes of the colours of such settings, as `shade` takes them."""


class Look(NamedTuple):
    """How the curve of a case is drawn."""

    colour: str
    line: Any
    """Line style, as Matplotlib knows it."""


@contextmanager
def styled() -> Iterator[None]:
    """Draw in this style, whatever the style of the program around it; also a decorator."""
    with rc_context(STYLE):
        yield


def check_picture(path: Path | str) -> Path:
    """Return the path of a picture to be written later, after checking that it can be written.

    Raises
    ------
    UprightError
        If its ending is not one of the FORMATS, or it cannot be written.
    """
    require_one_of(f"the ending of {str(path)!r}", Path(path).suffix, FORMATS)
    return check_output(path)


@styled()
def save(figure: Figure, path: Path | str) -> None:
    """Write a figure to a file, whose ending selects the format.

    Raises
    ------
    UprightError
        As for `check_picture`.
    """
    check_picture(path)
    output = io.BytesIO()
    ending = Path(path).suffix
    figure.savefig(output, format=ending[1:], dpi=PIXELS, metadata=UNDATED.get(ending))
    write_file(path, output.getvalue())


def looks(cases: Sequence[Case]) -> list[Look]:
    """Return how to draw each of some cases: a colour an agent, a line for each of its settings.

    The default settings of an agent have a solid line, or else the first ones that are shown;
    published ones have a dashed line. All others also have a shade of the agent's colour.
    """
    custom = cycle([*CUSTOM_COLOURS, *(shade(colour, 0.5) for colour in CUSTOM_COLOURS)])
    colours: dict[str, str] = {}
    variants: dict[str, list[_Variant]] = {}
    for case in cases:
        if case.agent not in colours:
            colours[case.agent] = AGENT_COLOURS.get(case.agent) or next(custom)
        shown = variants.setdefault(case.agent, [])
        if _variant(case) not in shown:
            shown.append(_variant(case))
    lines = {agent: _lines(shown, colours[agent]) for agent, shown in variants.items()}
    return [lines[case.agent][_variant(case)] for case in cases]


_Variant = tuple[str, str, Any]


def _variant(case: Case) -> _Variant:
    """Return in what the cases of one agent in one task can differ."""
    return case.settings_name, case.language, case.plant


def _lines(variants: Sequence[_Variant], colour: str) -> dict[_Variant, Look]:
    """Return the look of each variant of an agent."""
    found: dict[_Variant, Look] = {}
    solid = [variant for variant in variants if variant[0] == "default"]
    dashed = [variant for variant in variants if variant[0] == "as-published"]
    solid = solid or [variant for variant in variants if variant not in dashed]
    for line, first in (("-", solid[:1]), ("--", dashed[:1])):
        found |= dict.fromkeys(first, Look(colour, line))
    others = [variant for variant in variants if variant not in found]
    for number, variant in enumerate(others):
        tone = shade(colour, SHADES[number % len(SHADES)])
        found[variant] = Look(tone, LINES[number % len(LINES)])
    return found


def shade(colour: str, change: float) -> str:
    """Return a colour mixed with white (a change above zero, up to 1) or black (below zero)."""
    goal = 1.0 if change > 0 else 0.0
    mixed = [part + abs(change) * (goal - part) for part in to_rgb(colour)]
    return to_hex((mixed[0], mixed[1], mixed[2]))


def whole(value: float, _position: object = None) -> str:
    """Return a number as people write it: 1,000."""
    return f"{value:,.0f}"


def whole_ticks(last: int, most: int = 8) -> list[int]:
    """Return whole numbers from 1 to `last` to mark on a linear axis, about `most` of them.

    Examples
    --------
    >>> whole_ticks(3), whole_ticks(23), whole_ticks(1000)
    ([1, 2, 3], [1, 5, 10, 15, 20], [1, 200, 400, 600, 800, 1000])
    """
    locator = MaxNLocator(most, integer=True, steps=[1, 2, 5, 10], min_n_ticks=1)
    ticks = [round(tick) for tick in locator.tick_values(1, max(2, last))]
    inside = [tick for tick in ticks if 1 <= tick <= last]
    return inside if inside[:1] in ([1], [2]) else [1, *inside]


def logarithmic_ticks(low: float, high: float, most: int = 7) -> list[int]:
    """Return whole numbers to mark on a logarithmic axis: 1, 2, 5, 10 ... or 1, 10, 100 ...

    Examples
    --------
    >>> logarithmic_ticks(1, 60), logarithmic_ticks(8, 60_000)
    ([1, 2, 5, 10, 20, 50], [10, 100, 1000, 10000])
    """
    decades = [10**power for power in range(int(np.log10(high)) + 1)]
    fine = [m * decade for decade in decades for m in (1, 2, 5) if low <= m * decade <= high]
    return fine if len(fine) <= most else [tick for tick in decades if low <= tick <= high]


def number_axis(axis: Axis, low: float, high: float, *, logarithmic: bool, most: int = 8) -> None:
    """Mark an axis that counts from `low` to `high` with whole numbers only."""
    minor: list[int] = []
    if logarithmic:
        ticks = logarithmic_ticks(low, high, most)
        decades = [10**power for power in range(int(np.log10(high)) + 1)]
        minor = [m * d for d in decades for m in range(1, 10) if low <= m * d <= high]
    else:
        ticks = whole_ticks(int(high), most)
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_minor_locator(FixedLocator(minor))
    axis.set_major_formatter(FuncFormatter(whole))
    axis.set_minor_formatter(NullFormatter())


def in_lines(text: str, width: int) -> str:
    """Return a text in lines of at most this many characters, each of which can be seen.

    A sign that the font lacks becomes its code, and of a very long text the beginning is shown.
    """
    shown = "".join(
        sign if _has(sign) else sign.encode("ascii", "backslashreplace").decode()
        for sign in visible(text[: 2 * width * LINES_OF_TEXT])
    )
    return fill(shown, width, max_lines=LINES_OF_TEXT, placeholder=" …")


@cache
def _has(sign: str) -> bool:
    """Whether the font of pictures has a sign."""
    return get_font(findfont(STYLE["font.family"])).get_char_index(ord(sign)) > 0


def entitle(axes: Axes, title: str, subtitle: Iterable[str] = (), beside: float = 0.0) -> None:
    """Write a title above a panel, and smaller lines below it, none wider than the panel.

    Parameters
    ----------
    beside
        Width of what stands beside all panels [inch].
    """
    figure, grid = axes.figure, axes.get_gridspec()
    assert isinstance(figure, Figure)
    assert grid is not None
    width = int(((figure.get_figwidth() - beside) / grid.ncols - 0.3) / LETTER)
    lines = [in_lines(line, round(1.2 * width)) for line in subtitle if line]
    text = "\n".join(lines)
    axes.set_title(in_lines(title, width), pad=6 + 12 * (text.count("\n") + 1 if lines else 0))
    if lines:
        place = {"xycoords": "axes fraction", "textcoords": "offset points"}
        axes.annotate(text, (0, 1), (0, 5), **place, color=MUTED, fontsize=8.5, va="bottom")  # type: ignore[arg-type]


def panels(
    count: int, height: float, across: str, up: str
) -> tuple[Figure, list[Axes], list[Axes]]:
    """Return a figure of some panels in rows, the panels, and the empty places after them.

    All panels have the same axes. They are labelled at the first panel of each row and at the
    lowest of each column.

    Parameters
    ----------
    count
        Number of panels; three in a row, or two if there are four.
    height
        Height of a row of three [inch]; fewer are higher.
    across, up
        Labels of the axes.
    """
    columns = 2 if count == 4 else min(count, 3)
    rows = -(-count // columns)
    width, stretch = ((5.8, 1.4), (7.2, 1.2), (WIDTH, 1.0))[columns - 1]
    figure = Figure((width, stretch * height * rows + 0.4), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    shown, empty = list(grid[:count]), list(grid[count:])
    for axes in empty:
        axes.axis("off")
    for axes in shown[-columns:]:
        axes.tick_params(labelbottom=True)
        axes.set_xlabel(across)
    for axes in shown[::columns]:
        axes.set_ylabel(up)
    return figure, shown, empty


def place_legend(
    figure: Figure, empty: Sequence[Axes], handles: Sequence[Artist], labels: Sequence[str]
) -> None:
    """Place the legend where it hides no data: in an empty place, or else below the panels."""
    if empty and len(labels) <= 10:
        texts = [in_lines(label, 34) for label in labels]
        empty[0].legend(handles, texts, loc="center left", bbox_to_anchor=(0, 0.5))
        return
    texts = [in_lines(label, 60) for label in labels]
    longest = max(len(text) for text in texts)
    columns = max(1, min(len(texts), int(figure.get_figwidth() / (0.65 + 0.078 * longest))))
    lines = sum(text.count("\n") + 1 for text in texts)
    figure.set_figheight(figure.get_figheight() + 0.2 * (1 + -(-lines // columns)))
    figure.legend(handles, texts, loc="outside lower center", ncols=columns)


def shared_title(figure: Figure, *parts: str) -> None:
    """Write above all panels what they have in common; empty parts are left out."""
    text = ", ".join(filter(None, parts))
    if text:
        lines = in_lines(text[0].upper() + text[1:], int(figure.get_figwidth() / 0.09))
        figure.suptitle(lines, x=0.01, ha="left")


def mark_limits(axes: Axes, limit: float) -> None:
    """Draw the limits ±`limit` of the horizontal axis, and shade what lies beyond them."""
    for side in (-1, 1):
        label = "limit of a trial" if side == 1 else None
        axes.axvline(side * limit, color=MUTED, linestyle=(0, (4, 2)), lw=1, label=label)
        axes.axvspan(side * limit, side * 2 * limit, color=FAINT, lw=0, zorder=0)
