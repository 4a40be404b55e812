"""Watching one run learn, or a policy play, trial by trial."""

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
from upright.studies.run import make_run
from upright.support.interrupts import hold_interrupts, let_interrupts_through

BAR = 40
"""Width of the longest bar [characters]."""
POLL = 0.05
"""Time between two looks at the run [s]."""
PATIENCE = 1.0
"""How long an interrupted run is waited for [s]."""


def watch_run(
    case: Case, seed: int, run: int, *, quiet: bool = False, twister: bool = False
) -> tuple[Any, Result]:
    """Make a run and print a line for each trial as it ends, then how the run ended.

    Parameters
    ----------
    case, seed, run
        What is run.
    quiet
        Whether only the end is told.
    twister
        Whether it draws the random numbers of the MATLAB twin.

    Returns
    -------
    tuple
        The agent as it is then, and the result.

    Raises
    ------
    KeyboardInterrupt
        If interrupted; the run ends before its next trial.
    """

    def work(lengths: np.ndarray, stop: np.ndarray) -> tuple[Any, Result | None]:
        numbers = twister_numbers if twister else None
        return make_run(case, seed, run, lengths, stop, numbers)

    def tell(number: int, length: int) -> None:
        if not quiet:
            print_trial(case, number, length)

    return watch(case, work, tell)


def watch(
    case: Case,
    work: Callable[[np.ndarray, np.ndarray], tuple[Any, Result | None]],
    tell: Callable[[int, int], None],
    stop: np.ndarray | None = None,
) -> tuple[Any, Result]:
    """Have a run made in a thread, tell of each trial as it ends, and print how the run ended.

    Parameters
    ----------
    case
        What is run.
    work
        Makes the run, given where to write the lengths of its trials, and `stop`.
    tell
        Told each trial's number, from 1, and its length in steps.
    stop
        Shape (1,), bool; set when interrupted, so that the work ends.

    Returns
    -------
    tuple
        What the work returned.

    Raises
    ------
    KeyboardInterrupt
        If interrupted.
    """
    lengths = np.zeros(case.spec.trials, np.int64)
    stop = np.zeros(1, np.bool_) if stop is None else stop
    told = 0

    def tell_more() -> None:
        nonlocal told
        while told < len(lengths) and lengths[told] > 0:
            told += 1
            tell(told, int(lengths[told - 1]))

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
                    tell_more()
        finally:
            stop[0] = True
            wait([future], PATIENCE)  # a cart is to be stopped
            thread.shutdown(wait=False)
    made, result = future.result()
    assert result is not None, "it was stopped by an interrupt alone"
    tell_more()
    print(_ending(case, result))
    return made, result


def print_trial(case: Case, number: int, length: int) -> None:
    """Print a trial of so many steps, with a bar that is logarithmic."""
    seconds = length * case.spec.time_step
    bar = "█" * max(1, round(BAR * math.log(1 + length) / math.log(1 + case.spec.steps)))
    print(f"trial {number:4d} {length:9,d} steps {seconds:10,.1f} s  {bar}", flush=True)


def _ending(case: Case, result: Result) -> str:
    if not result.success:
        longest = int(result.lengths.max())
        return f"not balanced within {result.trials:,} trials; the longest was {longest:,} steps"
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
    """Let a policy play and print a line for each trial as it ends, then how they went.

    Parameters
    ----------
    video
        Where what was to be seen is written to, if anywhere.
    window
        Whether it is shown as fast as it would happen. Who closes the window ends the playing.

    Returns
    -------
    list
        How each trial went that was played to its end.

    Raises
    ------
    UprightError
        If a library is missing, there is no display, or the video cannot be written.
    """
    rate = 1 / case.spec.time_step
    played: list[TrialOutcome] = []

    def tell(trial: TrialOutcome) -> None:
        played.append(trial)
        print_trial(case, len(played), trial.steps)

    frames = pictures(policy, case, episodes, seed, tell)
    if window:
        frames = _shown(frames, Window(f"{policy.agent}, {case.spec.noise}", rate))
    try:
        if video:
            write_video(video, frames, rate)
        elif window:
            deque(frames, maxlen=0)
        else:
            for trial in play_trials(policy, case, episodes, seed):
                tell(trial)
    finally:
        print(_summary(played))
    return played


def _shown(frames: Iterator[np.ndarray], window: Window) -> Iterator[np.ndarray]:
    """Pass pictures on as they are shown, while the window is open."""
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
