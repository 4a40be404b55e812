"""Adam (D. Kingma, J. Ba, *Adam: A method for stochastic optimization*, ICLR 2015).

With decoupled weight decay (I. Loshchilov, F. Hutter, *Decoupled weight decay regularization*, ICLR
2019), which here does not depend on the learning rate.
"""

import math
from typing import NamedTuple

import numpy as np

from upright.core.compiled import inlined
from upright.core.portable_math import whole_power

EPSILON = 1e-8
"""ε: keeps the step finite where the gradient has always been zero."""


class Adam(NamedTuple):
    """The optimiser's memory, and what it works on."""

    weights: np.ndarray
    """w."""
    gradient: np.ndarray
    """g, to be set before each step."""
    mean: np.ndarray
    """m: the moving average of the gradient."""
    mean_square: np.ndarray
    """v: the moving average of its squares."""
    steps: np.ndarray
    """t: how many steps have been made."""
    learning_rate: float
    """α."""
    beta1: float
    """β1: how much of m is kept at a step."""
    beta2: float
    """β2: how much of v is kept at a step."""
    weight_decay: float
    """d: the part of every weight that is lost at a step."""


def make_adam(
    weights: np.ndarray, learning_rate: float, beta1: float, beta2: float, weight_decay: float
) -> Adam:
    """Return the optimiser of a row of weights, which it will change in place."""
    return Adam(
        weights=weights,
        gradient=np.zeros_like(weights),
        mean=np.zeros_like(weights),
        mean_square=np.zeros_like(weights),
        steps=np.zeros(1),
        learning_rate=learning_rate,
        beta1=beta1,
        beta2=beta2,
        weight_decay=weight_decay,
    )


@inlined
def ascend(adam):
    """Make one step up the gradient.

    m ← β1 m + (1 - β1) g,    m̂ = m / (1 - β1^t),
    v ← β2 v + (1 - β2) g²,   v̂ = v / (1 - β2^t),
    w ← (1 - d) (w + α m̂ / (√v̂ + ε))
    """
    w, m, v = adam.weights, adam.mean, adam.mean_square
    adam.steps[0] += 1.0
    m_correction = 1.0 - whole_power(adam.beta1, adam.steps[0])
    v_correction = 1.0 - whole_power(adam.beta2, adam.steps[0])
    for i in range(len(w)):
        g = adam.gradient[i]
        m[i] += (1.0 - adam.beta1) * (g - m[i])
        v[i] += (1.0 - adam.beta2) * (g * g - v[i])
        size = math.sqrt(v[i] / v_correction) + EPSILON
        w[i] = (1.0 - adam.weight_decay) * (w[i] + adam.learning_rate * m[i] / m_correction / size)
