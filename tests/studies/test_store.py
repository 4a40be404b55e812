import json
import os
import shutil
import sqlite3
import subprocess
import sys
import threading
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from helpers import ROOT, python

from upright import __version__
from upright.core.trials import Result
from upright.errors import UprightError
from upright.studies.case import make_case
from upright.studies.database import Database, log_of
from upright.studies.schema import NEWEST
from upright.studies.store import Store
from upright.studies.study import study

KEY = '{"agent": "any"}'


def result(run, *lengths, success=True):
    return Result(run, success, np.array(lengths, np.int64), 0.5)


def rows(store, key=KEY, seed=1):
    return [(r.run, r.success, r.lengths.tolist(), r.seconds) for r in store.results(key, seed)]


@pytest.fixture(params=["file", "memory"])
def store(request, tmp_path):
    store = Store(tmp_path / "results.db" if request.param == "file" else None)
    yield store
    store.close()


def integrity(path):
    database = sqlite3.connect(path)
    ((answer,),) = database.execute("PRAGMA integrity_check")
    database.close()
    return answer


# ------------------------------------------------------------------------------ round trip


def test_results_come_back_in_order(store):
    store.add(KEY, 1, result(2, 7, 60_000))
    store.add(KEY, 1, result(0, 1, 2, 3, success=False))
    assert rows(store) == [(0, False, [1, 2, 3], 0.5), (2, True, [7, 60_000], 0.5)]
    assert store.results(KEY, 1)[0].lengths.dtype == np.int64
    assert store.finished(KEY, 1) == {0, 2}
    assert [r.run for r in store.results(KEY, 1, runs=2)] == [0]


def test_the_longest_trial_comes_back(store):
    store.add(KEY, 1, result(0, 10**9))
    assert rows(store)[0][2] == [10**9]


def test_cases_and_seeds_are_kept_apart(store):
    other = '{"agent": "other"}'
    store.add(KEY, 1, result(0, 1))
    store.add(KEY, 2, result(1, 2))
    store.add(other, 1, result(2, 3))
    assert store.finished(KEY, 1) == {0}
    assert store.finished(KEY, 2) == {1}
    assert store.finished(other, 1) == {2}
    assert store.finished(other, 2) == set()
    assert list(store.cases()) == [
        ({"agent": "any"}, KEY, 1),
        ({"agent": "any"}, KEY, 2),
        ({"agent": "other"}, other, 1),
    ]


def test_the_first_result_of_a_run_stays(store):
    store.add(KEY, 1, result(0, 1))
    store.add(KEY, 1, result(0, 2))
    assert rows(store) == [(0, True, [1], 0.5)]


def test_several_runs_are_stored_as_a_whole_or_not_at_all(store):
    store.add_several([(KEY, result(0, 1)), ("{}", result(0, 2)), (KEY, result(0, 3))], 1)
    assert rows(store) == [(0, True, [1], 0.5)]
    assert rows(store, "{}") == [(0, True, [2], 0.5)]
    with pytest.raises(AttributeError):
        store.add_several([(KEY, result(1, 1)), (KEY, None)], 1)
    assert store.finished(KEY, 1) == {0}


@pytest.mark.parametrize("read", ["cases", "each_run"])
def test_a_case_that_is_written_while_the_store_is_read_is_no_damage(read, tmp_path, monkeypatch):
    path, keys = tmp_path / "runs.sqlite", Store._keys

    def keys_then_another(store):
        found = keys(store)
        with Store(path) as other:
            other.add('{"agent": "new"}', 1, result(0, 1))
        return found

    with Store(path) as store:
        store.add(KEY, 1, result(0, 1))
    with Store(path) as store, monkeypatch.context() as patch:
        patch.setattr(Store, "_keys", keys_then_another)
        assert len(list(getattr(store, read)())) in (1, 2)


def test_the_largest_seed_is_kept(store):
    store.add(KEY, 2**63 - 1, result(0, 1))
    assert store.finished(KEY, 2**63 - 1) == {0}


def test_a_file_is_found_again(tmp_path):
    for run in range(3):
        store = Store(tmp_path / "results.db")
        assert store.finished(KEY, 1) == set(range(run))
        store.add(KEY, 1, result(run, 5))
        store.close()
    assert os.listdir(tmp_path) == ["results.db"]


def test_memory_is_not_shared():
    first, second = Store(), Store()
    first.add(KEY, 1, result(0, 1))
    assert second.finished(KEY, 1) == set()
    first.close()
    second.close()


# ------------------------------------------------------------------------------ what is no store


def foreign_database(path):
    database = sqlite3.connect(path)
    database.execute("CREATE TABLE runs (precious TEXT)")
    database.execute("INSERT INTO runs VALUES ('data')")
    database.commit()
    database.close()


def text(path):
    path.write_text("Dear diary, this is no database, and it is longer than a header.\n" * 50)


def beheaded_store(path):
    store = Store(path)
    store.add(KEY, 1, result(0, 1))
    store.close()
    content = bytearray(path.read_bytes())
    content[100:] = b"\xff" * (len(content) - 100)
    path.write_bytes(content)


def truncated_store(path):
    store = Store(path)
    store.add(KEY, 1, result(0, *range(3000)))
    store.close()
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])


@pytest.mark.parametrize("make", [foreign_database, text, beheaded_store])
def test_a_file_that_is_no_store_is_refused_and_left_alone(make, tmp_path):
    path = tmp_path / "precious.db"
    make(path)
    content = path.read_bytes()
    with pytest.raises(UprightError, match=r"precious\.db"):
        Store(path)
    assert path.read_bytes() == content
    assert os.listdir(tmp_path) == ["precious.db"]


def damaged_rows(path):
    """Make a store whose first pages are intact and whose rows are damaged."""
    store = Store(path)
    for run in range(50):
        store.add(KEY, 1, result(run, *range(500)))
    store.close()
    content = bytearray(path.read_bytes())
    content[5 * 4096 :] = b"\xff" * (len(content) - 5 * 4096)
    path.write_bytes(content)


@pytest.mark.parametrize("make", [truncated_store, damaged_rows])
def test_damage_is_reported_when_it_is_found(make, tmp_path):
    path = tmp_path / "damaged.db"
    make(path)
    store = None
    try:
        with pytest.raises(UprightError, match=r"damaged\.db"):  # noqa: PT012
            store = Store(path)
            store.finished(KEY, 1)
            store.results(KEY, 1)
    finally:
        if store is not None:
            store.close()


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(UprightError, match=str(tmp_path)):
        Store(tmp_path)


@pytest.mark.parametrize("must_exist", [False, True])
def test_a_missing_folder_is_refused_and_not_made(must_exist, tmp_path):
    path = tmp_path / "nowhere" / "results.db"
    with pytest.raises(UprightError, match="nowhere"):
        Store(path, must_exist=must_exist)
    assert not path.parent.exists()


def test_a_missing_file_is_refused_if_it_must_exist(tmp_path):
    with pytest.raises(UprightError, match="there is no such file"):
        Store(tmp_path / "results.db", must_exist=True)
    assert os.listdir(tmp_path) == []


def test_a_file_is_made_when_the_first_run_is_stored(tmp_path):
    path = tmp_path / "results.db"
    with Store(path) as store:
        assert store.finished(KEY, 1) == set()
        assert store.results(KEY, 1) == store.cases() == []
        assert store.version(KEY, 1) is None
        assert not list(tmp_path.iterdir())
        with Store(path) as other:
            other.add(KEY, 1, result(0, 1))
        assert store.finished(KEY, 1) == {0}
        store.add(KEY, 1, result(1, 1))
        assert store.finished(KEY, 1) == {0, 1}


def test_a_study_that_fails_leaves_no_file(tmp_path):
    case = make_case("random-search", steps=300)
    with Store(tmp_path / "results.db") as store:
        with pytest.raises(UprightError, match="runs is 0"):
            study([case], 0, 0, store)
        with pytest.raises(UprightError, match="cases is"):
            study([case, "reinforce"], 1, 0, store)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("wrong", [3, ["runs.sqlite"], b"runs.sqlite", True])
def test_what_is_not_a_path_is_refused(wrong):
    with pytest.raises(UprightError, match=r"^store is .*; it must be the path of a file"):
        Store(wrong)


# ------------------------------------------------------------------------------ versions


def test_the_version_that_made_the_runs_is_kept(store, monkeypatch):
    store.add(KEY, 1, result(0, 1))
    assert store.version(KEY, 1) == __version__
    monkeypatch.setattr("upright.studies.store.__version__", "9.9")
    store.add(KEY, 1, result(1, 1))
    assert store.version(KEY, 1) == f"{__version__} and 9.9"
    assert store.version(KEY, 2) is None


# ------------------------------------------------------------------------------ earlier forms

OLD = {
    "0.1": ROOT / "tests/data/0.1.0/store.sqlite",
    "0.2": ROOT / "tests/data/stores/0.2.0.sqlite",
    "unreleased": ROOT / "tests/data/stores/unreleased.sqlite",
}
"""Stores that the code of earlier versions wrote."""


@pytest.fixture(params=OLD)
def old(request, tmp_path):
    return shutil.copy(OLD[request.param], tmp_path / "old.sqlite")


def contents(path):
    with Store(path, must_exist=True) as store:
        return [(about, r[:2], r.lengths.tolist(), r.seconds) for about, r in store.runs()]


def outcomes(path):
    with Store(path, must_exist=True) as store:
        return [[a.tolist() for a in store.outcomes(key, seed)] for _, key, seed in store.cases()]


def form(path):
    database = sqlite3.connect(path)
    ((version,),) = database.execute("PRAGMA user_version")
    database.close()
    return version


def test_an_old_store_is_read_without_a_change_and_gets_the_present_form_with_a_run(old, tmp_path):
    bytes_before, before, summary = old.read_bytes(), contents(old), outcomes(old)
    assert len(before) >= 6
    assert (old.read_bytes(), os.listdir(tmp_path)) == (bytes_before, ["old.sqlite"])
    with Store(old) as store:
        version = before[0][0]["version"]
        known = None if version == "unknown" else version
        assert store.version(*store.cases()[0][1:]) == known
        store.add(KEY, 1, result(0, 1))
        assert store.version(KEY, 1) == __version__
        assert rows(store) == [(0, True, [1], 0.5)]
    assert integrity(old) == "ok"
    assert form(old) == NEWEST
    database = sqlite3.connect(old)
    database.execute(
        "DELETE FROM runs WHERE case_id = (SELECT id FROM cases WHERE key = ?)", (KEY,)
    )
    database.commit()
    database.close()
    assert contents(old) == before
    assert outcomes(old) == summary


def test_the_trials_in_old_stores_are_those_that_were_recorded():
    expected = [[9, 174, 11, 300], [9, 9, 10, 9, 9, 300]]
    for name in ("0.2", "unreleased"):
        with Store(OLD[name]) as store:
            key, seed = store.cases()[1][1:]
            assert [r.lengths.tolist() for r in store.results(key, seed, 2)] == expected
            assert store.environments() == {0: ("", 10)}


def test_a_recorded_store_of_the_present_form_is_read(tmp_path):
    """Whoever changes the tables adds a form, and leaves this file as it is."""
    path = shutil.copy(ROOT / "tests/data/stores/form-3.sqlite", tmp_path)
    recorded = contents(path)
    assert [lengths for _, _, lengths, _ in recorded] == [[9, 174, 11, 300], [9, 9, 10, 9, 9, 300]]
    with Store(path) as store:
        assert store.environments() == {1: (store.find(*store.cases()[0][1:], 0).environment, 2)}
        store.add(KEY, 1, result(0, 1))
        assert [r.lengths.tolist() for r in store.results(*store.cases()[0][1:])] == [
            lengths for _, _, lengths, _ in recorded
        ]
    assert form(path) == NEWEST


WRITES_AND_DIES = """
import os, signal
from upright.studies.store import Store
from helpers import Result, np
store = Store({path!r})
for run in range(5):
    store.add('{key}', 1, Result(run, True, np.array([1, run]), 0.5))
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture
def killed(tmp_path):
    """A store whose writer was killed: its runs are in the log alone."""
    path = tmp_path / "killed" / "runs.sqlite"
    path.parent.mkdir()
    code = WRITES_AND_DIES.format(path=str(path), key=KEY)
    died = python(code, PYTHONPATH=os.pathsep.join(sys.path))
    assert died.returncode == -9, died.stderr
    assert log_of(path).stat().st_size
    return path


def test_what_a_killed_process_wrote_is_read_without_a_change(killed):
    def files():
        return {path: path.read_bytes() for path in (killed, log_of(killed))}

    before = files()
    with Store(killed, must_exist=True) as store:
        assert store.finished(KEY, 1) == set(range(5))
    assert files() == before
    with Store(killed) as store:
        store.recover()
    assert os.listdir(killed.parent) == ["runs.sqlite"]
    with Store(killed) as store:
        assert store.finished(KEY, 1) == set(range(5))


def test_a_study_takes_in_what_a_killed_one_left(killed):
    case = make_case("random-search", steps=300)
    with Store(killed) as store:
        store.add(case.key, 0, result(0, 300))
    python(WRITES_AND_DIES.format(path=str(killed), key=KEY), PYTHONPATH=os.pathsep.join(sys.path))
    assert log_of(killed).exists()
    with Store(killed) as store:
        study([case], 1, 0, store)
    assert os.listdir(killed.parent) == ["runs.sqlite"]


def test_a_migration_that_is_killed_leaves_the_old_store(old, tmp_path):
    before = contents(old)
    code = (
        "import os, signal, upright.studies.schema as schema\n"
        "from upright.studies.store import Store\n"
        "schema._insert = lambda *_: os.kill(os.getpid(), signal.SIGKILL)\n"
        f"Store({str(old)!r})._open_to_write()"
    )
    assert python(code).returncode == -9
    assert contents(old) == before
    with Store(old) as store:
        store.add(KEY, 1, result(0, 1))
    assert form(old) == NEWEST
    assert os.listdir(tmp_path) == ["old.sqlite"]


def test_a_store_of_a_newer_version_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "new.sqlite"
    with Store(path) as store:
        store.add(KEY, 1, result(0, 1))
    database = sqlite3.connect(path)
    database.execute(f"PRAGMA user_version = {NEWEST + 1}")
    database.execute("ALTER TABLE runs ADD COLUMN more TEXT")
    database.close()
    content = path.read_bytes()
    with pytest.raises(UprightError, match=r"new\.sqlite'; it was written by a newer version"):
        Store(path)
    assert path.read_bytes() == content


def test_a_case_of_a_newer_version_is_refused_by_its_part(tmp_path):
    case = make_case("random-search", steps=300)
    key = json.dumps(json.loads(case.key) | {"weather": "fine"})
    with Store(tmp_path / "new.sqlite") as store:
        store.add(key, 1, result(0, 1))
        with pytest.raises(UprightError, match=r"new\.sqlite'; .* part of a case is 'weather'"):
            list(store.runs())


@pytest.mark.parametrize("content", [b"", None])
def test_reading_makes_no_store_of_an_empty_file(content, tmp_path):
    path = tmp_path / "results.db"
    path.write_bytes(content or b"")
    if content is None:  # a database without tables
        database = sqlite3.connect(path)
        database.execute("PRAGMA journal_mode = WAL")
        database.close()
    before = path.read_bytes()
    with Store(path, must_exist=True) as store:
        assert store.cases() == []
        assert store.finished(KEY, 1) == set()
    assert (path.read_bytes(), os.listdir(tmp_path)) == (before, ["results.db"])


@pytest.mark.parametrize("name", [":memory:", "file:runs?mode=memory", "t%41.db", "q?mode=ro#x.db"])
def test_a_name_is_the_name_of_a_file_whatever_it_looks_like(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with Store(name) as store:
        store.add(KEY, 1, result(0, 1))
    assert os.listdir(tmp_path) == [name]
    with Store(name) as store:
        assert store.finished(KEY, 1) == {0}


@pytest.mark.parametrize("name", ["", "a\0b", "/dev/null"])
def test_what_cannot_be_a_file_is_refused(name):
    with pytest.raises(UprightError, match=r"^store is .*; it (must be the name of|is not a reg)"):
        Store(name)


@pytest.mark.parametrize("lost", ["deleted", "replaced", "log", "folder"])
@pytest.mark.parametrize("moment", ["as it goes on", "at the end"])
def test_a_store_that_is_lost_as_it_is_written_is_kept_elsewhere(
    lost, moment, tmp_path, monkeypatch
):
    folder, refuge = tmp_path / "folder", tmp_path / "refuge"
    for each in (folder, refuge):
        each.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(refuge))
    path = folder / "runs.sqlite"
    store = Store(path)
    store.add(KEY, 1, result(0, 1))
    if lost == "folder":
        shutil.rmtree(folder)
    else:
        (log_of(path) if lost == "log" else path).unlink()
    if lost == "replaced":
        path.write_text("something else")
    at_the_end = moment == "at the end"
    with pytest.raises(UprightError, match=r"runs\.sqlite'; it was deleted") as caught:
        store.close() if at_the_end else store.add(KEY, 1, result(1, 1))
    (kept,) = (refuge if lost == "folder" else folder).glob("*rescued*")
    assert str(kept) in str(caught.value)
    expected = {0} if at_the_end else {0, 1}
    with Store(kept) as saved:
        assert saved.finished(KEY, 1) == expected
        saved.add('{"agent": "other"}', 1, result(0, *range(3000)))
    store.close()
    folder.mkdir(exist_ok=True)
    kept.replace(path)
    with Store(path) as saved:  # no log of the lost file is applied to it
        assert saved.finished(KEY, 1) == expected
        assert saved.count() == len(expected) + 1


@pytest.mark.parametrize("others", ["deleted", "replaced", "kept"])
def test_a_store_that_is_deleted_as_its_tables_are_made_is_kept_elsewhere(
    others, tmp_path, monkeypatch
):
    path, commands = tmp_path / "runs.sqlite", []
    run = Database.run

    def deleting(database, statement, values=()):
        run(database, statement, values)
        commands.append(statement)
        if statement == "COMMIT" and commands.count("COMMIT") == 1:
            for each in tmp_path.glob("runs.sqlite*" if others == "deleted" else "runs.sqlite"):
                each.unlink()
            if others == "replaced":
                path.write_text("something else")

    monkeypatch.setattr(Database, "run", deleting)
    with pytest.raises(UprightError, match=r"runs\.sqlite'; it was deleted"), Store(path) as store:
        store.add(KEY, 1, result(0, 1))
    (kept,) = tmp_path.glob("*rescued*.sqlite")
    with Store(kept) as saved:
        assert saved.finished(KEY, 1) == {0}


def test_a_program_that_changes_its_folder_loses_no_store(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with Store("runs.sqlite") as store:
        store.add(KEY, 1, result(0, 1))
        (tmp_path / "elsewhere").mkdir()
        monkeypatch.chdir(tmp_path / "elsewhere")
        store.add(KEY, 1, result(1, 1))
    assert not [*tmp_path.glob("*rescued*")]
    with Store(tmp_path / "runs.sqlite") as store:
        assert store.finished(KEY, 1) == {0, 1}


# ------------------------------------------------------------------------------ disks

as_root = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0 or not shutil.which("mount"),
    reason="only root can mount a disk",
)


@contextmanager
def mounted(folder, *options):
    if subprocess.run(
        ["mount", *options, str(folder)], check=False, capture_output=True
    ).returncode:
        pytest.skip("mounting is not allowed here")
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


@as_root
@pytest.mark.parametrize("name", ["present", "old", "killed"])
def test_a_store_on_a_read_only_disk_is_read_but_not_written(name, tmp_path, killed):
    folder = tmp_path / "disk"
    folder.mkdir()
    path = folder / "runs.sqlite"
    if name == "killed":
        for each in killed.parent.iterdir():
            shutil.copy(each, folder)
    elif name == "old":
        shutil.copy(OLD["0.2"], path)
    else:
        with Store(path) as store:
            store.add(KEY, 1, result(0, 1))
    before = contents(path) if name == "old" else None
    with mounted(folder, "--bind", str(folder)):
        subprocess.run(["mount", "-o", "remount,bind,ro", str(folder)], check=True)
        with Store(path, must_exist=True) as store:
            if name == "old":
                assert [r.lengths.tolist() for _, r in store.runs()] == [each[2] for each in before]
            else:
                assert store.finished(KEY, 1) >= {0}
            with pytest.raises(UprightError, match=r"runs\.sqlite'; it cannot be written to"):
                store.add(KEY, 1, result(9, 1))


@as_root
def test_a_log_on_a_read_only_disk_that_cannot_be_read_is_explained(tmp_path, killed):
    Path(f"{killed}-shm").unlink()
    with mounted(killed.parent, "--bind", str(killed.parent)):
        subprocess.run(["mount", "-o", "remount,bind,ro", str(killed.parent)], check=True)
        with pytest.raises(
            UprightError, match=r"runs\.sqlite'; .*; a process that wrote it was kil"
        ):
            Store(killed)


@as_root
def test_runs_that_ended_before_the_disk_was_full_are_kept(tmp_path):
    with mounted(tmp_path, "-t", "tmpfs", "-o", "size=256k", "none"):
        path, numbers = tmp_path / "runs.sqlite", np.random.default_rng(0)
        kept = 0
        with Store(path) as store, pytest.raises(UprightError, match=r"used: .*"):  # noqa: PT012
            for run in range(1000):
                store.add(KEY, 1, result(run, *numbers.integers(1, 10**9, 1000)))
                kept += 1
        assert 0 < kept < 1000
        for must_exist in (False, True):
            with Store(path, must_exist=must_exist) as store:
                assert store.finished(KEY, 1) == set(range(kept))
                assert len(store.results(KEY, 1)) == kept
        assert integrity(path) == "ok"


def test_an_empty_file_becomes_a_store(tmp_path):
    path = tmp_path / "results.db"
    path.touch()
    store = Store(path)
    store.add(KEY, 1, result(0, 1))
    store.close()
    assert integrity(path) == "ok"


def test_a_full_disk_is_reported_and_loses_nothing(tmp_path):
    path = tmp_path / "results.db"
    store = Store(path)
    store.add(KEY, 1, result(0, 1))
    ((pages,),) = store._rows("PRAGMA page_count")
    store._rows(f"PRAGMA max_page_count = {pages}")
    with pytest.raises(UprightError, match=r"results\.db'; it cannot be used: .*full"):
        store.add(KEY, 1, result(1, *range(10**5)))
    assert store.finished(KEY, 1) == {0}
    store.close()
    assert integrity(path) == "ok"


# ------------------------------------------------------------------------------ several processes


CROWD = """
import multiprocessing
from helpers import write_results

context = multiprocessing.get_context("fork")
barrier = context.Barrier(32)
spans = [(10 * number, 10 * number + 20) for number in range(32)]
workers = [
    context.Process(target=write_results, args=({path!r}, '{key}', *span, barrier))
    for span in spans
]
for worker in workers:
    worker.start()
for worker in workers:
    worker.join()
print([worker.exitcode for worker in workers] == 32 * [0])
"""


@pytest.mark.slow
def test_many_processes_write_to_one_store(tmp_path):
    """They open a new file at the same moment, and most of their runs are the same."""
    path = tmp_path / "results.db"
    told = python(CROWD.format(path=str(path), key=KEY), PYTHONPATH=os.pathsep.join(sys.path))
    assert told.stdout == "True\n", told.stderr
    with Store(path) as store:
        assert rows(store) == [(run, True, [run, run + 1], 0.5) for run in range(330)]
    assert integrity(path) == "ok"


def test_writing_waits_for_another_process_that_is_making_the_store(tmp_path):
    """That process has marked the file as a store, and is not done with it."""
    path = tmp_path / "results.db"
    with Store(path) as store:
        store.add(KEY, 1, result(0, 1))
    other = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    other.execute("PRAGMA journal_mode = DELETE")
    other.execute("BEGIN IMMEDIATE")
    release = threading.Timer(0.3, other.execute, ["COMMIT"])
    release.start()
    try:
        with Store(path) as store:
            assert rows(store) == [(0, True, [1], 0.5)]
            assert other.in_transaction, "reading waited"
            store.add(KEY, 1, result(1, 1))
        assert not other.in_transaction, "writing did not wait"
    finally:
        release.join()
        other.close()


KILLED_STUDY = """
import os, signal, sys
from upright.studies.database import log_of
from upright.studies.schema import NEWEST
from upright.studies.store import Store
from upright.studies.case import make_case
from upright.studies.study import study

def die():
    os.kill(os.getpid(), signal.SIGKILL)

heard = 0
def after_a_result(case, result):
    global heard
    heard += 1
    print(result.run, flush=True)
    if {moment!r} == "between two" and heard == 5:
        die()

def within_a_write(statement):
    if {moment!r} == "within one" and heard == 5 and "INTO runs" in statement:
        die()

store = Store({path!r})
store._open_to_write()._connection.set_trace_callback(within_a_write)
study([make_case("random-search", steps=500)], 30, 7, store, after_a_result)
"""


@pytest.mark.parametrize("moment", ["between two", "within one"])
def test_a_killed_study_continues_where_it_stopped(moment, tmp_path):
    path, case = tmp_path / "results.db", make_case("random-search", steps=500)
    killed = python(KILLED_STUDY.format(path=str(path), moment=moment))
    assert killed.returncode == -9, killed.stderr
    finished = {int(line) for line in killed.stdout.split()}
    assert len(finished) == 5
    store = Store(path)
    assert store.finished(case.key, 7) == finished
    heard = []
    study([case], 30, 7, store, lambda case, result: heard.append(result.run))
    assert sorted({*heard} | finished) == list(range(30))
    assert not {*heard} & finished
    whole = Store()
    study([case], 30, 7, whole)
    assert [r[:3] for r in rows(store, case.key, 7)] == [r[:3] for r in rows(whole, case.key, 7)]
    store.close()
    whole.close()
    assert integrity(path) == "ok"
