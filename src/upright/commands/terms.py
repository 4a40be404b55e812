"""List the terms of --noise and --condition: disturbances with sizes, which compose.

Terms are joined by commas, and go with the names of cases: --noise actuator=0.1,gaussian=0.5 or
--condition delay-1,encoder=1024. Where an option takes a list of noise cases with commas between,
+ joins terms: --noises none,actuator=0.1+gaussian=0.5.
"""

import argparse
import textwrap
from collections.abc import Mapping

from upright.commands.parser import Parser
from upright.core.conditions import CONDITION_TERMS, NOISE_TERMS
from upright.core.terms import RANGE, VARIABLE, Term
from upright.support import terminal

EXAMPLES = """\
examples:
  upright terms
  upright learn adaptive-lqr --noise gaussian=0.5 --condition delay=1,encoder=1024
  upright learn q-learning --condition at-5000.force=-10            left and right change places
  upright learn ndp --condition at-5000.half_length=1,gust=5        the pole grows, in gusty wind
  upright table --condition each-run.half_length=0.25:1:log,each-episode.cart_mass=0.5:2
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright terms`."""
    parser.add_argument(
        "--format",
        choices=("text", "markdown"),
        default="text",
        metavar="NAME",
        help="format of the list: %(choices)s (default: %(default)s)",
    )


def run(options: argparse.Namespace) -> int:
    """Carry out `upright terms`."""
    show = markdown if options.format == "markdown" else text
    for option, terms in (("--noise", NOISE_TERMS), ("--condition", CONDITION_TERMS)):
        print(f"Terms of {option}:\n\n{show(terms)}\n")
    note = f"PARAMETER is one of {', '.join(VARIABLE)} (units: upright plants)."
    print(note if options.format == "markdown" else _wrapped(note))
    return 0


def text(terms: Mapping[str, Term]) -> str:
    """Return each term, how it is written and what it means, in lines that fit the terminal."""
    width = max(len(_written(name, term)) for name, term in terms.items())
    return "\n".join(
        _wrapped(f"  {_written(name, term):{width}}  {term.meaning}", indent=width + 4)
        for name, term in terms.items()
    )


def markdown(terms: Mapping[str, Term]) -> str:
    """Return the terms as a table in Markdown, with where each is from."""
    rows = [f"| `{_written(n, t)}` | {t.meaning} | {t.source} |" for n, t in terms.items()]
    return "\n".join(["| term | meaning | source |", "|---|---|---|", *rows])


def _wrapped(line: str, indent: int = 0) -> str:
    return textwrap.fill(
        line,
        max(terminal.width(), indent + 20),
        subsequent_indent=" " * indent,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _written(name: str, term: Term) -> str:
    if term.unit == RANGE:
        return f"{name}={RANGE}"
    return f"{name}=SIZE [{term.unit}]" if term.unit else name
