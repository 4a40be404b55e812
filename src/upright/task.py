"""What a run is: a plant, a noise case, a start, and when a trial and a run end."""

from typing import NamedTuple

from upright.cartpole import Integrator, Parameters, State, check_parameters
from upright.errors import require, require_one_of
from upright.noise import NOISES, Noise
from upright.published import STEPS, TRIALS

STARTS = {
    "random": State(0.05, 0.05, 0.05, 0.05),
    "zero": State(0.0, 0.0, 0.0, 0.0),
}
"""Half-widths of the uniform start: Gymnasium's convention, and Si & Wang's exact zero."""


class Task(NamedTuple):
    """The numbers that define a run, in the form that compiled code takes."""

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


def make_task(
    noise: str = "none",
    start: str = "random",
    steps: int = STEPS,
    trials: int = TRIALS,
    integrator: str = "euler",
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
    require("steps", steps, 1, 10**9, whole=True)
    require("trials", trials, 1, 10**6, whole=True)
    parameters = check_parameters(Parameters(integrator=integrators[integrator]))
    return Task(parameters, NOISES[noise], STARTS[start], steps, trials)
