"""Statistics of studies: a row of figures for each case."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from upright import __version__
from upright.agents import AGENTS
from upright.core.task import TaskSpec
from upright.core.trials import Result
from upright.errors import UprightError, require_all, require_kind
from upright.plants import PLANTS
from upright.reports.names import noise_rank
from upright.reports.published import figures
from upright.studies.case import Case, named
from upright.studies.intervals import bootstrap_interval, wilson_interval
from upright.studies.outcomes import Outcomes, outcomes_of
from upright.studies.store import Store
from upright.support.settings import changed_values
from upright.support.short_repr import call

INTERVALS = ("success_ci95", "ci95", "all_runs_ci95")
"""The fields of a row that are intervals, each as its two ends."""


@dataclass(frozen=True)
class Row:
    """Statistics of one case of a study."""

    agent: str
    """Name of the agent."""
    settings: str
    """Name of its settings, with what was changed."""
    task: TaskSpec
    """The task."""
    runs: int
    """Number of runs."""
    successes: int
    """Number of successful runs."""
    success_rate: float
    """Fraction of runs that succeeded."""
    success_ci95: tuple[float, float]
    """95 % interval of the success rate (Wilson 1927)."""
    mean_trials: float | None
    """Mean number of trials over the successful runs; None, as below, if there are none."""
    ci95: tuple[float, float] | None
    """95 % interval of this mean (bias-corrected and accelerated bootstrap, Efron 1987)."""
    median_trials: float | None
    """Median number of trials over the successful runs."""
    p95_trials: float | None
    """95th percentile of the number of trials over the successful runs."""
    max_trials: int | None
    """Largest number of trials over the successful runs."""
    mean_trials_all_runs: float
    """Mean number of trials over all runs, where a failed run counts with all its trials."""
    all_runs_ci95: tuple[float, float]
    """95 % interval of this mean (bootstrap, as above)."""
    steps_simulated: int
    """Total steps of all trials of all runs."""
    seconds: float
    """Computing time of all runs, on one core [s]."""
    published: dict[str, float]
    """Published mean trials of the same task, by source."""
    seed: int
    """Seed of the study."""
    version: str | None = __version__
    """Version of this package that made the runs; None if that is not known."""
    language: str = "Python"
    """Language that the runs were made in."""
    plant: str = "equations"
    """Name of the plant, or of the environment."""
    plant_settings: Mapping[str, Any] = field(default_factory=dict)
    """Settings of the plant that differ from the default ones."""

    @property
    def name(self) -> str:
        """Name of the agent, for display."""
        return named(self.agent, self.language, self.plant)

    def __repr__(self) -> str:
        parts = {**self.task.changes(), "runs": self.runs, "successes": self.successes}
        means = {"mean_trials": self.mean_trials and round(self.mean_trials, 2)}
        return call("Row", parts | means, [self.name, self.settings])

    def as_data(self) -> dict[str, Any]:
        """Return the row as data for JSON, with the fields of the task among its own."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        data: dict[str, Any] = {}
        for name, value in values.items():
            data |= value.as_data() if name == "task" else {name: value}
        return data

    @classmethod
    def from_data(cls, values: Mapping[str, Any]) -> "Row":
        """Return the row that is described by the result of `as_data`, also of version 0.1.

        The published figures are looked up anew: version 0.1 had them beside other tasks, too.
        """
        parts = {field.name for field in fields(TaskSpec)}
        task = {name: value for name, value in values.items() if name in parts}
        own = {name: value for name, value in values.items() if name not in parts}
        for name in INTERVALS:
            own[name] = own[name] and tuple(own[name])
        row = cls(task=TaskSpec.from_data(task), **own)
        return replace(row, published=figures(row.agent, row.task, row.plant, row.plant_settings))


def summarise(
    case: Case,
    seed: int,
    results: Sequence[Result] | Outcomes,
    *,
    environment: str | None = None,
    version: str | None = __version__,
) -> Row:
    """Return the statistics of a case over its runs.

    Parameters
    ----------
    case
        What was run.
    seed
        Seed of the study.
    results
        Results of the case's runs, in order; or their outcomes, as `Store.outcomes` returns them
        for studies of a million runs.
    environment
        Name of the environment that the runs were made in, if it was not the case's plant: the row
        is named after it, and has no published figures.
    version
        Version of this package that made the runs; None if that is not known.

    Returns
    -------
    Row
        Success rate and mean trials with 95 % intervals, median, 95th percentile and maximum of
        trials, and the published figures of the same case.

    Raises
    ------
    UprightError
        If there are no results, or they are not results.

    Examples
    --------
    >>> case = upright.make_case("random-search", steps=300)
    >>> row = upright.summarise(case, 0, upright.study([case], runs=20)[case])
    >>> row.runs, row.success_rate
    (20, 1.0)
    >>> low, high = row.ci95
    >>> low < row.mean_trials < high
    True
    """
    require_kind("case", case, Case, "what make_case returns")
    outcomes = _outcomes(results)
    all_trials = outcomes.trials
    trials = all_trials[outcomes.success]
    succeeded = len(trials) > 0
    plant = environment or case.plant.name
    plant_settings = changed_values(PLANTS.default(case.plant.name), case.plant)
    return Row(
        agent=case.agent,
        settings=case.settings_name,
        task=case.spec,
        runs=len(all_trials),
        successes=len(trials),
        success_rate=len(trials) / len(all_trials),
        success_ci95=wilson_interval(len(trials), len(all_trials)),
        mean_trials=float(trials.mean()) if succeeded else None,
        ci95=bootstrap_interval(trials) if succeeded else None,
        median_trials=float(np.median(trials)) if succeeded else None,
        p95_trials=float(np.percentile(trials, 95)) if succeeded else None,
        max_trials=int(trials.max()) if succeeded else None,
        mean_trials_all_runs=float(all_trials.mean()),
        all_runs_ci95=bootstrap_interval(all_trials),
        steps_simulated=int(outcomes.steps.sum()),
        seconds=float(outcomes.seconds.sum()),
        published=figures(case.agent, case.spec, plant, plant_settings),
        seed=seed,
        version=version,
        language=case.language,
        plant=plant,
        plant_settings={} if environment else plant_settings,
    )


def _outcomes(results: Sequence[Result] | Outcomes) -> Outcomes:
    if not isinstance(results, Outcomes):
        expected = "a list of what study returns of a case"
        results = outcomes_of(require_all("results", results, Result, expected))
    if not len(results.run):
        raise UprightError("results is empty; there must be at least one run")
    return results


def summarise_all(cases: Iterable[Case], runs: int, seed: int, store: Store) -> list[Row]:
    """Return the statistics of the first `runs` runs of each case."""
    return [_stored_row(case, seed, store, case.key, runs) for case in cases]


def stored_rows(path: Path | str) -> list[Row]:
    """Return the statistics of all cases of a store, in the order of a table.

    Raises
    ------
    UprightError
        If the file is missing or not a store.
    """
    with Store(path, must_exist=True) as store:
        found = [(store.case(key), seed, key) for _, key, seed in store.cases()]
        return in_order([_stored_row(case, seed, store, key) for case, seed, key in found])


def _stored_row(case: Case, seed: int, store: Store, key: str, runs: int | None = None) -> Row:
    outcomes = store.outcomes(key, seed, runs)
    return summarise(case, seed, outcomes, version=store.version(key, seed))


def in_order(rows: Iterable[Row]) -> list[Row]:
    """Return rows in the order in which `upright table` has them.

    Agents and noise cases stand as they are listed elsewhere; custom agents follow as they come.
    """
    rows = list(rows)
    agents = list(dict.fromkeys([*AGENTS, *(row.agent for row in rows)]))
    return sorted(
        rows,
        key=lambda row: (
            agents.index(row.agent),
            row.name,
            row.settings != "default",
            row.settings,
            str(row.task.as_data() | {"noise": "", "parameters": ""}),
            row.task.parameters,
            str(row.plant_settings),
            row.seed,
            noise_rank(row.task.noise),
        ),
    )
