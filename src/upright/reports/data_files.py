"""The runs or trials of a store as CSV, JSON or Parquet, with the columns of docs/data.md."""

import csv
import io
import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TextIO

from upright.errors import require_module
from upright.reports.escaping import csv_cell
from upright.studies.columns import COLUMNS

if TYPE_CHECKING:
    from upright.core.trials import Result
    from upright.studies.store import Store

FORMATS = ("csv", "json", "parquet")
"""Formats of a table with a row for each run or trial."""


def write_csv(store: "Store", each: str, file: TextIO) -> None:
    """Write a line for each run, or for each trial, as it is read; the first line has the names.

    Text that a spreadsheet would take for a formula begins with an apostrophe (see docs/data.md).

    Parameters
    ----------
    store
        Where the runs are.
    each
        "run" or "trial".
    file
        Where the lines are written to.

    Raises
    ------
    UprightError
        If the store is damaged.
    """
    from upright.studies.records import rows  # imported late: the help needs only FORMATS

    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(COLUMNS[each])
    writer.writerows(rows(map(_as_texts, store.runs()), each))


def _as_texts(run: tuple[Mapping[str, Any], "Result"]) -> tuple[dict[str, str], "Result"]:
    """Return a run with its values written for CSV: once, though it may have many rows."""
    values, result = run
    return {name: str(csv_cell(value)) for name, value in values.items()}, result


def write_json(store: "Store", each: str, file: TextIO) -> None:
    """Write a JSON array with an object on a line for each run, or for each trial, as it is read.

    Parameters and errors are those of `write_csv`.
    """
    from upright.studies.records import rows  # imported late, as above

    mark = "[\n"
    for row in rows(store.runs(), each):
        values = dict(zip(COLUMNS[each], row, strict=True))
        file.write(mark + json.dumps(values, allow_nan=False))
        mark = ",\n"
    file.write("\n]\n")


def to_parquet(store: "Store", each: str) -> bytes:
    """Return the content of a Parquet file with a row for each run, or for each trial.

    Raises
    ------
    UprightError
        If pandas or PyArrow is missing, or the store is damaged.
    """
    for library in ("pandas", "pyarrow"):
        require_module(library, "Parquet needs pandas and PyArrow", "data")
    file = io.BytesIO()
    store.frame(each).to_parquet(file, engine="pyarrow", index=False)
    return file.getvalue()
