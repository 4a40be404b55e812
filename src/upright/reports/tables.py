"""Tables of studies, in formats for reading and for programs."""

import csv
import io
import json
import textwrap
from collections.abc import Callable, Collection, Iterable, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple

from upright.core.conditions import TRIALS
from upright.core.parameters import changed_parameters
from upright.errors import require_all, require_one_of
from upright.reports.escaping import csv_cell, latex, markdown
from upright.reports.sweeps import heading, sizes, swept
from upright.support import terminal
from upright.support.words import count

if TYPE_CHECKING:
    from upright.reports.statistics import Row


class Table(NamedTuple):
    """A table of text."""

    head: list[str]
    body: list[list[str]]
    notes: list[str]
    """Lines below the table."""
    labels: int = 1
    """Number of columns, from the left, that name a line; all others hold figures."""


class Column(NamedTuple):
    """A column of the table of a study."""

    head: str
    cells: list[str]
    stays: bool = False
    """Whether it stays on its lines where other names are too long and stand above them."""


def number(value: float | None, digits: int = 1) -> str:
    """Return a number as text, or a dash for None."""
    return "–" if value is None else f"{value:.{digits}f}"


def mean_text(row: "Row") -> str:
    """Return the mean number of trials with its interval."""
    if row.mean_trials is None or row.ci95 is None:
        return "–"
    digits = 2 if row.mean_trials < 2 else 1  # the floor is 1, and 1.04 is not 1.00
    mean, low, high = (number(value, digits) for value in (row.mean_trials, *row.ci95))
    return f"{mean} [{low}, {high}]"


def success_text(row: "Row") -> str:
    """Return the success rate with its interval."""
    low, high = row.success_ci95
    return f"{100 * row.success_rate:.0f} % [{100 * low:.0f}, {100 * high:.0f}]"


def study_table(rows: Sequence["Row"]) -> Table:
    """Return a table with a line for every case, beside the published figures."""
    labels, sources = _labels(rows), _sources(rows)
    columns = [*labels, *_figures(rows), *_published(rows, sources)]
    body = [list(line) for line in zip(*(column.cells for column in columns), strict=True)]
    notes = [*_notes(rows), *_citations(rows, sources)]
    return Table([column.head for column in columns], body, notes, len(labels))


def _labels(rows: Sequence["Row"]) -> list[Column]:
    """Return the columns that tell cases apart; some of them only where cases differ in it."""
    labels = [
        Column("Agent", [row.name for row in rows]),
        Column("Settings", [row.settings for row in rows]),
        Column("Noise", [row.task.noise for row in rows], stays=True),
        *_sweeps(rows),
    ]
    perhaps = [
        Column("Task", _differences(rows)),
        Column("Runs", [str(row.runs) for row in rows]),
        Column("Seed", [str(row.seed) for row in rows]),
    ]
    return labels + [column for column in perhaps if len(set(column.cells)) > 1]


def _sweeps(rows: Sequence["Row"]) -> list[Column]:
    """Return a column for each number that the tasks differ in."""
    tasks = [row.task for row in rows]
    return [
        Column(heading(name), [f"{sizes(task)[name]:.12g}" for task in tasks], stays=True)
        for name in swept(tasks)
    ]


def _figures(rows: Sequence["Row"]) -> list[Column]:
    texts: dict[str, Callable[[Row], str]] = {
        "Success": success_text,
        "Mean trials": mean_text,
        "Median": lambda row: number(row.median_trials),
        "p95": lambda row: number(row.p95_trials),
        "Max": lambda row: number(row.max_trials, 0),
    }
    return [Column(head, list(map(text, rows))) for head, text in texts.items()]


def _sources(rows: Sequence["Row"]) -> list[str]:
    """Return the names of the sources that have published figures of these cases."""
    return list(dict.fromkeys(name for row in rows for name in row.published))


def _published(rows: Sequence["Row"], sources: Sequence[str]) -> list[Column]:
    return [
        Column(source, [number(row.published.get(source), 2) for row in rows]) for source in sources
    ]


def _notes(rows: Sequence["Row"]) -> list[str]:
    """Return how the runs were made, and how the figures are to be read."""
    shared = _shared(rows)
    return [
        *sorted({_protocol(row, shared) for row in rows}),
        "Mean trials, median, p95 and max are over the successful runs; every trial counts, "
        "including the successful one. 95 % intervals are in brackets.",
    ]


def _citations(rows: Sequence["Row"], sources: Sequence[str]) -> list[str]:
    from upright.reports.published import SOURCES  # imported late: the help needs only FORMATS

    agents = {row.agent for row in rows}
    return [
        f"{source.name}: {source.citation} ({source.protocol})."
        for source in SOURCES
        if source.name in sources and (source.agent is None or source.agent in agents)
    ]


def _protocol(row: "Row", shared: Sequence[str]) -> str:
    """Return how the runs of a row were made, on what its task shares with those of other rows."""
    parts = [f"{count(row.runs, 'run')} per case", *shared, f"seed {row.seed}"]
    parts += [f"upright {row.version}"] if row.version else []
    return ", ".join(parts) + "."


def _shared(rows: Sequence["Row"]) -> list[str]:
    """Return the parts that the tasks of all rows have."""
    tasks = [_parts(row) for row in rows]
    return [part for part in tasks[0] if all(part in task for task in tasks)] if tasks else []


def _differences(rows: Sequence["Row"]) -> list[str]:
    """Return in what the task of each row differs from what all tasks share, or a dash.

    What has a column of its own is left out.
    """
    shared, apart = _shared(rows), swept(row.task for row in rows)
    texts = (", ".join(part for part in _parts(row, apart) if part not in shared) for row in rows)
    return [text or "–" for text in texts]


def _parts(row: "Row", apart: Collection[str] = ()) -> list[str]:
    """Return the parts of a row's task but for its noise, and all that differs from the usual.

    Parameters of the plant whose names are in `apart` are left out.
    """
    task = row.task
    parts = [f"N = {task.steps:,} steps", f"start {task.start}"]
    parts += [f"condition {task.condition}"] if task.condition != "nominal" else []
    parts += [f"at most {task.trials:,} trials"] if task.trials != TRIALS else []
    changed = changed_parameters(task.parameters)
    changed = {name: value for name, value in changed.items() if name not in apart}
    changed |= row.plant_settings
    return [*parts, *(f"{name} {value}" for name, value in changed.items())]


CORE = ("Success", "Mean trials", "Median")
"""The figures that are shown even if lines must be broken for them."""


def to_text(rows: Sequence["Row"], width: int | None = None, *, sources: bool = False) -> str:
    """Return the table of a study as text that is as wide as the terminal.

    Names that are too long for it stand above their lines. Columns for which there is no room are
    left out, and a note names them.

    Parameters
    ----------
    rows
        Rows of the table.
    width
        Width [columns]; by default that of the terminal.
    sources
        Whether to leave nothing out, neither published figures nor where they were published; what
        has no room stands in further tables below.
    """
    width = width or terminal.width()
    said = _said_once(rows)
    labels = seen(label for label in _labels(rows) if label.head not in said)
    figures, published = _figures(rows), _published(rows, _sources(rows))
    tables, left_out = [], []
    if sources:
        waiting = figures + published
        while waiting:
            some = _as_many_as_fit(labels, waiting, width)
            tables.append(lines_of(labels, some, width))
            waiting = waiting[len(some) :]
    else:
        some = _as_many_as_fit(labels, figures, width)
        whole = _as_many_as_fit(labels, figures + published, width)
        some = whole if len(whole) == len(figures + published) else some
        tables.append(lines_of(labels, some, width))
        left_out = [column.head for column in figures + published if column not in some]
    notes = _notes(rows)
    if said:
        notes.insert(0, " ".join(f"{head}: {cell}." for head, cell in said.items()))
    heads = [column.head for column in published]
    if sources:
        notes += _citations(rows, heads)
    elif left_out:
        notes.append(f"Not shown: {', '.join(left_out)}; {ALL} shows everything.")
    elif heads:
        notes.append(f"Published mean trials: {', '.join(heads)}; {ALL} cites them.")
    notes = [
        textwrap.fill(terminal.visible(note), width, subsequent_indent="  ", **UNBROKEN)
        for note in notes
    ]
    return "\n".join([*("\n".join([*table, ""]) for table in tables), *notes]) + "\n"


def _said_once(rows: Sequence["Row"]) -> dict[str, str]:
    """Return the labels, by head, that stand below a text because all rows share them."""
    heads = ("Settings", "Noise") if swept(row.task for row in rows) else ("Settings",)
    labels = [label for label in _labels(rows) if label.head in heads]
    return {label.head: label.cells[0] for label in labels if len(set(label.cells)) == 1}


ALL = "--sources (in Python, sources=True)"
"""How nothing is left out."""
UNBROKEN: dict[str, Any] = {"break_long_words": False, "break_on_hyphens": False}
"""How text is broken into lines: between words only."""


def _as_many_as_fit(
    labels: Sequence[Column], figures: Sequence[Column], width: int
) -> list[Column]:
    """Return the first figures that fit beside their labels, or below their names; at least one."""
    core = [column for column in figures if column.head in CORE]
    beside = _width([*labels, *core]) <= width
    present = list(labels) if beside else _indented(labels)
    fitting = next(
        (n for n in range(len(figures), 1, -1) if _width([*present, *figures[:n]]) <= width), 1
    )
    return list(figures[:fitting])


def lines_of(labels: Sequence[Column], figures: Sequence[Column], width: int) -> list[str]:
    """Return the lines of a table, with names above their lines if they are too long."""
    if _width([*labels, *figures]) <= width:
        return _aligned(labels, figures)
    head, rule, *body = _aligned(_indented(labels), figures)
    others = [label for label in labels if not label.stays]
    names = list(zip(*(label.cells for label in others), strict=True))
    lines = [head, rule]
    for name, group in groupby(zip(names, body, strict=True), key=lambda pair: pair[0]):
        said = ", ".join(cell for cell in name if cell != "–")
        lines.append(textwrap.fill(said, width, **UNBROKEN))
        lines += [line for _, line in group]
    return lines


def _indented(labels: Sequence[Column]) -> list[Column]:
    """Return the labels that stand on a line whose name is above it."""
    first, *others = (label for label in labels if label.stays)
    return [Column(f"  {first.head}", [f"  {cell}" for cell in first.cells]), *others]


def _aligned(labels: Sequence[Column], figures: Sequence[Column]) -> list[str]:
    """Return the lines of a table: labels flush left, figures flush right."""
    columns = [*labels, *figures]
    padded = []
    for place, column in enumerate(columns):
        wide = _width([column])
        texts = [column.head, *column.cells]
        spaces = [" " * (wide - _cells(text)) for text in texts]
        pairs = zip(texts, spaces, strict=True)
        left = place < len(labels)
        padded.append([text + space if left else space + text for text, space in pairs])
    lines = ["  ".join(line).rstrip() for line in zip(*padded, strict=True)]
    return [lines[0], "─" * _width(columns), *lines[1:]]


def seen(columns: Iterable[Column]) -> list[Column]:
    """Return columns in which every character can be seen."""
    return [column._replace(cells=list(map(terminal.visible, column.cells))) for column in columns]


def _width(columns: Sequence[Column]) -> int:
    """Return the width of columns beside each other, two spaces apart."""
    widths = [max(map(_cells, [column.head, *column.cells])) for column in columns]
    return sum(widths) + 2 * (len(widths) - 1)


def _cells(text: str) -> int:
    """Return how many columns of a terminal a text takes: some letters of Asia take two."""
    from rich.cells import cell_len

    return cell_len(text)


def to_markdown(table: Table) -> str:
    """Return a table in Markdown; cells that are Markdown already stay as they are."""

    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(markdown(cell).replace("|", r"\|") for cell in cells) + " |"

    written = [line(table.head), line(["---"] * len(table.head)), *map(line, table.body)]
    notes = ["", *(f"- {markdown(note)}" for note in table.notes)] if table.notes else []
    return "\n".join([*written, *notes]) + "\n"


def to_latex(table: Table) -> str:
    """Return a table in LaTeX, which needs the package booktabs."""

    def line(cells: Sequence[str]) -> str:
        return " & ".join(map(latex, cells)) + r" \\"

    columns = "l" * table.labels + "r" * (len(table.head) - table.labels)
    head = [r"\begin{tabular}{" + columns + "}", r"\toprule"]
    body = [line(table.head), r"\midrule", *map(line, table.body)]
    notes = [f"% {terminal.visible(note)}" for note in table.notes]
    return "\n".join([*notes, *head, *body, r"\bottomrule", r"\end{tabular}"]) + "\n"


def to_json(rows: Sequence["Row"]) -> str:
    """Return the rows as a JSON array of objects with the fields of `Row`."""
    return json.dumps([row.as_data() for row in rows], indent=2, allow_nan=False) + "\n"


def to_csv(rows: Sequence["Row"]) -> str:
    """Return the rows as comma-separated values.

    There are columns for ends of intervals, for sources, and for each number that tasks differ in.
    Text that a spreadsheet would take for a formula begins with an apostrophe (see docs/data.md).
    """
    names = swept(row.task for row in rows)
    lines = [_flatten(row) | {name: sizes(row.task)[name] for name in names} for row in rows]
    output = io.StringIO()
    heads = list(dict.fromkeys(name for line in lines for name in line))
    writer = csv.DictWriter(output, heads, lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: csv_cell(value) for name, value in line.items()} for line in lines)
    return output.getvalue()


def _flatten(row: "Row") -> dict[str, object]:
    from upright.reports.statistics import INTERVALS

    line = row.as_data()
    for name in INTERVALS:
        line[f"{name}_low"], line[f"{name}_high"] = line.pop(name) or (None, None)
    for source, value in line.pop("published").items():
        line[f"published: {source}"] = value
    for name in ("parameters", "plant_settings"):
        line[name] = " ".join(f"{key}={value}" for key, value in line.pop(name).items())
    return line


FORMATS = ("text", "markdown", "csv", "json", "latex")


def render(
    rows: Sequence["Row"], format_name: str, *, width: int | None = None, sources: bool = False
) -> str:
    """Return the table of a study in a format for reading or for programs.

    Parameters
    ----------
    rows
        Return values of `summarise`, one for each case.
    format_name
        "text", "markdown", "csv", "json" or "latex".
    width
        Width of a text [columns]; by default that of the terminal. Columns for which there is no
        room are left out, and a note names them. All other formats have everything.
    sources
        Whether a text leaves nothing out and cites where published figures come from; what has no
        room then stands in further tables below.

    Raises
    ------
    UprightError
        If there is no such format, or the rows are none.

    Examples
    --------
    >>> cases = [upright.make_case("random-search", steps=300, noise=n) for n in upright.NOISES]
    >>> results = upright.study(cases, runs=5)
    >>> rows = [upright.summarise(case, 0, results[case]) for case in cases]
    >>> upright.render(rows, "markdown").splitlines()[0][:38]
    '| Agent | Settings | Noise | Success |'
    """
    from upright.reports.statistics import Row

    require_one_of("format", format_name, FORMATS)
    rows = require_all("rows", rows, Row, "a list of what summarise returns")
    if format_name == "text":
        return to_text(rows, width, sources=sources)
    if format_name in ("csv", "json"):
        return {"csv": to_csv, "json": to_json}[format_name](rows)
    return {"markdown": to_markdown, "latex": to_latex}[format_name](study_table(rows))
