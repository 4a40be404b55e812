"""Tabular Q-learning on boxes of the measurements.

The four measurements are cut into boxes; a table holds, for each box and push, the value to expect:
0 if the pole will stand, -γ^k if it falls after k more moves. The agent pushes as the better value
says, and each move from box b to box b' under push a changes the table (C. Watkins, P. Dayan,
*Q-learning*, Machine Learning 8, 1992; the report's equation (2)):

    Q(b, a) ← Q(b, a) + α (r + γ max_a' Q(b', a') - Q(b, a)),    r = -1 at the fall, else 0.

As published, that happens at every time step. The tuned settings instead keep the moves from one
box to another and learn when the pole has fallen: the last moves are replayed backwards, the newest
first, so that news of the fall travels along the whole way that led there (L.-J. Lin,
*Self-improving reactive agents*, Machine Learning 8, 1992). The return of a move is then mixed with
the return G of the move after it:

    G ← -1 at a fall, else γ ((1 - λ) max_a' Q(b', a') + λ G),
    Q(b, a) ← Q(b, a) + α (G - Q(b, a)).

A cart-pole seen in a mirror is a cart-pole: with `mirrored`, a box and its mirror image share their
values, pushes exchanged.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

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
from upright.core.compiled import compiled, inlined
from upright.core.parameters import LARGEST
from upright.errors import require
from upright.support.short_repr import short_repr

FALL = -1
"""Stands for the box that a fall leads to."""


class QLearningAgent(NamedTuple):
    """What the agent carries from step to step and from trial to trial."""

    table: np.ndarray
    """Q, at the place that `entry` gives for a box and a push."""
    boxes: Boxes
    mirrored: bool
    move_entries: np.ndarray
    """Of each kept move, the place in the table of its box and push; a ring."""
    move_boxes: np.ndarray
    """Of each kept move, the box that it led to, or FALL."""
    moves: np.ndarray
    """How many moves there have been, shape (1,)."""
    learning_rate: float
    discount: float
    trace_decay: float
    replay_passes: int
    jitter: float

    def __repr__(self) -> str:
        return short_repr(self)

    @compiled
    def push_probability(self, observation):
        """Return 1 where the policy pushes to the right, else 0."""
        return 1.0 if right_is_better(self, find_box(self.boxes, observation)) else 0.0

    @compiled
    def begin_run(self, rng):
        """Draw the first values, which breaks ties."""
        for i in range(len(self.table)):
            self.table[i] = self.jitter * (rng.random() - 0.5)

    @compiled
    def begin_trial(self, rng):
        """Nothing to do: the table and the kept moves carry over."""

    @compiled
    def act(self, observation, rng):
        """Push as the better value says."""
        return right_is_better(self, find_box(self.boxes, observation))

    @compiled
    def learn(self, before, action, after, fallen):
        """Learn from a move, or keep it until the pole has fallen."""
        box = find_box(self.boxes, before)
        next_box = FALL if fallen else find_box(self.boxes, after)
        if self.replay_passes == 0:
            learn_at_once(self, entry(self, box, action), next_box)
        elif next_box != box:
            keep_move(self, entry(self, box, action), next_box)

    @compiled
    def end_trial(self, fallen):
        """Learn from the kept moves after a fall."""
        if fallen:
            for _ in range(self.replay_passes):
                replay(self)

    def policy_form(self):
        """Return the policy as data."""
        return tabulate(self.boxes, self.push_probability)

    def index_limits(self):
        """Return the least and greatest number in each array of indices, as files must keep it."""
        boxes = math.prod(self.boxes.parts)
        return {"move_entries": (0, len(self.table) - 1), "move_boxes": (FALL, boxes - 1)}


# ---- The table -----------------------------------------------------------------------------------


@inlined
def entry(agent, box, action):
    """Return the place of a box and a push in the table, the same for their mirror image."""
    place = 2 * box + (1 if action else 0)
    return min(place, len(agent.table) - 1 - place) if agent.mirrored else place


@inlined
def right_is_better(agent, box):
    """Return whether the table prefers a push to the right; of equals the left one is taken."""
    return agent.table[entry(agent, box, True)] > agent.table[entry(agent, box, False)]


@inlined
def best_value(agent, box):
    """Return max_a Q(b, a), the value of the better push in a box."""
    return max(agent.table[entry(agent, box, False)], agent.table[entry(agent, box, True)])


# ---- As published: learn at every step -----------------------------------------------------------


@inlined
def learn_at_once(agent, place, next_box):
    """Change the value of a box and a push by the move that they led to."""
    # Q(b, a) ← Q(b, a) + α (r + γ max_a' Q(b', a') - Q(b, a))
    target = -1.0 if next_box == FALL else agent.discount * best_value(agent, next_box)
    agent.table[place] += agent.learning_rate * (target - agent.table[place])


# ---- Tuned: replay after a fall ------------------------------------------------------------------


@inlined
def keep_move(agent, place, next_box):
    """Keep a move, in place of the oldest if there is no more room."""
    row = agent.moves[0] % len(agent.move_boxes)
    agent.move_entries[row] = place
    agent.move_boxes[row] = next_box
    agent.moves[0] += 1


@inlined
def replay(agent):
    """Learn from the kept moves, the newest first."""
    discount, trace_decay = agent.discount, agent.trace_decay
    move_return = 0.0
    count = agent.moves[0]
    for move in range(count - 1, max(0, count - len(agent.move_boxes)) - 1, -1):
        row = move % len(agent.move_boxes)
        place, next_box = agent.move_entries[row], agent.move_boxes[row]
        # G ← -1 at a fall, else γ ((1 - λ) max_a' Q(b', a') + λ G)
        if next_box == FALL:
            move_return = -1.0
        else:
            one_step = discount * best_value(agent, next_box)
            move_return = (1.0 - trace_decay) * one_step + trace_decay * discount * move_return
        # Q(b, a) ← Q(b, a) + α (G - Q(b, a))
        agent.table[place] += agent.learning_rate * (move_return - agent.table[place])


# ---- Settings ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class QLearning:
    """Settings of Q-learning."""

    learning_rate: float = 0.08
    """α: how far a value moves towards the new one."""
    discount: float = 0.99
    """γ: how much less a fall counts for each move that it lies ahead."""
    replay_passes: int = 2
    """How often the kept moves are replayed after a fall; 0 learns at every step instead."""
    replay_size: int = 2000
    """How many of the last moves from box to box are kept."""
    trace_decay: float = 0.15
    """λ: how much of the return of a move passes on to the move before it."""
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

    RENAMED: ClassVar = {
        "passes": "replay_passes",
        "kept_moves": "replay_size",
        "trace": "trace_decay",
    }

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        require("learning_rate", self.learning_rate, 0, 1)
        require("discount", self.discount, 0, 1)
        require("replay_passes", self.replay_passes, 0, 1000, whole=True)
        require("replay_size", self.replay_size, 1, 10**7, whole=True)
        require("trace_decay", self.trace_decay, 0, 1)
        require("jitter", self.jitter, 0, LARGEST)
        check_edges(self)

    def agent(self, rng: np.random.Generator) -> QLearningAgent:
        """Return a new agent with a blank table."""
        boxes = make_boxes(self)
        agent = QLearningAgent(
            table=np.zeros(2 * math.prod(boxes.parts)),
            boxes=boxes,
            mirrored=self.mirrored,
            move_entries=np.zeros(self.replay_size, np.int64),
            move_boxes=np.zeros(self.replay_size, np.int64),
            moves=np.zeros(1, np.int64),
            learning_rate=self.learning_rate,
            discount=self.discount,
            trace_decay=self.trace_decay,
            replay_passes=self.replay_passes,
            jitter=self.jitter,
        )
        agent.begin_run(rng)
        return agent


SETTINGS = {
    "default": QLearning(),
    "as-published": QLearning(
        learning_rate=0.3,
        discount=0.9,
        replay_passes=0,
        replay_size=1,
        trace_decay=0.0,
        mirrored=False,
        **BARTO_SUTTON_ANDERSON,
    ),
}
"""As published: the report's α and γ. It leaves the boxes open; these are the 162 of Barto, Sutton
& Anderson (1983), learned at every step, greedily, from values near zero."""
