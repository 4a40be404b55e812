"""The reading twins make the same trials as the compiled agents.

The plant and Q-learning add in the same order as the package, so all their bits agree. REINFORCE
and adaptive LQR leave the order to NumPy's matrices: their last bits differ, and trial lengths
would differ if that flipped a push. All trials agreed in 50 whole runs of Q-learning (seeds 0 to
49), in 70 of REINFORCE (seeds 0 to 69; 20 of them also with two other kinds of OpenBLAS kernels),
in 300 runs of adaptive LQR with N = 2000 (seeds 0 to 299), and in 48 of up to 30 trials with
settings that make it fall often.
"""

import ast
import subprocess
import sys
from dataclasses import asdict, replace
from importlib import import_module

import numpy as np
import pytest
from helpers import ROOT

from upright.core.parameters import State
from upright.studies.case import make_case
from upright.studies.random_streams import random_numbers
from upright.studies.run import make_run

FOLDER = ROOT / "examples" / "reading"
TWINS = ("q-learning", "reinforce", "adaptive-lqr")

sys.path.insert(0, str(FOLDER.parents[1]))


def file_name(agent):
    return agent.replace("-", "_")


def twin_of(agent):
    return import_module(f"examples.reading.{file_name(agent)}")


def lengths_of(case, seed, run):
    return make_run(case, seed, run)[1].lengths.tolist()


@pytest.mark.parametrize(
    ("agent", "seed", "run"),
    [
        ("q-learning", 4, 0),  # 27 trials, one of which falls after 16,898 steps
        ("q-learning", 12, 0),  # 54 trials
        ("q-learning", 3, 5),
        ("reinforce", 4, 0),  # 10 trials, one of which falls after 18,192 steps
        ("reinforce", 5, 0),  # 10 trials
        ("reinforce", 3, 5),
        ("adaptive-lqr", 1, 0),
    ],
)
def test_a_twin_makes_the_trials_of_the_compiled_agent(agent, seed, run):
    lengths = list(twin_of(agent).trial_lengths(random_numbers(seed, run)))
    assert lengths == lengths_of(make_case(agent), seed, run)
    assert lengths[-1] == 60_000


@pytest.mark.parametrize("seed", range(4))
def test_adaptive_lqr_s_twin_falls_where_the_compiled_agent_falls(seed, monkeypatch):
    """With its own settings it hardly ever falls; with many random pushes it keeps falling."""
    twin = twin_of("adaptive-lqr")
    monkeypatch.setattr(twin, "EXPLORATION", 0.5)
    case = make_case("adaptive-lqr", steps=3_000, trials=20)
    case = replace(case, settings=replace(case.settings, exploration=0.5))
    lengths = list(twin.trial_lengths(random_numbers(seed, 0), steps=3_000, trials=20))
    assert lengths == lengths_of(case, seed, 0)
    assert len(set(lengths)) > 10


def test_adaptive_lqr_s_twin_designs_the_same_control_from_few_data():
    """Where the ridge still counts, which trial lengths hardly show."""
    agent = make_case("adaptive-lqr").settings.agent(np.random.default_rng(0))
    twin = twin_of("adaptive-lqr").AdaptiveLQR()
    rng = np.random.default_rng(1)
    o = 0.05 * rng.standard_normal(4)
    z = np.tile([0.0, *o], agent.model.shape[1] // 5)[1:]
    for _ in range(12):
        right, after = bool(rng.random() < 0.5), 0.05 * rng.standard_normal(4)
        agent.learn(State(*o), right, State(*after), False)
        r = np.array([1.0 if right else -1.0, *z])
        twin.learn(r, after - o)
        o, z = after, np.concatenate([after, r[:-5]])
        np.testing.assert_allclose(twin.K, agent.gains[1:], rtol=1e-6, atol=1e-9)
    assert np.all(twin.K != 0.0)


@pytest.mark.parametrize(
    ("agent", "names"),
    [
        ("q-learning", "learning_rate discount trace_decay replay_size replay_passes"),
        ("reinforce", "learning_rate discount episodes kept_steps epochs stride logit_scale"),
        ("adaptive-lqr", "history ridge push_ridge ridge_growth push_cost horizon learning_steps"),
    ],
)
def test_settings_of_a_twin_are_the_defaults(agent, names):
    """Those of the same name; some of them would change no trial length above."""
    twin, settings = twin_of(agent), asdict(make_case(agent).settings)
    alike = {name: value for name, value in settings.items() if hasattr(twin, name.upper())}
    assert alike.keys() >= set(names.split())
    assert {name: getattr(twin, name.upper()) for name in alike} == alike


@pytest.mark.parametrize("agent", TWINS)
def test_a_twin_needs_numpy_alone_and_prints_the_lengths(agent, tmp_path):
    """It is run from a copy outside the project."""
    script = tmp_path / "twin.py"
    script.write_text((FOLDER / f"{file_name(agent)}.py").read_text("utf-8"), "utf-8")
    command = [sys.executable, "-I", str(script), "8"]
    printed = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout
    lengths = [int(line.split()[-2]) for line in printed.splitlines()]
    assert lengths == lengths_of(make_case(agent), 8, 0)


@pytest.mark.parametrize("agent", TWINS)
def test_a_twin_imports_numpy_and_the_standard_library_alone(agent):
    tree = ast.parse((FOLDER / f"{file_name(agent)}.py").read_text("utf-8"))
    imported = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imported |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported.add(str(node.module).partition(".")[0])
    assert "numpy" in imported
    assert imported <= {"numpy", *sys.stdlib_module_names}
