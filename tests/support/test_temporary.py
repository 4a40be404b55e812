import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from upright.support.temporary import temporary_folder

KILLED = """
import os, signal, sys
from upright.support.temporary import temporary_folder
with temporary_folder("test") as folder:
    (folder / "file").touch()
    print(folder, flush=True)
    if sys.argv[1] == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    """A folder for temporary files of its own."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return tmp_path


def start(how):
    command = [sys.executable, "-c", KILLED, how]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    return process, Path(process.stdout.readline().rstrip())


def test_a_folder_is_there_within_the_block_alone(place):
    with temporary_folder("test") as folder:
        assert folder.parent == place
        (folder / "file").touch()
        assert folder.stat().st_mode & 0o777 == 0o700
    assert not list(place.iterdir())


def test_what_a_killed_program_left_is_removed_by_the_next_but_not_what_is_in_use(place):
    using, used = start("waiting")
    killed, left = start("killed")
    killed.communicate()
    assert killed.returncode == -signal.SIGKILL
    assert (left / "file").exists()
    with temporary_folder("another"):
        assert left.exists()
    with temporary_folder("test") as own:
        assert {*place.iterdir()} == {used, own}
    using.communicate()
    assert using.returncode == 0
    assert not list(place.iterdir())


def test_links_and_files_of_such_a_name_are_left_alone(place, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / "file").touch()
    (place / "upright-test-link").symlink_to(elsewhere)
    (place / "upright-test-file").touch()
    with temporary_folder("test"):
        pass
    assert sorted(os.listdir(place)) == ["upright-test-file", "upright-test-link"]
    assert (elsewhere / "file").exists()
