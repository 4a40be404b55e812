"""The plants that agents balance, each in its own file or folder, with its settings.

All of them meet the contract `core.contracts.Plant`: a plant can be put into a state, pushed for
one time step, asked whether it has fallen, and closed. May import `upright.core` and what stands
left of it.
"""

from collections.abc import Mapping
from typing import Any

from upright.plants.settings import PlantSettings
from upright.support.registry import Registry
from upright.support.settings import values_of

PLANTS: Registry[PlantSettings] = Registry(
    "plant",
    {
        "equations": "upright.plants.equations",
        "mujoco": "upright.plants.mujoco",
        "gazebo": "upright.plants.gazebo.plant",
        "ros2": "upright.plants.ros2.plant",
    },
    group="upright.plants",
)
"""Every plant and its module. Installed packages can register more as entry points.

Examples
--------
>>> "mujoco" in upright.PLANTS
True
>>> upright.PLANTS.default("equations").integrator
'euler'
"""


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
