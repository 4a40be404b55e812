"""What a run is: a plant, a noise case, a start, and when a trial and a run end."""

from typing import NamedTuple

import numpy as np

from upright.core.conditions import CONDITIONS, NOISES, STARTS, STEPS, TRIALS, Noise
from upright.core.parameters import Integrator, Parameters, State, check_parameters
from upright.errors import require, require_one_of


class Task(NamedTuple):
    """The numbers that define a run, in the form that compiled code takes.

    Examples
    --------
    >>> task = upright.make_case("reinforce", noise="sensor-5", condition="delay-1").task()
    >>> task.steps, task.delay, task.noise.angle
    (60000, 1, 0.05)
    """

    parameters: Parameters = Parameters()
    """The plant."""
    noise: Noise = Noise()
    """What disturbs the force and the measurement."""
    start: State = STARTS["random"]
    """Half-widths of the start state."""
    steps: int = STEPS
    """N: a trial that lasts this many steps without a fall succeeds."""
    trials: int = TRIALS
    """A run is at most this many consecutive trials."""
    delay: int = 0
    """How many steps pass before a push acts; until the first arrives, none does."""


def make_task(
    noise: str = "none",
    start: str = "random",
    steps: int = STEPS,
    trials: int = TRIALS,
    integrator: str = "euler",
    condition: str = "nominal",
) -> Task:
    """Return the task with these named parts.

    Raises
    ------
    UprightError
        If a name is unknown or a number is not a whole one of at least 1.
    """
    integrators = {i.name.lower().replace("_", "-"): i for i in Integrator}
    require_one_of("noise", noise, NOISES)
    require_one_of("start", start, STARTS)
    require_one_of("integrator", integrator, integrators)
    require_one_of("condition", condition, CONDITIONS)
    require("steps", steps, 1, 10**9, whole=True)
    require("trials", trials, 1, 10**6, whole=True)
    differs = CONDITIONS[condition]
    parameters = Parameters(integrator=integrators[integrator])
    parameters = parameters._replace(
        cart_friction=differs.friction * parameters.cart_friction,
        pole_friction=differs.friction * parameters.pole_friction,
    )
    measured = NOISES[noise]._replace(hides_velocities=differs.hides_velocities)
    parameters = check_parameters(parameters)
    return Task(parameters, measured, STARTS[start], steps, trials, differs.delay)


def draw_plant(parameters: Parameters, rng: np.random.Generator) -> Parameters:
    """Return the parameters of another plant: a pole of 0.25 to 2 m, masses halved to doubled.

    Each factor is drawn uniformly on a scale of powers.
    """
    half_length, cart, pole = rng.uniform((-2, -1, -1), (1, 1, 1)).tolist()
    return parameters._replace(
        half_length=parameters.half_length * 2.0**half_length,
        cart_mass=parameters.cart_mass * 2.0**cart,
        pole_mass=parameters.pole_mass * 2.0**pole,
    )
