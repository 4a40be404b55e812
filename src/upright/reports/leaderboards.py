"""Leaderboards: all agents side by side, ranked, on the published cases and beyond them.

A board has a row for each agent and a column for each task. Agents are ranked by the mean number of
trials over all runs, where a failed run counts with all its trials; agents whose intervals overlap
are tied.
"""

import shlex
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from upright import __version__
from upright.agents import AGENTS
from upright.core.conditions import PUBLISHED_NOISES, STEPS, STRICT_RUNS, STRICT_STEPS, TRIALS
from upright.core.parameters import Parameters
from upright.errors import UprightError
from upright.reports.escaping import Markdown, markdown, markdown_code
from upright.reports.published import SOURCES, Source
from upright.reports.statistics import Row, summarise_all
from upright.reports.tables import Table, number, to_json, to_markdown
from upright.studies.case import Case, make_case
from upright.studies.executors import AnyExecutor
from upright.studies.progress import study_with_progress
from upright.studies.store import Store
from upright.studies.study import check_study
from upright.support.files import check_output, require_apart, write_file
from upright.support.settings import as_options
from upright.support.terminal import visible
from upright.support.words import count

STARTS_SHOWN = {
    "random": "Start within ±0.05",
    "zero": "Start exactly upright",
}
PUBLISHED: dict[str, dict[str, Any]] = {
    f"{start} {noise}": {"start": start, "noise": noise}
    for start in STARTS_SHOWN
    for noise in PUBLISHED_NOISES
}
"""The columns of the leaderboard, in both of its tables."""
ROBUST: dict[str, dict[str, Any]] = {
    "as published": {},
    "plant varies": {"condition": "varied-plant"},
    "delay 1": {"condition": "delay-1"},
    "delay 2": {"condition": "delay-2"},
    "no velocities": {"condition": "no-velocities"},
    "start ±6°": {"start": "wide"},
    "friction ×100": {"condition": "friction-100"},
}
"""The columns of the robust suite."""
USUAL_STEPS = {"leaderboard": STRICT_STEPS, "robust": STEPS}
"""Default N of each command: that of Si & Wang, and that of the report."""


class BoardPlan(NamedTuple):
    """Everything that determines a board, besides its columns."""

    agents: Sequence[str] = tuple(AGENTS)
    """Names of the agents; all have their default settings."""
    runs: int = STRICT_RUNS
    """Runs of each case."""
    seed: int = 0
    """Seed of the study."""
    steps: int = USUAL_STEPS["leaderboard"]
    """N: steps of a successful trial."""
    parameters: Mapping[str, float] = {}
    """Parameters of the plant that differ from the published ones."""
    store: Path | str | None = None
    """Path of the store of finished runs; without one, they are lost on an interrupt."""
    output: Path | str | None = None
    """Path that the board is written to, in Markdown, with its figures beside it as JSON."""
    executor: AnyExecutor = None
    """Where to run, as for `study`."""


Columns = dict[str, list[Row]]
"""The rows of all agents for each column of a board, by its title."""


class Board(NamedTuple):
    """One of the boards."""

    name: str
    """Name of its command."""
    columns: dict[str, dict[str, Any]]
    """Its columns: the parts of the task that differ from the published one, by title."""
    markdown: Callable[[Columns, BoardPlan], str]
    """Returns the board as a page in Markdown."""
    text: Callable[[Columns, BoardPlan], str]
    """Returns the board as text for the terminal."""


def make_rows(plan: BoardPlan, columns: dict[str, dict[str, Any]]) -> Columns:
    """Make the runs that are missing, and return the rows of all agents for each column.

    Raises
    ------
    UprightError
        If an agent is unknown, or a number is not allowed.
    """
    check_study(plan.runs, plan.seed)
    cases = _cases(plan, columns)
    with Store(plan.store) as store:
        all_cases = [case for column in cases.values() for case in column]
        study_with_progress(all_cases, plan.runs, plan.seed, store, plan.executor)
        return {
            title: summarise_all(column, plan.runs, plan.seed, store)
            for title, column in cases.items()
        }


def make_board(board: Board, plan: BoardPlan) -> Columns:
    """Measure all agents on the tasks of a board, and write it where the plan says.

    Whatever cannot be measured or written is refused before any run is made.

    Raises
    ------
    UprightError
        If an agent is unknown, a number is not allowed, or a file cannot be written.
    """
    if plan.output is not None:
        figures = check_output(plan.output).with_suffix(".json")
        if figures == Path(plan.output):
            why = "it must not end in .json, as the figures are written there"
            raise UprightError(f"output is {str(plan.output)!r}; {why}")
        check_output(figures)
        require_apart(
            [("output", plan.output), ("figures beside the output", figures), ("store", plan.store)]
        )
    rows = make_rows(plan, board.columns)
    if plan.output is not None:
        write_file(figures, to_json([row for column in rows.values() for row in column]))
        write_file(plan.output, board.markdown(rows, plan))
    return rows


def _cases(plan: BoardPlan, columns: dict[str, dict[str, Any]]) -> dict[str, list[Case]]:
    return {
        title: [
            make_case(agent, steps=plan.steps, parameters=plan.parameters, **task)
            for agent in plan.agents
        ]
        for title, task in columns.items()
    }


def ranks(rows: Sequence[Row]) -> list[int]:
    """Return each row's rank: 1 plus the number of rows whose interval lies below its own."""
    return [
        1 + sum(other.all_runs_ci95[1] < row.all_runs_ci95[0] for other in rows) for row in rows
    ]


def _in_order(columns: Columns) -> list[tuple[str, float, list[tuple[Row, int]]]]:
    """Return each agent with its mean rank, and its row and rank in each column; the best first."""
    ranked = [list(zip(rows, ranks(rows), strict=True)) for rows in columns.values()]
    agents = []
    for cells in zip(*ranked, strict=True):
        mean_rank = sum(rank for _, rank in cells) / len(cells)
        agents.append((cells[0][0].agent, mean_rank, list(cells)))
    return sorted(agents, key=lambda agent: agent[1])


def _published(columns: Columns) -> list[tuple[Source, list[float | None]]]:
    """Return the sources that have figures of these tasks, and the figure of each column."""
    tasks = [rows[0].task for rows in columns.values()]
    found = [(source, [source.figure(task) for task in tasks]) for source in SOURCES]
    return [(source, figures) for source, figures in found if any(figures)]


def board(columns: Columns, published: bool = False) -> str:
    """Return a board in Markdown, with the best agents first."""
    body = [
        [markdown_code(agent), number(mean_rank), *(_cell(row, rank) for row, rank in cells)]
        for agent, mean_rank, cells in _in_order(columns)
    ]
    for source, figures in _published(columns) if published else ():
        rule = f" ({source.agent})" if source.agent else ""
        name = f"*{source.name}{rule}, {count(source.runs, 'run')}, N = {source.steps:,}*"
        body.append([Markdown(name), "", *(number(figure, 2) for figure in figures)])
    return to_markdown(Table(["Agent", "Mean rank", *columns], body, []))


def _cell(row: Row, rank: int) -> str:
    """Return the rank, mean trials with interval and, if some runs failed, the success rate."""
    if row.mean_trials is None or row.ci95 is None:
        return f"{rank}. never"
    low, high = row.ci95
    mean = f"{rank}. {row.mean_trials:.2f} [{low:.2f}, {high:.2f}]"
    mean = f"**{mean}**" if rank == 1 else mean
    rate = "" if row.successes == row.runs else f" {100 * row.success_rate:.0f} %"
    return Markdown(mean + rate)


def board_text(columns: Columns, published: bool = False) -> str:
    """Return a board as text for the terminal: means without intervals, the best with a star."""
    lines = [["", *half] for half in zip(*map(_halves, ["mean rank", *columns]), strict=True)]
    for agent, mean_rank, cells in _in_order(columns):
        shown = visible(agent)
        lines.append([shown, number(mean_rank), *(_short_cell(row, rank) for row, rank in cells)])
    sources = _published(columns) if published else []
    names = _told_apart([source.name for source, _ in sources])
    for name, (_, figures) in zip(names, sources, strict=True):
        lines.append([name, "", *("–" if each is None else f"{each:g}" for each in figures)])
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    drawn = [
        " ".join(
            cell.rjust(width) if place else cell.ljust(width)
            for place, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    ]
    drawn.insert(2, "─" * max(map(len, drawn)))
    notes = [
        f"{name}: {source.what}, {source.runs} runs, N = {source.steps:,}."
        for name, (source, _) in zip(names, sources, strict=True)
    ]
    return "\n".join([*drawn, *([""] if notes else []), *notes]) + "\n"


def _told_apart(names: list[str]) -> list[str]:
    """Return names in which those that are alike are numbered."""
    return [
        name if names.count(name) == 1 else f"{name} ({names[: place + 1].count(name)})"
        for place, name in enumerate(names)
    ]


def _halves(title: str) -> tuple[str, str]:
    """Return the title of a column in two lines, the first of them empty if it is one word."""
    first, _, second = title.partition("-" if "-" in title else " ")
    return (first, second) if second else ("", first)


def _short_cell(row: Row, rank: int) -> str:
    if row.mean_trials is None:
        return "never"
    rate = "" if row.successes == row.runs else f" {100 * row.success_rate:.0f}%"
    digits = 2 if row.mean_trials < 2 else 1 if row.mean_trials < 100 else 0
    return f"{'*' if rank == 1 else ''}{row.mean_trials:.{digits}f}{rate}"


READING = f"""Each cell has the agent's rank in that column, its mean number of trials to success
with a 95 % interval and, if some runs failed, the success rate. The mean is over the successful
runs; every trial counts, including the successful one. Ranks are by the mean over all runs, where a
failed run counts with its {TRIALS:,} trials; agents whose intervals overlap are tied. The best rank
is bold. `random-search` draws a new linear policy for every trial and learns nothing: an agent is
only as good as its improvement over this baseline.
"""
"""The paragraph that explains a board."""


def leaderboard_page(rows: Columns, plan: BoardPlan) -> str:
    """Return the leaderboard in Markdown."""
    parts: list[str] = []
    shown: list[Source] = []
    for start, title in STARTS_SHOWN.items():
        named = _with_start(rows, start)
        parts.append(f"## {title}\n\n{board(named, published=True)}")
        shown += [source for source, _ in _published(named)]
    cited = "\n".join(f"- {source.name}: {source.citation}." for source in shown)
    italics = (
        "Rows in italics are published figures, as given in their sources. They stand below the"
    )
    italics += f"\nstart that their source used:\n\n{cited}"
    if not shown:
        italics = "Published figures are left out, because they are for another task."
    return f"""# Leaderboard

The number of trials each agent needs until the pole stays up for N = {plan.steps:,} steps, on the
seven published noise cases. {_origin(plan, "leaderboard", _version(rows))}

{READING}
{parts[0]}
{parts[1]}
{italics}

{_settings(plan)}"""


def _with_start(rows: Columns, start: str) -> Columns:
    """Return the columns of the leaderboard that have one start, by noise."""
    return {noise: rows[f"{start} {noise}"] for noise in PUBLISHED_NOISES}


def robust_page(rows: Columns, plan: BoardPlan) -> str:
    """Return the board of the robust suite in Markdown."""
    return f"""# Robustness

The same agents with the same settings, noise-free, on tasks that differ from the published one. A
trial of N = {plan.steps:,} steps succeeds. {_origin(plan, "robust", _version(rows))}

- *plant varies*: Each run has its own plant, with a pole of 0.25 to 2 m and both masses between
  half and double the published ones.
- *delay*: Each push acts one or two steps of {Parameters().time_step} s late.
- *no velocities*: The agent reads 0 for both velocities.
- *start ±6°*: The pole leans by up to 6° at the start.
- *friction ×100*: The friction of cart and hinge is 100 times the published one.

{READING}
{board(rows)}
## Where agents fail

These are the tasks in which fewer than 95 % of the runs succeed:

{_failures(rows)}

{_settings(plan)}"""


def leaderboard_text(rows: Columns, plan: BoardPlan) -> str:
    """Return the leaderboard as text for the terminal."""
    parts = [_heading(plan)]
    for start, title in STARTS_SHOWN.items():
        named = _with_start(rows, start)
        parts.append(f"{title}:\n\n{board_text(named, published=True)}")
    return "\n".join([*parts, _legend()]) + "\n"


def robust_text(rows: Columns, plan: BoardPlan) -> str:
    """Return the board of the robust suite as text for the terminal."""
    return "\n".join([_heading(plan), board_text(rows), _legend()]) + "\n"


def _heading(plan: BoardPlan) -> str:
    changed = "".join(f", {name} {value}" for name, value in plan.parameters.items())
    return (
        f"Mean number of trials until the pole stays up for N = {plan.steps:,} steps;\n"
        f"{count(plan.runs, 'run')} per case, seed {plan.seed}{changed}.\n"
    )


def _legend() -> str:
    return (
        "A star marks the best rank. Ranks are by the mean over all runs, where a failed\n"
        f"run counts with {TRIALS:,} trials; agents whose 95 % intervals overlap are tied.\n"
        "Where runs failed, the mean is over the others, with the success rate beside it.\n"
        "random-search learns nothing: compare with it."
    )


LEADERBOARD = Board("leaderboard", PUBLISHED, leaderboard_page, leaderboard_text)
"""All agents on the published cases, from both starts."""
ROBUST_BOARD = Board("robust", ROBUST, robust_page, robust_text)
"""All agents on tasks beyond the published ones."""


def _version(rows: Columns) -> str:
    """Return the version of the package that measured a board, or that writes it."""
    return next(iter(rows.values()))[0].version or __version__


def _origin(plan: BoardPlan, command: str, version: str) -> str:
    """Return the number of runs, and the command and version that generated a board."""
    options = {"agents": ",".join(plan.agents), "runs": plan.runs, "steps": plan.steps}
    usual = BoardPlan(steps=USUAL_STEPS[command])
    usual_options = {"agents": ",".join(usual.agents), "runs": usual.runs, "steps": usual.steps}
    changed = [name for name, value in options.items() if value != usual_options[name]]
    arguments = [f"--{name} {options[name]}" for name in changed]
    arguments += as_options("--parameter", plan.parameters)
    arguments.append(f"--seed {plan.seed}")
    files = {"output": plan.output, "store": plan.store}
    arguments += [f"--{name} {shlex.quote(str(path))}" for name, path in files.items() if path]
    line = markdown_code(" ".join(["upright", command, *arguments]))
    origin = (
        f"{count(plan.runs, 'run')} per case; generated with\n{line}, upright {markdown(version)}."
    )
    if not plan.parameters:
        return origin
    values = ", ".join(f"{name} {value}" for name, value in plan.parameters.items())
    return f"""{origin}

**The plant is not the published one**: {values}. Lengths, masses, times and friction named below
are those of the published plant; what varies is scaled from these values."""


def _failures(rows: Columns) -> str:
    failures: dict[str, list[str]] = {row.agent: [] for row in next(iter(rows.values()))}
    for title, column in rows.items():
        for row in column:
            if row.success_rate < 0.95:
                failures[row.agent].append(f"{title} ({100 * row.success_rate:.0f} %)")
    return "\n".join(
        f"- {markdown_code(agent)}: {', '.join(titles) or 'none'}"
        for agent, titles in failures.items()
    )


def _settings(plan: BoardPlan) -> str:
    lines = [
        f"- {markdown_code(agent)}: {markdown_code(str(make_case(agent).settings))}"
        for agent in plan.agents
    ]
    return "## Settings\n\n" + "\n".join(lines) + "\n"
