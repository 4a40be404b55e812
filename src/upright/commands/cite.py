"""Print how to cite this software, and the sources of its task and its agents."""

import argparse

from upright.commands.options import add
from upright.commands.parser import Parser
from upright.commands.showing import put
from upright.reports.citation import FORMATS

EXAMPLES = """\
examples:
  upright cite
  upright cite --format bibtex --output upright.bib
  upright cite --format cff                the file CITATION.cff, which programs read
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright cite`."""
    parser.add_argument(
        "--format",
        choices=FORMATS,
        default="text",
        metavar="NAME",
        help="format: %(choices)s (default: %(default)s)",
    )
    add(parser, "--output", help="write to this file, not to the screen")


def run(options: argparse.Namespace) -> int:
    """Carry out `upright cite`."""
    put(FORMATS[options.format](), options.output)
    return 0
