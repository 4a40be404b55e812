"""What the settings of all plants have in common."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol, TypeAlias

from upright.errors import UprightError, require
from upright.support.settings import Fields

if TYPE_CHECKING:
    import numpy as np

    from upright.core.contracts import Plant
    from upright.core.parameters import Parameters
    from upright.core.task import Task, TaskSpec


class RunContext(NamedTuple):
    """The run that a plant is made for."""

    task: "Task"
    """The task in numbers."""
    spec: "TaskSpec"
    """The same task by names, for plants that produce noise themselves."""
    seed: int
    """Seed of the random numbers that the plant draws itself."""
    stop: "np.ndarray"
    """Shape (1,), bool. Once it is set, the plant may refuse its next step by raising `Stopped`."""
    run: int = 0
    """Number of the run within its study, for errors."""


class PlantSettings(Fields, Protocol):
    """Settings of a plant, as a frozen dataclass.

    Its class attribute `FILES`, if any, has the names of those that are paths of files: in a TOML
    file they are relative to its folder.
    """

    @property
    def name(self) -> str:
        """Name of the plant in PLANTS, or its path `module:name`."""

    alone: ClassVar[bool]
    """Whether only one such plant exists, so that its runs cannot overlap."""

    def make(self, context: RunContext) -> "tuple[Plant, Task]":
        """Return the plant for a run, and the part of the task that is left to the loop."""

    def version(self) -> str:
        """Return the version of the simulator behind the plant, or an empty string."""


AnyPlant: TypeAlias = "str | PlantSettings | Callable[[Parameters], Any]"
"""A plant by its name or path `module:name`, its settings, or the class or function of a custom
one."""


SHORTEST_STEP, LONGEST_STEP = 1e-6, 10.0
"""The shortest and the longest time step that a simulator may be given [s]."""
MOST_STEPS = 100_000
"""Most physics steps between two pushes."""


def count_steps(physics_step: float, time_step: float) -> int:
    """Return the number of physics steps between two pushes.

    Parameters
    ----------
    physics_step
        The simulator's time step [s].
    time_step
        The time between two pushes [s].

    Raises
    ------
    UprightError
        If it is not a whole number, or too large.
    """
    steps = max(1, round(time_step / physics_step))
    require("the number of physics steps between two pushes", steps, 1, MOST_STEPS, whole=True)
    if abs(steps * physics_step - time_step) > 1e-9 * time_step:
        allowed = ", ".join(f"{time_step / n:g}" for n in (1, 2, 4, 5, 10))
        raise UprightError(
            f"physics_step is {physics_step!r}; it must be the time step of {time_step:g} s "
            f"divided by a whole number, such as {allowed}"
        )
    return steps


def refuse_breakaway(parameters: "Parameters", simulator: str) -> None:
    """Raise UprightError if a cart at rest has more friction than a moving one.

    A simulator has one friction, which always lets a cart rest.
    """
    if parameters.static_friction not in (0.0, parameters.cart_friction):
        raise UprightError(
            f"static_friction is {parameters.static_friction}; in {simulator} it must be 0 or "
            f"{parameters.cart_friction}, the cart_friction: there is no other friction at rest"
        )
