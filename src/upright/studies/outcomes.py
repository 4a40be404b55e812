"""What came out of the runs of a case, without the length of each trial."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from upright.core.trials import Result


class Outcomes(NamedTuple):
    """What came out of runs: arrays with an element for each run, in order.

    A million runs take 40 MB, where their results, with the length of each trial, may take 8 GB.
    """

    run: np.ndarray
    """Number of the run within its case and seed, int64."""
    success: np.ndarray
    """Whether its last trial succeeded, bool."""
    trials: np.ndarray
    """Number of its trials, int64."""
    steps: np.ndarray
    """Steps of all its trials together, int64 [steps]."""
    seconds: np.ndarray
    """Computing time, float64 [s]."""


KINDS = {"run": "i8", "success": "?", "trials": "i8", "steps": "i8", "seconds": "f8"}
"""The data type of each array."""


def make_outcomes(rows: Iterable[tuple[int, bool, int, int, float]]) -> Outcomes:
    """Return the outcomes of runs, each given as a row: the fields of `Outcomes`, in order."""
    table = np.fromiter(rows, np.dtype([*KINDS.items()]))
    return Outcomes(*(np.ascontiguousarray(table[name]) for name in KINDS))


def outcomes_of(results: Iterable[Result]) -> Outcomes:
    """Return the outcomes of runs from their results."""
    return make_outcomes(
        (result.run, result.success, result.trials, int(result.lengths.sum()), result.seconds)
        for result in results
    )
