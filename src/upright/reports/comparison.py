"""Several agents measured beside each other from Python: `compare`, and what it returns."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from upright.core.conditions import PUBLISHED_NOISES, RUNS
from upright.core.contracts import AnyAgent
from upright.core.trials import Result
from upright.errors import UprightError, require_one_of
from upright.reports.notebook import displayed, html_table
from upright.reports.statistics import Row, summarise
from upright.reports.sweeps import sizes, swept
from upright.reports.tables import study_table, to_text
from upright.studies.case import Case, make_case
from upright.studies.columns import RESULT, TRIAL
from upright.studies.executors import AnyExecutor
from upright.studies.progress import study_with_progress
from upright.studies.records import describe_case, make_frame
from upright.studies.store import Store
from upright.studies.study import check_study, make_missing_runs
from upright.support.settings import combinations, require_few_cases
from upright.support.words import count

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

GUESSING = "random-search"
"""The agent that guesses: what does no better has learned nothing."""
WORDS = ("Agent", "Settings", "Noise", "Task")
"""Columns of the table that hold words."""
COLUMNS = ("agent", "settings", "noise", "seed", "run")
"""Columns of frames that say which run it is; those of parameters that differ follow."""
MEASURED = {"run": tuple(RESULT), "trial": tuple(TRIAL)}
"""The other columns of frames with a row for each run, or for each trial."""
PLOTS = ("trials", "curves", "sweep")
"""What can be drawn."""


@dataclass(frozen=True, repr=False)
class Comparison:
    """What `compare` returns: the runs of several agents, and tables, frames and plots of them.

    A notebook shows it as a table; elsewhere ``print`` does.

    Examples
    --------
    >>> compared = upright.compare("q-learning", runs=5, steps=300, progress=False)
    >>> compared
    Comparison(q-learning, random-search; none; 5 runs each)
    >>> [row.agent for row in compared.rows]
    ['q-learning', 'random-search']
    >>> frame = compared.frame()
    >>> list(frame.columns[-5:]), len(frame)
    (['success', 'trials', 'steps', 'longest_trial', 'seconds'], 10)
    >>> figure = compared.plot("curves")
    """

    results: Mapping[Case, Sequence[Result]]
    """The results of the runs of each case, in order."""
    seed: int
    """Seed of the study."""

    @cached_property
    def rows(self) -> list[Row]:
        """The statistics of each case: success rate and mean trials with intervals, and others."""
        return [summarise(case, self.seed, results) for case, results in self.results.items()]

    def frame(self, each: str = "run") -> "pandas.DataFrame":
        """Return the runs as a tidy pandas DataFrame.

        Parameters
        ----------
        each
            "run" for a row for each run: its `success`, its number of `trials`, the `steps` of all
            of them together, the `longest_trial` in steps, and the computing time in `seconds`.
            "trial" for a row for each trial: its number `trial`, from 1, the `steps` that it
            lasted, and whether it ended with the pole `fallen`. Before these stand `agent`,
            `settings`, `noise`, `seed` and `run`, and the parameters of the plant that differ.

        Raises
        ------
        UprightError
            If pandas is missing.
        """
        require_one_of("each", each, MEASURED)
        runs = (
            (values | {"seed": self.seed, "run": result.run}, result)
            for values, results in zip(
                map(describe_case, self.results), self.results.values(), strict=True
            )
            for result in results
        )
        return make_frame(
            runs, each, (*COLUMNS, *swept(case.spec for case in self.results), *MEASURED[each])
        )

    def plot(self, kind: str = "trials", parameter: str | None = None) -> "Figure":
        """Draw the runs.

        Parameters
        ----------
        kind
            "trials" for the fraction of runs that succeeded within a number of trials, "curves" for
            the learning curve of every run and of the median, or "sweep" for mean trials and
            success rate over a parameter of the plant that has several values.
        parameter
            That parameter, if several differ.

        Raises
        ------
        UprightError
            If there is no such kind, or no such sweep.
        """
        from upright.reports import plots  # imported late: it is slow

        require_one_of("kind", kind, PLOTS)
        learned = [(case, list(results)) for case, results in self.results.items()]
        if kind == "sweep":
            return displayed(plots.plot_sweep(learned, parameter))
        return displayed((plots.plot_curves if kind == "curves" else plots.plot_trials)(learned))

    def __str__(self) -> str:
        return to_text(self.rows)

    def __repr__(self) -> str:
        agents = dict.fromkeys(case.name for case in self.results)
        noises = dict.fromkeys(case.spec.noise for case in self.results)
        tasks = [case.spec for case in self.results]
        values = [(name, len({sizes(task)[name] for task in tasks})) for name in swept(tasks)]
        runs = count(max(map(len, self.results.values())), "run")
        parts = [", ".join(agents), ", ".join(noises), *(f"{n} of {name}" for name, n in values)]
        return f"Comparison({'; '.join(parts)}; {runs} each)"

    def _repr_html_(self) -> str:
        table = study_table(self.rows)
        return html_table(table.head, table.body, table.notes, WORDS)


def compare(
    agents: AnyAgent | Iterable[AnyAgent],
    noises: str | Iterable[str] = "none",
    settings: str = "default",
    *,
    runs: int = RUNS,
    seed: int = 0,
    store: Store | Path | str | None = None,
    guessing: bool = True,
    progress: bool = True,
    executor: AnyExecutor = None,
    **task: Any,
) -> Comparison:
    """Measure agents over many runs, beside random guessing.

    Parameters
    ----------
    agents
        The agents, or a single one: names in `AGENTS`, ``module:name`` of custom ones, or classes
        and functions which return an agent when they are called with a run's random numbers.
    noises
        Names of noise cases in `NOISES`, or a single one; "all" for the seven published ones.
    settings
        Name of the agents' settings: "default" or "as-published".
    runs
        Number of runs of each agent under each noise case.
    seed
        Seed of the study: the same seed gives the same result on every machine.
    store
        A file, or an open `Store`, where finished runs are kept and looked up. Interrupted, the
        same call goes on from there.
    guessing
        Whether to add `random-search`, which guesses and learns nothing, if it is not among the
        agents.
    progress
        Whether to show a progress bar, in a terminal or a notebook.
    executor
        Where to run: as for `study`, "threads", "processes", or the address of a dask scheduler.
    **task
        Other parts of the task by name, as `make_case` takes them: `start`, `steps`, `trials`,
        `condition`, `plant` and others. Each of the `parameters` may be a number or several, as
        ``{"half_length": [0.25, 0.5, 1]}``: every combination of them is measured.

    Returns
    -------
    Comparison
        It is shown as a table. Its attribute `rows` holds the statistics; its methods `frame` and
        `plot` return the runs as a pandas DataFrame and as a figure.

    Raises
    ------
    UprightError
        If a name is unknown, a number is not allowed, or an agent cannot work.
    KeyboardInterrupt
        If interrupted; the runs that have ended are in the store.

    Examples
    --------
    >>> compared = upright.compare(["reinforce", "q-learning"], runs=10, steps=300, progress=False)
    >>> print(compared)  # doctest: +ELLIPSIS
    Agent ...
    >>> compared.frame().groupby("agent")["success"].mean()["reinforce"].item()
    1.0

    A sweep has several values of a parameter, and its plot shows trials over them:

    >>> lengths = upright.compare("q-learning", runs=5, steps=300, progress=False,
    ...                           parameters={"half_length": [0.25, 0.5, 1.0]})
    >>> lengths
    Comparison(q-learning, random-search; none; 3 of half_length; 5 runs each)
    >>> figure = lengths.plot("sweep")
    """
    check_study(runs, seed)
    if "noise" in task:
        raise UprightError(f"noise is {task['noise']!r}; compare takes noises, one or several")
    tasks = _all_tasks(task)
    cases = [
        make_case(agent, settings, noise=noise, **each)
        for agent in _all_agents(agents, guessing)
        for each in tasks
        for noise in _all_noises(noises)
    ]
    cases = list(dict.fromkeys(cases))
    require_few_cases(len(cases))
    with nullcontext(store) if isinstance(store, Store) else Store(store) as opened:
        make = study_with_progress if progress else make_missing_runs
        make(cases, runs, seed, opened, executor=executor)
        return Comparison({c: opened.results(c.key, seed, runs) for c in cases}, seed)


def _all_agents(agents: Any, guessing: bool) -> list[AnyAgent]:
    is_one = isinstance(agents, str) or callable(agents) or not isinstance(agents, Iterable)
    several = [agents] if is_one else [*agents]
    return several + [GUESSING] * (guessing and GUESSING not in several)


def _all_tasks(task: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the parts of each task where parameters may have several values."""
    given = task.get("parameters")
    if not isinstance(given, Mapping):
        return [task]
    every = combinations({name: _several(name, value) for name, value in given.items()})
    return [task | {"parameters": chosen} for chosen in every]


def _several(name: str, value: Any) -> list[Any]:
    """Return the values that are given for a parameter: a number, or several, also as an array."""
    value = value.tolist() if hasattr(value, "tolist") else value
    several = [*value] if isinstance(value, Iterable) and not isinstance(value, str) else [value]
    if not several:
        raise UprightError(f"{name} is {value!r}; it must be a number, or several")
    return several


def _all_noises(noises: str | Iterable[str]) -> list[str]:
    if isinstance(noises, str):
        return [*PUBLISHED_NOISES] if noises == "all" else [noises]
    return [*noises]
