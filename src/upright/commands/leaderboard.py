"""Rank all agents on the published cases, from both starts.

If interrupted, the same command continues where it stopped.
"""

import argparse

from upright.commands.boards import add_board_options, write_board
from upright.commands.parser import Parser
from upright.core.conditions import STRICT_STEPS

EXAMPLES = """\
examples:
  upright leaderboard                    100 runs per case, N = 600,000, into docs/leaderboard.md
  upright leaderboard --agents adaptive-lqr,my_module:MyAgent,random-search --runs 20
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright leaderboard`."""
    add_board_options(parser, "leaderboard", STRICT_STEPS)


def run(options: argparse.Namespace) -> int:
    """Carry out `upright leaderboard`."""
    from upright.reports.leaderboards import leaderboard

    return write_board(options, leaderboard)
