"""Boards: all agents side by side, ranked, on the published cases and beyond them.

A board has a line for each agent and a column for each task. Who is better is decided by the mean
number of trials over all runs, in which a failed run counts with all the trials it made; where two
intervals overlap, the two are tied.
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
"""The columns of the leaderboard, over both its tables."""
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
"""N of each command's board unless told otherwise: Si & Wang's form, and the report's."""


class BoardPlan(NamedTuple):
    """What a board is made of, besides its columns."""

    agents: Sequence[str] = tuple(AGENTS)
    """Names of the agents; all with their default settings."""
    runs: int = STRICT_RUNS
    """Runs of each case."""
    seed: int = 0
    """Of the study."""
    steps: int = USUAL_STEPS["leaderboard"]
    """N: steps of a successful trial."""
    parameters: Mapping[str, float] = {}
    """Parameters of the plant that differ from the published ones."""
    store: Path | str | None = None
    """Where finished runs are kept; without one, they are lost when interrupted."""


def make_rows(study: BoardPlan, columns: dict[str, dict[str, Any]]) -> dict[str, list[Row]]:
    """Make the runs that are missing, and return the row of every agent for each column."""
    cases = _cases(study, columns)
    with Store(study.store) as store:
        all_cases = [case for some in cases.values() for case in some]
        study_with_progress(all_cases, study.runs, study.seed, store)
        return {
            title: summarise_all(some, study.runs, study.seed, store)
            for title, some in cases.items()
        }


def _cases(study: BoardPlan, columns: dict[str, dict[str, Any]]) -> dict[str, list[Case]]:
    return {
        title: [
            make_case(agent, steps=study.steps, parameters=study.parameters, **task)
            for agent in study.agents
        ]
        for title, task in columns.items()
    }


def ranks(rows: Sequence[Row]) -> list[int]:
    """Return each row's rank: 1 more than the rows whose interval lies below its own."""
    return [
        1 + sum(other.all_runs_ci95[1] < row.all_runs_ci95[0] for other in rows) for row in rows
    ]


def board(columns: dict[str, list[Row]], published: bool = False) -> str:
    """Return a board in Markdown, the best agents first."""
    agents = [row.agent for row in next(iter(columns.values()))]
    places = {title: ranks(rows) for title, rows in columns.items()}
    mean_rank = [sum(some[i] for some in places.values()) / len(places) for i in range(len(agents))]
    body = []
    for i in sorted(range(len(agents)), key=lambda i: mean_rank[i]):
        cells = [_cell(rows[i], places[title][i]) for title, rows in columns.items()]
        body.append([f"`{agents[i]}`", number(mean_rank[i]), *cells])
    for source in SOURCES if published else ():
        figures = (source.mean_trials.get(rows[0].task.noise) for rows in columns.values())
        rule = f" ({source.agent})" if source.agent else ""
        name = f"*{source.name}{rule}, {source.runs} runs, N = {source.steps:,}*"
        body.append([name, "", *(number(figure, 2) for figure in figures)])
    return to_markdown(Table(["Agent", "Mean rank", *columns], body, []))


def _cell(row: Row, rank: int) -> str:
    """Return rank, mean trials with interval and, unless all runs succeeded, the success rate."""
    if row.mean_trials is None or row.ci95 is None:
        return f"{rank}. never"
    low, high = row.ci95
    mean = f"{rank}. {row.mean_trials:.2f} [{low:.2f}, {high:.2f}]"
    mean = f"**{mean}**" if rank == 1 else mean
    return mean if row.successes == row.runs else f"{mean} {100 * row.success_rate:.0f} %"


READING = f"""Each cell has the agent's rank in that column, its mean number of trials to success
with a 95 % interval and, where some runs failed, the success rate; the mean is over the successful
runs. Ranks go by the mean over all runs, a failed one counted with the {TRIALS:,} trials it made;
agents whose intervals overlap are tied. The best rank is bold. Every trial counts, the successful
one included. `random-search` draws a new linear policy for every trial and learns nothing: an agent
is worth what it gains on that.
"""


def leaderboard(path: Path | str, study: BoardPlan, say: Callable[[str], None] = print) -> None:
    """Measure all agents on the published cases, and write the leaderboard.

    Parameters
    ----------
    path
        Where the board is written, in Markdown; its figures go beside it, as JSON.
    study
        Agents, runs, seed and length of a success.
    say
        Told what is being done.

    Raises
    ------
    UprightError
        If an agent is unknown or a file cannot be written.
    """
    write_file(path, leaderboard_text(_measure(path, study, PUBLISHED, say), study))


def robust(path: Path | str, study: BoardPlan, say: Callable[[str], None] = print) -> None:
    """Measure all agents on tasks beyond the published ones, and write the board.

    Parameters and errors are those of `leaderboard`.
    """
    write_file(path, robust_text(_measure(path, study, ROBUST, say), study))


def leaderboard_text(rows: dict[str, list[Row]], study: BoardPlan) -> str:
    """Return the leaderboard in Markdown."""
    parts = []
    for start, title in STARTS_SHOWN.items():
        named = {noise: rows[f"{start} {noise}"] for noise in PUBLISHED_NOISES}
        parts.append(f"## {title}\n\n{board(named, published=True)}")
    cited = "\n".join(f"- {source.name}: {source.citation}." for source in SOURCES)
    return f"""# Leaderboard

How many trials every agent needs until the pole stands for N = {study.steps:,} steps, on the seven
published noise cases. {_made(study, "leaderboard", _version(rows))}

{READING}
{parts[0]}
{parts[1]}
Lines in italics are published figures, as they stand in their sources:

{cited}

{_settings(study)}"""


def robust_text(rows: dict[str, list[Row]], study: BoardPlan) -> str:
    """Return the board of the robust suite in Markdown."""
    return f"""# Robustness

The same agents with the same settings, noise-free, where the task departs from the published one.
A trial of N = {study.steps:,} steps succeeds. {_made(study, "robust", _version(rows))}

- *plant varies*: every run has another plant; pole of 0.25 to 2 m, both masses halved to doubled;
- *delay*: a push acts one or two steps of {Parameters().time_step} s later;
- *no velocities*: the agent reads 0 for both velocities;
- *start ±6°*: the pole leans up to 6° at the start;
- *friction ×100*: of cart and hinge.

{READING}
{board(rows)}
## What breaks whom

Where fewer than 95 % of the runs succeed:

{_broken(rows)}

{_settings(study)}"""


def _measure(
    path: Path | str,
    study: BoardPlan,
    columns: dict[str, dict[str, Any]],
    say: Callable[[str], None],
) -> dict[str, list[Row]]:
    """Make the folders, measure, and write the figures beside the board.

    What cannot be measured or written is refused before anything is made.
    """
    path = Path(path)
    check_study(study.runs, study.seed)
    _cases(study, columns)
    for folder in {path.parent, Path(study.store or path).parent}:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            why = f"a folder cannot be made there: {error.strerror}"
            raise UprightError(f"output is {str(folder)!r}; {why}") from None
    figures = check_output(path).with_suffix(".json")
    if figures == path:
        raise UprightError(f"output is {str(path)!r}; the figures go there, the board elsewhere")
    check_output(figures)
    say(f"{len(study.agents)} agents × {len(columns)} tasks × {study.runs} runs, seed {study.seed}")
    rows = make_rows(study, columns)
    write_file(figures, to_json([row for some in rows.values() for row in some]))
    return rows


def _version(rows: dict[str, list[Row]]) -> str:
    """Return the version that measured a board."""
    return next(iter(rows.values()))[0].version


def _made(study: BoardPlan, command: str, version: str) -> str:
    options = {"agents": ",".join(study.agents), "runs": study.runs, "steps": study.steps}
    usual = BoardPlan(steps=USUAL_STEPS[command])
    usual_options = {"agents": ",".join(usual.agents), "runs": usual.runs, "steps": usual.steps}
    told = [f"--{name} {value}" for name, value in options.items() if value != usual_options[name]]
    told += [f"--parameter {name}={value}" for name, value in study.parameters.items()]
    words = " ".join(["upright", command, *told, f"--seed {study.seed}"])
    return f"{study.runs} runs a case; made by\n`{words}`, upright {version}."


def _broken(rows: dict[str, list[Row]]) -> str:
    found: dict[str, list[str]] = {row.agent: [] for row in next(iter(rows.values()))}
    for title, some in rows.items():
        for row in some:
            if row.success_rate < 0.95:
                found[row.agent].append(f"{title} ({100 * row.success_rate:.0f} %)")
    return "\n".join(
        f"- `{agent}`: {', '.join(some) or 'nothing'}" for agent, some in found.items()
    )


def _settings(study: BoardPlan) -> str:
    lines = [f"- `{agent}`: `{make_case(agent).settings}`" for agent in study.agents]
    return "## Settings\n\n" + "\n".join(lines) + "\n"
