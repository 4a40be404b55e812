"""Bodies that agents balance, each in a file of its own, with its settings.

The contract that they share is `trials.Plant`: put into a state, pushed for one time step, asked
whether it fell, closed.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

from upright.errors import UprightError, require_one_of
from upright.settings import Fields, restored, values_of

if TYPE_CHECKING:
    import numpy as np

    from upright.task import Task
    from upright.trials import Plant

PLANTS = {
    "equations": "upright.plants.equations",
    "mujoco": "upright.plants.mujoco",
    "gazebo": "upright.plants.gazebo",
    "gz-sim": "upright.plants.gz_sim",
    "ros2": "upright.plants.ros2",
}
"""Every plant, and the module that makes it."""


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
        """Return what tells apart the plants that move differently with the same settings."""


def default_plant(name: str) -> PlantSettings:
    """Return the default settings of a plant.

    Raises
    ------
    UprightError
        If there is no such plant.
    """
    require_one_of("plant", name, PLANTS)
    settings: PlantSettings = import_module(PLANTS[name]).SETTINGS
    return settings


def summarise_plant(name: str) -> str:
    """Return what a plant is, in one line.

    Raises
    ------
    UprightError
        If there is no such plant.
    """
    require_one_of("plant", name, PLANTS)
    return (import_module(PLANTS[name]).__doc__ or "").partition("\n")[0]


def describe_plant(settings: PlantSettings) -> dict[str, Any]:
    """Return a plant as data: its name and its settings."""
    return {"name": settings.name, **values_of(settings)}


def restore_plant(values: dict[str, Any]) -> PlantSettings:
    """Return the plant that was described as data.

    Raises
    ------
    UprightError
        If there is no such plant, or the settings are not its own, or not allowed.
    """
    own = {name: value for name, value in values.items() if name != "name"}
    return restored(default_plant(values["name"]), own, values["name"])


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
