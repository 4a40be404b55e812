"""Merge stores of several machines into one, and compare the runs that more than one has."""

import argparse

from upright.commands.options import add
from upright.commands.parser import READ, Parser
from upright.errors import UprightError
from upright.support.exit_status import FAILED

EXAMPLES = """\
examples:
  upright merge laptop.sqlite server.sqlite --output all.sqlite
  upright merge node-*.sqlite --output all.sqlite     the same command again adds what is new
  upright show all.sqlite
A run that several stores have must be the same in all of them: success and the length of each
trial, bit for bit. One that is not is reported with both environments, as one of the machines is
broken; the output keeps the run that it had first. The stores are only read, and the output is
written as a whole or not at all. Damaged runs are left out and reported: merging a damaged store
alone saves the others.
exit status: 0 if all went well, 1 if a run was different or damaged, 2 if something asked for is
not possible.
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright merge`."""
    parser.add_argument("stores", metavar="STORE", nargs="+", file=READ, help="a store of runs")
    add(
        parser,
        "--output",
        help="the store that gets all their runs, which must be named; if it is there, what it "
        "holds stays",
    )


def run(options: argparse.Namespace) -> int:
    """Carry out `upright merge`."""
    if options.output is None:
        raise UprightError("output is missing; name the store that gets the runs with --output")
    from upright.studies.merge import merge
    from upright.studies.reading import reading_bar

    with reading_bar(options.stores, "merging") as on_read:
        merged = merge(options.stores, options.output, on_read=on_read)
    print(merged)
    return 0 if merged.is_sound else FAILED
