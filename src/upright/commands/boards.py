"""What the commands `leaderboard` and `robust` share: their options, and how a board is made."""

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING

from upright.commands.options import add, split, task_of
from upright.commands.parser import Parser
from upright.commands.showing import telling_what_is_kept
from upright.core.conditions import STRICT_RUNS

if TYPE_CHECKING:
    from upright.reports.leaderboards import BoardPlan


def add_board_options(parser: Parser, name: str, steps: int) -> None:
    """Add the options of a board, with its own defaults.

    Parameters
    ----------
    parser
        Of the command.
    name
        Of the board's files.
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
        default=f"docs/{name}.md",
        help="file for the board, in Markdown; its figures are written beside it as JSON "
        "(default: %(default)s)",
    )
    add(
        parser,
        "--store",
        default=f"results/{name}.sqlite",
        help="keep every finished run in this file, and reuse the runs it already holds "
        "(default: %(default)s)",
    )


def write_board(options: argparse.Namespace, write: "Callable[[str, BoardPlan], None]") -> int:
    """Make a board, say where it is, and return 0.

    Parameters
    ----------
    options
        Those of `add_board_options`.
    write
        Makes the missing runs and writes the board to a file.

    Raises
    ------
    UprightError
        If something asked for is not possible.
    """
    from upright.reports.leaderboards import BoardPlan

    agents, store = split(options.agents), options.store
    plan = BoardPlan(agents, options.runs, options.seed, store=store, **task_of(options))
    with telling_what_is_kept(store):
        write(options.output, plan)
    print(f"board: {options.output}")
    return 0
