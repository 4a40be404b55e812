"""Statistics of studies: a row of figures for each case."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from upright import __version__
from upright.core.task import TaskSpec
from upright.core.trials import Result
from upright.plants import PLANTS
from upright.reports.published import figures
from upright.studies.case import Case, named
from upright.studies.intervals import bootstrap_interval, wilson_interval
from upright.studies.store import Store
from upright.support.settings import changed_values

INTERVALS = ("success_ci95", "ci95", "all_runs_ci95")
"""The fields of a row that are intervals: their two ends."""


@dataclass(frozen=True)
class Row:
    """A case of a study in numbers."""

    agent: str
    """Name of the agent."""
    settings: str
    """Name of its settings."""
    task: TaskSpec
    """The task."""
    runs: int
    """Number of runs."""
    successes: int
    """How many of them succeeded."""
    success_rate: float
    """Part of the runs that succeeded."""
    success_ci95: tuple[float, float]
    """Its 95 % interval (Wilson 1927)."""
    mean_trials: float | None
    """Mean number of trials over the successful runs; None if there is none, as below."""
    ci95: tuple[float, float] | None
    """Its 95 % interval (bias-corrected and accelerated bootstrap, Efron 1987)."""
    median_trials: float | None
    """Their median."""
    p95_trials: float | None
    """Their 95th percentile."""
    max_trials: int | None
    """The most trials that a successful run needed."""
    mean_trials_all_runs: float
    """Mean number of trials made over all runs; a failed run counts with all it made."""
    all_runs_ci95: tuple[float, float]
    """Its 95 % interval, as above."""
    steps_simulated: int
    """Steps of all trials of all runs."""
    seconds: float
    """Computing time of all runs, on one core."""
    published: dict[str, float]
    """Published mean trials of the same noise case, by source."""
    seed: int
    """Seed of the study."""
    version: str = __version__
    """Version of this package."""
    language: str = "Python"
    """In which language it ran."""
    plant: str = "equations"
    """Name of the plant."""
    plant_settings: Mapping[str, Any] = field(default_factory=dict)
    """Its settings that differ from the default ones."""

    @property
    def name(self) -> str:
        """Name of the agent, for people."""
        return named(self.agent, self.language, self.plant)

    def as_data(self) -> dict[str, Any]:
        """Return the row as JSON takes it: parts of the task stand among the others."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        data: dict[str, Any] = {}
        for name, value in values.items():
            data |= value.as_data() if name == "task" else {name: value}
        return data

    @classmethod
    def from_data(cls, values: Mapping[str, Any]) -> "Row":
        """Return the row that `as_data` described, also one of version 0.1."""
        parts = {field.name for field in fields(TaskSpec)}
        task = {name: value for name, value in values.items() if name in parts}
        own = {name: value for name, value in values.items() if name not in parts}
        for name in INTERVALS:
            own[name] = own[name] and tuple(own[name])
        return cls(task=TaskSpec.from_data(task), **own)


def summarise(case: Case, seed: int, results: Sequence[Result]) -> Row:
    """Return the statistics of a case over its runs.

    Parameters
    ----------
    case
        What was run.
    seed
        Of the study.
    results
        Of its runs, in order.

    Returns
    -------
    Row
        Success rate, mean, median and 95th percentile of trials to success, with 95 % intervals,
        and the published figures of the same case.

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
    trials = np.array([result.trials for result in results if result.success])
    made = np.array([result.trials for result in results])
    rate_interval = wilson_interval(len(trials), len(results))
    some = len(trials) > 0
    return Row(
        agent=case.agent,
        settings=case.label,
        task=case.spec,
        runs=len(results),
        successes=len(trials),
        success_rate=len(trials) / max(1, len(results)),
        success_ci95=rate_interval,
        mean_trials=float(trials.mean()) if some else None,
        ci95=bootstrap_interval(trials) if some else None,
        median_trials=float(np.median(trials)) if some else None,
        p95_trials=float(np.percentile(trials, 95)) if some else None,
        max_trials=int(trials.max()) if some else None,
        mean_trials_all_runs=float(made.mean()),
        all_runs_ci95=bootstrap_interval(made),
        steps_simulated=int(sum(result.lengths.sum() for result in results)),
        seconds=sum(result.seconds for result in results),
        published=figures(case.agent, case.spec.noise),
        seed=seed,
        language=case.language,
        plant=case.plant.name,
        plant_settings=changed_values(PLANTS.default(case.plant.name), case.plant),
    )


def summarise_all(cases: Iterable[Case], runs: int, seed: int, store: Store) -> list[Row]:
    """Return the statistics of the first `runs` runs of each case."""
    return [summarise(case, seed, store.results(case.key, seed, runs)) for case in cases]
