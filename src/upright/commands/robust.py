"""Rank all agents on tasks beyond the published ones.

The plant varies from run to run, pushes are delayed, velocities are not measured, the pole leans at
the start, friction is a hundredfold: what breaks which agent?

The board is shown on the screen, with the best agents first. With --store, an interrupted command
continues where it stopped.
"""

import argparse

from upright.commands.boards import add_board_options, show_board
from upright.commands.parser import Parser
from upright.core.conditions import STEPS

EXAMPLES = """\
examples:
  upright robust                         100 runs a task, N = 60,000: some minutes
  upright robust --agents adaptive-lqr,my_module:MyAgent,random-search --runs 20
  upright robust --store robust.sqlite   (interrupted? run it again)
  upright robust --store robust.sqlite --output robust.md
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright robust`."""
    add_board_options(parser, STEPS)


def run(options: argparse.Namespace) -> int:
    """Carry out `upright robust`."""
    from upright.reports.leaderboards import ROBUST_BOARD

    return show_board(options, ROBUST_BOARD)
