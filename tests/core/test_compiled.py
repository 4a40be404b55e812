import os
import shutil
from pathlib import Path

import pytest
from helpers import LinearAgent, python

from upright.agents import AGENTS
from upright.core.compiled import PACKAGE, is_compiled
from upright.support.machine_code import sources_hash


@pytest.fixture
def copied(tmp_path):
    """Return a copy of the package that may be changed."""
    return Path(
        shutil.copytree(
            PACKAGE, tmp_path / "src" / "upright", ignore=shutil.ignore_patterns("__pycache__")
        )
    )


def in_copy(package, code, **environment):
    """Return the output of a program that uses the copy; fail if it fails."""
    ended = python(code, PYTHONPATH=str(package.parent), **environment)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def change(path, old, new):
    """Change a source file but keep its size and date, so that only its content differs."""
    assert len(old) == len(new)
    before, text = path.stat(), path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


# ------------------------------------------------------------------------------ kernels on disk

RUN = """
from upright.studies.case import make_case
from upright.studies.run import make_run
print(make_run(make_case("random-search", steps=500, trials=20), 3, 0)[1].lengths.tolist())
"""
STEP = """
from upright.core.parameters import Parameters, State
from upright.core.cartpole import step
print(step(Parameters(), State(0.0, 0.1, 0.2, 0.3), 10.0))
"""


@pytest.mark.slow
def test_a_changed_file_is_compiled_anew(copied, tmp_path):
    """Also into kernels of other files, which Numba by itself would not notice."""
    cache = str(tmp_path / "cache")
    before = in_copy(copied, RUN, NUMBA_CACHE_DIR=cache)
    assert before == in_copy(copied, RUN, NUMBA_CACHE_DIR=cache)
    change(copied / "core" / "cartpole.py", "(g * sin", "(2 * sin")
    after = in_copy(copied, RUN, NUMBA_CACHE_DIR=cache)
    assert after != before
    assert after == in_copy(copied, RUN, NUMBA_CACHE_DIR=str(tmp_path / "fresh"))


@pytest.mark.slow
def test_functions_can_be_called_from_python_after_compiled_code_called_them(tmp_path):
    """The two compiled forms of a function do not share machine code on disk."""
    cache = str(tmp_path)
    alone = python(STEP, NUMBA_CACHE_DIR=cache)
    assert alone.stdout.startswith("State(")
    for program in (RUN + STEP, STEP + RUN, RUN + STEP):
        ended = python(program, NUMBA_CACHE_DIR=cache)
        assert ended.returncode == 0, ended.stderr
        assert alone.stdout in ended.stdout


@pytest.mark.slow
def test_a_temporary_cache_serves_where_the_usual_folders_are_read_only(tmp_path):
    wall = tmp_path / "a file, no folder"
    wall.touch()
    places = dict.fromkeys(("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME", "TMPDIR"), str(wall))
    ended = python(STEP, **places)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.startswith("State(")
    assert wall.read_bytes() == b""


@pytest.mark.parametrize("variable", ["NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME"])
def test_kernels_are_cached_in_the_user_folder(variable, tmp_path):
    places = dict.fromkeys(("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "NUMBA_BOUNDSCHECK"), "")
    places[variable] = str(tmp_path)
    code = "from upright.support.machine_code import cache_folder; print(cache_folder())"
    ended = python(code, **places)
    assert Path(ended.stdout.strip()).is_relative_to(tmp_path)
    assert Path(ended.stdout.strip()).name == f"kernels-{sources_hash()}"


# --------------------------------------------------------------------------- forms of compilation

BEYOND = """
import numpy as np
from upright.core.compiled import compiled


@compiled
def element(array, i):
    return array[i]


@compiled
def of_element(array, i):
    return element(array, i) + 1.0


for function in (element, of_element):
    try:
        function(np.zeros(3), 3)
    except IndexError as error:
        print(error)
"""


@pytest.mark.slow
def test_a_variable_of_numba_has_all_indices_checked(tmp_path):
    """Also where nothing else checks anything: in functions that are inlined into others."""
    ended = python(BEYOND, NUMBA_BOUNDSCHECK="1", NUMBA_CACHE_DIR=str(tmp_path))
    assert ended.stdout == "index is out of bounds\n" * 2, ended.stderr


def test_a_variable_of_numba_turns_the_compiler_off(tmp_path):
    code = f"{STEP}\nfrom upright.core.compiled import machine_code\n"
    code += "arguments = Parameters(), State(0.0, 0.1, 0.2, 0.3), 10.0\n"
    code += "print(machine_code(step, *arguments)(*arguments))"
    ended = python(code, NUMBA_DISABLE_JIT="1", NUMBA_CACHE_DIR=str(tmp_path))
    assert ended.returncode == 0, ended.stderr
    first, second = ended.stdout.splitlines()
    assert first == second


# ------------------------------------------------------------------------------ kinds of agents


@pytest.mark.parametrize("name", AGENTS)
def test_built_in_agents_are_compiled(name):
    import numpy as np

    assert is_compiled(AGENTS.settings(name)["default"].agent(np.random.default_rng(1)))


def test_an_agent_in_plain_python_is_not_compiled():
    assert not is_compiled(LinearAgent())
