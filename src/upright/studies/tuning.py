"""Searches for better settings of an agent, with Optuna.

The objective is the mean number of trials over all runs and the chosen noise cases, where a failed
run counts as the maximum number of trials. Candidates are proposed by a tree-structured Parzen
estimator; a candidate is pruned if, after a part of its runs, it does worse than the median of the
previous ones. The search space is derived from the settings class: see `search_space.py`.

The best of many candidates was partly lucky on the runs it was chosen by. Therefore the settings
found, and those that the search started from, are measured again on runs that no candidate has
seen.

The same seed gives the same search, whatever the number of cores, and also if the search is
interrupted and resumed (with the same version of Optuna): a candidate depends only on the seed and
on the candidates finished before it. Processes that search the same store take turns, a candidate
each, as every one of them uses all cores.
"""

import json
import re
import sqlite3
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from upright import __version__
from upright.agents import AGENTS, Settings
from upright.core.parameters import changed_parameters
from upright.errors import AgentWarning, UprightError, require, require_module
from upright.plants import PLANTS
from upright.studies.case import Case
from upright.studies.database import check_place, is_there
from upright.studies.executors import AnyExecutor
from upright.studies.intervals import bootstrap_interval
from upright.studies.run import DIVERGED
from upright.studies.search_space import Range
from upright.studies.settings_file import settings_text
from upright.studies.store import Store
from upright.studies.study import make_missing_runs
from upright.support.files import creating
from upright.support.interrupts import hold_interrupts
from upright.support.locks import locked
from upright.support.settings import as_options, changed_values
from upright.support.words import count

SEEDS = 10**6
"""Seeds below this are for tables. No settings are chosen by runs with such a seed, so every table
shows fresh runs.
"""
BATCHES = 5
"""Number of batches that a candidate's runs are split into; it may be pruned after each."""
START = "start"
"""Marks the candidate that has exactly the settings that the search started from."""


def search_seed(seed: int) -> int:
    """Return the seed of the runs that candidates are compared on."""
    return SEEDS + seed


def validation_seed(seed: int) -> int:
    """Return the seed of the runs that only the best candidate is measured on."""
    return 2 * SEEDS + seed


# ------------------------------------------------------------------------------ the search


@dataclass(frozen=True)
class Search:
    """The plan of a search: everything that determines it except its length."""

    cases: tuple[Case, ...]
    """The agent with the settings to start from, on the noise cases to optimise for."""
    space: tuple[Range, ...]
    """The settings that are varied, with their ranges."""
    runs: int
    """Runs of a candidate on each noise case."""
    seed: int
    """Seed of the search; that of the runs follows from it, see `search_seed`."""

    def __post_init__(self) -> None:
        """Refuse an impossible search."""
        require("runs", self.runs, 1, 10**6, whole=True)
        require("seed", self.seed, 0, SEEDS - 1, whole=True)
        if not self.space:
            raise UprightError(f"there is no setting of {self.cases[0].agent} to search")

    def key(self) -> dict[str, Any]:
        """Return all that determines the result of a candidate, as data for JSON."""
        first = self.cases[0]
        values = first.as_data() | {
            "label": None,
            "task": [case.spec.as_data() for case in self.cases],
            "space": [list(range_) for range_ in self.space],
            "runs": self.runs,
            "seed": self.seed,
            "rule": first.rule,
        }
        plain: dict[str, Any] = json.loads(json.dumps(values))
        return plain

    def settings(self, trial: Any) -> Settings:
        """Return the settings that a trial of Optuna stands for."""
        if START in trial.user_attrs:
            return self.cases[0].settings
        changes = {
            range_.setting: range_.value(trial.params[range_.label]) for range_ in self.space
        }
        return replace(self.cases[0].settings, **changes)

    def cases_of(self, settings: Settings) -> list[Case]:
        """Return the cases with other settings."""
        return [replace(case, label="candidate", settings=settings) for case in self.cases]


class SearchProgress(NamedTuple):
    """The progress of a search."""

    finished: int
    """Candidates that were measured or pruned."""
    batch: int
    """Batches of the present candidate's runs that are finished."""
    best: float | None
    """Mean trials of the best candidate so far; None while there is none."""


class SearchResult(NamedTuple):
    """The result of a search."""

    settings: Settings
    """The best settings."""
    mean_trials: float
    """Their mean trials on the runs they were chosen by, which is too optimistic."""
    candidates: int
    """Number of candidates."""
    pruned: int
    """Number of candidates that were not measured to the end."""


def search(
    plan: Search,
    candidates: int,
    path: Path | str,
    on_progress: Callable[[SearchProgress], None] = lambda _progress: None,
    executor: AnyExecutor = None,
) -> SearchResult:
    """Try candidates until the store holds the given number of them, and return the best.

    Parameters
    ----------
    plan
        What to search.
    candidates
        Total number of candidates, including those in the store. The first has the settings that
        the search starts from.
    path
        Path of Optuna's SQLite database, where each candidate is stored as it ends; created if
        missing (its folder must exist). ``optuna-dashboard`` displays it.
    on_progress
        Called after every batch of a candidate's runs.
    executor
        Where to make the runs, as for `study.study`.

    Raises
    ------
    UprightError
        If Optuna is missing, or the store cannot be used or holds another search.
    KeyboardInterrupt
        If interrupted; the candidates that have ended are in the store.
    """
    require("candidates", candidates, 1, 10**6, whole=True)
    optuna = require_optuna()
    state = optuna.trial.TrialState
    with hold_interrupts(), _opened(plan, path) as optuna_study:
        while len(finished := _finished(optuna_study)) < candidates:
            on_progress(SearchProgress(len(finished), 0, _best(finished)))
            with locked(path):
                finished = _finished(optuna_study)  # another process may have tried one meanwhile
                if len(finished) < candidates:
                    _try_one(plan, optuna_study, finished, on_progress, executor)
        on_progress(SearchProgress(len(finished), 0, _best(finished)))
        if not optuna_study.get_trials(deepcopy=False, states=(state.COMPLETE,)):
            raise UprightError("none of the candidates is allowed; name other settings to search")
        best = optuna_study.best_trial
        return SearchResult(
            settings=plan.settings(best),
            mean_trials=float(best.values[0]),
            candidates=len(finished),
            pruned=sum(trial.state == state.PRUNED for trial in finished),
        )


def _try_one(
    plan: Search,
    optuna_study: Any,
    finished: Sequence[Any],
    on_progress: Callable[[SearchProgress], None],
    executor: AnyExecutor,
) -> None:
    """Measure the next candidate, and store what came out of it."""
    import optuna

    state = optuna.trial.TrialState
    optuna_study.sampler = _sampler(plan.seed, len(finished))
    if not finished:
        _begin_with_start(plan, optuna_study)
    distributions = {range_.label: range_.distribution() for range_ in plan.space}
    trial = optuna_study.ask(distributions)
    try:
        value = _measure(plan, trial, finished, on_progress, executor)
    except BaseException:
        optuna_study.tell(trial, state=state.FAIL)
        raise
    optuna_study.tell(trial, value, state.PRUNED if value is None else state.COMPLETE)


def place_for(agent: str) -> str:
    """Return the default name of the store of an agent's search."""
    name = re.sub(r"[^\w-]+", "-", agent)
    return f"tune-{name}.sqlite"


def require_optuna() -> Any:
    """Return the module optuna, with its log messages disabled.

    Raises
    ------
    UprightError
        If it is not installed.
    """
    optuna = require_module("optuna", "tuning needs Optuna", "tune")
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    return optuna


def _sampler(seed: int, finished: int) -> Any:
    """Return a sampler that does not depend on what this process has drawn before.

    Optuna does not store a sampler's state. With a new sampler for each candidate, seeded by the
    candidate's number, an interrupted search continues as if it had not been interrupted.
    """
    import optuna

    sequence = np.random.SeedSequence(seed, spawn_key=(finished,))
    return optuna.samplers.TPESampler(
        seed=int(sequence.generate_state(1)[0]),
        constant_liar=False,  # an interrupted candidate must leave no trace
    )


@contextmanager
def _opened(plan: Search, path: Path | str) -> Iterator[Any]:
    """Open a store, which is new or holds the same search; yield Optuna's study."""
    is_ready = _check_store(path)
    if not is_there(path):
        with creating(path) as part, _opened_study(part, path) as optuna_study:
            _check_same(plan, optuna_study, path)
    with ExitStack() as opened:
        with ExitStack() as alone:
            if not is_ready:  # an empty file, into which several processes may put tables
                alone.enter_context(locked(path))
            optuna_study = opened.enter_context(_opened_study(Path(path), path))
            _check_same(plan, optuna_study, path)
        yield optuna_study


@contextmanager
def _opened_study(file: Path, path: Path | str) -> Iterator[Any]:
    """Yield the study of Optuna that a file holds, or a new one in it; errors name the path.

    Optuna creates its tables one by one, and fails if another process does so in the same file.
    """
    import optuna
    from sqlalchemy.exc import SQLAlchemyError
    from sqlalchemy.pool import QueuePool

    # Not by a URL, in which some characters of a name mean something else.
    opening = {"creator": lambda: _connect(file), "poolclass": QueuePool}
    storage = None
    try:
        storage = optuna.storages.RDBStorage("sqlite://", opening)
        optuna_study = optuna.create_study(
            storage=storage,
            study_name="upright",
            load_if_exists=True,
            pruner=optuna.pruners.MedianPruner(),
        )
        _check_values(optuna_study, path)
        yield optuna_study
    except (SQLAlchemyError, sqlite3.Error, optuna.exceptions.StorageInternalError) as error:
        why = str(error).splitlines()[0]
        raise UprightError(f"store is {str(path)!r}; it cannot be used: {why}") from None
    finally:
        if storage is not None:
            storage.remove_session()
            storage.engine.dispose()


def _check_values(optuna_study: Any, path: Path | str) -> None:
    """Raise UprightError if Optuna cannot read what a store holds."""
    try:
        optuna_study.get_trials(deepcopy=False)
        optuna_study.user_attrs  # noqa: B018 - it reads them
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        why = str(error).partition("\n")[0]
        raise UprightError(f"store is {str(path)!r}; it is damaged: {why}") from None


def _connect(file: Path | str) -> sqlite3.Connection:
    """Open a database, whatever its name: SQLite gives some names that are not paths a meaning."""
    return sqlite3.connect(Path(file).absolute(), timeout=60, check_same_thread=False)


def _check_store(path: Path | str) -> bool:
    """Return whether a file holds a database of Optuna; False if it is empty or missing.

    Raises
    ------
    UprightError
        If it is anything else.
    """
    if Path(path).is_dir():
        raise UprightError(f"store is {str(path)!r}; it is a folder, a file is needed")
    if not is_there(path):
        check_place(path)
        return False
    try:
        with closing(_connect(path)) as database:
            rows = database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
            tables = {name for (name,) in rows}
    except sqlite3.Error as error:
        raise UprightError(f"store is {str(path)!r}; it cannot be used: {error}") from None
    if tables and not {"studies", "trials"} <= tables:
        raise UprightError(f"store is {str(path)!r}; it is a database of another program")
    return bool(tables)


def _check_same(plan: Search, optuna_study: Any, path: Path | str) -> None:
    """Store the plan of a new search; raise UprightError if the store holds another plan."""
    key = plan.key()
    stored = optuna_study.user_attrs.get("upright")
    if stored is None and not optuna_study.trials:
        optuna_study.set_user_attr("upright", key)
    elif stored != key:
        stored = stored if isinstance(stored, dict) else {}
        names = ", ".join(name for name in key if stored.get(name) != key[name])
        why = f"it holds another search, which differs in: {names}; name another file"
        raise UprightError(f"store is {str(path)!r}; {why}")


def _finished(optuna_study: Any) -> list[Any]:
    """Return the candidates that were measured or pruned, in order."""
    import optuna

    states = (optuna.trial.TrialState.COMPLETE, optuna.trial.TrialState.PRUNED)
    trials: list[Any] = optuna_study.get_trials(deepcopy=False, states=states)
    return trials


def _best(finished: Sequence[Any]) -> float | None:
    complete = [trial.values[0] for trial in finished if trial.state.name == "COMPLETE"]
    return min(complete, default=None)


def _begin_with_start(plan: Search, optuna_study: Any) -> None:
    """Make the settings to start from the first candidate, if they are in the search space."""
    import optuna

    start = plan.cases[0].settings
    drawn = {range_.label: range_.drawn(getattr(start, range_.setting)) for range_ in plan.space}
    waiting = optuna_study.get_trials(deepcopy=False, states=(optuna.trial.TrialState.WAITING,))
    if None not in drawn.values() and not waiting:
        optuna_study.enqueue_trial(drawn, {START: True})


def _measure(
    plan: Search,
    trial: Any,
    finished: Sequence[Any],
    on_progress: Callable[[SearchProgress], None],
    executor: AnyExecutor,
) -> float | None:
    """Return a candidate's mean trials; None if it was pruned."""
    try:
        settings = plan.settings(trial)
    except ValueError:  # each value is allowed, but not their combination
        return None
    cases = plan.cases_of(settings)
    seed = search_seed(plan.seed)
    with Store() as store, warnings.catch_warnings():
        warnings.filterwarnings("ignore", f".*{DIVERGED}", AgentWarning)  # some candidates will
        for batch in range(BATCHES):
            runs = -(-plan.runs * (batch + 1) // BATCHES)
            make_missing_runs(cases, runs, seed, store, executor=executor)
            mean = float(np.mean(_trials(cases, store, seed)))
            trial.report(mean, batch)
            on_progress(SearchProgress(len(finished), batch + 1, _best(finished)))
            if batch < BATCHES - 1 and trial.should_prune():
                return None
    return mean


def _trials(cases: Sequence[Case], store: Store, seed: int) -> np.ndarray:
    """Return the number of trials of every run; a failed run has made the maximum number."""
    return np.concatenate([store.outcomes(case.key, seed).trials for case in cases])


# ------------------------------------------------------------------------------ validation


class Validation(NamedTuple):
    """The results of settings on fresh runs."""

    mean_trials: float
    """Mean over all runs, where a failed run counts as the maximum number of trials."""
    ci95: tuple[float, float]
    """Its 95 % interval."""
    successes: int
    """Number of runs that succeeded."""
    runs: int
    """Number of runs."""


class Comparison(NamedTuple):
    """The settings found beside those that the search started from, on fresh runs."""

    tuned: Validation
    """The results of the settings found."""
    original: Validation
    """The results of the settings that the search started from."""
    gain: float
    """Mean of the differences in trials of runs of the same case and number: original - tuned."""
    gain_ci95: tuple[float, float]
    """Its 95 % interval (bootstrap over these pairs)."""

    def verdict(self) -> str:
        """Return one sentence: whether a difference can be shown."""
        low, high = self.gain_ci95
        digits = 2 if max(abs(low), abs(high)) < 2 else 1
        if low == high == 0:
            return "The tuned settings need as many trials as the original ones in every run."
        if low <= 0 <= high:
            ends = f"{low:+.{digits}f}, {high:+.{digits}f}"
            return (
                "No difference between the tuned and the original settings can be shown: "
                f"{self.gain:+.{digits}f} trials [{ends}]."
            )
        low, high = sorted((abs(low), abs(high)))
        ends = f"{low:.{digits}f}, {high:.{digits}f}"
        word = "better" if self.gain > 0 else "worse"
        return f"The tuned settings are {word} by {abs(self.gain):.{digits}f} trials [{ends}]."


def validate(
    plan: Search,
    settings: Settings,
    runs: int,
    make: Callable[[list[Case], int, int, Store], object] = make_missing_runs,
) -> Comparison:
    """Measure settings, and those a search started from, on runs that no candidate has seen.

    Parameters
    ----------
    plan
        What was searched.
    settings
        The settings found.
    runs
        Runs on each noise case.
    make
        Makes the runs: `study.make_missing_runs`, or a variant that shows its progress.
    """
    tuned = plan.cases_of(settings)
    start = plan.cases_of(plan.cases[0].settings)
    seed = validation_seed(plan.seed)
    with Store() as store:
        make(tuned if tuned == start else tuned + start, runs, seed, store)
        # Both settings draw the same starts in the first trial of a run, so runs are pairs.
        gains = _trials(start, store, seed) - _trials(tuned, store, seed)
        return Comparison(
            _validation(tuned, store, seed),
            _validation(start, store, seed),
            float(gains.mean()),
            bootstrap_interval(gains),
        )


def _validation(cases: list[Case], store: Store, seed: int) -> Validation:
    trials = _trials(cases, store, seed)
    successes = sum(int(store.outcomes(case.key, seed).success.sum()) for case in cases)
    return Validation(float(trials.mean()), bootstrap_interval(trials), successes, len(trials))


def describe(plan: Search, result: SearchResult, compared: Comparison, label: str) -> str:
    """Return a report of a search, with the settings as a command and as Python code.

    Parameters
    ----------
    plan
        What was searched.
    result
        What was found.
    compared
        The return value of `validate`.
    label
        Name of the settings that the options of `upright learn` change.
    """
    case, settings = plan.cases[0], result.settings
    tuned, original = (
        f"{validation.mean_trials:8.1f} [{validation.ci95[0]:.1f}, {validation.ci95[1]:.1f}], "
        f"{validation.successes} of {count(validation.runs, 'run')} succeeded"
        for validation in compared[:2]
    )
    learn = [f"upright learn {case.agent}"]
    learn += [f"--settings {label}"] if label != "default" else []
    learn += as_options("--set", changed_values(AGENTS.settings(case.agent)[label], settings))
    learn += as_options("--parameter", changed_parameters(case.spec.parameters))
    learn += [f"--plant {case.plant.name}"] if case.plant.name != "equations" else []
    learn += as_options("--plant-set", _plant_changes(case))
    same = settings == case.settings
    lines = [
        f"best of {count(result.candidates, 'candidate')} ({result.pruned} pruned), "
        f"chosen by {result.mean_trials:.1f} mean trials over {count(plan.runs, 'run')} per case",
        "mean trials [95 % interval] on fresh runs, "
        f"where a failed run counts as {case.spec.trials:,}:",
        f"  tuned     {tuned}",
        f"  original  {original}",
        "The best settings are the original ones." if same else compared.verdict(),
    ]
    lines += ["", " ".join(learn), "", as_python(settings)]
    return "\n".join(lines)


def result_text(plan: Search, result: SearchResult, compared: Comparison) -> str:
    """Return the content of a file with the settings found and how they were found.

    Parameters are those of `describe`.
    """
    task = plan.cases[0].spec.as_data()
    found = {
        "version": __version__,
        "searched": [range_.setting for range_ in plan.space],
        "candidates": result.candidates,
        "runs": plan.runs,
        "seed": plan.seed,
        "noises": [case.spec.noise for case in plan.cases],
        **{name: task[name] for name in ("start", "condition", "steps", "trials")},
        "parameters": [f"{name}={value}" for name, value in task["parameters"].items()],
        "plant": plan.cases[0].plant.name,
        "plant_settings": [f"{n}={value}" for n, value in _plant_changes(plan.cases[0]).items()],
        "fresh_runs": compared.tuned.runs,
        "mean_trials": round(compared.tuned.mean_trials, 3),
        "mean_trials_ci95": [round(end, 3) for end in compared.tuned.ci95],
        "original_mean_trials": round(compared.original.mean_trials, 3),
        "original_mean_trials_ci95": [round(end, 3) for end in compared.original.ci95],
        "gain": round(compared.gain, 3),
        "gain_ci95": [round(end, 3) for end in compared.gain_ci95],
    }
    return settings_text(plan.cases[0].agent, result.settings, found)


def _plant_changes(case: Case) -> dict[str, Any]:
    """Return the settings of a case's plant that differ from the default ones."""
    return changed_values(PLANTS.default(case.plant.name), case.plant)


def as_python(settings: Settings) -> str:
    """Return Python code that makes the settings."""
    kind = type(settings)
    changed = (
        f"{field.name}={getattr(settings, field.name)!r}"
        for field in fields(settings)
        if getattr(settings, field.name) != field.default
    )
    call = f"{kind.__name__}({', '.join(changed)})"
    return f"from {kind.__module__} import {kind.__name__}\n\n{call}"
