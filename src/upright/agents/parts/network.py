"""The report's 4-8-16-1 network: from a measurement to the log-odds of a push, and backwards.

Loops over numbers instead of matrix products: they allocate nothing, and at this size they are as
fast. The layers have no biases.
"""

import math
from typing import NamedTuple

import numpy as np

from upright.core.compiled import inlined
from upright.core.noise import uniform
from upright.core.portable_math import exponential

HIDDEN_1, HIDDEN_2 = 8, 16
"""Units of the two hidden layers (the report's figure 2)."""
WEIGHTS = 4 * HIDDEN_1 + HIDDEN_1 * HIDDEN_2 + HIDDEN_2
"""Weights of all layers."""


class PolicyNetwork(NamedTuple):
    """The weights of the three layers, or their gradient: views of one row of numbers."""

    layer_1: np.ndarray
    """Shape (4, HIDDEN_1)."""
    layer_2: np.ndarray
    """Shape (HIDDEN_1, HIDDEN_2)."""
    layer_3: np.ndarray
    """Shape (HIDDEN_2,)."""


class Activations(NamedTuple):
    """The outputs of all units at the last evaluation, and the error that came back."""

    inputs: np.ndarray
    hidden_1: np.ndarray
    hidden_2: np.ndarray
    error_2: np.ndarray
    """Of the second hidden layer: the derivative along its sums."""


@inlined
def sigmoid(z):
    """Return the logistic function."""
    return 1.0 / (1.0 + exponential(-z))


@inlined
def activation(z):
    """Return a unit's output: z above zero, bending towards -1 below (ISRLU: ELU without exp)."""
    return z if z > 0.0 else z / math.sqrt(1.0 + z * z)


@inlined
def activation_slope(output):
    """Return the activation's derivative, (1 + z²)^(-3/2) below zero, from the unit's output."""
    one_less_square = 1.0 - output * output
    return 1.0 if output > 0.0 else one_less_square * math.sqrt(one_less_square)


@inlined
def evaluate_layer(inputs, weights, outputs, fan_in, width):
    """Set outputs[k] to the activation of the sum over j of inputs[j] weights[j, k]."""
    for k in range(width):
        total = 0.0
        for j in range(fan_in):
            total += inputs[j] * weights[j, k]
        outputs[k] = total
    for k in range(width):
        outputs[k] = activation(outputs[k])


@inlined
def evaluate(network, units):
    """Return the network's last sum for the inputs in `units`, which keeps the units' outputs."""
    evaluate_layer(units.inputs, network.layer_1, units.hidden_1, 4, HIDDEN_1)
    evaluate_layer(units.hidden_1, network.layer_2, units.hidden_2, HIDDEN_1, HIDDEN_2)
    total = 0.0
    for k in range(HIDDEN_2):
        total += units.hidden_2[k] * network.layer_3[k]
    return total


@inlined
def add_gradient(gradient, network, units, error):
    """Add `error` times the gradient of the last evaluation (backpropagation)."""
    # Layer 3, and the error at the sums of hidden layer 2
    for k in range(HIDDEN_2):
        gradient.layer_3[k] += error * units.hidden_2[k]
        units.error_2[k] = error * network.layer_3[k] * activation_slope(units.hidden_2[k])
    for j in range(HIDDEN_1):
        # Layer 2, and the error at the sum of unit j of hidden layer 1
        error_1 = 0.0
        for k in range(HIDDEN_2):
            error_1 += units.error_2[k] * network.layer_2[j, k]
            gradient.layer_2[j, k] += units.error_2[k] * units.hidden_1[j]
        error_1 *= activation_slope(units.hidden_1[j])
        # Layer 1
        for i in range(4):
            gradient.layer_1[i, j] += error_1 * units.inputs[i]


@inlined
def set_to_zero(gradient):
    """Begin a new sum of gradients."""
    gradient.layer_1[:] = 0.0
    gradient.layer_2[:] = 0.0
    gradient.layer_3[:] = 0.0


@inlined
def draw_weights(network, init_std, rng):
    """Draw uniform random weights, layer after layer.

    Their standard deviation is `init_std` divided by the root of a unit's number of inputs.
    """
    for i in range(4):
        draw_row(network.layer_1[i], init_std, 4, rng)
    for i in range(HIDDEN_1):
        draw_row(network.layer_2[i], init_std, HIDDEN_1, rng)
    draw_row(network.layer_3, init_std, HIDDEN_2, rng)


@inlined
def draw_row(weights, init_std, fan_in, rng):
    """Draw a row of weights to units that have `fan_in` inputs."""
    half_width = init_std * math.sqrt(3.0 / fan_in)
    for i in range(len(weights)):
        weights[i] = uniform(half_width, rng)


def network_of(row: np.ndarray) -> PolicyNetwork:
    """Return the layers that view a row of numbers, shape (WEIGHTS,)."""
    first, second = 4 * HIDDEN_1, 4 * HIDDEN_1 + HIDDEN_1 * HIDDEN_2
    return PolicyNetwork(
        row[:first].reshape(4, HIDDEN_1),
        row[first:second].reshape(HIDDEN_1, HIDDEN_2),
        row[second:],
    )


def blank_activations() -> Activations:
    """Return room for the outputs of all units."""
    return Activations(np.zeros(4), np.zeros(HIDDEN_1), np.zeros(HIDDEN_2), np.zeros(HIDDEN_2))
