import os
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from helpers import python

from upright.support import machine_code
from upright.support.machine_code import (
    IN_USE,
    MOST,
    UNUSED_FOR,
    cache_folder,
    keep,
    kept,
    lacking,
    note_compiled,
    sources_hash,
)


def test_the_digest_of_sources_changes_with_any_file(tmp_path, monkeypatch):
    monkeypatch.setattr(machine_code, "PACKAGE", tmp_path)
    (tmp_path / "part").mkdir()
    sources = [tmp_path / "whole.py", tmp_path / "part" / "one.py"]
    for source in sources:
        source.write_text("gravity = 9.8")
    seen = [sources_hash()]
    assert seen[0] == sources_hash()
    for source in sources:  # of the same size and date, so that only the content differs
        before = source.stat()
        source.write_text("gravity = 9.7")
        os.utime(source, ns=(before.st_atime_ns, before.st_mtime_ns))
        seen.append(sources_hash())
    sources[0].rename(tmp_path / "half.py")
    seen.append(sources_hash())
    (tmp_path / "new.py").touch()
    seen.append(sources_hash())
    assert len(set(seen)) == 5


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder of machine code."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "")
    machine_code._say.cache_clear()
    cache_folder.cache_clear()
    yield tmp_path
    cache_folder.cache_clear()


def test_what_was_compiled_is_no_longer_lacking(folder):
    things = ["learn", "learn q-learning"]
    assert lacking(things) == things
    note_compiled(things[1:])
    assert lacking(things) == ["learn"]
    note_compiled(things)
    assert lacking(things) == []
    assert lacking(["play"]) == ["play"]
    assert cache_folder().is_relative_to(folder)


def test_a_folder_that_vanishes_is_not_an_error(folder, capsys):
    shutil.rmtree(cache_folder())
    note_compiled(["learn"])
    assert lacking(["learn"]) == ["learn"]
    for _ in range(2):
        keep("code", b"machine code")
    assert kept("code") is None
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "cannot be kept" in said


def test_without_a_folder_nothing_is_kept(folder, monkeypatch):
    monkeypatch.setattr(machine_code, "_roots", lambda: iter([Path(os.devnull) / "upright"]))
    assert cache_folder() is None
    note_compiled(["learn"])
    assert lacking(["learn"]) == ["learn"]
    keep("code", b"machine code")
    assert kept("code") is None


def test_neither_needs_numba():
    code = "import sys; from upright.support.machine_code import lacking; lacking(['learn']); "
    assert python(code + "print('numba' in sys.modules)").stdout == "False\n"


def test_the_folder_of_bounds_checks_is_another(folder, monkeypatch):
    usual = cache_folder()
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "1")
    cache_folder.cache_clear()
    assert cache_folder() == usual.with_name(f"{usual.name}-checked")


@pytest.mark.parametrize("variable", ["NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME"])
@pytest.mark.parametrize("home", ["~nobody-is-called-so", "~nobody-is-called-so/cache"])
def test_a_home_that_is_not_known_is_passed_over(folder, variable, home, monkeypatch):
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", "~")
    monkeypatch.setenv(variable, home)
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    assert cache_folder().is_relative_to(folder)


# ------------------------------------------------------------------------------ what is kept


def test_machine_code_is_found_again(folder):
    assert kept("code") is None
    keep("code", b"machine code")
    assert kept("code") == b"machine code"
    keep("code", b"newer code")
    assert kept("code") == b"newer code"
    assert not [*cache_folder().glob("*.part")]


def _replace_by_folder(path):
    path.unlink()
    path.mkdir()
    (path / "file").touch()


def _change_a_bit(path):
    data = bytearray(path.read_bytes())
    data[-3] ^= 1
    path.write_bytes(data)


def _replace_by_link_to_itself(path):
    path.unlink()
    path.symlink_to(path)


def _replace_by_fifo(path):
    path.unlink()
    os.mkfifo(path)


def _replace_by_link_to_device(path):
    path.unlink()
    path.symlink_to("/dev/zero")


DAMAGES = {
    "empty": lambda path: path.write_bytes(b""),
    "cut short": lambda path: path.write_bytes(path.read_bytes()[:-1]),
    "cut in the digest": lambda path: path.write_bytes(path.read_bytes()[:20]),
    "the digest alone": lambda path: path.write_bytes(path.read_bytes()[:32]),
    "too long": lambda path: path.write_bytes(path.read_bytes() + b"\0"),
    "a bit": _change_a_bit,
    "other bytes": lambda path: path.write_bytes(os.urandom(1000)),
    "a folder": _replace_by_folder,
    "a link to itself": _replace_by_link_to_itself,
    "a FIFO": _replace_by_fifo,
    "a device without an end": _replace_by_link_to_device,
    "open to others": lambda path: path.chmod(0o666),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_damaged_is_removed_said_once_and_replaced(damage, folder, capsys):
    for name in ("one", "two"):
        keep(name, b"machine code")
        DAMAGES[damage](cache_folder() / name)
    for name in ("one", "two"):
        assert kept(name) is None
        assert not os.path.lexists(cache_folder() / name)
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.startswith("upright: machine code in ")
    keep("one", b"machine code")
    assert kept("one") == b"machine code"


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs root")
def test_a_file_of_another_user_is_not_used(folder):
    keep("code", b"machine code")
    os.chown(cache_folder() / "code", 65534, 65534)
    assert kept("code") is None


def test_many_may_keep_at_the_same_time(folder):
    cache_folder()
    names = [f"code-{number}" for number in range(90)]
    with ThreadPoolExecutor(9) as threads:
        [*threads.map(lambda name: keep(name, name.encode()), names)]
    assert [kept(name) for name in names] == [name.encode() for name in names]


# ------------------------------------------------------------------------ other versions' folders


@pytest.fixture
def others(folder):
    """Return a function that makes another version's folder, last used some seconds ago."""
    root = folder / "upright"
    root.mkdir(0o700)

    def make(name, ago, *, new_form=True):
        (root / name).mkdir(0o700)
        (root / name / "code").touch()
        mark = root / name / IN_USE if new_form else root / name
        mark.touch()
        os.utime(mark, (time.time() - ago, time.time() - ago))
        return root / name

    return make


@pytest.mark.parametrize("new_form", [True, False])
def test_folders_of_other_versions_are_removed_when_long_unused(others, new_form):
    old = others("kernels-old", UNUSED_FOR + 60, new_form=new_form)
    recent = others("kernels-recent", UNUSED_FOR - 3600, new_form=new_form)
    foreign = others("something-else", 2 * UNUSED_FOR)
    cache_folder()
    assert not old.exists()
    assert recent.exists()
    assert foreign.exists()


def test_of_many_folders_the_latest_are_kept(others):
    made = [others(f"kernels-{number}", 60 * number) for number in range(MOST + 3)]
    cache_folder()
    assert [folder.exists() for folder in made] == [True] * MOST + [False] * 3


def test_a_folder_that_another_process_uses_is_not_removed(others):
    """Until that process ends, even if it is killed."""
    used = others("kernels-used", 0)
    code = "import sys; from pathlib import Path; from upright.support import machine_code as m; "
    code += f"m._hold(Path({str(used)!r})); print(flush=True); sys.stdin.read()"
    user = subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    with user:
        user.stdout.readline()
        os.utime(used / IN_USE, (0, 0))
        present = cache_folder()
        assert used.exists()
        user.kill()
    machine_code._remove_unused(present)
    assert not used.exists()
    assert present.exists()


def test_what_a_killed_process_left_half_written_is_removed(folder):
    (left := cache_folder() / "code.1234.part").touch()
    cache_folder.cache_clear()
    # The first call's lock is still held by this process, as by one that is writing.
    assert cache_folder() == left.parent
    assert left.exists()
    code = f"import os; os.environ['NUMBA_CACHE_DIR'] = {str(folder / 'other')!r}\n"
    code += "from upright.support import machine_code as m\n"
    code += "(left := m.cache_folder() / 'code.1234.part').touch(); print(left)"
    path = Path(python(code).stdout.strip())
    assert path.exists()
    assert python(code.replace(".touch()", ".exists()")).returncode == 0
    assert not path.exists()
