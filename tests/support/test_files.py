"""Files are written whole where a file is or nothing, and in place where anything else is."""

import errno
import os
import signal
import stat
import subprocess
import sys
import threading
from contextlib import contextmanager

import pytest
from helpers import python

from upright.errors import UprightError
from upright.support import files
from upright.support.files import (
    check_name,
    check_output,
    create_file,
    creating,
    require_apart,
    scratch,
    write_file,
    writing,
)

OPEN = f"import os, sys\nfrom upright.support.files import {', '.join(['write_file', 'writing'])}\n"
linux = pytest.mark.skipif(sys.platform != "linux", reason="needs Linux's files without a name")


@pytest.fixture(params=["unnamed", "named"])
def either(request, monkeypatch):
    """Both ways of writing whole files: that of Linux's own disks, and that of all others."""
    if request.param == "named":
        monkeypatch.setattr(files._Part, "_open_unnamed", lambda _part: None)


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


@contextmanager
def umask(bits):
    previous = os.umask(bits)
    yield
    os.umask(previous)


# ------------------------------------------------------------------------------ whole files


@pytest.mark.usefixtures("either")
def test_a_new_file_follows_the_umask_and_an_old_one_keeps_its_mode(tmp_path):
    path = tmp_path / "out.txt"
    for bits, expected in ((0o022, 0o644), (0o077, 0o600), (0o002, 0o664)):
        path.unlink(missing_ok=True)
        with umask(bits):
            write_file(path, "one")
        assert mode(path) == expected
    for bits in (0o600, 0o640, 0o755, 0o666):
        path.chmod(bits)
        write_file(path, f"mode {bits}")
        assert (mode(path), path.read_text()) == (bits, f"mode {bits}")
    assert os.listdir(tmp_path) == ["out.txt"]


@pytest.mark.usefixtures("either")
@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
def test_root_leaves_a_file_to_its_owner(tmp_path):
    path = tmp_path / "out.txt"
    write_file(path, "his")
    os.chown(path, 65534, 65533)
    path.chmod(0o604)
    write_file(path, "still his")
    status = path.stat()
    assert (status.st_uid, status.st_gid, mode(path)) == (65534, 65533, 0o604)


@pytest.mark.usefixtures("either")
def test_a_link_keeps_its_place_and_its_target_is_written(tmp_path):
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    target, link, further = folder / "target", tmp_path / "link", tmp_path / "further"
    link.symlink_to("elsewhere/target")  # which is not there yet
    further.symlink_to(link)
    for text in ("new", "newer"):
        write_file(further, text)
        assert further.is_symlink()
        assert os.readlink(link) == "elsewhere/target"
        assert target.read_text() == text
    assert os.listdir(folder) == ["target"]
    link.unlink()
    link.symlink_to("nowhere/target")
    with pytest.raises(UprightError, match=r"link'; its folder does not exist"):
        check_output(link)
    link.unlink()
    link.symlink_to(link)
    with pytest.raises(UprightError, match="symbolic links"):
        check_output(link)


@pytest.mark.usefixtures("either")
def test_readers_find_the_old_content_until_the_new_is_complete(tmp_path):
    path = tmp_path / "out.txt"
    write_file(path, "old")
    with path.open() as reader:
        with writing(path) as file:
            file.write(b"new")
            file.flush()
            assert path.read_text() == "old"
        assert (path.read_text(), reader.read()) == ("new", "old")


def fail_writing(path, written, error):
    with writing(path) as file:
        file.write(written)
        raise error


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
@pytest.mark.parametrize("written", [b"", b"half", b"h" * 100_000])
def test_an_error_leaves_what_was_there(tmp_path, error, written):
    for text in (None, "old"):
        path = tmp_path / f"{text}.txt"
        if text:
            write_file(path, text)
        with pytest.raises(error):
            fail_writing(path, written, error)
        assert not text or path.read_text() == text
    assert os.listdir(tmp_path) == ["old.txt"]


@pytest.mark.usefixtures("either")
def test_a_new_file_never_replaces_another(tmp_path):
    path = tmp_path / "new.py"
    create_file(path, "one")
    with pytest.raises(UprightError, match=r"new\.py'; it is already there"):
        create_file(path, "two")
    link = tmp_path / "link.py"
    link.symlink_to("nothing")
    with pytest.raises(UprightError, match="already there"):
        create_file(link, "two")
    assert path.read_text() == "one"
    assert sorted(os.listdir(tmp_path)) == ["link.py", "new.py"]


@pytest.mark.usefixtures("either")
def test_a_file_that_is_there_in_the_end_is_not_overwritten(tmp_path, monkeypatch):
    path = tmp_path / "new.py"
    put = files._Part.put

    def too_late(part, **options):
        path.write_text("first")
        put(part, **options)

    monkeypatch.setattr(files._Part, "put", too_late)
    with pytest.raises(UprightError, match="already there"):
        create_file(path, "second")
    assert path.read_text() == "first"
    path.unlink()
    with creating(path) as part:
        part.write_text("second")
    assert path.read_text() == "first"
    path.unlink()
    write_file(path, "second")
    assert path.read_text() == "second"
    assert os.listdir(tmp_path) == ["new.py"]


def test_a_disk_without_links_creates_files_all_the_same(tmp_path, monkeypatch):
    def no_links(*_places, **_options):
        raise OSError(errno.EPERM, "no links")

    monkeypatch.setattr(files._Part, "_open_unnamed", lambda _part: None)
    monkeypatch.setattr(os, "link", no_links)
    create_file(tmp_path / "a", "text")
    write_file(tmp_path / "b", "text")
    with creating(tmp_path / "c") as part:
        part.write_text("text")
    with creating(tmp_path / "c") as part:
        part.write_text("another")
    assert [(tmp_path / name).read_text() for name in "abc"] == ["text"] * 3
    assert sorted(os.listdir(tmp_path)) == ["a", "b", "c"]


@pytest.mark.skipif(sys.platform != "linux" or os.geteuid() != 0, reason="only root mounts")
def test_a_file_that_is_mounted_is_written_to_in_place(tmp_path):
    outside, inside = tmp_path / "outside", tmp_path / "inside"
    write_file(outside, "a long text")
    write_file(inside, "")
    if subprocess.run(["mount", "--bind", outside, inside], capture_output=True).returncode:
        pytest.skip("mounting is not allowed here")
    try:
        write_file(inside, "short")
        assert outside.read_text() == "short"
    finally:
        subprocess.run(["umount", inside], check=True)
    assert sorted(os.listdir(tmp_path)) == ["inside", "outside"]


# ------------------------------------------------------------------------------ killed processes

KILLED = """
import os, signal
from upright.support import files
def kill(*_): os.kill(os.getpid(), signal.SIGKILL)
{before}
with files.{how} as file:
    {work}
"""
NAMED = "files._Part._open_unnamed = lambda part: None"


def killed(how, work="file.write(b'half'); file.flush(); kill()", before=""):
    assert python(KILLED.format(how=how, work=work, before=before)).returncode == -signal.SIGKILL


@linux
def test_a_killed_process_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    path = tmp_path / "out.txt"
    write_file(path, "old")
    killed(f"writing({str(path)!r})")
    killed(f"writing({str(tmp_path / 'new.txt')!r})")
    killed("scratch()", "file[0].write(b'half'); kill()")
    assert os.listdir(tmp_path) == ["out.txt"]
    assert path.read_text() == "old"


@linux
@pytest.mark.parametrize(
    ("how", "work", "before", "left"),
    [
        ("writing", "file.write(b'half'); kill()", NAMED, 1),
        ("writing", "file.write(b'whole')", "files._Part._replace = kill", 1),
        ("creating", "open(f'{file}-journal', 'w').close(); kill()", "", 2),
    ],
)
def test_what_a_killed_process_had_to_leave_goes_with_the_next_writing(
    how, work, before, left, tmp_path
):
    path = tmp_path / "out.txt"
    write_file(path, "old")
    killed(f"{how}({str(path)!r})", work, before)
    assert path.read_text() == "old"
    write_file(tmp_path / "other.txt", "another")  # they are not its own
    assert len(os.listdir(tmp_path)) == 2 + left
    write_file(path, "new")
    assert sorted(os.listdir(tmp_path)) == ["other.txt", "out.txt"]


@pytest.mark.usefixtures("either")
def test_what_another_process_is_writing_stays(tmp_path):
    path = tmp_path / "out.txt"
    with creating(path) as part:
        with creating(path) as another:
            assert part.exists()
            assert another.exists()
        with writing(path) as file:
            file.write(b"meanwhile")
        assert part.exists()
    assert path.read_bytes() in (b"", b"meanwhile")
    assert os.listdir(tmp_path) == ["out.txt"]


# ------------------------------------------------------------------------------ anything else


def test_a_device_stays_a_device():
    write_file("/dev/null", "text")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    with pytest.raises(UprightError, match=r"'/dev/full'; it cannot be written: No space left"):
        write_file("/dev/full", "text")
    with pytest.raises(UprightError, match="No space left"), writing("/dev/full") as file:
        file.write(b"x" * 100_000)
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


def test_a_fifo_and_a_link_to_one_are_written_to(tmp_path):
    fifo, link = tmp_path / "fifo", tmp_path / "link"
    os.mkfifo(fifo)
    link.symlink_to(fifo)
    for path in (fifo, link):
        got = []
        reader = threading.Thread(target=lambda got=got: got.append(fifo.read_bytes()))
        reader.start()
        write_file(path, b"x" * 1_000_000)
        reader.join()
        assert got == [b"x" * 1_000_000]
    assert stat.S_ISFIFO(fifo.stat().st_mode)
    with pytest.raises(UprightError, match="already there"):
        create_file(fifo, "text")


@linux
@pytest.mark.parametrize("name", ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1", "link"])
def test_an_open_file_is_gone_on_with(tmp_path, name):
    (tmp_path / "link").symlink_to("/dev/stdout")
    log = tmp_path / "log"
    log.write_text("before\n")
    code = f"{OPEN}print('first')\nwrite_file({name!r}, 'second\\n')\nprint('third')"
    with log.open("a") as file:
        subprocess.run([sys.executable, "-c", code], stdout=file, cwd=tmp_path, check=True)
    assert log.read_text() == "before\nfirst\nsecond\nthird\n"


@linux
def test_an_open_file_that_is_not_open_is_refused():
    with pytest.raises(UprightError, match=r"'/dev/fd/999'; it cannot be written: Bad file"):
        check_output("/dev/fd/999")


def test_a_reader_that_ends_early_is_no_error_of_the_output():
    read, write = os.pipe()
    os.close(read)
    try:
        with pytest.raises(BrokenPipeError):
            write_file(f"/dev/fd/{write}", "text")
    finally:
        os.close(write)


# ------------------------------------------------------------------------------ before the work


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("", "^output is ''; the name of a file is needed"),
        ("a\0b", "cannot be a file's name: embedded null"),
        ("a" * 256, "cannot be a file's name: File name too long"),
        ("\ud800", "cannot be a file's name: .*surrogates"),
        (".", "it is a folder"),
        ("missing/file", "its folder does not exist"),
        ("file/below", "its folder does not exist"),
        ("new/", "it is the name of a folder"),
    ],
)
def test_a_name_that_cannot_be_written_is_refused_at_once(name, why, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    for check in (check_output, lambda path: write_file(path, ""), lambda p: create_file(p, "")):
        with pytest.raises(UprightError) as raised:
            check(name)
        assert "\n" not in str(raised.value)
    with pytest.raises(UprightError, match=why):
        check_output(name)


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("name", ["a" * 255, "ü" * 127, "\udcff", "-", "a\nb", "a\x1b[2J"])
def test_every_name_that_the_system_takes_is_written(name, tmp_path):
    for text in ("one", "two"):
        write_file(tmp_path / name, text)
    assert os.listdir(tmp_path) == [name]
    assert (tmp_path / name).read_text() == "two"


def test_the_name_of_a_file_to_be_read_may_be_missing():
    check_name("--store", "missing/file")
    with pytest.raises(
        UprightError, match=r"^--store is '/a+\.\.\.a+'; it cannot be a file's name"
    ):
        check_name("--store", "/" + "a" * 300)


def write_as_it_goes(folder):
    with writing(folder / "out.txt") as file:
        file.write(b"text")
        folder.rmdir()


def test_a_folder_that_is_gone_is_refused_or_explained(tmp_path, monkeypatch):
    folder = tmp_path / "gone"
    folder.mkdir()
    with pytest.raises(UprightError, match="cannot be written: No such file"):
        write_as_it_goes(folder)
    folder.mkdir()
    monkeypatch.chdir(folder)
    folder.rmdir()
    with pytest.raises(UprightError, match=r"'out\.txt'; .*No such file"):
        check_output("out.txt")


# ------------------------------------------------------------------------------ full disks


@pytest.mark.skipif(sys.platform != "linux" or os.geteuid() != 0, reason="only root mounts")
@pytest.mark.usefixtures("either")
def test_a_full_disk_is_one_sentence_and_keeps_what_was_there(tmp_path):
    command = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", tmp_path]
    if subprocess.run(command, capture_output=True).returncode:
        pytest.skip("mounting is not allowed here")
    try:
        path = tmp_path / "out.txt"
        write_file(path, "old")
        for _ in range(3):
            with pytest.raises(UprightError, match=r"out\.txt'; it cannot be written: No space"):
                write_file(path, b"x" * 1_000_000)
            with pytest.raises(UprightError, match="No space"):
                create_file(tmp_path / "new.txt", "x" * 1_000_000)
        assert path.read_text() == "old"
        assert os.listdir(tmp_path) == ["out.txt"]
    finally:
        subprocess.run(["umount", tmp_path], check=True)


# ------------------------------------------------------------------------------ one file


def test_two_names_of_one_file_are_found(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("store", "other"):
        (tmp_path / name).write_text(name)
    os.symlink("store", "link")
    os.link("store", "hard")
    os.symlink(".", "here")
    os.symlink("new", "dangling")
    same = ["store", "./store", "link", "hard", "here/store", str(tmp_path / "store")]
    for name in same:
        with pytest.raises(UprightError, match=r"output is '.*'; it is the same file as store"):
            require_apart([("output", name)], [("store", "store")])
        with pytest.raises(UprightError, match="the same file"):
            require_apart([("output", "other"), ("save", name), ("store", "store")])
    for name in ("dangling", "here/new", "./new"):
        with pytest.raises(UprightError, match="the same file"):
            require_apart([("output", "new"), ("store", name)])
    for end in ("-wal", "-shm", "-journal"):
        with pytest.raises(UprightError, match="belongs to"):
            require_apart([("output", f"here/store{end}")], [("store", "./store")])
        with pytest.raises(UprightError, match="belongs to it"):
            require_apart([("store", "./store"), ("output", f"here/store{end}")])


def test_files_that_differ_are_not_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a").touch()
    (tmp_path / "b").touch()
    require_apart(
        [("output", "a"), ("store", "b"), ("save", None)], [("task", "c"), ("from", None)]
    )
    require_apart([], [("task", "a"), ("settings", "a")])  # both are read
    require_apart([("output", "/dev/null"), ("save", "/dev/null")])


# ------------------------------------------------------------------------------ other programs


def test_another_program_opens_a_temporary_file_by_its_name():
    with scratch() as (file, name):
        subprocess.run([sys.executable, "-c", f"open({name!r}, 'w').write('text')"], check=True)
        assert file.read() == b"text"
