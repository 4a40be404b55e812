"""The associative search element and the adaptive critic element of 1983.

The first learner of this task, and the ancestor of all actor-critics: A. Barto, R. Sutton,
C. Anderson, *Neuronlike adaptive elements that can solve difficult learning control problems*, IEEE
Trans. Systems, Man, and Cybernetics 13, 1983. The measurements are cut into boxes. For the box b of
the present measurement the search element has a weight w(b), and pushes to the right, y = 1, if
that weight plus normal noise is above zero, else to the left, y = -1; the critic element has a
prediction p = v(b) of the falls ahead. The measurement after the push shows how much better or
worse things went than predicted,

    r̂ = r + γ p' - p,    r = -1 and p' = 0 at the fall, else r = 0,

and both elements learn from that, in every box by its traces: how lately the box was visited, and
how lately it was left by which push:

    e(b) ← δ e(b) + (1 - δ) y,    x̄(b) ← λ x̄(b) + (1 - λ)    in the box that was left,
    e(b) ← δ e(b),                x̄(b) ← λ x̄(b)              in all others,
    w(b) ← w(b) + α r̂ e(b),       v(b) ← v(b) + β r̂ x̄(b).

Traces are zero when a trial begins. Both predictions of a step come from the same v, as in Sutton's
own program (pole.c); the paper takes p from before the last update.

A cart-pole seen in a mirror is a cart-pole: with `mirrored`, a box and its mirror image share their
prediction, and their weight with its sign turned.
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
from upright.core.portable_math import error_function_complement
from upright.errors import require
from upright.support.short_repr import short_repr

NEGLIGIBLE = 1e-12
"""A trace or an r̂ below this is zero. Left alone, both would shrink for ever while the pole stands,
down to numbers so small that the processor slows on them.
"""


class AseAceAgent(NamedTuple):
    """What the agent carries from step to step and from trial to trial."""

    boxes: Boxes
    mirrored: bool
    weights: np.ndarray
    """w of each box."""
    predictions: np.ndarray
    """v of each box."""
    push_traces: np.ndarray
    """e of each box."""
    visit_traces: np.ndarray
    """x̄ of each box."""
    traced_boxes: np.ndarray
    """The boxes that have traces, in no order: few of all, and the only ones to look at."""
    traced_count: np.ndarray
    """How many those are, shape (1,)."""
    learning_rate: float
    critic_learning_rate: float
    discount: float
    actor_trace_decay: float
    critic_trace_decay: float
    noise: float

    def __repr__(self) -> str:
        return short_repr(self)

    @compiled
    def push_probability(self, observation):
        """Return the probability that the weight plus noise is above zero."""
        box, side = find_place(self, observation)
        distance = -side * self.weights[box] / (math.sqrt(2.0) * self.noise)
        return 0.5 * error_function_complement(distance)

    @compiled
    def begin_trial(self, rng):
        """Forget the traces."""
        for i in range(self.traced_count[0]):
            self.push_traces[self.traced_boxes[i]] = 0.0
            self.visit_traces[self.traced_boxes[i]] = 0.0
        self.traced_count[0] = 0

    @compiled
    def act(self, observation, rng):
        """Sample a push."""
        return rng.random() < self.push_probability(observation)

    @compiled
    def learn(self, before, action, after, fallen):
        """Learn from a step, in all boxes that were visited lately."""
        box, side = find_place(self, before)
        add_traces(self, box, side if action else -side)
        # r̂ = r + γ p' - p
        target = -1.0 if fallen else self.discount * self.predictions[find_place(self, after)[0]]
        r_hat = target - self.predictions[box]
        if abs(r_hat) > NEGLIGIBLE:
            update(self, r_hat)
        decay_traces(self)

    @compiled
    def end_trial(self, fallen):
        """Nothing to do: the agent has learned from the fall as from any other step."""

    def policy_form(self):
        """Return the policy as data."""
        return tabulate(self.boxes, self.push_probability)

    def index_limits(self):
        """Return the least and greatest number in each array of indices, as files must keep it."""
        boxes = len(self.traced_boxes)
        return {"traced_boxes": (0, boxes - 1), "traced_count": (0, boxes)}


@inlined
def find_place(agent, observation):
    """Return the box of a measurement and 1, or the box of its mirror image and -1."""
    box = find_box(agent.boxes, observation)
    image = len(agent.weights) - 1 - box
    return (image, -1.0) if agent.mirrored and image < box else (box, 1.0)


@inlined
def add_traces(agent, box, y):
    """Add to the traces of a box that is left by the push y, 1 or -1."""
    if agent.visit_traces[box] == 0.0 and agent.push_traces[box] == 0.0:
        agent.traced_boxes[agent.traced_count[0]] = box
        agent.traced_count[0] += 1
    # e(b) ← e(b) + (1 - δ) y,  x̄(b) ← x̄(b) + (1 - λ)
    agent.push_traces[box] += (1.0 - agent.actor_trace_decay) * y
    agent.visit_traces[box] += 1.0 - agent.critic_trace_decay


@inlined
def update(agent, r_hat):
    """Move weights and predictions by r̂."""
    for i in range(agent.traced_count[0]):
        b = agent.traced_boxes[i]
        # w(b) ← w(b) + α r̂ e(b),  v(b) ← v(b) + β r̂ x̄(b)
        agent.weights[b] += agent.learning_rate * r_hat * agent.push_traces[b]
        agent.predictions[b] += agent.critic_learning_rate * r_hat * agent.visit_traces[b]


@inlined
def decay_traces(agent):
    """Let the traces decay for the next step, and drop the boxes where they are negligible."""
    kept = 0
    for i in range(agent.traced_count[0]):
        b = agent.traced_boxes[i]
        # e(b) ← δ e(b),  x̄(b) ← λ x̄(b)
        agent.push_traces[b] *= agent.actor_trace_decay
        agent.visit_traces[b] *= agent.critic_trace_decay
        if max(abs(agent.push_traces[b]), agent.visit_traces[b]) > NEGLIGIBLE:
            agent.traced_boxes[kept] = b
            kept += 1
        else:
            agent.push_traces[b] = agent.visit_traces[b] = 0.0
    agent.traced_count[0] = kept


# ---- Settings ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class AseAce:
    """Settings of the two elements."""

    learning_rate: float = 8.0
    """α: how far the search element's weights move."""
    critic_learning_rate: float = 0.25
    """β: how far the critic element's predictions move."""
    discount: float = 0.99
    """γ: how much less a fall counts for each step that it lies ahead."""
    actor_trace_decay: float = 0.7
    """δ: how much of a push's trace is left after a step."""
    critic_trace_decay: float = 0.5
    """λ: how much of a visit's trace is left after a step."""
    noise: float = 0.01
    """σ: standard deviation of the noise on the search element's sum."""
    mirrored: bool = True
    """Whether a box and its mirror image share what they learn."""
    x_edges: tuple[float, ...] = (-1.0, 1.0)
    """Edges of the boxes along the cart's position [m]."""
    x_dot_edges: tuple[float, ...] = (0.0,)
    """Edges along the cart's velocity [m/s]."""
    theta_edges: tuple[float, ...] = degrees(-3, -0.5, 0.5, 3)
    """Edges along the pole's angle [rad]."""
    theta_dot_edges: tuple[float, ...] = degrees(-54, -17, 0, 17, 54)
    """Edges along the pole's angular velocity [rad/s]."""

    RENAMED: ClassVar = {
        "critic_rate": "critic_learning_rate",
        "push_trace": "actor_trace_decay",
        "box_trace": "critic_trace_decay",
    }
    RENAMED_ARRAYS: ClassVar = {
        "box_traces": "visit_traces",
        "recent": "traced_boxes",
        "recents": "traced_count",
    }

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        require("learning_rate", self.learning_rate, 0, 1e6)
        require("critic_learning_rate", self.critic_learning_rate, 0, 1)
        require("discount", self.discount, 0, 1)
        require("actor_trace_decay", self.actor_trace_decay, 0, 0.9999)
        require("critic_trace_decay", self.critic_trace_decay, 0, 0.9999)
        require("noise", self.noise, 1 / LARGEST, 1e6)
        check_edges(self)

    def agent(self, rng: np.random.Generator) -> AseAceAgent:
        """Return a new agent that knows nothing."""
        boxes = make_boxes(self)
        count = math.prod(boxes.parts)
        return AseAceAgent(
            boxes=boxes,
            mirrored=self.mirrored,
            weights=np.zeros(count),
            predictions=np.zeros(count),
            push_traces=np.zeros(count),
            visit_traces=np.zeros(count),
            traced_boxes=np.zeros(count, np.int64),
            traced_count=np.zeros(1, np.int64),
            learning_rate=self.learning_rate,
            critic_learning_rate=self.critic_learning_rate,
            discount=self.discount,
            actor_trace_decay=self.actor_trace_decay,
            critic_trace_decay=self.critic_trace_decay,
            noise=self.noise,
        )


SETTINGS = {
    "default": AseAce(),
    "as-published": AseAce(
        learning_rate=1000.0,
        critic_learning_rate=0.5,
        discount=0.95,
        actor_trace_decay=0.9,
        critic_trace_decay=0.8,
        noise=0.01,
        mirrored=False,
        **BARTO_SUTTON_ANDERSON,
    ),
}
"""As published: the paper's numbers. Tuned, a weight moves far less at a time, against the same
noise, so that a push is tried again before it is settled, and the boxes are other ones.
"""
