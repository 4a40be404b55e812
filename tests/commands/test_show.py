"""What `upright show` and `upright cite` print and write."""

import csv
import json

import numpy as np
import pandas
import pytest

import upright
from upright.commands import run
from upright.reports.citation import FORMATS
from upright.studies.columns import COLUMNS
from upright.studies.learned import learned_policy
from upright.support.exit_status import BAD_USE


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working folder with a store of two runs, an empty one, and a policy."""
    monkeypatch.chdir(tmp_path)
    case = upright.make_case("random-search", steps=9)
    with upright.Store("runs.sqlite") as store:
        store.add(case.key, 0, upright.Result(0, True, np.array([2, 9]), 0.5))
        store.add(case.key, 0, upright.Result(1, True, np.array([1, 4, 9]), 0.5))
    with upright.Store("empty.sqlite") as store:
        store._open_to_write()
    policy = learned_policy(case, 0, 0, case.settings.agent(None))
    upright.save_policy("policy.npz", policy)
    return tmp_path


def frame(each):
    with upright.Store("runs.sqlite") as store:
        return store.frame(each)


@pytest.mark.parametrize("each", COLUMNS)
def test_rows_are_shown_as_csv_unless_another_format_is_asked_for(each, folder, capsys):
    assert run(["show", "runs.sqlite", "--each", each]) == 0
    shown = list(csv.DictReader(capsys.readouterr().out.splitlines()))
    assert run(["show", "runs.sqlite", "--each", each, "--format", "json"]) == 0
    values = json.loads(capsys.readouterr().out)
    steps = frame(each)["steps"].tolist()
    assert [int(row["steps"]) for row in shown] == [row["steps"] for row in values] == steps


@pytest.mark.parametrize("name", ["csv", "json"])
def test_a_file_holds_what_the_screen_shows(name, folder, capsys):
    line = ["show", "runs.sqlite", "--each", "trial", "--format", name]
    assert run([*line, "--output", "trials"]) == 0
    assert capsys.readouterr().out == ""
    assert run(line) == 0
    assert (folder / "trials").read_bytes() == capsys.readouterr().out.encode()


@pytest.mark.parametrize(("words", "each"), [([], "run"), (["--each", "trial"], "trial")])
def test_parquet_is_of_runs_unless_trials_are_asked_for(words, each, folder):
    pytest.importorskip("pyarrow")
    assert run(["show", "runs.sqlite", *words, "--format", "parquet", "--output", "p"]) == 0
    pandas.testing.assert_frame_equal(pandas.read_parquet(folder / "p"), frame(each))


def test_without_rows_the_table_is_shown_as_before(folder, capsys):
    assert run(["show", "runs.sqlite", "--format", "csv"]) == 0
    (row,) = csv.DictReader(capsys.readouterr().out.splitlines())
    assert (row["runs"], row["mean_trials"]) == ("2", "2.5")
    assert run(["show", "runs.sqlite", "--each", "case"]) == 0
    assert "2 runs per case" in capsys.readouterr().out
    assert run(["show", "policy.npz"]) == 0
    assert "random-search" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("runs.sqlite --format parquet", "format is 'parquet'; it is not for a screen"),
        ("runs.sqlite --each case --format parquet", "format with --each case is 'parquet'; it mu"),
        ("runs.sqlite --each run --format text", "format with --each run is 'text'; it must be o"),
        ("empty.sqlite --each run", "store is 'empty.sqlite'; it holds no runs"),
        ("absent.sqlite --each run", "store is 'absent.sqlite'; there is no such file"),
        ("policy.npz --each run", "--each is 'run'; it needs a store, and this is a policy"),
        ("policy.npz --format csv", "format of a policy is 'csv'; it must be one of text"),
        ("runs.sqlite --each run --output no/a.csv", "output is 'no/a.csv'; its folder does not"),
    ],
)
def test_what_is_not_possible_is_refused_in_one_line(line, told, folder, capsys):
    before = sorted(folder.iterdir())
    assert run(["show", *line.split()]) == BAD_USE
    error = capsys.readouterr().err
    assert error.startswith(f"upright: error: {told}")
    assert error.count("\n") == 1
    assert sorted(folder.iterdir()) == before


def test_a_file_is_replaced_only_when_all_is_written(folder, monkeypatch):
    (folder / "runs.csv").write_text("old")
    monkeypatch.setattr("upright.reports.data_files.csv.writer", lambda *_, **__: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        run(["show", "runs.sqlite", "--each", "run", "--output", "runs.csv"])
    assert (folder / "runs.csv").read_text() == "old"
    assert {path.name for path in folder.iterdir()} == {
        "runs.sqlite",
        "empty.sqlite",
        "policy.npz",
        "runs.csv",
    }


@pytest.mark.parametrize("name", FORMATS)
def test_a_citation_is_printed_or_written(name, folder, capsys):
    assert run(["cite", "--format", name]) == 0
    assert capsys.readouterr().out == FORMATS[name]()
    assert run(["cite", "--format", name, "--output", "citation"]) == 0
    assert (folder / "citation").read_text() == FORMATS[name]()
