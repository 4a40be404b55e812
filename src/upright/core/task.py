"""What a run is: a plant, a noise case, a start, and when a trial and a run end.

`TaskSpec` says it in names, for people; `Task` in numbers, for the loop.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, NamedTuple

from upright.core.conditions import CONDITIONS, NOISES, STARTS, STEPS, TRIALS, Noise
from upright.core.parameters import (
    Parameters,
    State,
    changed_parameters,
    check_parameters,
    make_parameters,
)
from upright.errors import UprightError, require, require_one_of

if TYPE_CHECKING:
    import numpy as np


class Task(NamedTuple):
    """The numbers that define a run, in the form that compiled code takes.

    Examples
    --------
    >>> task = upright.TaskSpec(noise="sensor-5", condition="delay-1").task()
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


@dataclass(frozen=True)
class TaskSpec:
    """A task as people name it: what options, stores, policies and tables hold.

    Raises
    ------
    UprightError
        If a name is unknown, a number is not a whole one in its range, or a parameter is
        impossible.

    Examples
    --------
    >>> spec = upright.TaskSpec(noise="gaussian-0.1", condition="delay-1", steps=600)
    >>> spec.task().delay, spec.task().parameters.half_length
    (1, 0.5)
    """

    noise: str = "none"
    """Name of the noise case."""
    start: str = "random"
    """Name of the start."""
    condition: str = "nominal"
    """Name of the condition."""
    steps: int = STEPS
    """N: a trial that lasts this many steps without a fall succeeds."""
    trials: int = TRIALS
    """A run is at most this many consecutive trials."""
    parameters: Parameters = Parameters()
    """The parameters of the plant."""

    def __post_init__(self) -> None:
        """Refuse unknown names and impossible numbers."""
        require_one_of("noise", self.noise, NOISES)
        require_one_of("start", self.start, STARTS)
        require_one_of("condition", self.condition, CONDITIONS)
        require("steps", self.steps, 1, 10**9, whole=True)
        require("trials", self.trials, 1, 10**6, whole=True)
        object.__setattr__(self, "parameters", check_parameters(self.parameters))

    def task(self) -> Task:
        """Return the task in numbers; where every run has its own plant, with the nominal one."""
        differs, parameters = CONDITIONS[self.condition], self.parameters
        parameters = parameters._replace(
            cart_friction=differs.friction * parameters.cart_friction,
            pole_friction=differs.friction * parameters.pole_friction,
        )
        noise = NOISES[self.noise]._replace(hides_velocities=differs.hides_velocities)
        start = STARTS[self.start]
        return Task(parameters, noise, start, self.steps, self.trials, differs.delay)

    @property
    def time_step(self) -> float:
        """Time between two pushes [s]."""
        return self.parameters.time_step

    def as_data(self) -> dict[str, Any]:
        """Return the task by names as JSON takes it; of the parameters, those that are changed."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return values | {"parameters": changed_parameters(self.parameters)}

    @classmethod
    def from_data(cls, values: Mapping[str, Any]) -> "TaskSpec":
        """Return the task that `as_data` described; names that are missing have their defaults.

        Raises
        ------
        UprightError
            If a name is unknown, or a value is impossible.
        """
        values = dict(values)
        parameters = values.pop("parameters", {})
        for name in values:
            require_one_of("part of a task", name, [field.name for field in fields(cls)])
        if isinstance(parameters, Mapping):
            parameters = make_parameters(parameters)
        elif not isinstance(parameters, Parameters):
            raise UprightError(f"parameters is {parameters!r}; it must map names to numbers")
        return cls(**values, parameters=parameters)


def draw_plant(parameters: Parameters, rng: "np.random.Generator") -> Parameters:
    """Return the parameters of another plant: a pole of 0.25 to 2 m, masses halved to doubled.

    Each factor is drawn uniformly on a scale of powers.
    """
    half_length, cart, pole = rng.uniform((-2, -1, -1), (1, 1, 1)).tolist()
    return parameters._replace(
        half_length=parameters.half_length * 2.0**half_length,
        cart_mass=parameters.cart_mass * 2.0**cart,
        pole_mass=parameters.pole_mass * 2.0**pole,
    )
