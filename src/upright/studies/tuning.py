"""Searching for better settings of an agent, with Optuna.

What is made small is the mean number of trials over all runs and noise cases asked for, where a run
that fails counts as all the trials it was allowed. Candidates come from a tree-structured Parzen
estimator, and one that does worse after a part of its runs than half of those before it is given
up. The space of settings is read from the settings class itself: see `search_space.py`.

The best of many candidates was partly lucky on the runs it was chosen by. So what is found is
measured again, beside what the search began with, on runs that no candidate has seen.

The same seed gives the same search, whatever the number of cores, and also when it is interrupted
and taken up again (same version of Optuna provided, and one process at a time): a candidate depends
on the seed and on the candidates finished before it, on nothing else.
"""

import json
import re
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import closing, contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from upright.agents import AGENTS, Settings
from upright.errors import UprightError, require, require_module
from upright.studies.case import Case
from upright.studies.fingerprint import fingerprint
from upright.studies.intervals import bootstrap_interval
from upright.studies.search_space import Range
from upright.studies.store import Store
from upright.studies.study import study
from upright.support.interrupts import hold_interrupts
from upright.support.settings import values_of

SEEDS = 10**6
"""Seeds below this are for tables. None of the runs that settings were chosen by has such a seed,
so whatever table is made with one shows fresh runs.
"""
BATCHES = 5
"""In so many parts the runs of a candidate are made; after each it may be given up."""
START = "start"
"""Marks the candidate that is the settings a search began with, exactly."""


def search_seed(seed: int) -> int:
    """Return the seed of the runs that candidates are judged by."""
    return SEEDS + seed


def validation_seed(seed: int) -> int:
    """Return the seed of the runs that only the best candidate is measured by."""
    return 2 * SEEDS + seed


# ------------------------------------------------------------------------------ the search


@dataclass(frozen=True)
class Search:
    """What is searched, and by which runs: everything that determines a search, save its length."""

    cases: tuple[Case, ...]
    """The agent with the settings to begin with, on the noise cases to be good at."""
    space: tuple[Range, ...]
    """The settings that are varied, and how far."""
    runs: int
    """Runs of a candidate on each noise case."""
    seed: int
    """Of the search; the runs have a seed that follows from it, see `search_seed`."""

    def __post_init__(self) -> None:
        """Refuse a search that cannot be made."""
        require("runs", self.runs, 1, 10**6, whole=True)
        require("seed", self.seed, 0, SEEDS - 1, whole=True)
        if not self.space:
            raise UprightError(f"there is no setting of {self.cases[0].agent} to search")

    def key(self) -> dict[str, Any]:
        """Return all that determines what a candidate is worth, as JSON knows it."""
        case = self.cases[0]
        values = case.as_data() | {
            "label": None,
            "task": [each.spec.as_data() for each in self.cases],
            "space": [list(each) for each in self.space],
            "runs": self.runs,
            "seed": self.seed,
            "rule": fingerprint(case.agent, case.plant.name),
        }
        written: dict[str, Any] = json.loads(json.dumps(values))
        return written

    def settings(self, trial: Any) -> Settings:
        """Return the settings that a trial of Optuna stands for."""
        if START in trial.user_attrs:
            return self.cases[0].settings
        changes = {each.setting: each.value(trial.params[each.label]) for each in self.space}
        return replace(self.cases[0].settings, **changes)

    def cases_of(self, settings: Settings) -> list[Case]:
        """Return the cases with other settings."""
        return [replace(case, label="candidate", settings=settings) for case in self.cases]


class SearchProgress(NamedTuple):
    """How far a search is."""

    finished: int
    """Candidates that were measured or given up."""
    batch: int
    """Parts of the runs of the present candidate that are made."""
    best: float | None
    """Mean trials of the best candidate; None while there is none."""


class SearchResult(NamedTuple):
    """What a search found."""

    settings: Settings
    """The best settings."""
    mean_trials: float
    """What they reached on the runs they were chosen by: the optimist's figure."""
    candidates: int
    """How many were tried."""
    given_up: int
    """How many of them were not measured to the end."""


def search(
    wanted: Search,
    candidates: int,
    path: Path | str,
    on_progress: Callable[[SearchProgress], None] = lambda _standing: None,
    executor: Executor | None = None,
) -> SearchResult:
    """Try candidates until the store holds as many as wanted, and return the best.

    Parameters
    ----------
    wanted
        What to search.
    candidates
        How many to try in all, those in the store included. The first is the settings to begin
        with.
    path
        SQLite database of Optuna where each candidate is written as it ends; made if missing, but
        for its folder. ``optuna-dashboard`` shows it.
    on_progress
        Told of every part of a candidate as it ends.
    executor
        Where to make the runs; a thread for every core unless given.

    Raises
    ------
    UprightError
        If Optuna is missing, or the store cannot be used, or holds another search.
    KeyboardInterrupt
        If interrupted; the candidates that had ended are in the store.
    """
    require("candidates", candidates, 1, 10**6, whole=True)
    optuna = require_optuna()
    with hold_interrupts(), _opened(wanted, path) as found:
        finished = _finished(found)
        while len(finished) < candidates:
            found.sampler = _sampler(wanted.seed, len(finished))
            if not finished:
                _begin_with_start(wanted, found)
            trial = found.ask({each.label: each.distribution() for each in wanted.space})
            try:
                on_progress(SearchProgress(len(finished), 0, _best(finished)))
                value = _measure(wanted, trial, finished, on_progress, executor)
            except BaseException:
                found.tell(trial, state=optuna.trial.TrialState.FAIL)
                raise
            state = optuna.trial.TrialState
            found.tell(trial, value, state.PRUNED if value is None else state.COMPLETE)
            finished = _finished(found)
        on_progress(SearchProgress(len(finished), 0, _best(finished)))
        state = optuna.trial.TrialState
        if not found.get_trials(deepcopy=False, states=(state.COMPLETE,)):
            raise UprightError("none of the candidates is allowed; name other settings to search")
        best = found.best_trial
        return SearchResult(
            settings=wanted.settings(best),
            mean_trials=float(best.values[0]),
            candidates=len(finished),
            given_up=sum(each.state == state.PRUNED for each in finished),
        )


def place_for(agent: str) -> str:
    """Return the usual name of the store of an agent's search."""
    name = re.sub(r"[^\w-]+", "-", agent)
    return f"tune-{name}.sqlite"


def require_optuna() -> Any:
    """Return the module, quiet.

    Raises
    ------
    UprightError
        If it is not installed.
    """
    optuna = require_module("optuna", "tuning needs Optuna", "tune")
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    return optuna


def _sampler(seed: int, finished: int) -> Any:
    """Return a sampler that knows nothing of the candidates this process has drawn before.

    Optuna does not store a sampler's state. With a sampler for each candidate, seeded by its place,
    an interrupted search goes on as if it had not been interrupted.
    """
    import optuna

    place = np.random.SeedSequence(seed, spawn_key=(finished,))
    return optuna.samplers.TPESampler(
        seed=int(place.generate_state(1)[0]),
        constant_liar=False,  # a candidate that was interrupted must leave no trace
    )


@contextmanager
def _opened(wanted: Search, path: Path | str) -> Iterator[Any]:
    """Open a store, new or of the same search."""
    import optuna
    from sqlalchemy.exc import SQLAlchemyError

    _check_store(path)
    storage = None
    try:
        storage = optuna.storages.RDBStorage(f"sqlite:///{path}", {"connect_args": {"timeout": 60}})
        found = optuna.create_study(
            storage=storage,
            study_name="upright",
            load_if_exists=True,
            pruner=optuna.pruners.MedianPruner(),
        )
        _check_same(wanted, found, path)
        yield found
    except (SQLAlchemyError, optuna.exceptions.StorageInternalError) as error:
        why = str(error).splitlines()[0]
        raise UprightError(f"store is {str(path)!r}; it cannot be used: {why}") from None
    finally:
        if storage is not None:
            storage.remove_session()
            storage.engine.dispose()


def _check_store(path: Path | str) -> None:
    """Raise UprightError unless a path is that of a database of Optuna, or of none yet."""
    if not Path(path).parent.is_dir():
        raise UprightError(f"store is {str(path)!r}; its folder does not exist")
    if not Path(path).exists():
        return
    try:
        with closing(sqlite3.connect(path)) as database:
            rows = database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
            tables = {name for (name,) in rows}
    except sqlite3.Error as error:
        raise UprightError(f"store is {str(path)!r}; it cannot be used: {error}") from None
    if tables and not {"studies", "trials"} <= tables:
        raise UprightError(f"store is {str(path)!r}; it is a database of another program")


def _check_same(wanted: Search, found: Any, path: Path | str) -> None:
    """Write down what is searched, or raise UprightError if it is not what was written."""
    key = wanted.key()
    held = found.user_attrs.get("upright")
    if held is None and not found.trials:
        found.set_user_attr("upright", key)
    elif held != key:
        held = held or {}
        names = ", ".join(name for name in key if held.get(name) != key[name])
        why = f"it holds another search, which differs in: {names}; name another file"
        raise UprightError(f"store is {str(path)!r}; {why}")


def _finished(found: Any) -> list[Any]:
    """Return the candidates that were measured or given up, in order."""
    import optuna

    state = optuna.trial.TrialState
    trials: list[Any] = found.get_trials(deepcopy=False, states=(state.COMPLETE, state.PRUNED))
    return trials


def _best(finished: Sequence[Any]) -> float | None:
    complete = [each.values[0] for each in finished if each.state.name == "COMPLETE"]
    return min(complete, default=None)


def _begin_with_start(wanted: Search, found: Any) -> None:
    """Make the settings to begin with the first candidate, if they lie in the space."""
    import optuna

    start = wanted.cases[0].settings
    drawn = {each.label: each.drawn(getattr(start, each.setting)) for each in wanted.space}
    waiting = found.get_trials(deepcopy=False, states=(optuna.trial.TrialState.WAITING,))
    if None not in drawn.values() and not waiting:
        found.enqueue_trial(drawn, {START: True})


def _measure(
    wanted: Search,
    trial: Any,
    finished: Sequence[Any],
    on_progress: Callable[[SearchProgress], None],
    executor: Executor | None,
) -> float | None:
    """Return a candidate's mean trials; None if it was given up."""
    try:
        settings = wanted.settings(trial)
    except ValueError:  # values that are allowed each, but not together
        return None
    cases = wanted.cases_of(settings)
    seed = search_seed(wanted.seed)
    with Store() as store:
        for batch in range(BATCHES):
            runs = -(-wanted.runs * (batch + 1) // BATCHES)
            study(cases, runs, seed, store, executor=executor)
            mean = float(np.mean(_trials(cases, store, seed)))
            trial.report(mean, batch)
            on_progress(SearchProgress(len(finished), batch + 1, _best(finished)))
            if batch < BATCHES - 1 and trial.should_prune():
                return None
    return mean


def _trials(cases: Sequence[Case], store: Store, seed: int) -> np.ndarray:
    """Return the trials of every run; a failed one has made all it was allowed."""
    return np.array([r.trials for case in cases for r in store.results(case.key, seed)])


# ------------------------------------------------------------------------------ what it is worth


class Validation(NamedTuple):
    """What settings reach on fresh runs."""

    mean_trials: float
    """Over all runs, a failed one counted as all the trials it was allowed."""
    ci95: tuple[float, float]
    """Its 95 % interval."""
    successes: int
    """How many runs succeeded."""
    runs: int
    """Of how many."""


def validate(
    wanted: Search,
    settings: Settings,
    runs: int,
    make: Callable[[list[Case], int, int, Store], object] = study,
) -> tuple[Validation, Validation]:
    """Measure settings, and those a search began with, on runs that no candidate has seen.

    Parameters
    ----------
    wanted
        What was searched.
    settings
        What was found.
    runs
        Runs on each noise case.
    make
        Makes the studies: `study.study`, or another that shows how far it is.
    """
    tuned = wanted.cases_of(settings)
    start = wanted.cases_of(wanted.cases[0].settings)
    seed = validation_seed(wanted.seed)
    with Store() as store:
        make(tuned if tuned == start else tuned + start, runs, seed, store)
        return _worth(tuned, store, seed), _worth(start, store, seed)


def _worth(cases: list[Case], store: Store, seed: int) -> Validation:
    trials = _trials(cases, store, seed)
    successes = sum(r.success for case in cases for r in store.results(case.key, seed))
    return Validation(float(trials.mean()), bootstrap_interval(trials), successes, len(trials))


def describe(
    wanted: Search, found: SearchResult, worths: tuple[Validation, Validation], label: str
) -> str:
    """Return for people what was found, in forms that can be used again.

    Parameters
    ----------
    label
        Name of the settings that `upright learn` is to change.
    """
    case, settings = wanted.cases[0], found.settings
    tuned, start = (
        f"{worth.mean_trials:8.1f} [{worth.ci95[0]:.1f}, {worth.ci95[1]:.1f}], "
        f"{worth.successes} of {worth.runs} runs succeeded"
        for worth in worths
    )
    learn = [f"upright learn {case.agent}"]
    learn += [f"--settings {label}"] if label != "default" else []
    learn += as_options(settings, AGENTS.settings(case.agent)[label])
    lines = [
        f"best of {found.candidates} candidates ({found.given_up} given up early), "
        f"chosen by {found.mean_trials:.1f} trials on {wanted.runs} runs a case;",
        f"on fresh runs, a failed one counted as {case.spec.trials:,}: mean trials [95 % interval]",
        f"  found   {tuned}",
        f"  before  {start}",
    ]
    if worths[0].mean_trials >= worths[1].mean_trials:
        lines.append("What was found is no better than what there was.")
    lines += ["", " ".join(learn), "", as_python(settings)]
    return "\n".join(lines)


def as_options(settings: Settings, start: Settings) -> list[str]:
    """Return what `upright learn` has to be told to change one into the other."""
    options = []
    for name, value in _differences(settings, start).items():
        options.append(f"--set '{name}={value}'" if " " in str(value) else f"--set {name}={value}")
    return options


def as_python(settings: Settings) -> str:
    """Return the call that makes the settings."""
    kind = type(settings)
    changed = (
        f"{field.name}={getattr(settings, field.name)!r}"
        for field in fields(settings)
        if getattr(settings, field.name) != field.default
    )
    call = f"{kind.__name__}({', '.join(changed)})"
    return f"from {kind.__module__} import {kind.__name__}\n\n{call}"


def _differences(settings: Settings, start: Settings) -> dict[str, Any]:
    return {
        name: value for name, value in values_of(settings).items() if value != getattr(start, name)
    }
