import os
import pickle
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import pytest
from helpers import python

from upright.core import code_cache
from upright.core.compiled import Compiled
from upright.core.parameters import State
from upright.core.portable_math import sine_cosine
from upright.core.rig import parameters_of
from upright.support import machine_code
from upright.support.machine_code import cache_folder, keep

if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
    pytest.skip("nothing is compiled", allow_module_level=True)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """An empty folder of machine code."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    machine_code._say.cache_clear()
    cache_folder.cache_clear()
    yield tmp_path
    cache_folder.cache_clear()


def new(function=sine_cosine):
    """Return the function as a new process has it: compiled for nothing yet."""
    return Compiled(function.py_func)


def codes():
    return sorted(cache_folder().glob("*.code"))


def hits(function):
    stats = function._outer.stats
    return sum(stats.cache_hits.values()), sum(stats.cache_misses.values())


def test_each_combination_of_types_is_found_by_itself():
    first = new()
    values = first(0.5), first(np.float32(0.5)), first(1)
    assert hits(first) == (0, 3)
    assert len(codes()) == 3
    second = new()
    assert (second(0.5), second(np.float32(0.5)), second(1)) == values
    assert hits(second) == (3, 0)


def test_what_cannot_be_loaded_is_compiled_anew_and_said_once(capsys):
    """Such as what another version of Numba wrote; `kept` finds files that are damaged."""
    value = new()(0.5)
    for content in (b"no pickle", pickle.dumps(()), pickle.dumps([None] * 9)):
        keep(codes()[0].name, content)
        again = new()
        assert again(0.5) == value
        assert hits(again) == (0, 1)
    (loaded := new())(0.5)
    assert hits(loaded) == (1, 0)
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "is damaged; it is compiled anew" in said


def test_what_was_damaged_is_kept_again(capsys):
    value = new()(0.5)
    codes()[0].write_bytes(b"damaged")
    assert new()(0.5) == value
    assert (again := new())(0.5) == value
    assert hits(again) == (1, 0)
    assert capsys.readouterr().err.count("\n") == 1


def test_another_version_of_numba_has_its_own(monkeypatch):
    new()(0.5)
    monkeypatch.setattr(code_cache.numba, "__version__", "0.0")
    (other := new())(0.5)
    assert hits(other) == (0, 1)
    assert len(codes()) == 2


class OwnState(NamedTuple):
    x: float


def test_only_what_the_sources_determine_is_kept():
    present = np.zeros((12, 1))
    new(parameters_of)(present, 0)
    assert len(codes()) == 1

    def first(state):
        return state[0]

    first.__module__ = "upright.core.cartpole"  # as if it stood there
    function = Compiled(first)
    function._outer._cache = code_cache.CodeCache(first)
    assert function(State(1.0, 0.0, 0.0, 0.0)) == 1.0
    assert len(codes()) == 2
    assert function(OwnState(2.0)) == 2.0  # its class may change
    assert function((OwnState(3.0), 1.0)) == (3.0,)
    assert len(codes()) == 2

    def second(state):
        return first(state)

    second.__module__ = first.__module__
    assert code_cache.CodeCache(second)._name((), None) is None


STEP = """
import sys
from upright.core.parameters import Parameters, State
from upright.core.cartpole import accelerations, step
from upright.core.portable_math import sine_cosine
print(step(Parameters(), State(0.0, 0.1, 0.2, 0.3), 10.0))
print(sine_cosine(0.5), accelerations(Parameters(), State(0.0, 0.1, 0.2, 0.3), 10.0))
stats = [each._outer.stats for each in (step, sine_cosine, accelerations)]
print([sum(each.cache_hits.values()) for each in stats], file=sys.stderr)
"""


@pytest.mark.slow
def test_processes_that_compile_at_once_lose_nothing(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    together = [
        subprocess.Popen([sys.executable, "-c", STEP], env=environment, stdout=subprocess.DEVNULL)
        for _ in range(3)
    ]
    assert [process.wait(300) for process in together] == [0, 0, 0]
    ended = python(STEP, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert ended.stderr == "[1, 1, 1]\n"


@pytest.mark.slow
def test_a_full_disk_is_no_reason_not_to_run(tmp_path):
    full = "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
    ended = python(full + STEP, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.startswith("State(")
    assert ended.stderr.count("upright: ") == 1
    assert "cannot be kept" in ended.stderr
    kinds = {path.suffix for path in (tmp_path / "cache").rglob("*") if path.is_file()}
    assert kinds == {""}  # no code, and nothing half-written
