"""Show the table of a store of runs, or what a saved policy is."""

import argparse

from upright.commands.options import add
from upright.commands.parser import Parser
from upright.commands.showing import put, put_table
from upright.errors import UprightError, require_one_of

EXAMPLES = """\
examples:
  upright show runs.sqlite
  upright show results/runs.sqlite --format markdown --output table.md
  upright show policy.npz                its inputs, its output, and the task it was trained on
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright show`."""
    parser.add_argument(
        "source",
        metavar="FILE",
        help="a store, or a policy saved by learn --save; no code in it is executed",
    )
    add(parser, "--format", "--sources", "--output")


def run(options: argparse.Namespace) -> int:
    """Carry out `upright show`."""
    from upright.policies.files import is_policy, read_header
    from upright.policies.policy import describe
    from upright.reports.statistics import stored_rows

    if is_policy(options.source):
        require_one_of("format of a policy", options.format, ("text",))
        put(describe(read_header(options.source)) + "\n", options.output)
        return 0
    rows = stored_rows(options.source)
    if not rows:
        raise UprightError(f"store is {options.source!r}; it holds no runs")
    put_table(rows, options)
    return 0
