"""Print the folder of the MATLAB code."""

import argparse

from upright.commands.parser import Parser

EXAMPLES = """\
examples:
  upright matlab path
  addpath FOLDER           in MATLAB or Octave, with the folder that was printed
  help upright.Contents    what is there
"""


def add_options(_parser: Parser) -> None:
    """Add the options of `upright matlab path`: it has none."""


def run(_options: argparse.Namespace) -> int:
    """Carry out `upright matlab path`."""
    from upright.studies.matlab_twin import folder

    print(folder())
    return 0
