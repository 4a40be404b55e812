"""Shared by tests of environments: makes them, and compares what they return."""

import gymnasium
import numpy as np
from helpers import GOOD_WEIGHTS

import upright  # noqa: F401 - makes the environments known

NAMES = ("upright/CartPole-v0", "upright/ContinuousCartPole-v0")
MODES = ("NextStep", "SameStep", "Disabled")


def make(name=NAMES[0], **options):
    return gymnasium.make(name, **options)


def make_many(count, name=NAMES[0], **options):
    return gymnasium.make_vec(
        name, count, vectorization_mode="vector_entry_point", **options
    ).unwrapped


class Watching:
    """An agent for the loop that balances more or less well, and notes what it measures."""

    def __init__(self):
        self.seen = []

    def begin_trial(self, rng): ...

    def act(self, observation, rng):
        self.seen.append(observation)
        return bool(np.dot(GOOD_WEIGHTS, observation) > 0)

    def learn(self, before, action, after, fallen):
        self.last = after

    def end_trial(self, fallen): ...


def act(env, rng, *shape):
    """Return random actions."""
    if env.unwrapped.continuous:
        return rng.uniform(-10, 10, (*shape, 1)).astype(np.float32)
    actions = rng.integers(0, 2, shape)
    return actions if shape else int(actions)


def assert_alike(ours, theirs):
    """Compare what two vector environments return; of infos, only what their masks select."""
    assert ours.keys() == theirs.keys()
    for name, value in theirs.items():
        if isinstance(value, dict):
            assert_alike(ours[name], value)
        elif name.startswith("_"):
            np.testing.assert_array_equal(ours[name], value, err_msg=name)
        else:
            for i in np.flatnonzero(theirs[f"_{name}"]):
                np.testing.assert_array_equal(ours[name][i], value[i], err_msg=name)
                assert ours[name][i].dtype == value[i].dtype


def assert_steps_alike(ours, theirs):
    for mine, yours in zip(ours[:-1], theirs[:-1], strict=True):
        np.testing.assert_array_equal(mine, yours)
        assert mine.dtype == yours.dtype
    assert_alike(ours[-1], theirs[-1])
