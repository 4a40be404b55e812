"""Noise cases, starts and conditions by name, and lengths of trials and runs. Data only."""

import math
from typing import NamedTuple

from upright.core.parameters import State

PUBLISHED_NOISES = (
    "none",
    "actuator-5",
    "actuator-10",
    "sensor-5",
    "sensor-10",
    "gaussian-0.1",
    "gaussian-0.2",
)
"""The seven published noise cases, in the order of the tables."""


STEPS, TRIALS, RUNS = 60_000, 1_000, 20
"""The report's protocol, the default everywhere: steps of a success, trials per run, and runs."""
STRICT_STEPS, STRICT_RUNS = 600_000, 100
"""Si & Wang's stricter protocol, which the leaderboard uses too."""


class Noise(NamedTuple):
    """Sizes of the disturbances; a size of zero disturbs nothing and draws no random number.

    Examples
    --------
    An environment with more noise on the measured angle than any named case:

    >>> env = upright.CartPoleEnv(noise=upright.Noise(angle=0.2))
    """

    actuator: float = 0.0
    """p: the acting force is F (1 + u), with u uniform in ±p."""
    angle: float = 0.0
    """p: the measured angle is theta (1 + u), with u uniform in ±p."""
    others: float = 0.0
    """p: the same for the measured x, x_dot and theta_dot, each with its own u."""
    angle_offset: float = 0.0
    """sigma [rad]: the measured angle is theta + n, with n normal of this standard deviation."""
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
"""Every named noise case. The first seven are the published ones; the last two go beyond them.

Examples
--------
>>> list(upright.NOISES)[:3]
['none', 'actuator-5', 'actuator-10']
>>> upright.NOISES["sensor-5"].angle
0.05
"""

STARTS = {
    "random": State(0.05, 0.05, 0.05, 0.05),
    "zero": State(0.0, 0.0, 0.0, 0.0),
    "wide": State(0.05, 0.05, math.radians(6), 0.05),
}
"""Half-widths of the uniform start state, by name: Gymnasium's convention, Si & Wang's exact zero,
and one in which the pole leans up to 6°.

Examples
--------
>>> upright.STARTS["random"]
State(x=0.05, x_dot=0.05, theta=0.05, theta_dot=0.05)
"""


class Condition(NamedTuple):
    """How a task differs from the published one, besides its noise."""

    varies_plant: bool = False
    """Whether every run has its own plant, drawn by `draw_plant`."""
    friction: float = 1.0
    """Factor on both frictions."""
    delay: int = 0
    """How many steps pass before a push acts."""
    hides_velocities: bool = False
    """Whether the agent reads 0 for both velocities."""


CONDITIONS = {
    "nominal": Condition(),
    "varied-plant": Condition(varies_plant=True),
    "friction-100": Condition(friction=100.0),
    "delay-1": Condition(delay=1),
    "delay-2": Condition(delay=2),
    "no-velocities": Condition(hides_velocities=True),
}
"""Every named condition; all but the first go beyond the published task.

Examples
--------
>>> upright.CONDITIONS["delay-2"].delay
2
"""
