"""Tabular Q-learning on boxes of the measurements.

The four measurements are cut into boxes; a table holds, for each box and push, the value to expect:
0 if the pole will stand, -γ^k if it falls after k more moves. The agent pushes as the better value
says, and each move from box b to box b' under push a changes the table (C. Watkins, P. Dayan,
*Q-learning*, Machine Learning 8, 1992; the report's equation (2)):

    Q(b, a) ← (1 - α) Q(b, a) + α (r + γ max_a' Q(b', a')),    r = -1 at the fall, else 0.

As published, that happens at every time step. The tuned settings instead keep the moves from one
box to another and learn when the pole has fallen: the last moves are gone through backwards, the
newest first, so that news of the fall travels along the whole way that led there (L.-J. Lin,
*Self-improving reactive agents*, Machine Learning 8, 1992). What a move is worth is then mixed with
the worth G of the move after it:

    G ← -1 at a fall, else γ ((1 - λ) max_a' Q(b', a') + λ G),
    Q(b, a) ← Q(b, a) + α (G - Q(b, a)).

A cart-pole seen in a mirror is a cart-pole: with `mirrored`, a box and its mirror image share their
values, pushes exchanged.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from upright.agents.parts.boxes import (
    BARTO_SUTTON_ANDERSON,
    Boxes,
    check_edges,
    degrees,
    find_box,
    make_boxes,
    tabulate,
)
from upright.core.compiled import compiled
from upright.errors import require

FALL = -1
"""Stands for the box that a fall leads to."""


@dataclass(frozen=True)
class QLearning:
    """Settings of Q-learning."""

    learning_rate: float = 0.08
    """α: how far a value moves towards the new one."""
    discount: float = 0.99
    """γ: how much less a fall counts for each move that it lies ahead."""
    passes: int = 2
    """How often the kept moves are gone through after a fall; 0 learns at every step instead."""
    kept_moves: int = 2000
    """How many of the last moves from box to box are kept."""
    trace: float = 0.15
    """λ: how much of the value given to the next move passes on to the one before."""
    mirrored: bool = True
    """Whether a box and its mirror image share their values."""
    jitter: float = 1e-6
    """Width of the random first values, which breaks ties."""
    x_edges: tuple[float, ...] = (-1.6, 1.6)
    """Edges of the boxes along the cart's position [m]."""
    x_dot_edges: tuple[float, ...] = (0.0,)
    """Edges along the cart's velocity [m/s]."""
    theta_edges: tuple[float, ...] = degrees(-3, -1, 1, 3)
    """Edges along the pole's angle [rad]."""
    theta_dot_edges: tuple[float, ...] = degrees(-50, -30, -12, 0, 12, 30, 50)
    """Edges along the pole's angular velocity [rad/s]."""

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        require("learning_rate", self.learning_rate, 0, 1)
        require("discount", self.discount, 0, 1)
        require("passes", self.passes, 0, 1000, whole=True)
        require("kept_moves", self.kept_moves, 1, 10**7, whole=True)
        require("trace", self.trace, 0, 1)
        require("jitter", self.jitter, 0)
        check_edges(self)

    def agent(self, rng: np.random.Generator) -> "Memory":
        """Return a new agent with a blank table."""
        boxes = make_boxes(self)
        return Memory(
            table=self.jitter * (rng.random(2 * math.prod(boxes.parts)) - 0.5),
            boxes=boxes,
            mirrored=self.mirrored,
            move_entries=np.zeros(self.kept_moves, np.int64),
            move_boxes=np.zeros(self.kept_moves, np.int64),
            moves=np.zeros(1, np.int64),
            learning_rate=self.learning_rate,
            discount=self.discount,
            trace=self.trace,
            passes=self.passes,
        )


SETTINGS = {
    "default": QLearning(),
    "as-published": QLearning(
        learning_rate=0.3,
        discount=0.9,
        passes=0,
        kept_moves=1,
        trace=0.0,
        mirrored=False,
        **BARTO_SUTTON_ANDERSON,
    ),
}
"""As published: the report's α and γ. It leaves the boxes open; these are the 162 of Barto, Sutton
& Anderson (1983), learned at every step, greedily, from values near zero."""


class Memory(NamedTuple):
    """What the agent carries from step to step and from trial to trial."""

    table: np.ndarray
    """Values, at the place that `entry` gives for a box and a push."""
    boxes: Boxes
    mirrored: bool
    move_entries: np.ndarray
    """Of each kept move, the place in the table of its box and push; a ring."""
    move_boxes: np.ndarray
    """Of each kept move, the box it led to, or FALL."""
    moves: np.ndarray
    """How many moves there have been."""
    learning_rate: float
    discount: float
    trace: float
    passes: int

    @compiled
    def push_probability(self, observation):
        """Return 1 where the policy pushes to the right, else 0."""
        return 1.0 if right_is_better(self, find_box(self.boxes, observation)) else 0.0

    @compiled
    def begin_trial(self, rng):
        """Nothing is to be done: the table and the moves are kept."""

    @compiled
    def act(self, observation, rng):
        """Push as the better value says."""
        return right_is_better(self, find_box(self.boxes, observation))

    @compiled
    def learn(self, before, action, after, fallen):
        """Learn from a move, or keep it until the pole has fallen."""
        box = find_box(self.boxes, before)
        next_box = FALL if fallen else find_box(self.boxes, after)
        if self.passes == 0:
            change(self, entry(self, box, action), target(self, next_box))
        elif next_box != box:
            row = self.moves[0] % len(self.move_boxes)
            self.move_entries[row] = entry(self, box, action)
            self.move_boxes[row] = next_box
            self.moves[0] += 1

    @compiled
    def end_trial(self, fallen):
        """Go through the kept moves backwards after a fall."""
        if fallen:
            for _ in range(self.passes):
                replay(self)

    def policy_form(self):
        """Return the policy as data."""
        return tabulate(self.boxes, self.push_probability)


@compiled
def right_is_better(memory, box):
    """Return whether the table prefers a push to the right; of equals the left one is taken."""
    return memory.table[entry(memory, box, True)] > memory.table[entry(memory, box, False)]


@compiled
def entry(memory, box, action):
    """Return the place of a box and a push in the table, the same for their mirror image."""
    place = 2 * box + (1 if action else 0)
    return min(place, len(memory.table) - 1 - place) if memory.mirrored else place


@compiled
def best_value(memory, box):
    """Return the value of the better push in a box."""
    return max(memory.table[entry(memory, box, False)], memory.table[entry(memory, box, True)])


@compiled
def target(memory, next_box):
    """Return what a move was worth: the reward and the discounted value of where it led."""
    return -1.0 if next_box == FALL else memory.discount * best_value(memory, next_box)


@compiled
def change(memory, place, value):
    """Move a value of the table towards a new one."""
    memory.table[place] += memory.learning_rate * (value - memory.table[place])


@compiled
def replay(memory):
    """Learn from the kept moves, the newest first."""
    value = 0.0
    count = memory.moves[0]
    for move in range(count - 1, max(0, count - len(memory.move_boxes)) - 1, -1):
        row = move % len(memory.move_boxes)
        next_box = memory.move_boxes[row]
        one_step = target(memory, next_box)
        if next_box == FALL:
            value = one_step
        else:
            value = (1.0 - memory.trace) * one_step + memory.trace * memory.discount * value
        change(memory, memory.move_entries[row], value)
