"""Leaderboards: all agents side by side, ranked, on the published cases and beyond them.

A board has a row for each agent and a column for each task. Agents are ranked by the mean number of
trials over all runs, where a failed run counts with all its trials; agents whose intervals overlap
are tied.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from upright.agents import AGENTS
from upright.core.conditions import PUBLISHED_NOISES, STEPS, STRICT_RUNS, STRICT_STEPS, TRIALS
from upright.core.parameters import Parameters
from upright.errors import UprightError
from upright.reports.published import SOURCES
from upright.reports.statistics import Row, summarise_all
from upright.reports.tables import Table, number, to_json, to_markdown
from upright.studies.case import Case, make_case
from upright.studies.progress import study_with_progress
from upright.studies.store import Store
from upright.studies.study import check_study
from upright.support.files import check_output, write_file

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


def make_rows(plan: BoardPlan, columns: dict[str, dict[str, Any]]) -> dict[str, list[Row]]:
    """Make the runs that are missing, and return the rows of all agents for each column."""
    cases = _cases(plan, columns)
    with Store(plan.store) as store:
        all_cases = [case for column in cases.values() for case in column]
        study_with_progress(all_cases, plan.runs, plan.seed, store)
        return {
            title: summarise_all(column, plan.runs, plan.seed, store)
            for title, column in cases.items()
        }


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


def board(columns: dict[str, list[Row]], published: bool = False) -> str:
    """Return a board in Markdown, with the best agents first."""
    agents = [row.agent for row in next(iter(columns.values()))]
    rank = {title: ranks(rows) for title, rows in columns.items()}
    mean_rank = [sum(column[i] for column in rank.values()) / len(rank) for i in range(len(agents))]
    body = []
    for i in sorted(range(len(agents)), key=lambda i: mean_rank[i]):
        cells = [_cell(rows[i], rank[title][i]) for title, rows in columns.items()]
        body.append([f"`{agents[i]}`", number(mean_rank[i]), *cells])
    for source in SOURCES if published else ():
        figures = (source.mean_trials.get(rows[0].task.noise) for rows in columns.values())
        rule = f" ({source.agent})" if source.agent else ""
        name = f"*{source.name}{rule}, {source.runs} runs, N = {source.steps:,}*"
        body.append([name, "", *(number(figure, 2) for figure in figures)])
    return to_markdown(Table(["Agent", "Mean rank", *columns], body, []))


def _cell(row: Row, rank: int) -> str:
    """Return the rank, mean trials with interval and, if some runs failed, the success rate."""
    if row.mean_trials is None or row.ci95 is None:
        return f"{rank}. never"
    low, high = row.ci95
    mean = f"{rank}. {row.mean_trials:.2f} [{low:.2f}, {high:.2f}]"
    mean = f"**{mean}**" if rank == 1 else mean
    return mean if row.successes == row.runs else f"{mean} {100 * row.success_rate:.0f} %"


READING = f"""Each cell has the agent's rank in that column, its mean number of trials to success
with a 95 % interval and, if some runs failed, the success rate. The mean is over the successful
runs; every trial counts, including the successful one. Ranks are by the mean over all runs, where a
failed run counts with its {TRIALS:,} trials; agents whose intervals overlap are tied. The best rank
is bold. `random-search` draws a new linear policy for every trial and learns nothing: an agent is
only as good as its improvement over this baseline.
"""
"""The paragraph that explains a board."""


def leaderboard(path: Path | str, plan: BoardPlan, say: Callable[[str], None] = print) -> None:
    """Measure all agents on the published cases, and write the leaderboard.

    Parameters
    ----------
    path
        Path of the board, in Markdown; its figures are written beside it, as JSON.
    plan
        Agents, runs, seed and length of a success.
    say
        Called with lines about the progress.

    Raises
    ------
    UprightError
        If an agent is unknown or a file cannot be written.
    """
    write_file(path, leaderboard_text(_measure(path, plan, PUBLISHED, say), plan))


def robust(path: Path | str, plan: BoardPlan, say: Callable[[str], None] = print) -> None:
    """Measure all agents on tasks beyond the published ones, and write the board.

    Parameters and errors are those of `leaderboard`.
    """
    write_file(path, robust_text(_measure(path, plan, ROBUST, say), plan))


def leaderboard_text(rows: dict[str, list[Row]], plan: BoardPlan) -> str:
    """Return the leaderboard in Markdown."""
    parts = []
    for start, title in STARTS_SHOWN.items():
        named = {noise: rows[f"{start} {noise}"] for noise in PUBLISHED_NOISES}
        parts.append(f"## {title}\n\n{board(named, published=not plan.parameters)}")
    cited = "\n".join(f"- {source.name}: {source.citation}." for source in SOURCES)
    italics = "Rows in italics are published figures, as given in their sources"
    if plan.parameters:
        italics = "Published figures are left out, because they are for another plant"
    return f"""# Leaderboard

The number of trials each agent needs until the pole stays up for N = {plan.steps:,} steps, on the
seven published noise cases. {_origin(plan, "leaderboard", _version(rows))}

{READING}
{parts[0]}
{parts[1]}
{italics}:

{cited}

{_settings(plan)}"""


def robust_text(rows: dict[str, list[Row]], plan: BoardPlan) -> str:
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


def _measure(
    path: Path | str,
    plan: BoardPlan,
    columns: dict[str, dict[str, Any]],
    say: Callable[[str], None],
) -> dict[str, list[Row]]:
    """Create the folders, measure, and write the figures beside the board.

    Whatever cannot be measured or written is refused before any run is made.
    """
    path = Path(path)
    check_study(plan.runs, plan.seed)
    _cases(plan, columns)
    for folder in {path.parent, Path(plan.store or path).parent}:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            why = f"the folder cannot be created: {error.strerror}"
            raise UprightError(f"output is {str(folder)!r}; {why}") from None
    figures = check_output(path).with_suffix(".json")
    if figures == path:
        raise UprightError(
            f"output is {str(path)!r}; it must not end in .json, as the figures are written there"
        )
    check_output(figures)
    say(f"{len(plan.agents)} agents × {len(columns)} tasks × {plan.runs} runs, seed {plan.seed}")
    rows = make_rows(plan, columns)
    write_file(figures, to_json([row for column in rows.values() for row in column]))
    return rows


def _version(rows: dict[str, list[Row]]) -> str:
    """Return the version of the package that measured a board."""
    return next(iter(rows.values()))[0].version


def _origin(plan: BoardPlan, command: str, version: str) -> str:
    """Return the number of runs, and the command and version that generated a board."""
    options = {"agents": ",".join(plan.agents), "runs": plan.runs, "steps": plan.steps}
    usual = BoardPlan(steps=USUAL_STEPS[command])
    usual_options = {"agents": ",".join(usual.agents), "runs": usual.runs, "steps": usual.steps}
    changed = [name for name, value in options.items() if value != usual_options[name]]
    arguments = [f"--{name} {options[name]}" for name in changed]
    arguments += [f"--parameter {name}={value}" for name, value in plan.parameters.items()]
    line = " ".join(["upright", command, *arguments, f"--seed {plan.seed}"])
    origin = f"{plan.runs} runs per case; generated with\n`{line}`, upright {version}."
    if not plan.parameters:
        return origin
    values = ", ".join(f"{name} {value}" for name, value in plan.parameters.items())
    return f"""{origin}

**The plant is not the published one**: {values}. Lengths, masses, times and friction named below
are those of the published plant; what varies is scaled from these values."""


def _failures(rows: dict[str, list[Row]]) -> str:
    failures: dict[str, list[str]] = {row.agent: [] for row in next(iter(rows.values()))}
    for title, column in rows.items():
        for row in column:
            if row.success_rate < 0.95:
                failures[row.agent].append(f"{title} ({100 * row.success_rate:.0f} %)")
    return "\n".join(
        f"- `{agent}`: {', '.join(titles) or 'none'}" for agent, titles in failures.items()
    )


def _settings(plan: BoardPlan) -> str:
    lines = [f"- `{agent}`: `{make_case(agent).settings}`" for agent in plan.agents]
    return "## Settings\n\n" + "\n".join(lines) + "\n"
