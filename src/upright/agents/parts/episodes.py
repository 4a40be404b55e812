"""The last episodes, as policy gradients learn from them: a ring of episodes.

Each episode is a ring of its last steps in turn.
"""

from typing import NamedTuple

import numpy as np

from upright.core.compiled import inlined


class Episodes(NamedTuple):
    """The steps of the last episodes; the first two axes are the episode and the row of a step."""

    inputs: np.ndarray
    """What the policy saw, shape (episodes, kept steps, 4)."""
    actions: np.ndarray
    """Whether it pushed to the right."""
    probabilities: np.ndarray
    """How likely it was to push to that side."""
    advantages: np.ndarray
    """How much better than expected things went from there."""
    lengths: np.ndarray
    """How many steps each episode had, those that were not kept included; shape (episodes,)."""
    newest: np.ndarray
    """Which episode is the newest, shape (1,)."""


def make_episodes(episodes: int, kept_steps: int) -> Episodes:
    """Return room for this many episodes, and for this many steps of each."""
    steps = (episodes, kept_steps)
    return Episodes(
        inputs=np.zeros((*steps, 4)),
        actions=np.zeros(steps, np.bool_),
        probabilities=np.zeros(steps),
        advantages=np.zeros(steps),
        lengths=np.zeros(episodes, np.int64),
        newest=np.zeros(1, np.int64),
    )


@inlined
def begin_episode(episodes):
    """Make room for a new episode in place of the oldest."""
    episodes.newest[0] = (episodes.newest[0] + 1) % len(episodes.lengths)
    episodes.lengths[episodes.newest[0]] = 0


@inlined
def record_step(episodes, inputs, action, probability):
    """Add a step to the newest episode, in place of its oldest one if there is no more room.

    `probability` is that of the push that was made, `action`.
    """
    episode = episodes.newest[0]
    row = episodes.lengths[episode] % episodes.actions.shape[1]
    episodes.lengths[episode] += 1
    for i in range(4):
        episodes.inputs[episode, row, i] = inputs[i]
    episodes.actions[episode, row] = action
    episodes.probabilities[episode, row] = probability


@inlined
def count_kept(episodes, episode):
    """Return how many steps of an episode are kept."""
    return min(episodes.lengths[episode], episodes.actions.shape[1])


@inlined
def row_before_end(episodes, episode, back):
    """Return the row of the step that lies `back` steps before an episode's last."""
    return (episodes.lengths[episode] - 1 - back) % episodes.actions.shape[1]
