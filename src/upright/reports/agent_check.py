"""Checks of a custom agent: whether it keeps to the contract, repeats its runs, and learns.

The checks come one after the other, the quick ones first. Their random numbers come from a seed
that tables do not use, so that an agent may be changed until it passes, and measured afterwards.
"""

import multiprocessing
import pickle
import random
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from enum import StrEnum
from threading import Timer
from typing import Any

import numpy as np

from upright import __version__
from upright.agents.checks.contract import METHODS, is_learner
from upright.core.compiled import is_compiled
from upright.core.trials import Result
from upright.errors import AgentError, UprightError
from upright.reports.comparison import GUESSING
from upright.reports.statistics import Row, summarise
from upright.studies.case import Case, make_case
from upright.studies.learned import check_policy
from upright.studies.random_streams import random_numbers
from upright.studies.run import make_run
from upright.studies.study import study
from upright.studies.trace import Trace, trace, trace_elsewhere
from upright.support.processes import process_pool
from upright.support.words import count

FORMAT, VERSION = "upright check", 1
"""What a report says it is when it is written as data, and the version of its form."""
SEED = 1_000_000
"""Seed of all checks; those of tables are smaller."""
GUESSING_RUNS = 100
"""Number of runs of the agent that guesses."""
PROBE_STEPS, PROBE_TRIALS, PROBE_SECONDS = 500, 10, 1.0
"""Runs that are compared with each other: their size, and the time for one, which may reduce it."""
STUDY_STEPS, STUDY_TRIALS, STUDY_RUNS, STUDY_SECONDS = 5_000, 100, 20, 8.0
"""The study: its size, and the time for it, which may reduce it."""
FEWEST_STEPS, FEWEST_TRIALS, FEWEST_RUNS = 50, 2, 5
"""Sizes that are not reduced further. A study of fewer runs gives no verdict."""
PATIENCE = 60.0
"""How long the other process may take [s]."""
SLOW = 10_000
"""An agent that makes fewer steps a second makes studies tedious."""


class Outcome(StrEnum):
    """How a check ended."""

    PASSED = "passed"
    FAILED = "failed"
    NOTED = "noted"
    """Nothing that must be mended, but worth knowing."""
    SKIPPED = "skipped"


class Verdict(StrEnum):
    """How an agent compares with guessing."""

    FASTER = "faster"
    SIMILAR = "similar"
    SLOWER = "slower"


@dataclass(frozen=True)
class Finding:
    """What a check found."""

    check: str
    """Name of the check."""
    outcome: Outcome
    """How it ended."""
    text: str
    """What was found, in a sentence; the traceback of the agent's own code may follow."""
    advice: str = ""
    """What to do about it, in a sentence."""
    figures: dict[str, Any] = field(default_factory=dict)
    """What was measured, as data."""
    raised: bool = False
    """Whether the agent's code raised an exception."""


@dataclass(frozen=True)
class Report:
    """All that the checks of an agent found."""

    agent: str
    """Name of the agent."""
    findings: Sequence[Finding]
    """What each check found. Checks that others made impossible are absent."""

    @property
    def failed(self) -> list[str]:
        """The checks that failed."""
        return [each.check for each in self.findings if each.outcome is Outcome.FAILED]

    @property
    def raised(self) -> bool:
        """Whether the agent's code raised an exception."""
        return any(each.raised for each in self.findings)

    @property
    def verdict(self) -> str | None:
        """How the agent compares with guessing; None if that is not known."""
        found = [each.figures.get("verdict") for each in self.findings if each.check == "study"]
        return found[0] if found else None

    def as_data(self) -> dict[str, Any]:
        """Return the report as data for JSON."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "upright": __version__,
            "agent": self.agent,
            "passed": not self.failed,
            "raised": self.raised,
            "verdict": self.verdict,
            "checks": {
                each.check: {
                    "outcome": str(each.outcome),
                    "text": each.text,
                    "advice": each.advice,
                    "figures": each.figures,
                }
                for each in self.findings
            },
        }


def check_agent(agent: str, show: Callable[[str], None]) -> Iterator[Finding]:
    """Try an agent, and yield what each check finds.

    Parameters
    ----------
    agent
        Name of a custom agent.
    show
        Called with what is being tried.

    Raises
    ------
    UprightError
        If there is no agent of this name.
    """
    stage = "contract"
    try:
        show("creating the agent")
        case = make_case(agent, steps=FEWEST_STEPS, trials=FEWEST_TRIALS)
        yield _contract(case)
        stage = "run"
        show("letting it run")
        trace(case, SEED)  # which compiles what it needs
        _, first = trace(case, SEED)
        case = _sized(case, first.speed)
        trained, first = trace(case, SEED)
        yield _run(case, first)
        yield _actions(trained, first)
        yield Finding("numbers", Outcome.PASSED, "no number that it holds became NaN")
        stage = "same-seed"
        show("repeating the run, also in another process")
        repeated = list(_repetition(case, first))
        yield from repeated
        yield _learning(case, trained)
        yield _saving(case)
        stage = "study"
        shares = any(
            each.check == "shared-state" and each.outcome is Outcome.FAILED for each in repeated
        )
        yield from _study(case, first.speed, show, independent=not shares)
    except AgentError as error:
        yield _failure(agent, error, stage)


# ------------------------------------------------------------------------------ one run


def _failure(agent: str, error: AgentError, stage: str) -> Finding:
    """Return what an error says about the check that its stage of the checks is, or another."""
    text = str(error).removeprefix(f"agent is {agent!r}; ")
    line = text.partition("\n")[0]
    compiles = "it cannot be compiled" not in line
    if not compiles:
        check = "contract"
    elif stage == "run" and error.__cause__ is None:
        check = "numbers" if " is NaN " in line else "actions" if "act return" in line else stage
    else:
        check = stage
    raised = compiles and error.__cause__ is not None
    advice = "the lines of your file that led there stand below" if raised else ""
    return Finding(check, Outcome.FAILED, text, advice, raised=raised)


def _contract(case: Case) -> Finding:
    agent = _new(case)
    kind = "learner" if is_learner(agent) else "compiled" if is_compiled(agent) else "plain"
    text = {
        "learner": "a learner that only knows Gymnasium, with train(env)",
        "compiled": f"a compiled agent with {', '.join(METHODS)}",
        "plain": f"an agent in plain Python with {', '.join(METHODS)}",
    }[kind]
    return Finding(
        "contract", Outcome.PASSED, f"created from rng alone: {text}", figures={"kind": kind}
    )


def _new(case: Case) -> Any:
    """Return a new agent with the random numbers of the first run."""
    return case.settings.agent(random_numbers(SEED, 0))


def _sized(case: Case, speed: float) -> Case:
    """Return the case of runs to compare, as large as its steps per second allow."""
    steps = max(FEWEST_STEPS, min(PROBE_STEPS, int(speed * PROBE_SECONDS)))
    trials = max(FEWEST_TRIALS, min(PROBE_TRIALS, int(speed * PROBE_SECONDS / steps)))
    return replace(case, spec=replace(case.spec, steps=steps, trials=trials))


def _run(case: Case, first: Trace) -> Finding:
    trials = count(len(first.lengths), "trial")
    text = f"{trials} of at most {case.spec.steps} steps ended without an error"
    return Finding("run", Outcome.PASSED, text, figures={"lengths": list(first.lengths)})


def _actions(agent: Any, first: Trace) -> Finding:
    """Return what is found about actions; wrong ones have ended the run before this."""
    if is_learner(agent):
        text = "the environment checks the actions of a learner that only knows Gymnasium"
        return Finding("actions", Outcome.SKIPPED, text)
    if not first.pushes:
        text = "act returns True or False, or 1 or 0"
        return Finding("actions", Outcome.PASSED, text)
    pushes, right = len(first.pushes), sum(first.pushes)
    figures = {"right": right, "left": pushes - right}
    if 0 < right < pushes:
        text = f"every action was True or False; {right / pushes:.0%} pushed right"
        return Finding("actions", Outcome.PASSED, text.replace("%", " %"), figures=figures)
    text = f"every action was {right > 0}: all {pushes} pushes went {'right' if right else 'left'}"
    advice = "return True to push right and False to push left, as the observation demands"
    return Finding("actions", Outcome.NOTED, text, advice, figures)


# ------------------------------------------------------------------------------ the same again


def _repetition(case: Case, first: Trace) -> Iterator[Finding]:
    """Yield what is found by repeating a run: here, in another process, with another seed."""
    with _other_processes(case) as begin:
        answer = begin()
        before = _global_generators()
        again = trace(case, SEED)[1]
        touched = [name for name, state in _global_generators().items() if before[name] != state]
        other = trace(case, SEED, run=1)[1]
        try:
            key, fresh = answer.result(PATIENCE)
            repeats = again.is_like(first) and fresh.is_like(first)
            shares = not repeats and begin().result(PATIENCE)[1].is_like(fresh)
        except (BrokenProcessPool, TimeoutError, UprightError) as error:
            yield from _only_here(first, again, error)
        else:
            yield from _same_seed(first, again, fresh, repeats=repeats, shares=shares)
            yield _random_numbers(touched, repeats=repeats or shares)
            yield _processes(case, key)
    if other.is_like(first):
        text = "another seed gives the very same trials, so that many runs say no more than one"
        advice = "draw seeds from rng, as in int(rng.integers(2**31)), and write none as a number"
        yield Finding("other-seed", Outcome.FAILED, text, advice)
    else:
        yield Finding("other-seed", Outcome.PASSED, "another seed gives other trials")


@contextmanager
def _other_processes(case: Case) -> Iterator[Callable[[], Future[tuple[str, Trace]]]]:
    """Give a function that lets a new process return the key and the trace of a case."""
    others = set(multiprocessing.active_children())
    pools = []

    def begin() -> Future[tuple[str, Trace]]:
        pools.append(process_pool())
        return pools[-1].submit(trace_elsewhere, case, SEED)

    try:
        yield begin
    finally:
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()
        for pool in pools:
            pool.shutdown(wait=False)


def _same_seed(
    first: Trace, again: Trace, fresh: Trace, *, repeats: bool, shares: bool
) -> Iterator[Finding]:
    """Yield what equal seeds and agents side by side lead to."""
    if repeats:
        text = "the same seed gives the same trials: twice here, and once in another process"
        yield Finding("same-seed", Outcome.PASSED, text)
        text = "agents of the same process do not influence each other"
        yield Finding("shared-state", Outcome.PASSED, text)
        return
    differing = again if not again.is_like(first) else fresh
    difference = _difference(first, differing)
    if shares:
        text = "in a new process, the same seed gives the same trials"
        yield Finding("same-seed", Outcome.PASSED, text)
        text = f"an agent depends on those that were there before it: {difference}"
        advice = (
            "keep what it learns in self, set in __init__; not in the class, in the module, or in "
            "the default value of a parameter, which all agents share"
        )
        yield Finding("shared-state", Outcome.FAILED, text, advice)
        return
    text = f"the same seed gives different trials: {difference}"
    advice = "draw every random number from the rng that the methods are given"
    yield Finding("same-seed", Outcome.FAILED, text, advice)
    text = "not known, as long as the same seed gives different trials"
    yield Finding("shared-state", Outcome.SKIPPED, text)


def _only_here(first: Trace, again: Trace, error: Exception) -> Iterator[Finding]:
    """Yield what is known if no other process could run the agent."""
    if again.is_like(first):
        text = "the same seed gives the same trials twice in this process"
        yield Finding("same-seed", Outcome.PASSED, text)
    else:
        text = f"the same seed gives different trials: {_difference(first, again)}"
        advice = "draw every random number from rng, and keep what is learned in self"
        yield Finding("same-seed", Outcome.FAILED, text, advice)
    reason = str(error) or type(error).__name__
    text = f"it does not run in another process: {reason}"
    advice = "create all that it needs in its module or in __init__, as if it were alone"
    yield Finding("processes", Outcome.FAILED, text, advice)


def _difference(first: Trace, other: Trace) -> str:
    """Return where two traces differ, in words."""
    for number, (one, two) in enumerate(zip(first.lengths, other.lengths, strict=False), 1):
        if one != two:
            return f"trial {number} took {one} steps, and then {two}"
    if len(first.lengths) != len(other.lengths):
        return f"the run had {len(first.lengths)} trials, and then {len(other.lengths)}"
    return "trials are equally long, but the pushes in them differ"


def _global_generators() -> dict[str, Any]:
    """Return the states of generators of random numbers that a whole process shares."""
    states: dict[str, Any] = {
        "random": random.getstate(),
        "np.random": pickle.dumps(np.random.get_state()),  # noqa: NPY002 - not drawn from
    }
    if torch := sys.modules.get("torch"):
        states["torch"] = torch.get_rng_state().numpy().tobytes()
    return states


def _random_numbers(touched: Sequence[str], *, repeats: bool) -> Finding:
    """Return what is found about where random numbers come from."""
    names = " and ".join(f"`{name}`" for name in touched)
    figures = {"others": list(touched)}
    advice = "use rng.random(), rng.integers(), rng.normal(), ... in their place"
    if repeats and not touched:
        text = "all its random numbers come from rng"
        return Finding("random-numbers", Outcome.PASSED, text, figures=figures)
    if repeats:
        text = f"it uses {names} as well as rng, seeded so that runs repeat"
        return Finding("random-numbers", Outcome.NOTED, text, advice, figures)
    if touched:
        text = f"it draws from {names}, which no seed of a run reaches"
        return Finding("random-numbers", Outcome.FAILED, text, advice, figures)
    text = "something that it does is random, but not drawn from rng"
    advice = "look for default_rng() without a seed, the time, and the order of sets"
    return Finding("random-numbers", Outcome.FAILED, text, advice, figures)


def _processes(case: Case, key: str) -> Finding:
    if key == case.key:
        text = "it runs in other processes, and a store recognises its runs"
        return Finding("processes", Outcome.PASSED, text)
    text = "its source changed while it was checked"
    return Finding("processes", Outcome.FAILED, text, "check it again")


# ------------------------------------------------------------------------------ what it learns


def _learning(case: Case, trained: Any) -> Finding:
    """Return what a run has changed in an agent."""
    if is_learner(trained):
        text = "what a learner that only knows Gymnasium holds is not looked at"
        return Finding("learning", Outcome.SKIPPED, text)
    new, now = _held(_new(case)), _held(trained)
    changed = [name for name in now if now[name] != new.get(name)]
    if changed:
        text = f"its trials change {', '.join(changed)}"
        return Finding("learning", Outcome.PASSED, text, figures={"changed": changed})
    text = "its trials change nothing that it holds, so it cannot learn"
    advice = "let learn or end_trial change what act depends on"
    return Finding("learning", Outcome.NOTED, text, advice, {"changed": []})


def _held(agent: Any) -> dict[str, bytes]:
    """Return what an agent holds, as far as it can be compared."""
    held = {}
    attributes = agent._asdict() if hasattr(agent, "_asdict") else getattr(agent, "__dict__", {})
    for name, value in attributes.items():
        try:
            held[name] = pickle.dumps(value)
        except Exception:  # of any kind: what cannot be pickled raises what it likes
            held[name] = repr(value).encode()
    return held


def _saving(case: Case) -> Finding:
    try:
        check_policy(case)
    except UprightError as error:
        text = str(error).removeprefix(f"agent is {case.agent!r}; ")
        return Finding("saving", Outcome.NOTED, text)
    text = f"what it learns can be saved: upright learn {case.agent} --save policy.npz"
    return Finding("saving", Outcome.PASSED, text)


# ------------------------------------------------------------------------------ a small study


def _study(
    case: Case, speed: float, show: Callable[[str], None], *, independent: bool
) -> Iterator[Finding]:
    """Yield how fast the agent is, and how it compares with guessing."""
    steps = max(FEWEST_STEPS, min(STUDY_STEPS, int(speed * PROBE_SECONDS)))
    case = replace(case, spec=replace(case.spec, steps=steps, trials=STUDY_TRIALS))
    results = _runs(case, show) if independent else []
    show(GUESSING)
    long = make_case(GUESSING, trials=STUDY_TRIALS)
    yield _speed(
        case,
        _steps_a_second(results) if results else speed,
        _steps_a_second(study([long], FEWEST_RUNS, SEED)[long]),
    )
    if not independent:
        text = "not made, as its runs would depend on each other (shared-state)"
        yield Finding("study", Outcome.SKIPPED, text)
    elif len(results) < FEWEST_RUNS:
        text = f"too slow: {len(results)} of {STUDY_RUNS} runs ended in {STUDY_SECONDS:.0f} s"
        advice = f"upright table --agents {case.agent},{GUESSING} --noises none takes its time"
        yield Finding("study", Outcome.NOTED, text, advice, {"runs": len(results)})
    else:
        guessing = make_case(GUESSING, steps=steps, trials=STUDY_TRIALS)
        guesses = study([guessing], GUESSING_RUNS, SEED)[guessing]
        rows = summarise(case, SEED, results), summarise(guessing, SEED, guesses)
        yield _comparison(*rows)


def _runs(case: Case, show: Callable[[str], None]) -> list[Result]:
    """Return the results of the runs that end in time."""
    stop = np.zeros(1, np.bool_)
    timer = Timer(STUDY_SECONDS, stop.fill, [True])
    timer.daemon = True
    results: list[Result] = []
    timer.start()
    try:
        for run in range(STUDY_RUNS):
            show(f"run {run + 1} of {STUDY_RUNS}")
            _, result = make_run(case, SEED, run, stop=stop)
            if result is None or stop[0]:
                break
            results.append(result)
    finally:
        timer.cancel()
    return results


def _steps_a_second(results: Sequence[Result]) -> float:
    steps = sum(int(result.lengths.sum()) for result in results)
    return steps / max(sum(result.seconds for result in results), 1e-9)


def _speed(case: Case, own: float, guessing: float) -> Finding:
    """Return how fast an agent is, beside guessing, which is compiled."""
    figures = {"steps_per_second": round(own), "guessing_steps_per_second": round(guessing)}
    text = f"{_rounded(own)} steps a second; {GUESSING}, which is compiled: {_rounded(guessing)}"
    advice = "`upright new FILE --compiled` shows how an agent is compiled"
    if own >= SLOW:
        return Finding("speed", Outcome.PASSED, text, figures=figures)
    return Finding("speed", Outcome.NOTED, text, "" if is_learner(_new(case)) else advice, figures)


def _rounded(number: float) -> str:
    """Return a number to two digits, as people read it."""
    return f"{float(f'{number:.1e}'):,.0f}"


def _comparison(own: Row, guess: Row) -> Finding:
    """Return the verdict on an agent. Runs that failed count with all their trials."""
    verdict, words, outcome = Verdict.SIMILAR, "no better than guessing", Outcome.NOTED
    if own.all_runs_ci95[1] < guess.all_runs_ci95[0]:
        verdict, words = Verdict.FASTER, "learns faster than guessing"
        outcome = Outcome.PASSED
    elif own.all_runs_ci95[0] > guess.all_runs_ci95[1]:
        verdict, words = Verdict.SLOWER, "slower than guessing"
    cut = []
    if own.runs < STUDY_RUNS:
        cut.append(f"only {own.runs} of {STUDY_RUNS} runs ended in {STUDY_SECONDS:.0f} s")
    if own.task.steps < STUDY_STEPS:
        cut.append(f"N is {own.task.steps:,} and not {STUDY_STEPS:,}, because the agent is slow")
    text = (
        f"{words}: {_trials(own)} trials against {_trials(guess)}; it balanced for "
        f"{own.task.steps:,} steps in {own.successes} of {own.runs} runs"
        f"{''.join(f'; {reason}' for reason in cut)}"
    )
    advice = f"`upright learn {own.agent}` shows each trial" if outcome is Outcome.NOTED else ""
    figures = {
        "verdict": str(verdict),
        "steps": own.task.steps,
        "trials": own.task.trials,
        "seed": SEED,
        "agent": _figures(own),
        "guessing": _figures(guess),
        "cut": cut,
    }
    return Finding("study", outcome, text, advice, figures)


def _trials(row: Row) -> str:
    low, high = row.all_runs_ci95
    return f"{row.mean_trials_all_runs:.1f} [{low:.1f}, {high:.1f}]"


def _figures(row: Row) -> dict[str, Any]:
    return {
        "runs": row.runs,
        "successes": row.successes,
        "mean_trials": row.mean_trials_all_runs,
        "ci95": list(row.all_runs_ci95),
    }
