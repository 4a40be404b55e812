"""Numbers in a policy's file reach compiled code, which trusts indices: they are checked before."""

import io
import os
import subprocess
import sys
from contextlib import suppress

import numpy as np
import pytest

from upright.agents import AGENTS
from upright.core.task import TaskSpec
from upright.errors import UprightError
from upright.policies.files import load_policy, save_policy
from upright.policies.npz_file import LARGEST_COUNT, arrays_of
from upright.policies.policy import Policy

SMALL = {
    "adaptive-lqr": {"history": 1, "horizon": 1},
    "reinforce": {"episodes": 2, "kept_steps": 50, "epochs": 1},
    "ndp": {"critic_cycles": 1, "action_cycles": 1},
}
"""Settings with which an agent is quick in plain Python."""
EXTREMES = (-(2**63), -(2**40), -2, -1, 0, 1, 7, 10**6, 2**40, LARGEST_COUNT, 2**63 - 1)


def policy_of(agent, **settings):
    chosen = AGENTS.default(agent) if not settings else type(AGENTS.default(agent))(**settings)
    return Policy(agent, chosen.agent(np.random.default_rng(0)), TaskSpec(), settings=chosen)


def forged(path, policy, name, value):
    """Write a file as `save_policy` would, with one value in all of an array."""
    save_policy(path, policy)
    with np.load(path) as archive:
        members = dict(archive)
    members[name] = np.full_like(members[name], value)
    written = io.BytesIO()
    np.savez(written, **members)
    path.write_bytes(written.getvalue())


WHOLE = [
    (agent, name)
    for agent in AGENTS.built_in
    for name, array in arrays_of(AGENTS.default(agent).agent(np.random.default_rng(0)))
    if array.dtype.kind == "i"
]


@pytest.mark.slow
@pytest.mark.parametrize(("agent", "name"), WHOLE, ids=map("-".join, WHOLE))
def test_no_number_leads_out_of_an_array(agent, name, tmp_path):
    """An agent that goes on from what is accepted stays within its arrays, as plain Python sees."""
    policy, accepted = policy_of(agent, **SMALL.get(agent, {})), []
    for number, value in enumerate(EXTREMES):
        path = tmp_path / f"{number}.npz"
        forged(path, policy, name, value)
        with suppress(UprightError):
            load_policy(path)
            accepted.append(path)
    assert 0 < len(accepted) < len(EXTREMES)
    code = "import sys\nfrom upright.commands import run\n" + "".join(
        f"if run(['learn', {agent!r}, '--from', {str(path)!r}, '--trials', '2', '--steps', '30',"
        " '--quiet']) > 1: sys.exit(1)\n"
        for path in {accepted[0], accepted[-1]}
    )
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    ended = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=300
    )
    assert ended.returncode == 0, ended.stderr


@pytest.mark.parametrize(
    ("agent", "name", "value", "said"),
    [
        ("q-learning", "move_entries", 2**40, "not from 0 to 479"),
        ("q-learning", "move_boxes", -2, "not from -1 to 239"),
        ("ase-ace", "traced_boxes", 180, "not from 0 to 179"),
        ("ase-ace", "traced_count", 181, "not from 0 to 180"),
        ("reinforce", "episodes.lengths", -1, "not from 0 to 1,000,000,000,000,000"),
    ],
)
def test_impossible_indices_are_refused(agent, name, value, said, tmp_path):
    forged(tmp_path / "policy.npz", policy_of(agent), name, value)
    with pytest.raises(UprightError, match=f"{name} holds a number that is {said}"):
        load_policy(tmp_path / "policy.npz")


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_what_diverged_is_not_saved_without_a_word(value, tmp_path):
    policy = policy_of("random-search")
    policy.memory.weights[0] = value
    with pytest.raises(UprightError, match="diverged"):
        save_policy(tmp_path / "policy.npz", policy)
    assert not list(tmp_path.iterdir())


def test_a_policy_that_could_not_be_exported_is_not_loaded(tmp_path):
    """With a gain of 10³⁰, for example; the same bounds hold in every format."""
    forged(tmp_path / "policy.npz", policy_of("random-search"), "weights", 1e30)
    with pytest.raises(UprightError, match=r"a weight of layer 1 is 1e\+30; it must be a number"):
        load_policy(tmp_path / "policy.npz")


@pytest.mark.parametrize("name", ["a" * 300, "a/" * 3000, "\0", "\ud800", "a\n"])
def test_names_that_no_file_can_have(name):
    with pytest.raises(UprightError, match="there is no such file"):
        load_policy(f"{name}.npz")
