"""Runs as rows and as frames of pandas, with the columns of `studies.columns`.

They are made from pairs: the values of a run that are known beside its result, by name, and the
result.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from upright.core.trials import Result
from upright.errors import require_module, require_one_of
from upright.plants import PLANTS
from upright.studies.case import Case, name_settings, named
from upright.studies.columns import COLUMNS, KINDS, TRIAL

if TYPE_CHECKING:
    import pandas


def describe_case(case: Case) -> dict[str, Any]:
    """Return what identifies a case, by the names of columns."""
    usual_plant = PLANTS.default(case.plant.name)
    return {
        "agent": named(case.agent, "Python", "equations"),  # language and plant have columns
        "settings": case.settings_name,
        "noise": case.spec.noise,
        "start": case.spec.start,
        "condition": case.spec.condition,
        "max_steps": case.spec.steps,
        "max_trials": case.spec.trials,
        **case.spec.parameters._asdict(),
        "plant": case.plant.name,
        "plant_settings": name_settings("default", usual_plant, case.plant),
        "language": case.language,
    }


def rows(runs: Iterable[tuple[Mapping[str, Any], Result]], each: str) -> Iterator[list[Any]]:
    """Yield a row for each run, or for each trial, with a cell for each of COLUMNS[each].

    Raises
    ------
    UprightError
        If `each` is neither "run" nor "trial".
    """
    require_one_of("each", each, COLUMNS)
    for values, result in runs:
        cells = {**values, **_measured(result, each)}
        row = [cells[name] for name in COLUMNS[each]]
        if each == "run":
            yield row
        else:
            shared, own = row[: -len(TRIAL)], row[-len(TRIAL) :]
            for trial in zip(*(array.tolist() for array in own), strict=True):
                yield [*shared, *trial]


def make_frame(
    runs: Iterable[tuple[Mapping[str, Any], Result]], each: str, columns: Iterable[str] = ()
) -> "pandas.DataFrame":
    """Return a pandas DataFrame with a row for each run, or for each trial.

    Parameters
    ----------
    runs
        Pairs of a run's values by name and its result.
    each
        "run" or "trial".
    columns
        Names of the columns; all of COLUMNS[each] unless given.

    Raises
    ------
    UprightError
        If `each` is neither, or pandas is missing.
    """
    require_one_of("each", each, COLUMNS)
    library = require_module("pandas", "frame() needs pandas", "data")
    cells: dict[str, list[Any]] = {name: [] for name in columns or COLUMNS[each]}
    sizes = []
    for values, result in runs:
        sizes.append(1 if each == "run" else result.trials)
        for name, cell in {**values, **_measured(result, each)}.items():
            if name in cells:
                cells[name].append(cell)

    def column(name: str) -> Any:
        kind = COLUMNS[each][name].kind
        if each == "trial" and name in TRIAL:  # each cell is an array with the trials of a run
            return np.concatenate([np.zeros(0, KINDS[kind]), *cells[name]])
        return _series(library, kind, cells[name]).repeat(sizes).array

    made = {name: column(name) for name in cells}
    frame: pandas.DataFrame = library.DataFrame(made, copy=False)  # a copy takes as much again
    return frame


def _series(library: Any, kind: str, cells: list[Any]) -> Any:
    """Return cells as a pandas Series; names as categories in the order in which they come."""
    if kind == "text":
        return library.Series(cells, dtype=library.CategoricalDtype([*dict.fromkeys(cells)]))
    return library.Series(cells, dtype=KINDS[kind])


def _measured(result: Result, each: str) -> dict[str, Any]:
    """Return the columns of what came out of a run: values, or an array for each of its trials."""
    lengths = result.lengths
    if each == "trial":
        numbers = np.arange(1, result.trials + 1)
        return {
            "trial": numbers,
            "steps": lengths,
            "fallen": (numbers < result.trials) | (not result.success),
        }
    return {
        "success": result.success,
        "trials": result.trials,
        "steps": int(lengths.sum()),
        "longest_trial": int(lengths.max(initial=0)),
        "seconds": result.seconds,
    }
