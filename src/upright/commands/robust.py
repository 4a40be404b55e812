"""Rank all agents on tasks beyond the published ones.

The plant varies from run to run, pushes are delayed, velocities are not measured, the pole leans at
the start, friction is a hundredfold: what breaks which agent?

If interrupted, the same command continues where it stopped.
"""

import argparse

from upright.commands.boards import add_board_options, write_board
from upright.commands.parser import Parser
from upright.core.conditions import STEPS

EXAMPLES = """\
examples:
  upright robust                         100 runs a task, N = 60,000, into docs/robust.md
  upright robust --agents adaptive-lqr,my_module:MyAgent,random-search --runs 20
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright robust`."""
    add_board_options(parser, "robust", STEPS)


def run(options: argparse.Namespace) -> int:
    """Carry out `upright robust`."""
    from upright.reports.leaderboards import robust

    return write_board(options, robust)
