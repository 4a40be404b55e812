"""Watch a run learn, or a policy play, trial by trial."""

import math
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import nullcontext, suppress
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from upright.core.trials import Result
from upright.pictures.size import SIZE, Size
from upright.pictures.video import write_video
from upright.policies.policy import Policy
from upright.studies.case import Case
from upright.studies.filming import Film, check_film, in_words
from upright.studies.observing import Moment, check_observable
from upright.studies.playing import TrialOutcome, pictures, play_trials
from upright.studies.random_streams import twister_numbers
from upright.studies.repeatability import doubt_about, warn_if_doubtful
from upright.studies.run import make_run
from upright.studies.stage import PERIOD, Stage
from upright.support.interrupts import hold_interrupts, let_interrupts_through
from upright.support.terminal import end_notice, visible, width
from upright.support.words import count

SHORTEST, BAR = 10, 40
"""Width of the bar of a success: as much as fits the terminal, within these [characters]."""
MARGIN = 41
"""Width of what stands before a bar [characters]."""
POLL = 0.05
"""Interval at which the run is checked for trials that have ended [s]."""
PATIENCE = 1.0
"""How long to wait for an interrupted run to end [s]."""
GOES_ON = "the window is closed; the run goes on without pictures (Ctrl-C stops it)"
"""Printed when the window of a run is closed."""

T = TypeVar("T")


def watch_run(
    case: Case,
    seed: int,
    run: int,
    *,
    quiet: bool = False,
    twister: bool = False,
    window: bool = False,
    video: str | None = None,
    size: Size = SIZE,
    policy: Policy | None = None,
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
    window
        Whether to show the run in a window. Once that is closed, the run goes on without.
    video
        Path of a video to make of the run, if any.
    size
        Size of the window and the video.
    policy
        The policy that the agent goes on from; by default it is a new one.

    Returns
    -------
    tuple
        The trained agent, and the result. Both are the same with pictures as without.

    Raises
    ------
    UprightError
        If the plant cannot be drawn, a library is missing, there is no display, or the video
        cannot be written.
    KeyboardInterrupt
        If interrupted; the run ends before its next trial, with pictures before its next step.
    """
    if window:
        check_observable(case)
    if video is not None:
        check_film(video, case)
    stop = np.zeros(1, np.bool_)
    stage = Stage(case.name, case.spec.noise, stop, size, chart=True) if window else None
    film = Film() if video is not None else None
    observers = [observer for observer in (film, stage) if observer is not None]

    def observe(moment: Moment) -> None:
        for observer in observers:
            observer(moment)

    def work(lengths: np.ndarray, stop: np.ndarray) -> tuple[Any, Result | None]:
        warn_if_doubtful(doubt_about(case))
        numbers = twister_numbers if twister else None
        observer = observe if observers else None
        return make_run(case, seed, run, lengths, stop, numbers, observer=observer, policy=policy)

    def show(number: int, length: int) -> None:
        if not quiet:
            print_trial(case, number, length)

    agent, result = watch(case, work, show, stop, stage)
    if film is not None and video is not None:
        _write_film(film, video, case, size)
    return agent, result


def watch(
    case: Case,
    work: Callable[[np.ndarray, np.ndarray], tuple[Any, Result | None]],
    on_trial: Callable[[int, int], None],
    stop: np.ndarray | None = None,
    stage: Stage | None = None,
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
    stage
        Shows the run in a window, if given, and is closed at the end.

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

    def say_so() -> None:
        print(GOES_ON, flush=True)

    agent, result = _in_thread(lambda: work(lengths, stop), report, stop, stage, say_so)
    assert result is not None, "only an interrupt stops a run"
    end_notice()
    print(_ending(case, result))
    return agent, result


def _in_thread(
    work: Callable[[], T],
    report: Callable[[], None],
    stop: np.ndarray,
    stage: Stage | None,
    on_closing: Callable[[], None],
) -> T:
    """Do work in a thread, and meanwhile report and draw until the window is closed."""
    ended: SimpleQueue[Future[Any]] = SimpleQueue()
    shows = stage is not None
    with hold_interrupts(), stage or nullcontext():
        thread = ThreadPoolExecutor(1)
        future = thread.submit(work)
        future.add_done_callback(ended.put)
        try:
            while not future.done():
                with let_interrupts_through():
                    with suppress(Empty):
                        ended.get(timeout=PERIOD / 2 if shows else POLL)
                    report()
                    if stage and shows:
                        stage.update()
                        shows = stage.is_open
                        if not shows:
                            on_closing()
            report()
            if stage and not future.exception():
                with let_interrupts_through():
                    stage.linger()
        finally:
            stop[0] = True
            wait([future], PATIENCE)  # so that a cart is stopped
            thread.shutdown(wait=False)
    return future.result()


def _write_film(film: Film, path: str, case: Case, size: Size) -> None:
    """Write the video of a run, with a progress bar."""
    columns = TextColumn("drawing the video"), BarColumn(), TimeRemainingColumn()
    console = Console(stderr=True)
    hidden = not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=hidden) as bar:
        task = bar.add_task("", total=None)

        def show(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        film.write(path, case.name, size, on_picture=show)
    print(f"video: {visible(str(path))}")


def print_trial(case: Case, number: int, length: int) -> None:
    """Print a trial's number and its length in steps, with a logarithmic bar.

    Above the first trial stands the scale of the bars.
    """
    longest = max(SHORTEST, min(BAR, width() - MARGIN))
    if number == 1:
        end_notice()
        print(
            f"{'steps, on a logarithmic scale':>{MARGIN - 2}}  {_scale(case.spec.steps, longest)}"
        )
    seconds = length * case.spec.time_step
    bar = "█" * max(1, _bar(length, case.spec.steps, longest))
    steps = "step " if length == 1 else "steps"
    print(f"trial {number:4d} {length:9,d} {steps} {seconds:10,.1f} s  {bar}", flush=True)


def _bar(length: int, steps: int, longest: int) -> int:
    """Return the length of the bar of a trial [characters]."""
    return round(longest * math.log(1 + length) / math.log(1 + steps))


def _scale(steps: int, longest: int) -> str:
    """Return powers of ten and the length of a success, each ending where its bar ends."""
    marks = [10**power for power in range(len(str(steps))) if 10**power < steps]
    scale = ""
    end = f" {steps:,}".rjust(longest)
    for mark in marks:
        place = _bar(mark, steps, longest)
        text = f" {mark:,}".rjust(place - len(scale))
        if len(scale + text) == place and not end[: place + 1].strip():
            scale += text
    return scale + end[len(scale) :]


def _ending(case: Case, result: Result) -> str:
    if not result.success:
        longest = count(int(result.lengths.max()), "step")
        return f"not balanced within {count(result.trials, 'trial')}; the longest took {longest}"
    simulated = case.spec.steps * case.spec.time_step
    return (
        f"balanced at trial {result.trials}: {count(case.spec.steps, 'step')}, "
        f"{in_words(simulated)} of simulated time; "
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
    size: Size = SIZE,
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
        Whether to show the trials in a window. Closing it stops playback; a video then has the
        trials that were played to their end.
    size
        Size of the window and the video.

    Returns
    -------
    list
        The outcome of each trial that was played to its end.

    Raises
    ------
    UprightError
        If the plant cannot be drawn, a library is missing, there is no display, or the video
        cannot be written.
    """
    played: list[TrialOutcome] = []

    def report(outcome: TrialOutcome) -> None:
        played.append(outcome)
        print_trial(case, len(played), outcome.steps)

    def draw(trials: int, on_trial: Callable[[TrialOutcome], None]) -> None:
        if video is not None and trials:
            frames = pictures(policy, case, trials, seed, on_trial, size)
            write_video(video, frames, 1 / case.spec.time_step, size)

    try:
        if window:
            _play_in_window(policy, case, episodes, seed, report, size)
            draw(len(played), lambda _: None)
        elif video is not None:
            draw(episodes, report)
        else:
            for outcome in play_trials(policy, case, episodes, seed):
                report(outcome)
    finally:
        end_notice()
        print(_summary(played))
    return played


def _play_in_window(
    policy: Policy,
    case: Case,
    episodes: int,
    seed: int,
    on_trial: Callable[[TrialOutcome], None],
    size: Size,
) -> None:
    """Play in a window, and report each trial as it ends."""
    check_observable(case)
    stop = np.zeros(1, np.bool_)
    stage = Stage(policy.agent, case.spec.noise, stop, size, chart=False)
    ended: SimpleQueue[TrialOutcome] = SimpleQueue()

    def work() -> None:
        for outcome in play_trials(policy, case, episodes, seed, stop, stage):
            ended.put(outcome)

    def report() -> None:
        while not ended.empty():
            on_trial(ended.get())

    _in_thread(work, report, stop, stage, partial(stop.__setitem__, 0, True))


def _summary(played: list[TrialOutcome]) -> str:
    if not played:
        return "no trial was played to its end"
    steps, trials = [trial.steps for trial in played], count(len(played), "trial")
    balanced = sum(trial.balanced for trial in played)
    return (
        f"balanced in {balanced:,} of {trials}; steps: mean {np.mean(steps):,.1f}, "
        f"median {np.median(steps):,.0f}, shortest {min(steps):,}"
    )
