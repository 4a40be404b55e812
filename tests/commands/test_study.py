import json
import os
import signal
import subprocess
import time
from pathlib import Path

import pytest
from helpers import COMMAND, ROOT

from upright.commands import run
from upright.studies.store import Store
from upright.studies.study_file import read_study
from upright.support.exit_status import BAD_USE, INTERRUPTED

TEXT = """\
agents = ["random-search"]
noise = ["none", "sensor-5"]
runs = 4
steps = 300
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder with the file of a study."""
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_text(TEXT)
    return tmp_path


def files():
    return sorted(path.name for path in Path().iterdir())


def without_times(text):
    return [{k: v for k, v in row.items() if "seconds" not in k} for row in json.loads(text)]


def test_a_study_ends_with_the_table_of_the_command(capsys):
    assert run(["study", "a.toml", "--format", "json"]) == 0
    shown = capsys.readouterr()
    assert shown.err.endswith("2 cases of 4 runs each\n")
    options = "--agents random-search --noises none,sensor-5 --runs 4 --steps 300 --format json"
    assert run(["table", *options.split()]) == 0
    assert without_times(shown.out) == without_times(capsys.readouterr().out)
    assert files() == ["a.sqlite", "a.toml"]


def test_a_study_goes_on_where_its_store_is(capsys):
    plan = read_study("a.toml")
    assert run(["study", "a.toml"]) == 0
    with Store("a.sqlite") as store:
        first = store.results(plan["cases"][0].key, 0)
    Path("a.toml").write_text(TEXT.replace("runs = 4", "runs = 6"))
    assert run(["study", "a.toml", "--output", "table.txt"]) == 0
    with Store("a.sqlite") as store:
        second = store.results(plan["cases"][0].key, 0)
    assert [result.seconds for result in second[:4]] == [result.seconds for result in first]
    assert len(second) == 6
    assert "6 runs per case" in Path("table.txt").read_text()
    capsys.readouterr()


def test_a_dry_run_tells_what_is_to_be_done_and_writes_nothing(capsys):
    assert run(["study", "a.toml", "--dry-run"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:3] == [
        "study: 2 cases of 4 runs each: 8",
        "store: a.sqlite, which has 0 of them",
        "to do: 8 runs",
    ]
    assert [line.partition(":")[0] for line in lines[3:]] == ["time", "disk", "from"]
    assert lines[-1] == "from: 8 runs of 2 cases, made now and not kept"
    assert files() == ["a.toml"]


def test_the_status_tells_how_far_a_study_is(capsys):
    assert run(["study", "a.toml", "--status"]) == 0
    assert "0 of 8 runs are finished in a.sqlite; time left: unknown." in capsys.readouterr().out
    assert files() == ["a.toml"]
    assert run(["study", "a.toml", "--part", "1/2", "--store", "a.sqlite"]) == 0
    said = capsys.readouterr().out
    assert said.endswith("4 of 4 runs are finished in a.sqlite; nothing is left to do.\n")
    assert run(["study", "a.toml", "--status"]) == 0
    assert "4 of 8 runs are finished in a.sqlite; time left: " in capsys.readouterr().out


def test_each_part_has_a_store_of_its_own(capsys):
    for part in ("1/2", "2/2"):
        assert run(["study", "a.toml", "--part", part]) == 0
    capsys.readouterr()
    assert files() == ["a.1-of-2.sqlite", "a.2-of-2.sqlite", "a.toml"]
    for case in read_study("a.toml")["cases"]:
        found = []
        for name in files()[:2]:
            with Store(name) as store:
                found += [result.run for result in store.results(case.key, 0)]
        assert sorted(found) == [0, 1, 2, 3]


@pytest.mark.parametrize("part", ["3/2", "0/2", "1/0", "2", "-1/2", "1/2/3", "²/3", "1/9999999"])
def test_a_part_that_is_none_is_refused(part, capsys):
    with pytest.raises(SystemExit) as ended:
        run(["study", "a.toml", f"--part={part}"])
    assert ended.value.code == BAD_USE
    assert f"{part!r}; it must be K/N, such as 2/5, with K from 1 to N" in capsys.readouterr().err


@pytest.mark.parametrize("options", [["--dry-run"], ["--status"], []])
def test_a_wrong_file_is_refused_before_anything_runs(options, capsys):
    Path("a.toml").write_text(TEXT + "trails = 5\n")
    assert run(["study", "a.toml", *options]) == BAD_USE
    error = capsys.readouterr().err
    assert "study file is 'a.toml'; line 5, trails: key is 'trails'" in error
    assert "did you mean 'trials'?" in error
    assert error.count("\n") == 1
    assert files() == ["a.toml"]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("store = 'nowhere/a.sqlite'", "line 5, store: store is 'nowhere/a.sqlite'; its folder"),
        ("store = '.'", "line 5, store: store is '.'; it is a folder"),
        ("", "store is 'a.sqlite'; it cannot be used: file is not a database"),
    ],
    ids=["no folder", "folder", "not named"],
)
@pytest.mark.parametrize("options", [["--dry-run"], ["--status"], []])
def test_a_store_that_cannot_be_is_refused_with_its_line(line, said, options, capsys):
    Path("a.toml").write_text(f"{TEXT}{line}\n")
    Path("a.sqlite").write_text("nothing of ours" * 100)
    assert run(["study", "a.toml", *options]) == BAD_USE
    assert f"error: study file is 'a.toml'; {said}" in capsys.readouterr().err
    assert run(["study", "a.toml", "--dry-run", "--store", "other.sqlite"]) == 0


@pytest.mark.slow
def test_the_example_runs(capsys):
    """With fewer and shorter runs."""
    text = (ROOT / "examples/study.toml").read_text()
    assert text.count("runs = 10 ") == text.count("steps = 6000") == 1
    text = text.replace("runs = 10 ", "runs = 1 ").replace("steps = 6000", "steps = 100")
    Path("study.toml").write_text(text)
    assert run(["study", "study.toml", "--format", "csv"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 1 + 36


def finished(path):
    if not path.exists():
        return 0
    with Store(path) as store:
        return sum(1 for _ in store.runs())


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_a_stopped_study_goes_on_and_its_status_can_be_seen_meanwhile(how, folder, capsys):
    Path("a.toml").write_text(TEXT.replace("runs = 4", "runs = 60").replace("300", "60000"))
    process = subprocess.Popen(
        [*COMMAND, "study", "a.toml"],
        cwd=folder,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"COLUMNS": "80"},
    )
    until = time.monotonic() + 200
    while finished(folder / "a.sqlite") < 2:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        time.sleep(0.01)
    assert run(["study", "a.toml", "--status"]) == 0
    assert " of 120 runs are finished in a.sqlite" in capsys.readouterr().out
    process.send_signal(how)
    _, error = process.communicate(timeout=60)
    if how == signal.SIGINT:
        assert process.returncode == INTERRUPTED
        assert "finished runs are kept in a.sqlite; the same command goes on from there" in error
    assert 2 <= finished(folder / "a.sqlite") < 120
    assert run(["study", "a.toml", "--format", "json"]) == 0
    again = without_times(capsys.readouterr().out)
    assert run(["study", "a.toml", "--format", "json", "--store", "whole.sqlite"]) == 0
    assert again == without_times(capsys.readouterr().out)
