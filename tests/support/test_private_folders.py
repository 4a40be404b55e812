import os
import shutil
import tempfile
from pathlib import Path

import pytest
from helpers import python

from upright.support.private_folders import changeable, is_ours, make_private

NOBODY = 65534
needs_root = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give files to others"
)


@pytest.fixture
def place(tmp_path):
    """A folder in which modes alone decide: others may go there, but may write nothing."""
    for folder in (tmp_path, tmp_path / "outer", tmp_path / "outer" / "inner"):
        folder.mkdir(exist_ok=True)
        folder.chmod(0o755)
    if changeable(tmp_path):
        pytest.skip(f"others may change {changeable(tmp_path)}")
    file = tmp_path / "outer" / "inner" / "file"
    file.touch(0o644)
    return file


@pytest.fixture(autouse=True)
def _others_may_go_everywhere(monkeypatch, tmp_path):
    """Folders above those of a test are closed to others; let only those of the test count."""
    parents = set(tmp_path.parents)
    found = Path.stat

    def stat(path, **options):
        status = found(path, **options)
        if path not in parents:
            return status
        return os.stat_result((0o040755, *status[1:4], 0, 0, *status[6:]))

    monkeypatch.setattr(Path, "stat", stat)


def test_what_only_this_user_can_change_is_private(place):
    assert changeable(place) is None
    assert changeable(place.parent) is None


@pytest.mark.parametrize("mode", [0o775, 0o757, 0o777])
@pytest.mark.parametrize("depth", [0, 1, 2])
def test_one_folder_open_to_others_is_enough(place, mode, depth):
    opened = (place, *place.parents)[depth]
    opened.chmod(mode)
    assert changeable(place) == opened


def test_in_a_folder_with_the_sticky_bit_others_cannot_change_what_is_ours(place):
    place.parents[1].chmod(0o1777)
    assert changeable(place) is None
    place.parent.chmod(0o1777)
    assert changeable(place) is None
    assert changeable(place.parent) == place.parent  # others can put something there
    place.parent.chmod(0o777)
    assert changeable(place) == place.parent


def test_below_a_folder_that_is_closed_to_others_modes_do_not_matter(place):
    place.parent.chmod(0o777)
    place.parents[1].chmod(0o700)
    assert changeable(place) is None


@needs_root
@pytest.mark.parametrize("depth", [0, 1, 2])
@pytest.mark.parametrize("closed", [False, True])
def test_what_belongs_to_another_user_is_not_private(place, depth, closed):
    if closed:
        place.parents[1].chmod(0o700)
    others = (place, *place.parents)[depth]
    os.chown(others, NOBODY, NOBODY)
    assert changeable(place) == others
    assert not is_ours(others.stat())


def test_folders_are_made_for_this_user_alone(place):
    before = os.umask(0)
    try:
        made = make_private(place.parent / "a" / "b")
    finally:
        os.umask(before)
    assert made.is_dir()
    assert made.stat().st_mode & 0o777 == made.parent.stat().st_mode & 0o777 == 0o700
    assert place.parent.stat().st_mode & 0o777 == 0o755
    assert make_private(made) == made


def test_symbolic_links_are_resolved(place):
    link = place.parents[1] / "link"
    link.symlink_to(place.parent)
    assert make_private(link / "a") == place.parent.resolve() / "a"


# ---------------------------------------------------------------------- a user beside another

CALL = """
import os, sys
from pathlib import Path
from upright.support import machine_code
name = machine_code.sources_hash()
machine_code.sources_hash = lambda: name  # the other user may not read the sources
temporary = Path(os.environ["TMPDIR"])
root = temporary / "upright-12345"
folder = root / f"kernels-{name}"
%s
os.setgroups([])
os.setgid(12345)
os.setuid(12345)
print(machine_code.cache_folder())
machine_code.keep("code", b"ours")
print(machine_code.kept("code"), machine_code.kept("payload"))
"""
TAKES = "os.chown({}, 65534, 65534); {}.chmod(0o777)\n"
MAKES = "folder.mkdir(parents=True)\n"
PAYLOAD = """
import hashlib
(folder / "payload").write_bytes(hashlib.sha256(b"theirs").digest() + b"theirs")
(folder / "payload").chmod(0o644)
"""
ATTACKS = {
    "both": MAKES + PAYLOAD + TAKES.format("root", "root") + TAKES.format("folder", "folder"),
    "outer": MAKES + PAYLOAD + TAKES.format("root", "root") + "os.chown(folder, 12345, 12345)",
    "link": "theirs = temporary / 'theirs'; theirs.mkdir(); root.symlink_to(theirs)\n"
    + "folder.mkdir()\n"
    + PAYLOAD
    + TAKES.format("theirs", "theirs"),
    "open": MAKES + PAYLOAD + "os.chown(root, 12345, 12345); root.chmod(0o777)",
}


@needs_root
@pytest.mark.parametrize("attack", ATTACKS)
def test_machine_code_that_another_user_has_laid_out_is_never_used(attack, open_folder):
    ended = python(CALL % ATTACKS[attack], **open_folder)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout == "None\nNone None\n"
    assert ended.stderr.count("\n") == 1
    assert "others may change" in ended.stderr


@needs_root
def test_a_temporary_folder_of_ones_own_holds_machine_code(open_folder):
    ended = python(CALL % "", **open_folder)
    assert ended.returncode == 0, ended.stderr
    assert ended.stderr == ""
    folder, found = ended.stdout.splitlines()
    assert found == "b'ours' None"
    assert Path(folder).parent == Path(open_folder["TMPDIR"]) / "upright-12345"
    assert Path(folder).parent.stat().st_mode & 0o777 == 0o700


@pytest.fixture
def open_folder():
    """The environment of a user without a home, and with a folder for all users instead of /tmp."""
    folder = tempfile.mkdtemp(dir="/tmp")
    os.chmod(folder, 0o1777)
    yield {"TMPDIR": folder, "HOME": "/proc/nothing", "NUMBA_CACHE_DIR": "", "XDG_CACHE_HOME": ""}
    shutil.rmtree(folder)
