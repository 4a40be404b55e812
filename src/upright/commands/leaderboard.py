"""Rank all agents on the published cases, from both starts.

The board is shown on the screen, with the best agents first. With --store, an interrupted command
continues where it stopped.
"""

import argparse

from upright.commands.boards import add_board_options, show_board
from upright.commands.parser import Parser
from upright.core.conditions import STRICT_STEPS

EXAMPLES = """\
examples:
  upright leaderboard                    100 runs per case, N = 600,000: a quarter of an hour
  upright leaderboard --agents adaptive-lqr,my_module:MyAgent,random-search --runs 20
  upright leaderboard --store board.sqlite    (interrupted? run it again)
  upright leaderboard --store board.sqlite --output board.md
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright leaderboard`."""
    add_board_options(parser, STRICT_STEPS)


def run(options: argparse.Namespace) -> int:
    """Carry out `upright leaderboard`."""
    from upright.reports.leaderboards import LEADERBOARD

    return show_board(options, LEADERBOARD)
