"""What the settings of every plant have in common."""

from typing import TYPE_CHECKING, ClassVar, NamedTuple, Protocol

from upright.errors import UprightError
from upright.support.settings import Fields

if TYPE_CHECKING:
    import numpy as np

    from upright.core.contracts import Plant
    from upright.core.task import Task, TaskSpec


class RunContext(NamedTuple):
    """What a plant is made for."""

    task: "Task"
    """What is to be done, in numbers."""
    spec: "TaskSpec"
    """The same by names, for a plant that makes its noise itself."""
    seed: int
    """Of random numbers that the plant draws itself."""
    stop: "np.ndarray"
    """Shape (1,), bool. Once it is set, the plant may refuse its next step by raising `Stopped`."""


class PlantSettings(Fields, Protocol):
    """A frozen dataclass: how a plant is made."""

    name: ClassVar[str]
    """Which of PLANTS it makes."""
    alone: ClassVar[bool]
    """Whether there is one such plant only, so that its runs are made one after the other."""

    def make(self, context: RunContext) -> "tuple[Plant, Task]":
        """Return the plant of a run, and the task that is left to the loop."""

    def version(self) -> str:
        """Return the version of the simulator behind the plant; empty if there is none."""


def count_steps(physics_step: float, time_step: float) -> int:
    """Return how many physics steps make up the time between two pushes.

    Raises
    ------
    UprightError
        If that is no whole number.
    """
    steps = max(1, round(time_step / physics_step))
    if abs(steps * physics_step - time_step) > 1e-9 * time_step:
        allowed = ", ".join(f"{time_step / n:g}" for n in (1, 2, 4, 5, 10))
        raise UprightError(
            f"physics_step is {physics_step!r}; it must be the time step of {time_step:g} s "
            f"divided by a whole number, such as {allowed}"
        )
    return steps
