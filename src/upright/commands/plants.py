"""List the plants, or show the settings of one.

With --plant-set, its settings are shown so changed. Of a model of your own, a URDF or MJCF file, it
is also shown what was found: the joints of cart and pole, where the pole is upright, the push.
"""

import argparse

from upright.commands.options import add, plant_of
from upright.commands.parser import Parser
from upright.commands.showing import print_settings
from upright.core.parameters import Parameters
from upright.errors import UprightError
from upright.plants import PLANTS
from upright.plants.settings import PlantSettings
from upright.support.terminal import visible

EXAMPLES = """\
examples:
  upright plants
  upright plants mujoco
  upright plants mujoco --plant-set model=my_cart.urdf
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright plants`."""
    parser.add_argument(
        "plant",
        nargs="?",
        metavar="PLANT",
        help=f"show the settings of this plant: {', '.join(PLANTS.built_in)}, or module:name of a "
        "custom one",
    )
    add(parser, "--plant-set")


def run(options: argparse.Namespace) -> int:
    """Carry out `upright plants`."""
    if options.plant:
        PLANTS.check(options.plant)
        print(f"{options.plant}: {PLANTS.summary(options.plant)}")
        settings = plant_of(options)
        if not PLANTS.is_path(options.plant):
            print_settings({"value" if options.plant_changes else "default": settings})
        _print_found(settings)
        return 0
    if options.plant_changes:
        raise UprightError("--plant-set needs the name of a plant, such as mujoco")
    for plant in PLANTS:
        print(f"{plant}: {PLANTS.summary(plant)}")
    print("\nParameters of every plant, for --parameter:")
    print_settings({"published": Parameters()})
    return 0


def _print_found(settings: PlantSettings) -> None:
    """Print what was found in a model of the user's own, if there is one."""
    for what, text in getattr(settings, "found", dict)().items():
        print(f"  found {visible(f'{what}: {text}')}")
