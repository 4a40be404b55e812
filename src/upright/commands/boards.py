"""What the commands `leaderboard` and `robust` share: their options, and showing a board."""

import argparse
import sys
from typing import TYPE_CHECKING

from upright.commands.options import add, add_executor_options, executor_of, split, task_of
from upright.commands.parser import Parser
from upright.commands.showing import put, tell_file, telling_of_compilation, telling_what_is_kept
from upright.core.conditions import STRICT_RUNS

if TYPE_CHECKING:
    from upright.reports.leaderboards import Board


def add_board_options(parser: Parser, steps: int) -> None:
    """Add the options of a board, with its own defaults.

    Parameters
    ----------
    parser
        Of the command.
    steps
        N of the board.
    """
    add(parser, "--agents", "--seed")
    add(parser, "--runs", default=STRICT_RUNS)
    add(parser, "--steps", default=steps)
    add(parser, "--parameter")
    add(
        parser,
        "--output",
        help="write the board to this file as well, in Markdown with intervals, and its figures "
        "beside it as JSON",
    )
    add(parser, "--store")
    add_executor_options(parser)


def show_board(options: argparse.Namespace, board: "Board") -> int:
    """Make a board, show it, write it where the options say, and return 0.

    Parameters
    ----------
    options
        Those of `add_board_options`.
    board
        Which board.

    Raises
    ------
    UprightError
        If something asked for is not possible.
    """
    agents = split(options.agents)
    with telling_of_compilation(agents), telling_what_is_kept(options.store):
        from upright.reports.leaderboards import BoardPlan, make_board

        files = {"store": options.store, "output": options.output}
        size = {"runs": options.runs, "seed": options.seed, "executor": executor_of(options)}
        plan = BoardPlan(agents, **size, **files, **task_of(options))
        rows = make_board(board, plan)
    put(board.text(rows, plan), None)
    if options.output:
        tell_file("board", options.output, sys.stderr)
    return 0
