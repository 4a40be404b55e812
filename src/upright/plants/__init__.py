"""The plants that agents balance, each in its own file or folder, with its settings.

All of them meet the contract `core.contracts.Plant`: a plant can be put into a state, pushed for
one time step, asked whether it has fallen, and closed. May import `upright.core` and what stands
left of it.
"""

from collections.abc import Mapping
from typing import Any

from upright.errors import UprightError
from upright.plants.settings import AnyPlant, PlantSettings
from upright.support.registry import Registry
from upright.support.settings import values_of


def _custom(name: str) -> PlantSettings:
    from upright.plants.custom import CustomPlant

    return CustomPlant(name)


def _advice(name: str) -> str:
    from upright.plants.custom import advice

    return advice(name)


PLANTS: Registry[PlantSettings] = Registry(
    "plant",
    {
        "equations": "upright.plants.equations",
        "mujoco": "upright.plants.mujoco",
        "gazebo": "upright.plants.gazebo.plant",
        "ros2": "upright.plants.ros2.plant",
    },
    group="upright.plants",
    custom=_custom,
    advice=_advice,
)
"""Every plant and its module. Installed packages can register more as entry points.

Examples
--------
>>> "mujoco" in upright.PLANTS
True
>>> upright.PLANTS.default("equations").integrator
'euler'
"""


def plant_settings(plant: AnyPlant) -> PlantSettings:
    """Return the settings of a plant that is given by name, class, function or settings.

    Raises
    ------
    UprightError
        If it is none of these, or there is no such plant.
    """
    if isinstance(plant, str):
        return PLANTS.default(plant)
    if callable(plant) and hasattr(plant, "__qualname__"):
        from upright.plants.custom import CustomPlant, path_of_plant

        return CustomPlant(path_of_plant(plant))
    if callable(plant) or not hasattr(plant, "make"):
        allowed = ", ".join(PLANTS)
        raise UprightError(
            f"plant is {plant!r}; it must be one of {allowed}, or its settings, or a class or "
            "function which returns a plant when it is called with the parameters"
        )
    return plant


def describe_plant(settings: PlantSettings) -> dict[str, Any]:
    """Return a plant as data: its name and its settings."""
    return {"name": settings.name, **values_of(settings)}


def restore_plant(values: Mapping[str, Any]) -> PlantSettings:
    """Return the settings of a plant that `describe_plant` described.

    Raises
    ------
    UprightError
        If there is no such plant, or the settings are not its own or are not allowed.
    """
    own = {name: value for name, value in values.items() if name != "name"}
    return PLANTS.restore(values.get("name", ""), own)
