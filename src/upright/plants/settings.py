"""What the settings of every plant have in common."""

from typing import TYPE_CHECKING, ClassVar, Protocol

from upright.errors import UprightError
from upright.support.settings import Fields

if TYPE_CHECKING:
    import numpy as np

    from upright.core.contracts import Plant
    from upright.core.task import Task


class PlantSettings(Fields, Protocol):
    """A frozen dataclass: how a plant is made."""

    name: ClassVar[str]
    """Which of PLANTS it makes."""
    alone: ClassVar[bool]
    """Whether there is one such body only, so that runs on it are made one after the other."""

    def make(self, task: "Task", noise: str, seed: int, stop: "np.ndarray") -> "tuple[Plant, Task]":
        """Return a plant, and what of its task is left to the loop.

        Parameters
        ----------
        task
            What is to be done.
        noise
            Name of its noise, for a body that makes it itself.
        seed
            Of random numbers that the body draws itself.
        stop
            Shape (1,), bool. Once it is set, the plant may refuse its next step by
            `KeyboardInterrupt`.
        """

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
