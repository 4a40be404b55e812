"""Histories: the last steps of a trial as one row of numbers, a block for each step.

A block holds the push, then the four measurements that it was chosen on; the newest block comes
first, so that a step of time shifts the row by one block. At the first step of a trial nothing came
before: the blocks are then filled as if the pole had always been measured where it is, without a
push.
"""

from upright.core.compiled import inlined

BLOCK = 5
"""Numbers in a block: the push, 1 to the right and -1 to the left, and four measurements."""


@inlined
def unchanged(observation, i):
    """Return the i-th number of a history in which there was no push and nothing has changed."""
    return observation[i % BLOCK - 1] if i % BLOCK > 0 else 0.0


@inlined
def set_newest(history, observation, action, is_first):
    """Set the newest block; at the first step of a trial all, as if it had always been so."""
    for i in range(len(history) if is_first else BLOCK):
        history[i] = unchanged(observation, i)
    history[0] = 1.0 if action else -1.0


@inlined
def shift(history):
    """Copy every block one step into the past; the newest stays in its own place, too."""
    for i in range(len(history) - 1, BLOCK - 1, -1):
        history[i] = history[i - BLOCK]
