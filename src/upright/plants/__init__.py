"""Plants that agents balance, each in a file or folder of its own, with its settings.

The contract that they share is `core.contracts.Plant`: put into a state, pushed for one time step,
asked whether it fell, closed. May import `upright.core` and what stands left of it.
"""

from importlib import import_module
from typing import Any

from upright.errors import require_one_of
from upright.plants.settings import PlantSettings
from upright.support.settings import restored, values_of

PLANTS = {
    "equations": "upright.plants.equations",
    "mujoco": "upright.plants.mujoco",
    "gazebo": "upright.plants.gazebo.plant",
    "ros2": "upright.plants.ros2.plant",
}
"""Every plant, and the module that makes it.

Examples
--------
>>> "mujoco" in upright.PLANTS
True
"""


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
