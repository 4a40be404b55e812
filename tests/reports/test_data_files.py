import io
import json
import sys

import numpy as np
import pandas
import pytest

import upright
from upright.reports.data_files import to_parquet, write_csv, write_json
from upright.studies.columns import COLUMNS


@pytest.fixture(scope="module")
def store():
    """A store with numbers and texts of every kind, and with runs that failed."""
    numbers = {"parameters": {"half_length": 0.1 + 0.2}, "steps": 9, "trials": 3}
    cases = [
        upright.make_case("q-learning", settings={"x_edges": (-0.5, 0.5)}, **numbers),
        upright.make_case("random-search", noise="none", steps=9, trials=3),
    ]
    with upright.Store() as store, pytest.MonkeyPatch.context() as patch:
        for case in cases:
            for run, lengths in enumerate(((2, 9), (1, 2, 3))):
                result = upright.Result(run, 9 in lengths, np.array(lengths), 1 / 3)
                patch.setattr("upright.studies.store.__version__", None if run else "0.3")
                store.add(case.key, 2**63 - 1 - run, result)
        yield store


def written(write, store, each):
    file = io.StringIO()
    write(store, each, file)
    return file.getvalue()


@pytest.mark.parametrize("each", COLUMNS)
@pytest.mark.parametrize("write", [write_csv, write_json])
def test_what_is_written_is_what_the_frame_holds(write, each, store):
    expected, text = store.frame(each), written(write, store, each)
    if write is write_csv:
        read = pandas.read_csv(io.StringIO(text), engine="python")
    else:
        read = pandas.DataFrame(json.loads(text))
    assert list(read) == list(COLUMNS[each])
    pandas.testing.assert_frame_equal(read.astype(expected.dtypes), expected)
    assert "0.30000000000000004" in text  # pandas may round it as it reads


@pytest.mark.parametrize("each", COLUMNS)
def test_csv_and_json_need_no_pandas_and_have_a_line_for_each_row(each, store, monkeypatch):
    count = len(store.frame(each))
    monkeypatch.setitem(sys.modules, "pandas", None)
    lines = written(write_csv, store, each).splitlines()
    assert lines[0] == ",".join(COLUMNS[each])
    assert len(lines) == 1 + count
    assert len(written(write_json, store, each).splitlines()) == 1 + count + 1


@pytest.mark.parametrize("each", COLUMNS)
def test_parquet_keeps_values_and_types(each, store):
    pytest.importorskip("pyarrow")
    read = pandas.read_parquet(io.BytesIO(to_parquet(store, each)))
    pandas.testing.assert_frame_equal(read, store.frame(each), check_exact=True)


@pytest.mark.parametrize("library", ["pandas", "pyarrow"])
def test_parquet_says_what_it_needs(library, store, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(upright.UprightError, match=r"^Parquet needs pandas and PyArrow"):
        to_parquet(store, "run")
