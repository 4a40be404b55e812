"""A file named in place of a module is answered with what to write."""

import pytest

from upright.agents.checks.names import agents_in
from upright.commands import run
from upright.support.exit_status import BAD_USE

ONE = "class Base:\n  def act(self): ...\nclass Pd(Base):\n  def act(self): ...\n"
TWO = "class Pd:\n  def act(self): ...\nclass Ppo:\n  def train(self, env): ...\n"
TUPLE = (
    "from typing import NamedTuple\nclass Pd(NamedTuple):\n  def act(self): ...\n"
    "def pd(rng): return Pd()\ndef helper(x): ...\n"
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with agents, which is the current one."""
    (tmp_path / "here/sub").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "here")
    for name, text in {
        "here/one.py": ONE,
        "here/two.py": TWO,
        "here/none.py": "raise SystemExit",
        "here/my-agent.py": ONE,
        "here/sub/pd.py": ONE,
        "other.py": ONE,
    }.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        ("one.py:Pd", "write 'one:Pd'"),
        ("./one.py:Pd", "write 'one:Pd'"),
        ("sub/pd.py:Pd", "write 'sub.pd:Pd'"),
        ("sub/pd:Pd", "write 'sub.pd:Pd'"),
        ("sub\\pd.py:Pd", "write 'sub.pd:Pd'"),
        ("one", "write 'one:Pd'"),
        ("one.py", "write 'one:Pd'"),
        ("two", "write 'two:NAME', where NAME is one of Pd, Ppo"),
        ("none.py", "write 'none:NAME'"),
        ("my-agent.py:Pd", "'my-agent' is not the name of a module; rename it so that"),
        ("my-agent", "'my-agent' is not the name of a module; rename it so that"),
        ("../other.py:Pd", "write 'other:Pd' in the folder '"),
        ("gone.py", "there is no file 'gone.py'; a custom agent is named module:name"),
        ("gone/pd.py:Pd", "there is no file 'gone/pd.py'; a custom agent is named module:name"),
        ("gone", "it must be one of adaptive-lqr, "),
    ],
)
def test_the_advice_names_what_to_write(name, advice, folder, capsys):
    assert run(["learn", name]) == BAD_USE
    error = capsys.readouterr().err
    assert error.startswith(f"upright: error: agent is {name!r}; {advice}")
    assert error.count("\n") == 1


def test_an_absolute_path_is_understood(folder, capsys):
    assert run(["table", "--agents", f"{folder}/here/sub/pd.py:Pd"]) == BAD_USE
    assert "; write 'sub.pd:Pd'\n" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "found"),
    [(ONE, ["Pd"]), (TWO, ["Pd", "Ppo"]), (TUPLE, ["pd"]), ("class A", []), ("x = 3", [])],
)
def test_agents_are_found_without_importing_their_module(text, found, tmp_path):
    path = tmp_path / "agents.py"
    path.write_text(f"{text}\nraise SystemExit" if found else text)
    assert agents_in(path) == found


def test_a_file_that_cannot_be_read_has_no_agents(tmp_path):
    (tmp_path / "latin.py").write_bytes(b"x = '\xe9'")
    assert agents_in(tmp_path / "latin.py") == agents_in(tmp_path / "gone.py") == []
