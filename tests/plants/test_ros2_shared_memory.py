"""What ended processes leave in shared memory is removed, and nothing else."""

import os

import pytest

pytest.importorskip("fcntl")

import fcntl

from upright.plants.ros2 import shared_memory
from upright.plants.ros2.shared_memory import remove_left_over

SEGMENT = "fastdds_00c0ffee12345678"
OTHERS = ["fastdds_port7411", "fastdds_port7411_el", "another_0123456789abcdef_el", "lttng-ust-6"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(shared_memory, "FOLDER", tmp_path)
    for name in (SEGMENT, f"{SEGMENT}_el", *OTHERS):
        (tmp_path / name).touch()
    for path in tmp_path.iterdir():
        os.utime(path, (0, 0))
    return tmp_path


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_what_nobody_has_locked_is_removed(folder):
    remove_left_over()
    assert names(folder) == sorted(OTHERS)


def test_what_a_process_has_locked_stays(folder):
    before = names(folder)
    with (folder / f"{SEGMENT}_el").open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        remove_left_over()
    assert names(folder) == before


def test_what_is_new_stays_as_it_may_not_be_locked_yet(folder):
    before = names(folder)
    os.utime(folder / f"{SEGMENT}_el")
    remove_left_over()
    assert names(folder) == before


def test_without_shared_memory_there_is_nothing_to_do(folder, monkeypatch):
    monkeypatch.setattr(shared_memory, "FOLDER", folder / "missing")
    remove_left_over()
