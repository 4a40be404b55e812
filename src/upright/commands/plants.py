"""List the plants, or show the settings of one."""

import argparse

from upright.commands.parser import Parser
from upright.commands.showing import print_settings
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
    from upright.plants import default_plant, summarise_plant

    for plant in [options.plant] if options.plant else PLANTS:
        default = default_plant(plant)
        print(f"{plant}: {summarise_plant(plant)}")
        if options.plant:
            print_settings({"default": default})
    return 0
