"""The main job: the report's tables again, with its settings and with ours, beside random guessing.

Everything goes into one folder: the store of runs, a report in Markdown, its pictures, and the
policies that they show.
"""

from collections.abc import Callable
from pathlib import Path

from upright.core.conditions import PUBLISHED_NOISES, RUNS, STEPS, TRIALS
from upright.core.parameters import Parameters
from upright.core.trials import Result
from upright.errors import UprightError
from upright.policies.files import save_policy
from upright.policies.policy import Policy
from upright.reports.published import REPORT, SI_AND_WANG
from upright.reports.statistics import Row, summarise
from upright.reports.tables import (
    Table,
    mean_text,
    number,
    study_table,
    success_text,
    to_json,
    to_markdown,
)
from upright.studies.case import Case, make_case
from upright.studies.learned import learned_policy
from upright.studies.progress import study_with_progress
from upright.studies.run import make_run
from upright.studies.store import Store
from upright.studies.study import check_study
from upright.support.files import write_file

SHOWN = (
    ("reinforce", "as-published"),
    ("reinforce", "default"),
    ("q-learning", "as-published"),
    ("q-learning", "default"),
    ("random-search", "default"),
)
"""Agents and settings of the tables."""


def reproduce(
    folder: Path | str,
    runs: int = RUNS,
    seed: int = 0,
    steps: int = STEPS,
    say: Callable[[str], None] = print,
) -> Path:
    """Make the studies that are missing in the folder, and the report of them all.

    Parameters
    ----------
    folder
        Where results are kept and the report is written; made if missing.
    runs
        Runs of each case; the report made 20.
    seed
        Of the study.
    steps
        N: steps of a successful trial.
    say
        Told what is being done.

    Returns
    -------
    Path
        The report.

    Raises
    ------
    UprightError
        If the folder cannot be used.
    """
    folder = Path(folder)
    check_study(runs, seed)
    cases = [
        make_case(agent, label, noise=noise, steps=steps)
        for agent, label in SHOWN
        for noise in PUBLISHED_NOISES
    ]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        why = f"a folder cannot be made there: {error.strerror}"
        raise UprightError(f"output is {str(folder)!r}; {why}") from None
    say(
        f"{len(SHOWN)} agents and settings × {len(PUBLISHED_NOISES)} noise cases × {runs} runs, "
        f"seed {seed}"
    )
    with Store(folder / "runs.sqlite") as store:
        study_with_progress(cases, runs, seed, store)
        learned = [(case, store.results(case.key, seed, runs)) for case in cases]
    say("drawing")
    draw(folder, learned, seed)
    rows = [summarise(case, seed, results) for case, results in learned]
    write_file(folder / "table.json", to_json(rows))
    write_file(folder / "report.md", report(rows))
    return folder / "report.md"


def draw(folder: Path, learned: list[tuple[Case, list[Result]]], seed: int) -> None:
    """Draw the report's pictures into the folder."""
    from upright.reports import plots

    tuned = [(case, results) for case, results in learned if case.label == "default"]
    noise_free = [(case, results) for case, results in tuned if case.spec.noise == "none"]
    plots.save(plots.plot_curves(noise_free), folder / "learning-curves.png")
    plots.save(plots.plot_trials(learned), folder / "trials.png")
    policies = []
    for case, results in noise_free:
        if case.agent != "random-search":
            policies.append(_learn_policy(case, results, seed))
            save_policy(folder / f"{case.agent}.npz", policies[-1])
    plots.save(plots.plot_policies(policies), folder / "policies.png")
    plots.save(plots.plot_phases(policies[0]), folder / "phases.png")


def _learn_policy(case: Case, results: list[Result], seed: int) -> Policy:
    """Return the policy of the first run that succeeded, or of the first run."""
    run = next((result.run for result in results if result.success), 0)
    agent, _ = make_run(case, seed, run)
    return learned_policy(case, seed, run, agent)


def comparison(rows: list[Row], agent: str, title: str) -> str:
    """Return a table of one agent as the report has it: a line for each noise case."""
    found = {(row.agent, row.settings, row.task.noise): row for row in rows}
    head = ["Noise", "Report", "Report's settings: success", "mean trials"]
    head += ["Ours: success", "mean trials", "Random guessing", SI_AND_WANG]
    body = []
    for noise in PUBLISHED_NOISES:
        published = found[agent, "as-published", noise]
        default = found[agent, "default", noise]
        guess = found["random-search", "default", noise]
        line = [noise, number(default.published.get(REPORT), 2)]
        line += [success_text(published), mean_text(published)]
        line += [success_text(default), f"**{mean_text(default)}**", mean_text(guess)]
        body.append([*line, number(default.published.get(SI_AND_WANG), 0)])
    return f"## {title}\n\n" + to_markdown(Table(head, body, []))


def report(rows: list[Row]) -> str:
    """Return the report in Markdown."""
    row = rows[0]
    total = sum(row.steps_simulated for row in rows)
    step = Parameters().time_step
    protocol = f"{row.runs} runs a case, N = {row.task.steps:,} steps of {step} s"
    protocol += f", at most {TRIALS:,} trials a run"
    return f"""# The report's tables, again

{protocol}, every trial
counted; seed {row.seed}, upright {row.version}. {total / 1e6:,.0f} million steps were simulated,
{total * step / 86400:,.0f} days of balancing and falling. In brackets stand 95 % intervals. Mean
trials are over the successful runs: where the success rate is low, they flatter.

{comparison(rows, "reinforce", "Table I: REINFORCE")}
{comparison(rows, "q-learning", "Table II: tabular Q-learning")}
The report gives only the noise-free case of Table II. Random guessing draws a new linear policy for
every trial and learns nothing: a learner is worth what it gains on that.

## How it learns

![Learning curves](learning-curves.png)

The length of each trial, noise-free: every run thin, the median over runs bold.

![Distribution of trials to success](trials.png)

The part of the runs that had succeeded within so many trials, for each noise case. A curve that
ends below 1 shows the runs that failed.

## What it learned

![Policy maps](policies.png)

The probability of a push to the right, with the cart at rest in the middle of its track.

![Phase portraits](phases.png)

Cart and pole while the policy that REINFORCE learned balances them.

## All figures

{to_markdown(study_table(rows))}"""
