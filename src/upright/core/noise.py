"""The noise, on the force and on what the agent measures; and random start states.

Noise on a measurement affects the agent alone; the plant and the test for a fall use the true
state. Every draw is computed from uniform numbers of the run's own generator, so that a program in
another language can follow the same stream.
"""

import math

import numpy as np

from upright.core.compiled import inlined
from upright.core.conditions import Noise
from upright.core.parameters import State
from upright.core.portable_math import cosine_of_turns, logarithm


@inlined
def uniform(half_width: float, rng: np.random.Generator) -> float:
    """Return a uniform number in ± a half-width."""
    return half_width * (2.0 * rng.random() - 1.0)


@inlined
def _normal(rng: np.random.Generator) -> float:
    """Return a standard normal number (Box & Muller, Ann. Math. Statist. 29, 1958)."""
    radius = math.sqrt(-2.0 * logarithm(1.0 - rng.random()))
    return radius * cosine_of_turns(rng.random())


@inlined
def disturb(noise: Noise, force: float, rng: np.random.Generator) -> float:
    """Return the force [N] that acts when `force` is commanded."""
    if noise.actuator > 0.0:
        force *= 1.0 + uniform(noise.actuator, rng)
    return force


@inlined
def measure(noise: Noise, state: State, rng: np.random.Generator) -> State:
    """Return what the agent measures of the true state."""
    x, x_dot, theta, theta_dot = state.x, state.x_dot, state.theta, state.theta_dot
    if noise.angle > 0.0:
        theta *= 1.0 + uniform(noise.angle, rng)
    if noise.others > 0.0:
        x *= 1.0 + uniform(noise.others, rng)
        x_dot *= 1.0 + uniform(noise.others, rng)
        theta_dot *= 1.0 + uniform(noise.others, rng)
    if noise.angle_offset > 0.0:
        theta += noise.angle_offset * _normal(rng)
    if noise.hides_velocities:
        x_dot, theta_dot = 0.0, 0.0
    return State(x, x_dot, theta, theta_dot)


@inlined
def draw_start(half_widths: State, rng: np.random.Generator) -> State:
    """Return a start state with each component uniform in ± its half-width."""
    return State(
        uniform(half_widths.x, rng),
        uniform(half_widths.x_dot, rng),
        uniform(half_widths.theta, rng),
        uniform(half_widths.theta_dot, rng),
    )
