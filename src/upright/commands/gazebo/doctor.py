"""Report what is installed of Gazebo, what is missing and how to get it."""

import argparse

from upright.commands.parser import Parser
from upright.support.exit_status import FAILED

EXAMPLES = """\
examples:
  upright gazebo doctor
exit status: 0 if Gazebo and its plugin are installed and it runs, 1 if not.
"""


def add_options(_parser: Parser) -> None:
    """Add the options of `upright gazebo doctor`: it has none."""


def run(_options: argparse.Namespace) -> int:
    """Carry out `upright gazebo doctor`."""
    from upright.plants.gazebo.doctor import examine

    things = examine()
    for thing in things:
        print(thing)
    return 0 if all(thing.found for thing in things if thing.needed) else FAILED
