"""Tables of studies, in formats for reading and for programs."""

import csv
import io
import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from upright.core.conditions import TRIALS
from upright.core.parameters import changed_parameters
from upright.errors import require_one_of
from upright.reports.published import SOURCES

if TYPE_CHECKING:
    from upright.reports.statistics import Row


class Table(NamedTuple):
    """A table of text."""

    head: list[str]
    body: list[list[str]]
    notes: list[str]
    """Lines below the table."""


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
    """Return a table with a line for every case, beside the published figures.

    Where tasks differ in more than their noise, a column names them.
    """
    tasks = [_task_text(row) for row in rows]
    differ = len(set(tasks)) > 1
    sources = list(dict.fromkeys(name for row in rows for name in row.published))
    measured = ["Agent", "Settings", "Noise", *(["Task"] if differ else [])]
    measured += ["Success", "Mean trials", "Median", "p95", "Max"]
    body = [
        [
            row.name,
            row.settings,
            row.task.noise,
            *([task] if differ else []),
            success_text(row),
            mean_text(row),
            number(row.median_trials),
            number(row.p95_trials),
            number(row.max_trials, 0),
            *(number(row.published.get(source), 2) for source in sources),
        ]
        for row, task in zip(rows, tasks, strict=True)
    ]
    return Table(measured + sources, body, _notes(rows, sources))


def _notes(rows: Sequence["Row"], sources: Sequence[str]) -> list[str]:
    agents = {row.agent for row in rows}
    notes = sorted({_protocol(row) for row in rows})
    notes.append(
        "Mean trials, median, p95 and max are over the successful runs; every trial counts, "
        "including the successful one. 95 % intervals are in brackets."
    )
    notes += [
        f"{source.name}: {source.citation} ({source.protocol})."
        for source in SOURCES
        if source.name in sources and (source.agent is None or source.agent in agents)
    ]
    return notes


def _protocol(row: "Row") -> str:
    """Return how the runs of a row were made, with all values that differ from the usual ones."""
    parts = [f"{row.runs} runs per case", _task_text(row)]
    return ", ".join([*parts, f"seed {row.seed}, upright {row.version}."])


def _task_text(row: "Row") -> str:
    """Return the task of a row but for its noise, with all that differs from the usual values."""
    task = row.task
    parts = [f"N = {task.steps:,} steps", f"start {task.start}"]
    parts += [f"condition {task.condition}"] if task.condition != "nominal" else []
    parts += [f"at most {task.trials:,} trials"] if task.trials != TRIALS else []
    changed = {**changed_parameters(task.parameters), **row.plant_settings}
    return ", ".join([*parts, *(f"{name} {value}" for name, value in changed.items())])


def to_text(table: Table) -> str:
    """Return a table as text for the terminal."""
    from rich.console import Console
    from rich.table import Table as RichTable
    from rich.text import Text

    drawn = RichTable(box=None, pad_edge=False, header_style="")
    for index, head in enumerate(table.head):
        numeric = index > 0 and head not in ("Settings", "Noise", "Task")
        drawn.add_column(head, justify="right" if numeric else "left", no_wrap=True)
    for line in table.body:
        drawn.add_row(*(Text(cell) for cell in line))
    written = io.StringIO()
    console = Console(file=written, width=1000, highlight=False, force_jupyter=False)
    console.print(drawn)
    lines = [line.rstrip() for line in written.getvalue().splitlines()]
    lines.insert(1, "─" * max(len(line) for line in lines))
    return "\n".join([*lines, "", *table.notes]) + "\n"


def to_markdown(table: Table) -> str:
    """Return a table in Markdown."""
    lines = [table.head, ["---"] * len(table.head), *table.body]
    written = ["| " + " | ".join(line) + " |" for line in lines]
    notes = ["", *(f"- {note}" for note in table.notes)] if table.notes else []
    return "\n".join([*written, *notes]) + "\n"


def to_latex(table: Table) -> str:
    """Return a table in LaTeX, which needs the package booktabs."""

    def line(cells: Sequence[str]) -> str:
        return " & ".join(_escape_latex(cell) for cell in cells) + r" \\"

    head = [r"\begin{tabular}{" + "l" * len(table.head) + "}", r"\toprule"]
    body = [line(table.head), r"\midrule", *map(line, table.body)]
    notes = [f"% {note}" for note in table.notes]
    return "\n".join([*notes, *head, *body, r"\bottomrule", r"\end{tabular}"]) + "\n"


def _escape_latex(cell: str) -> str:
    for sign in "&%_#":
        cell = cell.replace(sign, "\\" + sign)
    # LaTeX would read a bracket at the beginning of a line as an option of the previous line.
    return cell.replace("–", "--").replace("[", "{[}").replace("]", "{]}")


def to_json(rows: Sequence["Row"]) -> str:
    """Return the rows as a JSON array of objects with the fields of `Row`."""
    return json.dumps([row.as_data() for row in rows], indent=2, allow_nan=False) + "\n"


def to_csv(rows: Sequence["Row"]) -> str:
    """Return the rows as comma-separated values, with columns for ends of intervals and sources."""
    lines = [_flatten(row) for row in rows]
    output = io.StringIO()
    heads = list(dict.fromkeys(name for line in lines for name in line))
    writer = csv.DictWriter(output, heads, lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
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


def render(rows: Sequence["Row"], format_name: str) -> str:
    """Return the table of a study in one of the FORMATS.

    Parameters
    ----------
    rows
        Return values of `summarise`, one for each case.
    format_name
        "text", "markdown", "csv", "json" or "latex".

    Raises
    ------
    UprightError
        If there is no such format.

    Examples
    --------
    >>> cases = [upright.make_case("random-search", steps=300, noise=n) for n in upright.NOISES]
    >>> results = upright.study(cases, runs=5)
    >>> rows = [upright.summarise(case, 0, results[case]) for case in cases]
    >>> upright.render(rows, "markdown").splitlines()[0][:38]
    '| Agent | Settings | Noise | Success |'
    """
    require_one_of("format", format_name, FORMATS)
    if format_name == "json":
        return to_json(rows)
    if format_name == "csv":
        return to_csv(rows)
    writer = {"text": to_text, "markdown": to_markdown, "latex": to_latex}[format_name]
    return writer(study_table(rows))
