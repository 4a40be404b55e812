"""Files that earlier versions wrote are still read.

`data/0.1.0` holds policies, a store, and what version 0.1.0 made of them. They stay as they are:
their headers have the names of settings and of parts of a task that version had.
"""

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from helpers import ROOT

from upright.core.parameters import State
from upright.policies.files import load_policy
from upright.studies.playing import case_for, play_trials

FOLDER = ROOT / "tests/data/0.1.0"
EXPECTED = json.loads((FOLDER / "expected.json").read_text())
COMMAND = [sys.executable, "-c", "from upright.commands import main; main()"]
LIMITS = State(2.4, 2.0, 0.2, 2.0)


def play_three(policy):
    """Play on the task that the policy learned on, its integrator included."""
    case = case_for(policy, steps=1000)
    return [[trial.steps, trial.balanced] for trial in play_trials(policy, case, 3, seed=11)]


def pushes(policy):
    observations = (2 * np.random.default_rng(5).random((6, 4)) - 1) * LIMITS
    return [policy.push_probability(State(*each)) for each in observations.tolist()]


def figures(path):
    policy = load_policy(path)
    return {"agent": policy.agent, "pushes": pushes(policy), "trials": play_three(policy)}


def show(path):
    wide = os.environ | {"COLUMNS": "1000"}  # so that a table has all its columns
    line = [*COMMAND, "show", str(path)]
    return subprocess.run(
        line, capture_output=True, text=True, timeout=100, check=True, env=wide
    ).stdout


@pytest.mark.parametrize("name", sorted(EXPECTED["policies"]))
def test_a_policy_plays_as_it_did(name):
    assert figures(FOLDER / name) == EXPECTED["policies"][name]


@pytest.mark.parametrize("name", sorted(EXPECTED["policies"]))
def test_a_policy_is_shown(name):
    assert EXPECTED["policies"][name]["agent"] in show(FOLDER / name)


def test_every_file_is_read():
    found = {path.name for path in FOLDER.iterdir()}
    assert found == {*EXPECTED["policies"], "store.sqlite", "expected.json"}


def test_the_rows_of_a_store_are_shown():
    shown = show(FOLDER / "store.sqlite")
    cells = [re.split(" {2,}", line.strip()) for line in shown.splitlines()]
    newer = [cells[0].index(head) for head in cells[0] if head in ("Task", "Runs", "Seed")]
    assert newer  # columns that version 0.1.0 did not have
    lines = [" ".join(cell for i, cell in enumerate(line) if i not in newer) for line in cells]
    for row in EXPECTED["rows"]:
        assert any(line.startswith(row) for line in lines), row


def test_the_rows_of_a_store_that_names_no_version_are_not_said_to_be_of_this_one():
    assert "upright 0." not in show(FOLDER / "store.sqlite")
