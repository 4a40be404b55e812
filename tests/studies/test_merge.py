import os
import sqlite3
import subprocess
import sys

import numpy as np
import pytest
from helpers import COMMAND, ROOT, python

from upright.commands import run
from upright.core.trials import Result
from upright.errors import UprightError
from upright.studies.merge import merge
from upright.studies.store import Store

KEYS = ['{"agent": "one"}', '{"agent": "other"}']
OLD = ROOT / "tests/data/stores/0.2.0.sqlite"


def fill(path, runs, environment=None, **changes):
    with Store(path) as store:
        for key in KEYS:
            for number in runs:
                result = Result(number, True, np.array([number, number + 1]), 0.5)
                store.add(key, 1, result._replace(**changes), environment)
    return path


def contents(path):
    with Store(path, must_exist=True) as store:
        return {
            (key, row.seed, row.run): (row.success, lengths, row.seconds, row.ended)
            for key, row, lengths in store.each_run()
        }


@pytest.fixture
def two(tmp_path):
    return [fill(tmp_path / "a.sqlite", range(5)), fill(tmp_path / "b.sqlite", range(3, 9))]


def test_runs_of_several_stores_are_in_one_afterwards(two, tmp_path):
    before = [path.read_bytes() for path in two]
    merged = merge([*two, OLD], tmp_path / "all.sqlite")
    assert (merged.added, merged.equal, merged.is_sound) == (18 + 10, 4, True)
    assert contents(tmp_path / "all.sqlite") == {
        **contents(two[1]),
        **contents(two[0]),
        **contents(OLD),
    }
    assert [path.read_bytes() for path in two] == before
    again = merge([tmp_path / "all.sqlite", *two], tmp_path / "all.sqlite")
    assert (again.added, again.equal) == (0, 28 + 22)
    assert sorted(os.listdir(tmp_path)) == ["a.sqlite", "all.sqlite", "b.sqlite"]


def test_what_a_deleted_store_left_behind_is_not_applied_to_the_output(two, tmp_path):
    output = tmp_path / "all.sqlite"
    kill = "import os, signal; os.kill(os.getpid(), signal.SIGKILL)"
    python(
        "from upright.studies.store import Store; import numpy as np\n"
        "from upright.core.trials import Result\n"
        f"store = Store({str(output)!r})\n"
        "store.add('other', 1, Result(0, True, np.array([1]), 0.5)); " + kill
    )
    output.unlink()
    assert (tmp_path / "all.sqlite-wal").stat().st_size
    assert merge(two, output).added == 18
    assert len(contents(output)) == 18


def test_an_output_that_another_process_made_at_the_same_time_is_left_alone(two, tmp_path):
    output = tmp_path / "all.sqlite"
    other = iter([lambda: merge(two[1:], output)])
    with pytest.raises(UprightError, match=r"all\.sqlite'; another process made it at the same"):
        merge(two[:1], output, on_read=lambda: next(other, lambda: None)())
    assert contents(output) == contents(two[1])
    assert sorted(os.listdir(tmp_path)) == ["a.sqlite", "all.sqlite", "b.sqlite"]


def test_a_run_that_differs_is_reported_with_both_environments(two, tmp_path, capsys):
    odd = {"lengths": np.array([1, 2, 3])}
    broken = fill(tmp_path / "broken.sqlite", [4], '{"host": "node-17"}', **odd)
    output = tmp_path / "all.sqlite"
    assert run(["merge", *map(str, two), str(broken), "--output", str(output)]) == 1
    told = capsys.readouterr().out
    assert "18 runs added, 4 there already and the same, 2 different" in told
    assert "run 4 of seed 1 of" in told
    assert f"in {broken}: node-17" in told
    assert f"in {output}: {os.uname().nodename}" in told
    assert contents(output)[KEYS[0], 1, 4] == contents(two[0])[KEYS[0], 1, 4]


def test_what_a_terminal_would_obey_is_shown_as_its_code(tmp_path, capsys):
    paths = [
        fill(
            tmp_path / f"{lengths}.sqlite", [4], '{"host": "\\u001b[2J"}', lengths=np.array(lengths)
        )
        for lengths in ([1, 2], [1, 3])
    ]
    assert run(["merge", *map(str, paths), "--output", str(tmp_path / "all.sqlite")]) == 1
    assert run(["show", str(paths[0]), "--each", "environment"]) == 0
    told = capsys.readouterr().out
    assert told.count(r"\x1b[2J") == 5
    assert "\x1b" not in told


def test_environments_are_carried_over(two, tmp_path):
    other = fill(tmp_path / "c.sqlite", [20], '{"host": "node-17"}')
    merge([*two, other], tmp_path / "all.sqlite")
    with Store(tmp_path / "all.sqlite") as store:
        assert sorted(runs for _, runs in store.environments().values()) == [2, 18]
        assert store.find(KEYS[0], 1, 20).environment == '{"host": "node-17"}'


def test_damaged_runs_are_left_out_and_reported(two, tmp_path):
    database = sqlite3.connect(two[0])
    database.execute("UPDATE runs SET lengths = X'00000000' WHERE run = 2")
    database.commit()
    database.close()
    merged = merge([two[0]], tmp_path / "saved.sqlite")
    assert (merged.added, merged.damaged.total, merged.is_sound) == (8, 2, False)
    assert f"run 2 of seed 1 of case 1 of {str(two[0])!r}" in str(merged)


@pytest.mark.parametrize("present", [False, True])
def test_a_merge_that_fails_writes_nothing(present, two, tmp_path):
    output, names = tmp_path / "all.sqlite", sorted(os.listdir(tmp_path))
    if present:
        fill(output, [99])
        names.append("all.sqlite")
    before = contents(output) if present else None

    def fail():
        nonlocal left
        left -= 1
        if not left:
            raise KeyboardInterrupt

    left = 13
    with pytest.raises(KeyboardInterrupt):
        merge(two, output, on_read=fail)
    for wrong in ("absent.sqlite", OLD.parent):
        with pytest.raises(UprightError, match=r"^store is"):
            merge([*two, wrong], output)
    assert sorted(os.listdir(tmp_path)) == sorted(names)
    if present:
        assert contents(output) == before


def test_what_is_not_possible_ends_with_status_2(two, tmp_path):
    line = [*COMMAND, "merge", str(two[0]), "--output", str(tmp_path / "no" / "all.sqlite")]
    done = subprocess.run(line, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("upright: error: ")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("disk", ["full", "read-only"])
def test_an_output_that_no_disk_takes_is_one_sentence_and_leaves_nothing(disk, two, tmp_path):
    folder = tmp_path / "disk"
    folder.mkdir()
    options = ["size=64k"] if disk == "full" else ["ro"]
    mount = ["mount", "-t", "tmpfs", "-o", *options, "tmpfs", str(folder)]
    if sys.platform != "linux" or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("mounting is not allowed here")
    try:
        output = folder / "all.sqlite"
        with pytest.raises(UprightError) as caught:
            merge([fill(tmp_path / "c.sqlite", range(200)), *two], output)
        assert str(output) in str(caught.value)
        assert ".part" not in str(caught.value)
        assert os.listdir(folder) == []
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def test_a_folder_where_the_log_is_to_be_is_refused(two, tmp_path):
    (tmp_path / "all.sqlite-wal").mkdir()
    with pytest.raises(UprightError, match=r"all\.sqlite-wal' is in its way"):
        merge(two, tmp_path / "all.sqlite")
