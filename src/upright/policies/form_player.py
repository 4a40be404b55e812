"""Plays policy forms loaded from files: memories like those of agents, without learning.

All numbers are in arrays, so that all networks have one type for the compiler, and so do all
tables: each kind is compiled only once.
"""

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from upright.agents.parts import policy_form
from upright.agents.parts.boxes import find_box
from upright.agents.parts.history import BLOCK, set_newest, shift, unchanged
from upright.agents.parts.network import activation, sigmoid
from upright.core.compiled import compiled, guard, inlined
from upright.core.guards import once, require_array
from upright.core.parameters import State
from upright.core.portable_math import hyperbolic_tangent
from upright.errors import UprightError, require, require_kind
from upright.policies.form_json import UNITS

ISRLU, TANH, SIGMOID, ABOVE_ZERO = map(UNITS.index, ("isrlu", "tanh", "sigmoid", "above zero"))


class TablePlayer(NamedTuple):
    """A player of a table."""

    edges: tuple[np.ndarray, ...]
    """Where the range of each of the four measurements is divided."""
    parts: tuple[int, ...]
    """Number of parts that each range is divided into."""
    probabilities: np.ndarray

    @compiled
    def push_probability(self, observation):
        """Return the probability of a push to the right."""
        return self.probabilities[find_box(self, observation)]

    def policy_form(self):
        """Return the policy as data."""
        edges = tuple(tuple(cuts.tolist()) for cuts in self.edges)
        return policy_form.Table(edges, tuple(self.probabilities.tolist()))


class NetworkPlayer(NamedTuple):
    """A player of a network."""

    weights: np.ndarray
    """Weights of all layers, one layer after the other, each row by row."""
    widths: np.ndarray
    """The number of inputs, then the number of units of each layer."""
    units: np.ndarray
    """Index in UNITS of the unit of each layer."""
    scales: np.ndarray
    """Divisors of the four measurements; empty if they are not scaled."""
    history: np.ndarray
    """One block for each past step; all zeros when a trial begins."""
    inputs: np.ndarray
    """Work space for the inputs of a layer."""
    outputs: np.ndarray
    """Work space for the outputs of a layer."""

    @compiled
    def push_probability(self, observation):
        """Return the probability of a push to the right."""
        set_inputs(self, observation)
        inputs, outputs = self.inputs, self.outputs
        first_weight = 0
        for layer in range(len(self.units)):
            fan_in, width = self.widths[layer], self.widths[layer + 1]
            for k in range(width):
                outputs[k] = 0.0
            for j in range(fan_in):
                for k in range(width):
                    outputs[k] += inputs[j] * self.weights[first_weight + j * width + k]
            for k in range(width):
                outputs[k] = unit_output(self.units[layer], outputs[k])
            first_weight += fan_in * width
            inputs, outputs = outputs, inputs
        return inputs[0]

    @compiled
    def begin_trial(self, rng):
        """Start a new history."""
        self.history[:] = 0.0

    @compiled
    def remember(self, observation, action):
        """Enter a step into the history."""
        if len(self.history) > 0:
            is_first = has_no_past(self.history)
            shift(self.history)
            set_newest(self.history, observation, action, is_first)

    def policy_form(self):
        """Return the policy as data."""
        layers, first = [], 0
        for fan_in, width, unit in zip(self.widths, self.widths[1:], self.units, strict=False):
            weights = self.weights[first : first + fan_in * width].reshape(fan_in, width)
            layers.append(policy_form.Layer(weights, UNITS[unit]))
            first += fan_in * width
        past = len(self.history) // BLOCK
        return policy_form.Network(tuple(layers), tuple(self.scales.tolist()) or None, past)


def make_memory(form: policy_form.Form) -> TablePlayer | NetworkPlayer:
    """Return the player of a form."""
    if isinstance(form, policy_form.Table):
        return TablePlayer(
            edges=tuple(np.array(cuts, np.float64) for cuts in form.edges),
            parts=tuple(len(cuts) + 1 for cuts in form.edges),
            probabilities=np.array(form.probabilities, np.float64),
        )
    widths = [4 + BLOCK * form.past, *(weights.shape[1] for weights, _ in form.layers)]
    return NetworkPlayer(
        weights=np.concatenate([weights.ravel() for weights, _ in form.layers]),
        widths=np.array(widths, np.int64),
        units=np.array([UNITS.index(unit) for _, unit in form.layers], np.int64),
        scales=np.array(form.scales or (), np.float64),
        history=np.zeros(BLOCK * form.past),
        inputs=np.zeros(max(widths)),
        outputs=np.zeros(max(widths)),
    )


@inlined
def set_inputs(player, observation):
    """Set the inputs of the first layer: the scaled measurement and the history."""
    scales, history, inputs = player.scales, player.history, player.inputs
    for i in range(4):
        inputs[i] = observation[i] / scales[i] if len(scales) > 0 else observation[i]
    for i in range(len(history)):
        inputs[4 + i] = unchanged(observation, i) if has_no_past(history) else history[i]


@inlined
def has_no_past(history):
    """Whether the history holds no step of this trial yet; the push of a step is never 0."""
    return history[0] == 0.0


@inlined
def unit_output(unit, total):
    """Return the output of a unit, given the sum of its inputs."""
    if unit == ISRLU:
        return activation(total)
    if unit == TANH:
        return hyperbolic_tangent(total)
    if unit == SIGMOID:
        return sigmoid(total)
    if unit == ABOVE_ZERO:
        return 1.0 if total > 0.0 else 0.0
    return 1.0 if total >= 0.0 else 0.0


# ---- What Python may give to the functions above -------------------------------------------------


@once
def _check_table(player: TablePlayer) -> None:
    parts = tuple(len(cuts) + 1 for cuts in player.edges)
    if len(parts) != 4 or player.parts != parts:
        raise UprightError(f"parts are {player.parts}; by the edges, they must be four: {parts}")
    require_array("probabilities", player.probabilities, np.float64, math.prod(parts))


@once
def _check_network(player: NetworkPlayer) -> None:
    require_array("units", player.units, np.int64, None)
    require_array("widths", player.widths, np.int64, len(player.units) + 1)
    widths = player.widths.tolist()
    for width in widths:
        require("width", width, 1, whole=True)
    weights = sum(a * b for a, b in pairwise(widths))
    require_array("weights", player.weights, np.float64, weights)
    past = len(player.history) // BLOCK
    require_array("history", player.history, np.float64, past * BLOCK)
    require("inputs of the first layer", widths[0], 4 + past * BLOCK, 4 + past * BLOCK)
    require_array("scales", player.scales, np.float64, 4 if len(player.scales) else 0)
    for name in ("inputs", "outputs"):
        require_array(name, getattr(player, name), np.float64, max(widths))


@guard(TablePlayer.push_probability)
def _check_table_call(player: TablePlayer, observation: State) -> None:
    _check_table(player)
    require_kind("observation", observation, State, "a State")


@guard(NetworkPlayer.push_probability)
@guard(NetworkPlayer.remember)
def _check_network_call(player: NetworkPlayer, observation: State, *_push: Any) -> None:
    _check_network(player)
    require_kind("observation", observation, State, "a State")


@guard(NetworkPlayer.begin_trial)
def _check_network_begin(player: NetworkPlayer, _rng: np.random.Generator) -> None:
    _check_network(player)
