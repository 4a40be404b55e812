"""The task of a run: a plant, a noise case, a start, and when a trial and a run end.

`TaskSpec` describes it by names, for people; `Task` by numbers, for the loop.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, NamedTuple

from upright.core.conditions import (
    STARTS,
    STEPS,
    TRIALS,
    Condition,
    Noise,
    condition_of,
    condition_text,
    noise_of,
    noise_text,
)
from upright.core.parameters import (
    Parameters,
    State,
    changed_parameters,
    check_parameters,
    make_parameters,
)
from upright.errors import UprightError, require, require_one_of
from upright.support.short_repr import call

if TYPE_CHECKING:
    import numpy as np

    from upright.core.rig import Rig


class Task(NamedTuple):
    """The numbers that define a run, in a form that compiled code accepts.

    Examples
    --------
    >>> task = upright.TaskSpec(noise="sensor-5", condition="delay-1").task()
    >>> task.steps, task.rig.delay, task.noise.angle
    (60000, 1, 0.05)
    """

    parameters: Parameters = Parameters()
    """The parameters of the plant."""
    noise: Noise = Noise()
    """The noise on the force and on the measurement."""
    start: State = STARTS["random"]
    """Half-widths of the uniformly drawn start state."""
    steps: int = STEPS
    """N: a trial that lasts this many steps without a fall succeeds."""
    trials: int = TRIALS
    """A run is at most this many consecutive trials."""
    rig: "Rig | None" = None
    """What a condition puts between agent and plant, with memory of its own; None for nothing."""


def present_task(task: Task) -> Task:
    """Return the task with the parameters that its plant has now, if its rig changes them."""
    if task.rig is None:
        return task
    return task._replace(parameters=Parameters(*task.rig.present[:, 0].tolist()))


@dataclass(frozen=True)
class TaskSpec:
    """A task by names, as command-line options, stores, policies and tables hold it.

    Raises
    ------
    UprightError
        If a name is unknown, a number is not an integer in its range, or a parameter is out of
        range.

    Examples
    --------
    >>> spec = upright.TaskSpec(noise="gaussian-0.1", condition="delay-1", steps=600)
    >>> spec.task().rig.delay, spec.task().parameters.half_length
    (1, 0.5)
    >>> upright.TaskSpec(condition="encoder=1024,delay=2")
    TaskSpec(condition='delay=2,encoder=1024')
    """

    noise: str = "none"
    """Noise: the name of a case, or terms (see `upright terms`)."""
    start: str = "random"
    """Name of the start."""
    condition: str = "nominal"
    """Condition: the name of a case, or terms (see `upright terms`)."""
    steps: int = STEPS
    """N: a trial that lasts this many steps without a fall succeeds."""
    trials: int = TRIALS
    """A run is at most this many consecutive trials."""
    parameters: Parameters = Parameters()
    """The parameters of the plant, or a dictionary of those that differ from the published ones."""

    def __post_init__(self) -> None:
        """Refuse unknown names and numbers out of range."""
        object.__setattr__(self, "noise", noise_text(self.noise))
        require_one_of("start", self.start, STARTS)
        object.__setattr__(self, "condition", condition_text(self.condition))
        require("steps", self.steps, 1, 10**9, whole=True)
        require("trials", self.trials, 1, 10**6, whole=True)
        object.__setattr__(self, "parameters", _parameters(self.parameters))
        condition = condition_of(self.condition)
        _refuse_overridden(condition, self.parameters)
        check_varied(condition, _changed_by(condition, self.parameters))
        check_start(self.start, STARTS[self.start], self.parameters)

    def task(self, rng: "np.random.Generator | None" = None) -> Task:
        """Return the task in numbers.

        Parameters
        ----------
        rng
            Random numbers to draw the plant with, where every run has its own; without them, the
            plant is the nominal one.
        """
        from upright.core.rig import make_rig

        condition = condition_of(self.condition)
        parameters = _changed_by(condition, self.parameters)
        if rng is not None:
            parameters = draw_run(condition, parameters, rng)
        noise = noise_of(self.noise)._replace(hides_velocities=condition.hides_velocities)
        rig = make_rig(condition, parameters)
        return Task(parameters, noise, STARTS[self.start], self.steps, self.trials, rig)

    @property
    def time_step(self) -> float:
        """Time between two pushes [s]."""
        return self.parameters.time_step

    def as_data(self) -> dict[str, Any]:
        """Return the task by names, ready for JSON, with only those parameters that are changed."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return values | {"parameters": changed_parameters(self.parameters)}

    def changes(self) -> dict[str, Any]:
        """Return its parts by name that differ from those of the published, noise-free task."""
        values, usual = self.as_data(), TaskSpec().as_data()
        return {name: value for name, value in values.items() if value != usual[name]}

    def __repr__(self) -> str:
        return call("TaskSpec", self.changes())

    @classmethod
    def from_data(cls, values: Mapping[str, Any]) -> "TaskSpec":
        """Return the task that `as_data` described; missing names take their defaults.

        Raises
        ------
        UprightError
            If a name is unknown, or a value is out of range.
        """
        for name in values:
            require_one_of("part of a task", name, [field.name for field in fields(cls)])
        return cls(**values)


def _parameters(given: Any) -> Parameters:
    """Return parameters that are given as such, or by name where they are unusual."""
    if isinstance(given, Parameters):
        return check_parameters(given)
    if isinstance(given, Mapping):
        return make_parameters(given)
    raise UprightError(f"parameters is {given!r}; it must be Parameters, or map names to numbers")


def check_start(name: object, start: State, parameters: Parameters) -> None:
    """Raise UprightError if trials could begin with the pole or the cart beyond its limits.

    Parameters
    ----------
    name
        What the user calls the start, for the error.
    start
        Half-widths of the start.
    parameters
        The parameters of the plant, which include the limits.
    """
    for part, limit in (("x", "position_limit"), ("theta", "angle_limit")):
        size, allowed = getattr(start, part), getattr(parameters, limit)
        if size > allowed:
            within = [known for known, each in STARTS.items() if getattr(each, part) <= allowed]
            raise UprightError(
                f"start is {name!r}, with {part} up to {size!r}, but {limit} is {allowed!r}; it "
                f"must be a start within the limit, such as {' or '.join(within)}, or {limit} at "
                f"least {size!r}"
            )


def _refuse_overridden(condition: Condition, parameters: Parameters) -> None:
    """Raise UprightError if a parameter is changed that a condition sets all the same."""
    set_by = {name: f"each-run.{name}" for name, _ in condition.each_run}
    set_by |= {name: f"each-episode.{name}" for name, _ in condition.each_episode}
    set_by |= {"static_friction": "stick-slip"} if condition.stick_slip else {}
    for name, value in changed_parameters(parameters).items():
        if name in set_by:
            raise UprightError(
                f"{name} is {value!r}, and the condition has {set_by[name]}, which sets it too; "
                "leave out one of them"
            )


def _changed_by(condition: Condition, parameters: Parameters) -> Parameters:
    """Return the parameters of the plant under a condition.

    Raises
    ------
    UprightError
        If they are impossible.
    """
    parameters = parameters._replace(
        cart_friction=condition.friction * parameters.cart_friction,
        pole_friction=condition.friction * parameters.pole_friction,
        static_friction=condition.stick_slip or condition.friction * parameters.static_friction,
    )
    if condition.tilt:
        from upright.core.portable_math import sine_cosine

        sin, cos = sine_cosine(condition.tilt)
        g, along = parameters.gravity, parameters.gravity_along
        parameters = parameters._replace(
            gravity=g * cos - along * sin, gravity_along=g * sin + along * cos
        )
    return check_parameters(parameters)


def check_varied(condition: Condition, parameters: Parameters) -> None:
    """Raise UprightError if a run's plant could be impossible.

    That is, out of range, or with less friction for a cart at rest than for a moving one.

    Parameters
    ----------
    condition
        What changes, or is drawn.
    parameters
        The parameters of the plant under this condition.
    """
    if condition.varies_plant:
        for end in (0, 1):
            varied = {name: ends[end] for name, ends in VARIED.items()}
            check_parameters(_times_powers_of_2(parameters, varied))
    ranges = {name: drawn[:2] for name, drawn in (*condition.each_run, *condition.each_episode)}
    for _, name, value in condition.changes:
        ends = *ranges.get(name, (getattr(parameters, name),)), value
        ranges[name] = min(ends), max(ends)
    lowest = parameters._replace(**{name: low for name, (low, _) in ranges.items()})
    highest = parameters._replace(**{name: high for name, (_, high) in ranges.items()})
    if highest.static_friction > 0.0 and lowest.static_friction < highest.cart_friction:
        raise UprightError(
            f"static_friction may be {lowest.static_friction}; it must be 0, or at least the "
            f"cart_friction, which may be {highest.cart_friction}"
        )


def draw_run(
    condition: Condition, parameters: Parameters, rng: "np.random.Generator"
) -> Parameters:
    """Return the parameters of a run's own plant, drawn as its condition says.

    `parameters` are those under the condition: what is drawn is not multiplied or tilted again.
    """
    if condition.varies_plant:
        parameters = draw_plant(parameters, rng)
    if condition.each_run:
        from upright.core.rig import draw_parameters, draw_rows, lanes_of

        present = lanes_of(parameters)
        draw_parameters(draw_rows(condition.each_run), present, 0, rng)
        parameters = Parameters(*present[:, 0].tolist())
    return parameters


VARIED = {"half_length": (-2, 1), "cart_mass": (-1, 1), "pole_mass": (-1, 1)}
"""The lowest and the highest power of 2 that each parameter of a random plant is multiplied by."""


def draw_plant(parameters: Parameters, rng: "np.random.Generator") -> Parameters:
    """Return the parameters of a random plant: half to twice the masses, a pole of 0.25 to 2 m.

    Each factor is drawn log-uniformly. The pole's length holds for a nominal pole of 1 m.
    """
    drawn = rng.uniform(*zip(*VARIED.values(), strict=True)).tolist()
    return _times_powers_of_2(parameters, dict(zip(VARIED, drawn, strict=True)))


def _times_powers_of_2(parameters: Parameters, powers: Mapping[str, float]) -> Parameters:
    values = {name: getattr(parameters, name) * 2.0**power for name, power in powers.items()}
    return parameters._replace(**values)
