"""Watching one run learn, trial by trial."""

import math
import sys
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any

import numpy as np

from upright.store import Result
from upright.study import Case, make_run

BAR = 40
"""Width of the longest bar [characters]."""
POLL = 0.05
"""Time between two looks at the run [s]."""


def watch_run(case: Case, seed: int, run: int, *, quiet: bool = False) -> tuple[Any, Result]:
    """Make a run and print a line for each trial as it ends, then how the run ended.

    Returns
    -------
    tuple
        The agent as it is then, and the result.

    Raises
    ------
    KeyboardInterrupt
        If interrupted; the run ends before its next trial.
    """
    lengths, stop = np.zeros(case.trials, np.int64), np.zeros(1, np.bool_)
    shown = 0
    thread = ThreadPoolExecutor(1)
    future = thread.submit(make_run, case, seed, run, lengths, stop)
    try:
        while not wait([future], POLL).done:
            shown = shown if quiet else _show(case, lengths, shown)
    finally:
        stop[0] = True
        thread.shutdown(wait=False)
    agent, result = future.result()
    assert result is not None, "it was stopped by an interrupt alone"
    if not quiet:
        _show(case, lengths, shown)
    print(_ending(case, result))
    return agent, result


def _show(case: Case, lengths: np.ndarray, shown: int) -> int:
    """Print the trials that ended since; bars are logarithmic. Return how many are shown then."""
    step = case.task().parameters.time_step
    while shown < len(lengths) and lengths[shown] > 0:
        length = int(lengths[shown])
        shown += 1
        bar = "█" * max(1, round(BAR * math.log(1 + length) / math.log(1 + case.steps)))
        print(f"trial {shown:4d} {length:9,d} steps {length * step:10,.1f} s  {bar}")
    sys.stdout.flush()
    return shown


def _ending(case: Case, result: Result) -> str:
    if not result.success:
        longest = int(result.lengths.max())
        return f"not balanced within {result.trials:,} trials; the longest was {longest:,} steps"
    simulated = case.steps * case.task().parameters.time_step / 60
    return (
        f"balanced at trial {result.trials}: {case.steps:,} steps, {simulated:,.0f} minutes of "
        f"simulated time; the run took {result.seconds:.2f} s"
    )
