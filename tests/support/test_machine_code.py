import os

import pytest
from helpers import python

from upright.support import machine_code
from upright.support.machine_code import cache_folder, lacking, note_compiled, sources_hash


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


def test_a_folder_that_takes_nothing_is_not_an_error(folder):
    os.rmdir(cache_folder())
    note_compiled(["learn"])
    assert lacking(["learn"]) == ["learn"]


def test_neither_needs_numba():
    code = "import sys; from upright.support.machine_code import lacking; lacking(['learn']); "
    assert python(code + "print('numba' in sys.modules)").stdout == "False\n"
