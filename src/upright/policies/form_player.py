"""What plays a form that was read from a file: memory as an agent's, which learns nothing.

Everything lies in arrays, so that all networks are of one type to the compiler, and all tables:
machine code is made once.
"""

import math
from typing import NamedTuple

import numpy as np

from upright.agents.parts import policy_form
from upright.agents.parts.boxes import find_box
from upright.agents.parts.policy_form import BLOCK
from upright.agents.reinforce import activation, sigmoid
from upright.core.compiled import compiled
from upright.policies.form_json import UNITS

ISRLU, TANH, SIGMOID, ABOVE_ZERO = map(UNITS.index, ("isrlu", "tanh", "sigmoid", "above zero"))


class TableMemory(NamedTuple):
    """A table that plays."""

    edges: tuple[np.ndarray, ...]
    """Where each of the four measurements is cut."""
    parts: tuple[int, ...]
    """Into how many parts each is cut."""
    probabilities: np.ndarray

    @compiled
    def push_probability(self, observation):
        """Return the probability of a push to the right."""
        return self.probabilities[find_box(self, observation)]

    def policy_form(self):
        """Return the policy as data."""
        edges = tuple(tuple(some.tolist()) for some in self.edges)
        return policy_form.Table(edges, tuple(self.probabilities.tolist()))


class NetworkMemory(NamedTuple):
    """A network that plays."""

    weights: np.ndarray
    """Of all layers after each other, row by row."""
    widths: np.ndarray
    """How many inputs there are, then how many units each layer has."""
    units: np.ndarray
    """Of each layer, the place in UNITS."""
    scales: np.ndarray
    """Empty where measurements are taken as they are."""
    history: np.ndarray
    """BLOCK numbers of each past step, the newest first; the first is 0 when a trial begins."""
    before: np.ndarray
    """What a layer takes in."""
    after: np.ndarray
    """What it puts out."""

    @compiled
    def push_probability(self, observation):
        """Return the probability of a push to the right."""
        set_inputs(self, observation)
        before, after = self.before, self.after
        first = 0
        for layer in range(len(self.units)):
            inputs, count = self.widths[layer], self.widths[layer + 1]
            for k in range(count):
                after[k] = 0.0
            for j in range(inputs):
                for k in range(count):
                    after[k] += before[j] * self.weights[first + j * count + k]
            for k in range(count):
                after[k] = unit_output(self.units[layer], after[k])
            first += inputs * count
            before, after = after, before
        return before[0]

    @compiled
    def begin_trial(self, rng):
        """Start a new history."""
        self.history[:] = 0.0

    @compiled
    def remember(self, observation, action):
        """Take a step into the history; at the first of a trial, as if it always had been so."""
        history = self.history
        for i in range(len(history) - 1, -1, -1):
            known = i >= BLOCK and history[0] != 0.0
            history[i] = history[i - BLOCK] if known else unchanged(observation, i)
        if len(history) > 0:
            history[0] = 1.0 if action else -1.0

    def policy_form(self):
        """Return the policy as data."""
        layers, first = [], 0
        for inputs, count, unit in zip(self.widths, self.widths[1:], self.units, strict=False):
            weights = self.weights[first : first + inputs * count].reshape(inputs, count)
            layers.append(policy_form.Layer(weights, UNITS[unit]))
            first += inputs * count
        past = len(self.history) // BLOCK
        return policy_form.Network(tuple(layers), tuple(self.scales.tolist()) or None, past)


def make_memory(form: policy_form.Form) -> TableMemory | NetworkMemory:
    """Return what plays a form."""
    if isinstance(form, policy_form.Table):
        return TableMemory(
            edges=tuple(np.array(some, np.float64) for some in form.edges),
            parts=tuple(len(some) + 1 for some in form.edges),
            probabilities=np.array(form.probabilities, np.float64),
        )
    widths = [4 + BLOCK * form.past, *(weights.shape[1] for weights, _ in form.layers)]
    return NetworkMemory(
        weights=np.concatenate([weights.ravel() for weights, _ in form.layers]),
        widths=np.array(widths, np.int64),
        units=np.array([UNITS.index(unit) for _, unit in form.layers], np.int64),
        scales=np.array(form.scales or (), np.float64),
        history=np.zeros(BLOCK * form.past),
        before=np.zeros(max(widths)),
        after=np.zeros(max(widths)),
    )


@compiled
def set_inputs(memory, observation):
    """Set what the first layer takes in: the measurement, divided, and the history."""
    scales, history, inputs = memory.scales, memory.history, memory.before
    for i in range(4):
        inputs[i] = observation[i] / scales[i] if len(scales) > 0 else observation[i]
    for i in range(len(history)):
        inputs[4 + i] = history[i] if history[0] != 0.0 else unchanged(observation, i)


@compiled
def unchanged(observation, i):
    """Return a number of a history in which there was no push and nothing has changed."""
    return observation[i % BLOCK - 1] if i % BLOCK > 0 else 0.0


@compiled
def unit_output(unit, total):
    """Return what a unit makes of its sum."""
    if unit == ISRLU:
        return activation(total)
    if unit == TANH:
        return math.tanh(total)
    if unit == SIGMOID:
        return sigmoid(total)
    if unit == ABOVE_ZERO:
        return 1.0 if total > 0.0 else 0.0
    return 1.0 if total >= 0.0 else 0.0
