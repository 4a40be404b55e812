import json

import numpy as np
import pytest

from upright.cartpole import State
from upright.errors import UprightError
from upright.plots import play
from upright.policy import learned_policy, load_policy, save_policy
from upright.study import make_case, make_run

AGENTS = ("reinforce", "q-learning", "random-search")


def learn(agent):
    case = make_case(agent, steps=2000)
    memory, result = make_run(case, 0, 0)
    return case, result, learned_policy(case, 0, 0, memory)


@pytest.mark.parametrize("agent", AGENTS)
def test_a_policy_read_back_balances_alike(agent, tmp_path):
    case, result, policy = learn(agent)
    assert result.success
    save_policy(tmp_path / "policy.npz", policy, case.settings)
    again = load_policy(tmp_path / "policy.npz")
    assert again.task == policy.task
    for point in np.random.default_rng(0).normal(0, 0.2, (200, 4)):
        assert again.push_probability(point) == policy.push_probability(State(*point))
    states = play(again, case.task())
    np.testing.assert_array_equal(states, play(policy, case.task()))
    assert len(states) > 200  # far more than without control


def test_playing_teaches_nothing():
    case, _, policy = learn("reinforce")
    before = [array.copy() for array in policy.memory.network]
    play(policy, case.task()._replace(steps=100_000), seed=3)
    for array, old in zip(policy.memory.network, before, strict=True):
        np.testing.assert_array_equal(array, old)


def damage_cut(path):
    path.write_bytes(path.read_bytes()[:-100])


def damage_middle(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)


def change_header(change):
    def damage(path):
        with np.load(path) as archive:
            arrays = dict(archive)
        header = json.loads(str(arrays["header"]))
        change(header)
        arrays["header"] = np.array(json.dumps(header))
        with path.open("wb") as file:
            np.savez_compressed(file, **arrays)

    return damage


def damage_pickle(path):
    with path.open("wb") as file:
        np.savez(file, header=np.array([{"format": "a pickled object"}], dtype=object))


@pytest.mark.parametrize(
    "damage",
    [
        damage_cut,
        damage_middle,
        damage_pickle,
        lambda path: path.write_text("hello"),
        lambda path: path.unlink(),
        change_header(lambda header: header.update(format="upright policy 99")),
        change_header(lambda header: header.update(agent="nobody")),
        change_header(lambda header: header["settings"].update(x_scale=-1)),
        change_header(lambda header: header["settings"].pop("x_scale")),
        change_header(lambda header: header["settings"].update(tempo=1)),
    ],
)
def test_a_damaged_policy_is_refused(damage, tmp_path):
    case, _, policy = learn("random-search")
    path = tmp_path / "policy.npz"
    save_policy(path, policy, case.settings)
    damage(path)
    with pytest.raises(UprightError, match=r"policy\.npz"):
        load_policy(path)
