import itertools
import json
import sys
from dataclasses import fields, replace

import numpy as np
import pandas
import pytest
from helpers import ROOT

import upright
from upright.core.task import TaskSpec
from upright.plants import PLANTS
from upright.studies.columns import COLUMNS, IDENTITY, KINDS, ORIGIN, RESULT, TRIAL
from upright.studies.records import describe_case, make_frame, rows

CASE = upright.make_case("q-learning", "as-published", noise="sensor-5", steps=9, trials=3)
OTHERS = {
    "agent": upright.make_case("reinforce", "as-published", noise="sensor-5", steps=9, trials=3),
    "settings": replace(CASE, settings=replace(CASE.settings, discount=0.5)),
    "noise": replace(CASE, spec=replace(CASE.spec, noise="none")),
    "start": replace(CASE, spec=replace(CASE.spec, start="zero")),
    "condition": replace(CASE, spec=replace(CASE.spec, condition="delay-1")),
    "max_steps": replace(CASE, spec=replace(CASE.spec, steps=10)),
    "max_trials": replace(CASE, spec=replace(CASE.spec, trials=4)),
    "half_length": replace(CASE, spec=replace(CASE.spec, parameters={"half_length": 1.0})),
    "plant": replace(CASE, plant=PLANTS.default("ros2")),
    "plant_settings": replace(CASE, plant=replace(CASE.plant, integrator="rk4")),
    "language": replace(CASE, language="MATLAB"),
}
"""Cases that each differ from CASE in one column."""


def result(run, *lengths, success=True):
    return upright.Result(run, success, np.array(lengths, np.int64), 0.25)


@pytest.fixture
def store():
    with upright.Store() as store:
        store.add(CASE.key, 3, result(1, 4, 2, 5, success=False))
        store.add(CASE.key, 3, result(0, 2, 9))
        store.add(OTHERS["half_length"].key, 2**63 - 1, result(0, 9))
        yield store


def test_a_frame_has_a_row_for_each_run_in_order(store):
    frame = store.frame()
    assert frame[["case", "run", *RESULT]].values.tolist() == [
        [1, 0, True, 2, 11, 9, 0.25],
        [1, 1, False, 3, 11, 5, 0.25],
        [2, 0, True, 1, 9, 9, 0.25],
    ]
    assert frame["seed"].tolist() == [3, 3, 2**63 - 1]
    assert frame["half_length"].tolist() == [0.5, 0.5, 1.0]
    assert frame["settings"].tolist() == ["as-published"] * 3
    assert frame["version"].tolist() == [upright.__version__] * 3
    assert abs(frame["ended"] - pandas.Timestamp.now("UTC")).max() < pandas.Timedelta("1h")


def test_a_frame_has_a_row_for_each_trial_that_says_which_run_it_is_of(store):
    runs, trials = store.frame(), store.frame("trial")
    assert trials[["case", "run", *TRIAL]].values.tolist() == [
        [1, 0, 1, 2, True],
        [1, 0, 2, 9, False],
        [1, 1, 1, 4, True],
        [1, 1, 2, 2, True],
        [1, 1, 3, 5, True],
        [2, 0, 1, 9, False],
    ]
    of_run = trials[[*IDENTITY]].drop_duplicates(ignore_index=True)
    pandas.testing.assert_frame_equal(of_run, runs[[*IDENTITY]])


@pytest.mark.parametrize(("each", "count"), {"run": 3, "trial": 6}.items())
def test_frames_have_the_described_columns_and_kinds(each, count, store):
    kinds = {name: KINDS[column.kind] for name, column in COLUMNS[each].items()}
    with upright.Store() as empty:
        for frame, length in ((store.frame(each), count), (empty.frame(each), 0)):
            assert frame.dtypes.astype(str).to_dict() == kinds
            assert list(frame) == list(kinds)
            assert len(frame) == length


def test_names_are_categories_in_the_order_of_the_store():
    with upright.Store() as store:
        for case in (CASE, OTHERS["noise"]):
            store.add(case.key, 0, result(0, 9))
        assert store.frame()["noise"].cat.categories.tolist() == ["sensor-5", "none"]


@pytest.mark.parametrize("column", OTHERS)
def test_what_differs_between_cases_has_a_column(column):
    one, other = describe_case(CASE), describe_case(OTHERS[column])
    assert column in {name for name in one if one[name] != other[name]}
    assert list(one) == [name for name in IDENTITY if name not in ("case", "seed", "run")]


def test_every_part_of_a_task_has_a_column():
    """A new part of a task needs a column."""
    columns = {"steps": "max_steps", "trials": "max_trials"}
    parts = {field.name for field in fields(TaskSpec)} - {"parameters"}
    assert {columns.get(part, part) for part in parts} <= {*IDENTITY}
    assert {*upright.Parameters._fields} <= {*IDENTITY}


def test_no_two_columns_share_a_name():
    for parts in ((IDENTITY, RESULT, ORIGIN), (IDENTITY, TRIAL)):
        names = list(itertools.chain(*parts))
        assert len(names) == len({*names})


@pytest.mark.parametrize("each", COLUMNS)
def test_rows_are_those_of_the_frame(each, store):
    made = pandas.DataFrame(rows(store.runs(), each), columns=list(COLUMNS[each]))
    expected = store.frame(each)
    pandas.testing.assert_frame_equal(made.astype(expected.dtypes), expected)


def test_rows_are_made_run_by_run_as_these_are_read(store):
    read = []
    runs = (read.append(pair) or pair for pair in store.runs())
    assert next(rows(runs, "trial"))[-len(TRIAL) :] == [1, 2, True]
    assert len(read) == 1


@pytest.mark.parametrize("each", COLUMNS)
def test_a_comparison_has_the_same_values_under_the_same_names(each, store):
    compared = upright.Comparison({CASE: store.results(CASE.key, 3)}, seed=3)
    ours, theirs = compared.frame(each), store.frame(each).query("case == 1")
    pandas.testing.assert_frame_equal(ours, theirs[list(ours)])


def test_a_store_of_version_0_1_is_read():
    with upright.Store(ROOT / "tests/data/0.1.0/store.sqlite") as store:
        runs, trials = store.frame(), store.frame("trial")
        assert len(runs) == store._rows("SELECT count(*) FROM runs")[0][0]
    assert set(runs["version"]) == {"unknown"}
    assert not runs.isna().any(axis=None)
    assert len(trials) == runs["trials"].sum()


def test_an_agent_of_a_script_goes_by_its_name():
    name = "__main__:Climber"
    values = {"agent": name, "label": "default", "settings": {"agent_name": name}, "task": {}}
    with upright.Store() as store:
        store.add(json.dumps(values), 0, result(0, 9))
        assert store.frame()["agent"].tolist() == ["Climber"]


def test_other_rows_are_refused(store):
    with pytest.raises(upright.UprightError, match=r"^each is 'case'; it must be one of run, tri"):
        store.frame("case")


def test_without_pandas_a_frame_says_how_to_get_it(store, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(upright.UprightError, match=r"^frame\(\) needs pandas"):
        make_frame(store.runs(), "run")
