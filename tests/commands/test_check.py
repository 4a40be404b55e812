"""`upright check`: each wrong agent fails the line that is meant for it, and good ones none."""

import itertools
import json
import os
import subprocess
import sys

import pytest

from upright.commands import run
from upright.commands.check import agent_named
from upright.errors import UprightError
from upright.reports import agent_check
from upright.support.exit_status import AGENT_FAILED, BAD_USE, FAILED

GOOD = """
import random
import time

import numpy as np


class Mine:
    table = {}

    def __init__(self, rng):
        self.w = [0.0] * 4

    def begin_trial(self, rng):
        self.w = [rng.random() - 0.5 for _ in range(4)]

    def act(self, observation, rng):
        return sum(a * b for a, b in zip(self.w, observation)) > 0

    def learn(self, before, action, after, fallen):
        pass

    def end_trial(self, fallen):
        pass
"""
DRAW = "rng.random() - 0.5"
ACT = "return sum(a * b for a, b in zip(self.w, observation)) > 0"
COUNT = """n = self.table["n"] = self.table.get("n", 0) + 1
        self.w = [0.01 * n, 0.1, 1.0, 0.2 * (n % 5)]"""
WRONG = {
    "left as -1": ([(ACT, f"{ACT} or -1")], "actions", ["-1", "True (or 1)"]),
    "a force": ([("> 0\n", "* 10.0\n")], "actions", ["act returned"]),
    "no return": ([("return sum", "sum")], "actions", ["None", "forget"]),
    "no end_trial": ([("end_trial", "ending")], "contract", ["lacks end_trial"]),
    "no act": ([("act(self", "move(self")], "contract", ["lacks act"]),
    "a short signature": ([("action, after, fallen", "action")], "contract", ["learn(self"]),
    "NaN": ([("        pass\n\n", "        self.w[0] = np.nan\n\n")], "numbers", ["w[0] is NaN"]),
    "random": ([(DRAW, "random.random() - 0.5")], "random-numbers", ["`random`", "rng.random()"]),
    "np.random": ([(DRAW, "np.random.rand() - 0.5")], "random-numbers", ["`np.random`"]),
    "no seed": (
        [("self.w = [0.0] * 4", "self.r = np.random.default_rng()"), (DRAW, f"self.r.{DRAW[4:]}")],
        "random-numbers",
        ["default_rng() without a seed"],
    ),
    "a class attribute": (
        [(f"self.w = [{DRAW} for _ in range(4)]", COUNT)],
        "shared-state",
        ["before it", "in self"],
    ),
    "only in the first process": (
        [("self.w = [0.0] * 4", "assert __import__('multiprocessing').parent_process() is None")],
        "processes",
        ["AssertionError"],
    ),
}
"""What is replaced in the good agent, the check that fails, and words that it says."""
RAISING = {
    "in learn": ([("        pass\n\n", "        1 / 0\n\n")], "run", ["learn failed", "in learn"]),
    "in __init__": ([("[0.0] * 4", "[0.0] * many")], "contract", ["cannot be created", "'many'"]),
    "on import": ([("import time", "import nothing_of_this_name")], "contract", ["imported"]),
    "not Python": ([("return sum(", "return sum((")], "contract", ["SyntaxError"]),
}
LEARNER = """
import numpy as np


class Mine:
    def __init__(self, rng):
        self.rng = rng

    def train(self, env):
        while True:
            weights = self.rng.uniform(-1, 1, 4)
            observation, _ = env.reset({seed})
            fallen = False
            while not fallen:
                observation, _, fallen, _, _ = env.step(int(observation @ weights > 0))
"""
FAILURES = {**WRONG, **RAISING}
NUMBERS = itertools.count()


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Return a function that writes a module into the current, empty folder, and names it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", sys.path.copy())
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def write(text, changes=()):
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        name = f"checked_{next(NUMBERS)}"
        (tmp_path / f"{name}.py").write_text(text)
        return name

    return write


@pytest.fixture
def quick(monkeypatch):
    """Checks whose study is small."""
    monkeypatch.setattr(agent_check, "STUDY_RUNS", 5)
    monkeypatch.setattr(agent_check, "STUDY_STEPS", 300)
    monkeypatch.setattr(agent_check, "STUDY_TRIALS", 10)


def check(name):
    """Return the exit status of a check of a file, and what it wrote."""
    status = run(["check", f"{name}.py", "--json", "report.json"])
    with open("report.json") as file:
        return status, json.load(file)


def outcomes(report):
    return {name: each["outcome"] for name, each in report["checks"].items()}


@pytest.mark.slow
@pytest.mark.parametrize("wrong", FAILURES)
def test_a_wrong_agent_fails_the_check_that_is_meant_for_it(write, quick, capsys, wrong):
    changes, line, words = FAILURES[wrong]
    status, report = check(write(GOOD, changes))
    printed = capsys.readouterr().out
    assert status == (AGENT_FAILED if wrong in RAISING else FAILED)
    failed = {name for name, outcome in outcomes(report).items() if outcome == "failed"}
    assert failed - {"same-seed"} == {line}
    assert ("same-seed" in failed) == (line == "random-numbers")
    assert report["passed"] is False
    assert report["raised"] is (wrong in RAISING)
    assert f"\n✗ {line}: " in f"\n{printed}"
    found = report["checks"][line]
    for word in words:
        assert word in found["text"] + found["advice"]
        assert word in printed


@pytest.mark.slow
def test_an_agent_that_prints_is_not_heard(write, quick, capfd):
    status, report = check(write(GOOD, [(ACT, f"print('noise'); {ACT}")]))
    assert status == 0
    assert "noise" not in "".join(capfd.readouterr())
    assert list(outcomes(report))[-1] == "study"


@pytest.mark.slow
def test_what_is_worth_knowing_does_not_fail(write, quick):
    """An agent that always pushes left, and changes nothing that it holds."""
    status, report = check(write(GOOD, [(ACT, "return False"), (DRAW, "0.0")]))
    assert status == 0
    assert report["verdict"] == "slower"
    found = outcomes(report)
    assert {found[name] for name in ("actions", "learning", "study")} == {"noted"}
    assert report["checks"]["actions"]["figures"]["right"] == 0


@pytest.mark.slow
def test_a_gymnasium_learner_is_checked_as_well(write, quick):
    status, report = check(write(LEARNER, [("{seed}", "")]))
    assert status == 0
    assert report["checks"]["contract"]["figures"]["kind"] == "learner"
    assert outcomes(report)["study"] in ("passed", "noted")


@pytest.mark.slow
def test_runs_that_are_all_the_same_fail(write, quick):
    """The environment's random numbers are the run's, unless a learner seeds it."""
    fixed = [("{seed}", "seed=5"), ("self.rng = rng", "self.rng = np.random.default_rng(1)")]
    status, report = check(write(LEARNER, fixed))
    assert status == FAILED
    assert outcomes(report)["other-seed"] == "failed"


@pytest.mark.slow
def test_a_slow_agent_is_given_less(write, monkeypatch):
    monkeypatch.setattr(agent_check, "STUDY_SECONDS", 2.0)
    monkeypatch.setattr(agent_check, "PROBE_SECONDS", 0.2)
    status, report = check(write(GOOD, [(ACT, f"time.sleep(0.002); {ACT}")]))
    assert status == 0
    assert report["checks"]["speed"]["outcome"] == "noted"
    study = report["checks"]["study"]
    assert study["figures"].get("cut") or "too slow" in study["text"]


UPRIGHT = [sys.executable, "-m", "upright"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["plain", "compiled"])
def test_the_starter_passes_from_an_empty_folder(tmp_path, kind):
    def call(*words):
        return subprocess.run(
            [*UPRIGHT, *words],
            cwd=tmp_path,
            env=os.environ,
            capture_output=True,
            encoding="utf-8",
            timeout=300,
            check=False,
        )

    made = call("new", "my_agent.py", *(["--compiled"] if kind == "compiled" else []))
    assert made.returncode == 0, made.stderr
    ended = call("check", "my_agent.py", "--json", "report.json")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["verdict"] == "faster"
    assert report["passed"] is True
    assert (report["format"], report["version"]) == ("upright check", 1)
    assert report["checks"]["contract"]["figures"]["kind"] == kind
    assert set(outcomes(report).values()) <= {"passed", "noted"}
    assert ended.stdout.splitlines()[-1] == "nothing to mend"
    figures = report["checks"]["study"]["figures"]
    assert figures["agent"]["mean_trials"] < 0.5 * figures["guessing"]["mean_trials"]
    assert figures["seed"] >= 1_000_000


def test_an_agent_is_found_in_its_file(write):
    name = write(GOOD)
    for given in (f"{name}.py", f"{name}:Mine", f"{name}.py:Mine", f"./{name}.py"):
        assert agent_named(given) == f"{name}:Mine"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (GOOD + GOOD.replace("Mine", "Other"), r"several: name one of \w+:Mine, \w+:Other"),
        ("number = 3\n", "no class with the methods"),
    ],
)
def test_a_file_without_one_agent_is_refused(write, text, said):
    with pytest.raises(UprightError, match=said):
        agent_named(f"{write(text)}.py")


@pytest.mark.parametrize("given", ["absent.py", "absent:Mine", "nobody", "absent.py:Mine"])
def test_what_is_not_there_is_named(write, capsys, given):
    assert run(["check", given]) == BAD_USE
    assert "absent" in (told := capsys.readouterr().err) or "nobody" in told


def test_a_report_that_cannot_be_written_is_refused_at_once(write, capsys):
    assert run(["check", f"{write(GOOD)}.py", "--json", "missing/report.json"]) == BAD_USE
    told = capsys.readouterr()
    assert "folder does not exist" in told.err
    assert not told.out
