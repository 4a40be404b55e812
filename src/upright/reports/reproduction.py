"""Reproduces the report's tables, with its settings and with tuned ones, beside random guessing.

Everything is written to one folder: the store of runs, a report in Markdown, its pictures, and the
policies that they show.
"""

from collections.abc import Callable
from pathlib import Path

from upright.core.conditions import PUBLISHED_NOISES, RUNS, STEPS, TRIALS
from upright.core.parameters import Parameters
from upright.core.trials import Result
from upright.policies.files import save_policy
from upright.policies.policy import Policy
from upright.reports.escaping import Markdown
from upright.reports.published import REPORT
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
from upright.studies.executors import AnyExecutor
from upright.studies.learned import learned_policy
from upright.studies.progress import study_with_progress
from upright.studies.run import make_run
from upright.studies.store import Store
from upright.studies.study import check_study
from upright.support.files import make_folder, require_apart, write_file
from upright.support.terminal import end_notice
from upright.support.words import count

SHOWN = (
    ("reinforce", "as-published"),
    ("reinforce", "default"),
    ("q-learning", "as-published"),
    ("q-learning", "default"),
    ("random-search", "default"),
)
"""Agents and settings that the tables show."""
LEARNERS = tuple(agent for agent, label in SHOWN if label == "default" and agent != "random-search")
"""Agents whose policies are drawn and saved."""
PICTURES = ("learning-curves.png", "trials.png", "policies.png", "phases.png")
"""Pictures of the report."""


def reproduce(
    folder: Path | str,
    runs: int = RUNS,
    seed: int = 0,
    steps: int = STEPS,
    say: Callable[[str], None] = print,
    executor: AnyExecutor = None,
) -> Path:
    """Make the runs that are missing in the folder, and write the report on all of them.

    Parameters
    ----------
    folder
        The folder for results and the report; created if missing.
    runs
        Runs of each case; the original report made 20.
    seed
        Seed of the study.
    steps
        N: steps of a successful trial.
    say
        Called with lines about the progress.
    executor
        Where to run, as for `study`.

    Returns
    -------
    Path
        Path of the report.

    Raises
    ------
    UprightError
        If the folder cannot be used.
    """
    check_study(runs, seed)
    cases = [
        make_case(agent, label, noise=noise, steps=steps)
        for agent, label in SHOWN
        for noise in PUBLISHED_NOISES
    ]
    folder = make_folder(folder)
    store_file, table, page = (folder / name for name in ("runs.sqlite", "table.json", "report.md"))
    others = (folder / name for name in (*PICTURES, *(f"{agent}.npz" for agent in LEARNERS)))
    require_apart([("output", path) for path in (table, page, *others)], [("store", store_file)])
    end_notice()
    say(
        f"{len(SHOWN)} agents and settings × {len(PUBLISHED_NOISES)} noise cases × "
        f"{count(runs, 'run')}, seed {seed}"
    )
    with Store(store_file) as store:
        study_with_progress(cases, runs, seed, store, executor)
        learned = [(case, store.results(case.key, seed, runs)) for case in cases]
    say("drawing")
    draw(folder, learned, seed)
    rows = [summarise(case, seed, results) for case, results in learned]
    write_file(table, to_json(rows))
    write_file(page, report(rows))
    return page


def draw(folder: Path, learned: list[tuple[Case, list[Result]]], seed: int) -> None:
    """Draw the report's pictures into the folder."""
    from upright.reports import plots

    curves, trials, maps, phases = (folder / name for name in PICTURES)
    tuned = [(case, results) for case, results in learned if case.label == "default"]
    noise_free = [(case, results) for case, results in tuned if case.spec.noise == "none"]
    plots.save(plots.plot_curves(noise_free), curves)
    plots.save(plots.plot_trials(learned), trials)
    policies = []
    for case, results in noise_free:
        if case.agent in LEARNERS:
            policies.append(_learn_policy(case, results, seed))
            save_policy(folder / f"{case.agent}.npz", policies[-1])
    plots.save(plots.plot_policies(policies), maps)
    plots.save(plots.plot_phases(policies[0]), phases)


def _learn_policy(case: Case, results: list[Result], seed: int) -> Policy:
    """Return the policy of the first successful run, or else of the first run."""
    run = next((result.run for result in results if result.success), 0)
    agent, _ = make_run(case, seed, run)
    return learned_policy(case, seed, run, agent)


def comparison(rows: list[Row], agent: str, title: str) -> str:
    """Return a table of one agent like the report's, with a row for each noise case."""
    by_case = {(row.agent, row.settings, row.task.noise): row for row in rows}
    figures = [by_case[agent, "default", noise].published.get(REPORT) for noise in PUBLISHED_NOISES]
    head = ["Noise", *(["Report"] if any(figures) else []), "Report's settings: success"]
    head += ["mean trials", "Upright: success", "mean trials", "Random guessing"]
    body = []
    for noise, figure in zip(PUBLISHED_NOISES, figures, strict=True):
        published = by_case[agent, "as-published", noise]
        default = by_case[agent, "default", noise]
        guess = by_case["random-search", "default", noise]
        line = [noise, *([number(figure, 2)] if any(figures) else [])]
        line += [success_text(published), mean_text(published)]
        line += [success_text(default), Markdown(f"**{mean_text(default)}**"), mean_text(guess)]
        body.append(line)
    return f"## {title}\n\n" + to_markdown(Table(head, body, []))


def report(rows: list[Row]) -> str:
    """Return the report in Markdown."""
    row = rows[0]
    total = sum(row.steps_simulated for row in rows)
    step = Parameters().time_step
    protocol = f"{count(row.runs, 'run')} per case, N = {row.task.steps:,} steps of {step} s"
    protocol += f", at most {TRIALS:,} trials per run"
    return f"""# The report's tables, reproduced

"The report" is the course report *Balancing an Inverted Pendulum using Reinforcement Learning*.
Its settings, as far as it states them, do not give its figures; docs/protocol.md of this package
says what is known of the report, and what was tried.

{protocol}; every trial
counts. Seed {row.seed}, upright {row.version}. {total / 1e6:,.0f} million steps were simulated,
{total * step / 86400:,.0f} days of balancing and falling. 95 % intervals are in brackets. Means are
over the successful runs, so they flatter a learner with a low success rate.

{comparison(rows, "reinforce", "Table I: REINFORCE")}
{comparison(rows, "q-learning", "Table II: tabular Q-learning")}
The report gives only the noise-free case of Table II. Random guessing draws a new linear policy for
every trial and learns nothing: a learner is only as good as its improvement over this baseline.

## Learning

![Learning curves](learning-curves.png)

How many steps each trial lasted, noise-free: the median run, and the middle half of the runs. A run
that has succeeded counts with all steps in later trials.

![Distribution of trials to success](trials.png)

Runs that succeeded within a given number of trials, for each noise case, with 95 % intervals. A
curve ends below 100 % if some runs failed.

## Learned policies

![Policy maps](policies.png)

Probability of a push to the right. Above, the cart is at rest in the middle of its track; below,
the pole is upright and at rest. Along the line, both sides are as likely.

![Phase portraits](phases.png)

Phase portraits of cart and pole while the policy that REINFORCE learned balances them. Each push
changes the velocities, so that the states themselves zigzag; the coloured line is smoothed.

## All figures

{to_markdown(study_table(rows))}"""
