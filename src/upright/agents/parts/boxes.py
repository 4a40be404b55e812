"""Boxes: the four measurements, each cut at edges, and every combination of parts numbered.

For agents that learn a number for each box. Settings hold the edges; `make_boxes` turns them into
what compiled code reads.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypedDict

import numpy as np

from upright.agents.parts import policy_form
from upright.core.compiled import inlined
from upright.core.parameters import State
from upright.errors import UprightError, require

MOST_EDGES, MOST_BOXES = 100, 10**6
"""Of one measurement, and of all. Finer cuts take long to compile and much memory."""


def degrees(*edges: float) -> tuple[float, ...]:
    """Return edges given in degrees [rad]."""
    return tuple(math.radians(edge) for edge in edges)


class Edges(TypedDict):
    """Where each measurement is cut, as settings name it."""

    x_edges: tuple[float, ...]
    x_dot_edges: tuple[float, ...]
    theta_edges: tuple[float, ...]
    theta_dot_edges: tuple[float, ...]


BARTO_SUTTON_ANDERSON: Edges = {
    "x_edges": (-0.8, 0.8),
    "x_dot_edges": (-0.5, 0.5),
    "theta_edges": degrees(-6, -1, 0, 1, 6),
    "theta_dot_edges": degrees(-50, 50),
}
"""The 162 boxes of Barto, Sutton & Anderson (1983), theirs from Michie & Chambers (1968)."""


def edges_of(settings: Any) -> dict[str, tuple[float, ...]]:
    """Return the edges that an agent's settings hold, by name."""
    return {name: getattr(settings, name) for name in Edges.__annotations__}


def check_edges(settings: Any) -> None:
    """Raise UprightError unless `check_cuts` agrees and, if `mirrored`, edges are alike in ±."""
    check_cuts(edges_of(settings))
    for name, edges in edges_of(settings).items():
        if settings.mirrored and not np.allclose(edges, -np.flip(edges)):
            raise UprightError(f"{name} is {edges!r}; mirrored boxes need edges alike in ±")


def check_cuts(cuts: Mapping[str, Sequence[float]]) -> None:
    """Raise UprightError unless the edges, by name, ascend.

    They must be no more than MOST_EDGES, and make no more than MOST_BOXES.
    """
    for name, edges in cuts.items():
        require(f"the number of {name}", len(edges), 0, MOST_EDGES, whole=True)
        for edge in edges:
            require(f"an edge in {name}", edge, -1e6, 1e6)
        if list(edges) != sorted(set(edges)):
            raise UprightError(f"{name} is {edges!r}; its edges must ascend")
    count = math.prod(len(edges) + 1 for edges in cuts.values())
    require("the number of boxes", count, 1, MOST_BOXES, whole=True)


class Boxes(NamedTuple):
    """How the measurements are cut."""

    edges: tuple[tuple[float, ...], ...]
    """Where each of the four is cut. Tuples, not arrays: their lengths are known to the compiler,
    which then compares all at once.
    """
    parts: tuple[int, ...]
    """Into how many parts each is cut."""


def make_boxes(settings: Any) -> Boxes:
    """Return the boxes between the edges that an agent's settings hold."""
    edges = edges_of(settings).values()
    return Boxes(
        # An empty tuple has no type that compiled code could read: no measurement is above inf.
        edges=tuple(tuple(map(float, cuts)) or (math.inf,) for cuts in edges),
        parts=tuple(len(cuts) + 1 for cuts in edges),
    )


@inlined
def count_below(edges, value):
    """Return how many edges lie below a value."""
    count = 0
    for edge in edges:
        count += 1 if value > edge else 0
    return count


@inlined
def find_box(boxes, observation):
    """Return the number of the box that a measurement lies in; on an edge, of the one below."""
    edges, parts = boxes.edges, boxes.parts
    box = count_below(edges[0], observation.x)
    box = box * parts[1] + count_below(edges[1], observation.x_dot)
    box = box * parts[2] + count_below(edges[2], observation.theta)
    return box * parts[3] + count_below(edges[3], observation.theta_dot)


def tabulate(boxes: Boxes, push_probability: Callable[[State], float]) -> policy_form.Table:
    """Return as data a policy that is the same everywhere in a box: it is asked once in each."""
    edges = tuple(tuple(edge for edge in cuts if edge < math.inf) for cuts in boxes.edges)
    # A part's upper edge lies in it.
    places = itertools.product(*((*cuts, math.inf) for cuts in edges))
    return policy_form.Table(edges, tuple(push_probability(State(*place)) for place in places))
