"""Reproduce the published tables, with pictures.

If interrupted, the same command continues where it stopped.
"""

import argparse

from upright.agents import AGENTS
from upright.commands.options import add, add_executor_options, add_task_options, executor_of
from upright.commands.parser import Parser
from upright.commands.showing import tell_file, telling_of_compilation, telling_what_is_kept

EXAMPLES = """\
examples:
  upright reproduce                      20 runs per case, as in the report, into results/
  upright reproduce --runs 100           the stricter form; reuses finished runs
  upright reproduce --output /tmp/again
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright reproduce`."""
    add(parser, "--runs", "--seed")
    add_task_options(parser, ("--steps",))
    add(
        parser,
        "--output",
        default="results",
        metavar="FOLDER",
        help="folder for tables and pictures (default: %(default)s)",
    )
    add_executor_options(parser)


def run(options: argparse.Namespace) -> int:
    """Carry out `upright reproduce`."""
    with telling_of_compilation(AGENTS.built_in), telling_what_is_kept(options.output):
        from upright.reports.reproduction import reproduce

        report = reproduce(
            options.output, options.runs, options.seed, options.steps, executor=executor_of(options)
        )
    tell_file("report", report)
    return 0
