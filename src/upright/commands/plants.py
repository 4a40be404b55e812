"""List the plants, or show the settings of one."""

import argparse

from upright.commands.parser import Parser
from upright.commands.showing import print_settings
from upright.core.parameters import Parameters
from upright.plants import PLANTS

EXAMPLES = """\
examples:
  upright plants
  upright plants mujoco
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright plants`."""
    parser.add_argument(
        "plant",
        nargs="?",
        choices=PLANTS,
        metavar="PLANT",
        help="show the settings of this plant: %(choices)s",
    )


def run(options: argparse.Namespace) -> int:
    """Carry out `upright plants`."""
    for plant in [options.plant] if options.plant else PLANTS:
        default = PLANTS.default(plant)
        print(f"{plant}: {PLANTS.summary(plant)}")
        if options.plant:
            print_settings({"default": default})
    if not options.plant:
        print("\nParameters of every plant, for --parameter:")
        print_settings({"published": Parameters()})
    return 0
