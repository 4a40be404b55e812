"""What a learned policy computes, as data: the two forms from which it is written elsewhere.

An agent whose policy has one of these forms offers it by the method `policy_form()` of its memory.
Exporters know the forms and no agent.
"""

from typing import Any, Literal, NamedTuple

import numpy as np

Unit = Literal["isrlu", "tanh", "sigmoid", "above zero", "not below zero"]
"""What a unit puts out, of its sum s: s above zero and s / √(1 + s²) below; tanh s; 1 / (1 + e^-s);
1 if s > 0, else 0; 1 if s ≥ 0, else 0.
"""


class Layer(NamedTuple):
    """A layer of a network; it has no biases."""

    weights: np.ndarray
    """Shape (inputs, units)."""
    unit: Unit
    """What its units make of their sums."""


class Network(NamedTuple):
    """Layers after each other; a linear policy has one."""

    layers: tuple[Layer, ...]
    """The last has one unit, which puts out the probability of a push to the right."""
    scales: tuple[float, ...] | None = None
    """What each measurement is divided by first; None where they are taken as they are."""
    past: int = 0
    """How many past steps are inputs too, as `history` lays them out, not divided. At the first
    step of a trial all hold the present measurement, without a push. A policy that looks at the
    past must be sure of its push: its last unit puts out 0 or 1.
    """

    def contract(self) -> dict[str, Any]:
        """Return what a user must know of the inputs."""
        described: dict[str, Any] = {"normalisation": "none"}
        if self.scales:
            described["normalisation"] = {"divided by": list(self.scales)}
        if self.past:
            described["history"] = (
                f"of the last {self.past} steps, the newest first: push (1 right, -1 left), then "
                "the four measurements; at the first step of a trial all of them hold the present "
                "measurement, and 0 for the push"
            )
        return described


class Table(NamedTuple):
    """A probability for each box; on an edge counts the box below."""

    edges: tuple[tuple[float, ...], ...]
    """Where each of the four measurements is cut, ascending."""
    probabilities: tuple[float, ...]
    """Of a push to the right, in every box; the parts of the last measurement vary fastest."""

    def contract(self) -> dict[str, Any]:
        """Return what a user must know of the inputs."""
        return {"normalisation": {"cut at": [list(edges) for edges in self.edges]}}


Form = Network | Table
