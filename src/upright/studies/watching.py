"""Watch a run learn, or a policy play, trial by trial."""

import math
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np

from upright.core.trials import Result
from upright.pictures.video import write_video
from upright.pictures.window import Window
from upright.policies.policy import Policy
from upright.studies.case import Case
from upright.studies.playing import TrialOutcome, pictures, play_trials
from upright.studies.random_streams import twister_numbers
from upright.studies.repeatability import doubt_about, warn_if_doubtful
from upright.studies.run import make_run
from upright.support.interrupts import hold_interrupts, let_interrupts_through

BAR = 40
"""Width of the longest bar [characters]."""
POLL = 0.05
"""Interval at which the run is checked for trials that have ended [s]."""
PATIENCE = 1.0
"""How long to wait for an interrupted run to end [s]."""


def watch_run(
    case: Case, seed: int, run: int, *, quiet: bool = False, twister: bool = False
) -> tuple[Any, Result]:
    """Make a run; print a line for each trial as it ends, then one about the run.

    Parameters
    ----------
    case, seed, run
        What to run.
    quiet
        Whether to print only the line about the run.
    twister
        Whether to draw the random numbers of the MATLAB twin.

    Returns
    -------
    tuple
        The trained agent, and the result.

    Raises
    ------
    KeyboardInterrupt
        If interrupted; the run ends before its next trial.
    """

    def work(lengths: np.ndarray, stop: np.ndarray) -> tuple[Any, Result | None]:
        warn_if_doubtful(doubt_about(case))
        numbers = twister_numbers if twister else None
        return make_run(case, seed, run, lengths, stop, numbers)

    def show(number: int, length: int) -> None:
        if not quiet:
            print_trial(case, number, length)

    return watch(case, work, show)


def watch(
    case: Case,
    work: Callable[[np.ndarray, np.ndarray], tuple[Any, Result | None]],
    on_trial: Callable[[int, int], None],
    stop: np.ndarray | None = None,
) -> tuple[Any, Result]:
    """Make a run in a thread, report each trial as it ends, and print how the run ended.

    Parameters
    ----------
    case
        What to run.
    work
        Makes the run. Its arguments are the array that the lengths of trials are written to, and
        `stop`.
    on_trial
        Called after each trial with its number, from 1, and its length in steps.
    stop
        Shape (1,), bool; set when interrupted, so that `work` returns.

    Returns
    -------
    tuple
        What `work` returned.

    Raises
    ------
    KeyboardInterrupt
        If interrupted.
    """
    lengths = np.zeros(case.spec.trials, np.int64)
    stop = np.zeros(1, np.bool_) if stop is None else stop
    reported = 0

    def report() -> None:
        nonlocal reported
        while reported < len(lengths) and lengths[reported] > 0:
            reported += 1
            on_trial(reported, int(lengths[reported - 1]))

    ended: SimpleQueue[Future[Any]] = SimpleQueue()
    with hold_interrupts():
        thread = ThreadPoolExecutor(1)
        future = thread.submit(work, lengths, stop)
        future.add_done_callback(ended.put)
        try:
            while not future.done():
                with let_interrupts_through():
                    with suppress(Empty):
                        ended.get(timeout=POLL)
                    report()
        finally:
            stop[0] = True
            wait([future], PATIENCE)  # so that a cart is stopped
            thread.shutdown(wait=False)
    agent, result = future.result()
    assert result is not None, "only an interrupt stops a run"
    report()
    print(_ending(case, result))
    return agent, result


def print_trial(case: Case, number: int, length: int) -> None:
    """Print a trial's number and its length in steps, with a logarithmic bar."""
    seconds = length * case.spec.time_step
    bar = "█" * max(1, round(BAR * math.log(1 + length) / math.log(1 + case.spec.steps)))
    print(f"trial {number:4d} {length:9,d} steps {seconds:10,.1f} s  {bar}", flush=True)


def _ending(case: Case, result: Result) -> str:
    if not result.success:
        longest = int(result.lengths.max())
        return f"not balanced within {result.trials:,} trials; the longest took {longest:,} steps"
    simulated = case.spec.steps * case.spec.time_step
    time = f"{simulated / 60:,.0f} minutes" if simulated >= 120 else f"{simulated:,.0f} seconds"
    return (
        f"balanced at trial {result.trials}: {case.spec.steps:,} steps, {time} of simulated time; "
        f"the run took {result.seconds:.2f} s"
    )


def watch_play(
    policy: Policy,
    case: Case,
    episodes: int,
    seed: int,
    video: str | None = None,
    *,
    window: bool = False,
) -> list[TrialOutcome]:
    """Play a policy; print a line for each trial as it ends, then a summary.

    Parameters
    ----------
    policy
        The policy.
    case
        What it plays on.
    episodes
        Number of trials.
    seed
        Seed of their random numbers.
    video
        Path of a video to write, if any.
    window
        Whether to show the trials in real time. Closing the window stops playback.

    Returns
    -------
    list
        The outcome of each trial that was played to its end.

    Raises
    ------
    UprightError
        If a library is missing, there is no display, or the video cannot be written.
    """
    rate = 1 / case.spec.time_step
    played: list[TrialOutcome] = []

    def report(outcome: TrialOutcome) -> None:
        played.append(outcome)
        print_trial(case, len(played), outcome.steps)

    frames = pictures(policy, case, episodes, seed, report)
    if window:
        frames = _shown(frames, Window(f"{policy.agent}, {case.spec.noise}", rate))
    try:
        if video:
            write_video(video, frames, rate)
        elif window:
            deque(frames, maxlen=0)
        else:
            for outcome in play_trials(policy, case, episodes, seed):
                report(outcome)
    finally:
        print(_summary(played))
    return played


def _shown(frames: Iterator[np.ndarray], window: Window) -> Iterator[np.ndarray]:
    """Yield pictures as they are shown, while the window is open."""
    try:
        for pixels in frames:
            window.show(pixels)
            yield pixels
            if not window.is_open:
                return
    finally:
        window.close()


def _summary(played: list[TrialOutcome]) -> str:
    if not played:
        return "no trial was played to its end"
    steps = [trial.steps for trial in played]
    balanced = sum(trial.balanced for trial in played)
    return (
        f"balanced in {balanced:,} of {len(played):,} trials; steps: mean {np.mean(steps):,.1f}, "
        f"median {np.median(steps):,.0f}, shortest {min(steps):,}"
    )
