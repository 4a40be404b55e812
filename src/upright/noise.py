"""The noise cases: what acts on the force, and what the agent measures.

Noise on a measurement reaches the agent alone; the plant and the test for a fall see the true
state. Every draw is made of uniform numbers from the run's own generator, so that a program in
another language can follow the same stream.
"""

import math
from typing import NamedTuple

import numpy as np

from upright.cartpole import State
from upright.compiled import inlined
from upright.elementary import cosine_of_turns, logarithm


class Noise(NamedTuple):
    """Sizes of the disturbances; zero means none, and draws no random number."""

    actuator: float = 0.0
    """p: the force that acts is F (1 + u), u uniform in ±p."""
    angle: float = 0.0
    """p: the measured angle is theta (1 + u), u uniform in ±p."""
    others: float = 0.0
    """p: the same for the measured x, x_dot and theta_dot, each with its own u."""
    angle_offset: float = 0.0
    """sigma [rad]: the measured angle is theta + n, n normal with this standard deviation."""
    hides_velocities: bool = False
    """Whether the velocities are not measured: the agent reads 0 in their place."""


def _degrees_squared(variance: float) -> float:
    return math.radians(math.sqrt(variance))


NOISES = {
    "none": Noise(),
    "actuator-5": Noise(actuator=0.05),
    "actuator-10": Noise(actuator=0.10),
    "sensor-5": Noise(angle=0.05),
    "sensor-10": Noise(angle=0.10),
    "gaussian-0.1": Noise(angle_offset=_degrees_squared(0.1)),
    "gaussian-0.2": Noise(angle_offset=_degrees_squared(0.2)),
    "all-5": Noise(angle=0.05, others=0.05),
    "all-10": Noise(angle=0.10, others=0.10),
}
"""Every named case. The first seven are the published ones; the last two go beyond them."""


@inlined
def _uniform(half_width: float, rng: np.random.Generator) -> float:
    return half_width * (2.0 * rng.random() - 1.0)


@inlined
def _normal(rng: np.random.Generator) -> float:
    """Return a standard normal number (Box & Muller, Ann. Math. Statist. 29, 1958)."""
    radius = math.sqrt(-2.0 * logarithm(1.0 - rng.random()))
    return radius * cosine_of_turns(rng.random())


@inlined
def disturb(noise: Noise, force: float, rng: np.random.Generator) -> float:
    """Return the force [N] that acts when `force` was asked for."""
    if noise.actuator > 0.0:
        force *= 1.0 + _uniform(noise.actuator, rng)
    return force


@inlined
def measure(noise: Noise, state: State, rng: np.random.Generator) -> State:
    """Return what the agent sees of the true state."""
    x, x_dot, theta, theta_dot = state.x, state.x_dot, state.theta, state.theta_dot
    if noise.angle > 0.0:
        theta *= 1.0 + _uniform(noise.angle, rng)
    if noise.others > 0.0:
        x *= 1.0 + _uniform(noise.others, rng)
        x_dot *= 1.0 + _uniform(noise.others, rng)
        theta_dot *= 1.0 + _uniform(noise.others, rng)
    if noise.angle_offset > 0.0:
        theta += noise.angle_offset * _normal(rng)
    if noise.hides_velocities:
        x_dot, theta_dot = 0.0, 0.0
    return State(x, x_dot, theta, theta_dot)


@inlined
def draw_start(half_widths: State, rng: np.random.Generator) -> State:
    """Return a start state, each component uniform in ± its half-width."""
    return State(
        _uniform(half_widths.x, rng),
        _uniform(half_widths.x_dot, rng),
        _uniform(half_widths.theta, rng),
        _uniform(half_widths.theta_dot, rng),
    )
