import subprocess
import sys
from textwrap import dedent

import pytest
from helpers import python

from upright.errors import UprightError
from upright.studies import definitions
from upright.studies.definitions import digest_of, is_in_main, pack
from upright.studies.fingerprint import fingerprint

AGENT = """
    import functools
    from dataclasses import dataclass
    from typing import NamedTuple

    import numpy as np
    import upright

    RATE = 0.5
    GAINS = {"angle": [1.0, 2.0], "names": {"x", "theta", "theta_dot"}}
    WEIGHTS = np.array([1.0, 2.0])
    UNUSED = 1

    class Inner(NamedTuple):
        size: int = 3

        @upright.compiled
        def area(self):
            return self.size * 4

    @dataclass
    class Options:
        depth: int = 6

    OPTIONS = Options()

    def helper(x, scale=2.0):
        return x * scale * RATE

    def made(number):
        def inner(x):
            return x + number
        return inner

    shifted = made(7)
    doubled = functools.partial(helper, scale=8.0)

    class Base:
        def shared(self):
            return A, GAINS

    class A(Base):
        '''An agent.'''

        kind = "table"

        def act(self, observation, rng):
            tried = [helper(x) for x in observation if x in {"p", "q", "r"}]  # why
            return (lambda: WEIGHTS)() , tried, shifted, doubled, Inner(), OPTIONS.depth

        @property
        def size(self):
            return 9

        @staticmethod
        def limit():
            return 11
"""


def defined(text):
    """Return the class A of a script."""
    names = {"__name__": "__main__"}
    exec(dedent(text), names)
    return names["A"]


def edited(old, new):
    assert AGENT.count(old) == 1, old
    return AGENT.replace(old, new)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("RATE = 0.5", "RATE = 0.25"),
        ("[1.0, 2.0], ", "[1.0, 2.5], "),
        ('"x", "theta"', '"y", "theta"'),
        ("array([1.0, 2.0])", "array([1.0, 3.0])"),
        ("array([1.0, 2.0])", "array([1, 2])"),
        ("size: int = 3", "size: int = 4"),
        ("self.size * 4", "self.size * 5"),
        ("Options()", "Options(7)"),
        ("scale=2.0", "scale=3.0"),
        ("x + number", "x - number"),
        ("made(7)", "made(8)"),
        ("scale=8.0", "scale=9.0"),
        ("return A, GAINS", "return GAINS, A"),
        ('"table"', '"network"'),
        ('"q", "r"', '"q", "s"'),
        ("return 9", "return 10"),
        ("return 11", "return 12"),
        ("class A(Base)", "class A"),
        ("def limit", "def limits"),
    ],
)
def test_an_edit_of_anything_that_an_agent_uses_changes_its_digest(old, new):
    assert digest_of(defined(edited(old, new)))[0] != digest_of(defined(AGENT))[0]


@pytest.mark.parametrize(
    ("old", "new"),
    [("# why", ""), ("UNUSED = 1", "UNUSED = 2\n\n"), ("'''An agent.'''", "'''The agent.'''")],
)
def test_comments_and_what_it_does_not_use_do_not_count(old, new):
    assert digest_of(defined(edited(old, new))) == digest_of(defined(AGENT))


def test_sets_have_the_same_digest_in_every_process():
    ask = "from upright.studies.definitions import digest_of\nprint(digest_of(A)[0])"
    code = f"{dedent(AGENT)}\n{ask}"
    told = {python(code, PYTHONHASHSEED=seed).stdout for seed in ("1", "2")}
    assert told == {digest_of(defined(AGENT))[0] + "\n"}


def test_a_value_that_contains_itself_has_a_digest():
    text = "loop = []\nloop.append(loop)\n\ndef A(rng):\n    return loop\n"
    assert digest_of(defined(text)) == digest_of(defined(text))


def test_the_modules_that_it_uses_are_found():
    text = """
        import json
        from statistics import mean
        def A(rng):
            import decimal
            return json, mean
    """
    assert digest_of(defined(text))[1] >= {"json", "statistics", "decimal"}


@pytest.fixture
def main(monkeypatch):
    """Return a function that defines the agent A in this process's own script."""

    def define(text):
        monkeypatch.setattr(sys.modules["__main__"], "A", defined(text), raising=False)
        return "__main__:A"

    return define


def test_a_fingerprint_follows_the_present_class(main):
    first = fingerprint(main(AGENT), "equations")
    assert fingerprint(main(edited("return 9", "return 8")), "equations") != first
    assert fingerprint(main(AGENT), "equations") == first


def test_a_fingerprint_covers_the_users_own_modules(main, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    file = tmp_path / "own_module_of_a_script.py"
    file.write_text("def f(): return 1\n")
    agent = main("import own_module_of_a_script as own\n\ndef A(rng):\n    return own.f()\n")
    first = fingerprint(agent, "equations")
    file.write_text("def f(): return 2\n")
    assert fingerprint(agent, "equations") != first


def test_a_fingerprint_covers_the_parts_of_this_package_that_it_uses(main, monkeypatch):
    text = "from upright.agents.parts.boxes import Boxes\n\ndef A(rng):\n    return Boxes\n"
    given = []
    files = "upright.studies.fingerprint.determining_files"
    monkeypatch.setattr(files, lambda *modules: given.extend(modules) or set())
    fingerprint(main(text), "equations")
    assert "boxes.py" in {path.name for path in given}


def test_what_cannot_leave_the_process_is_named(main):
    agent = main("import threading\nlock = threading.Lock()\n\ndef A(rng):\n    return lock\n")
    with pytest.raises(
        UprightError, match=r"^agent is '__main__:A'; what it uses cannot be copied"
    ):
        pack([agent])


def test_what_cannot_be_defined_in_the_other_process_is_told(monkeypatch):
    monkeypatch.setattr(definitions, "_received", [b"nothing that was packed"])
    with pytest.raises(UprightError, match="cannot be copied to another process"):
        definitions.unpack()


def test_only_agents_of_the_script_are_copied(main):
    assert is_in_main("__main__:A")
    assert not is_in_main("reinforce")
    assert pack(["reinforce", "mine:A"]) == pack([])


SCRIPT = """
import os
import upright

PLACES = {"gain": 20.0}
print("imported")

class Base:
    def begin_trial(self, rng):
        self.weight = PLACES["gain"] * (rng.random() - 0.5)
    def learn(self, before, action, after, fallen): ...
    def end_trial(self, fallen): ...

class Mine(Base):
    def __init__(self, rng):
        open(f"{os.getpid()}.pid", "w").close()
    def act(self, observation, rng):
        x, x_dot, theta, theta_dot = observation
        return x + 1.5 * x_dot + self.weight * theta + 3 * theta_dot > 0

case = upright.make_case(Mine, steps=200, trials=20)
assert case == upright.make_case("__main__:Mine", steps=200, trials=20)
studied = upright.study([case], runs=4)[case]
made = [upright.make_run(case, 0, run)[1] for run in range(4)]
assert [r.lengths.tolist() for r in studied] == [r.lengths.tolist() for r in made]
assert len({tuple(r.lengths) for r in made}) > 1

with upright.Store("runs.sqlite") as store:
    upright.study([case], 2, store=store)
PLACES["gain"] = 30.0
try:
    upright.study([case], 2)
except upright.UprightError as error:
    print(error)
"""


@pytest.mark.slow
def test_a_script_without_a_guard_studies_its_own_agent_in_processes(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT)
    ended = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    changed = "agent is '__main__:Mine'; it changed after its case was made"
    assert ended.stdout.splitlines() == ["imported", changed]
    assert len(list(tmp_path.glob("*.pid"))) > 1
    shown = python(
        f"from upright.studies.study import stored\n"
        f"((case, seed, results),) = stored({str(tmp_path / 'runs.sqlite')!r})\n"
        f"print(case.agent, len(results))"
    )
    assert shown.stdout == "__main__:Mine 2\n", shown.stderr
