"""Run a study that a file describes: agents, settings, tasks, plants and runs.

The file is a task file whose values may be several, with agents and runs. Every combination is a
case, as in upright table, and the table is shown in the end. Finished runs are kept in a store
beside the file: interrupted or killed, the same command goes on from there. Paths in the file are
relative to its folder.
"""

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING

from upright.commands.options import add, add_executor_options
from upright.commands.parser import READ, Parser
from upright.commands.showing import put, telling_of_compilation
from upright.errors import said
from upright.support import terminal

if TYPE_CHECKING:
    from upright.studies.case import Case
    from upright.studies.estimate import Standing

FILE = """\
agents = ["q-learning", "random-search"]
runs = 20                            # of each case
noise = ["none", "gaussian-0.2"]     # a list: each of them
steps = 6000

[parameters]                         # of the plant (see upright plants)
half_length = "0.25:1:4"             # a range: four numbers from 0.25 to 1

[plant]
integrator = "rk4"

[settings.q-learning]                # (see upright agents q-learning)
discount = [0.9, 0.99]
"""
"""A small file of a study, which the help and the documents show."""
EXAMPLES = f"""\
a file, lengths.toml, of 24 cases (docs/studies.md lists all keys):
{"".join(f"  {line}" for line in FILE.splitlines(keepends=True))}
examples:
  upright study lengths.toml --dry-run      check it; how many runs, how long, how much disk?
  upright study lengths.toml                make the runs, show the table; interrupted? Once more
  upright study lengths.toml --status       how far is it? While it runs, in another terminal
  upright study lengths.toml --format markdown --output table.md
  upright study lengths.toml --part 1/2     the first half of the runs, in a store of its own
  upright study lengths.toml --part 2/2     the other half, on another machine: see --part
  upright table --agents ndp --noises all --save-study ndp.toml     a file for what options ask for
exit status: 0 if every run was made, 2 if something asked for is not possible, 3 if a custom agent
or plant failed; runs that had ended are in the store.
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright study`."""
    parser.add_argument(
        "file", metavar="FILE", file=READ, help="the file of the study, which ends in .toml"
    )
    alternatives = parser.add_mutually_exclusive_group()
    alternatives.add_argument(
        "--dry-run",
        action="store_true",
        help="run nothing: check everything, and tell how many runs are to be made, and about how "
        "long they and how much disk they will take",
    )
    alternatives.add_argument(
        "--status",
        action="store_true",
        help="run nothing: show how many runs of each case are finished, and what came out so far",
    )
    parser.add_argument(
        "--part",
        metavar="K/N",
        type=_part,
        help="make only part K of N, so that N machines share the study; each has a store of its "
        "own, and upright merge makes one of them",
    )
    add(
        parser,
        "--store",
        help="keep finished runs in this file (default: the store that FILE names, or beside it "
        "with the ending .sqlite; of a part, with the part in its name)",
    )
    add_executor_options(parser)
    add(parser, "--format", "--sources", "--output")


def _part(text: str) -> tuple[int, int]:
    """Return the part of a study that an option's text stands for."""
    if found := re.fullmatch("([0-9]{1,6})/([0-9]{1,6})", text):
        number, parts = map(int, found.groups())
        if 1 <= number <= parts:
            return number, parts
    why = f"{said(text)}; it must be K/N, such as 2/5, with K from 1 to N"
    raise argparse.ArgumentTypeError(why)


def run(options: argparse.Namespace) -> int:
    """Carry out `upright study`."""
    from upright.studies.store import Store
    from upright.studies.study import WHOLE
    from upright.studies.study_file import study_in
    from upright.support.toml_file import read_toml

    file = read_toml(options.file, "study file")
    plan = study_in(file)
    options.runs, options.seed = plan["runs"], plan["seed"]
    if options.store is None:
        options.store = _store_of_part(plan["store"], options.part)
        with file.at(*["store"] * ("store" in file.content)):
            Store(options.store).close()  # an error about it names the line
    options.part = options.part or WHOLE
    options.parser.check_files(options)  # now that the store has its name
    if options.dry_run or options.status:
        put((_plan if options.dry_run else _status)(plan["cases"], options), options.output)
        return 0
    from upright.commands.table import measure

    with telling_of_compilation(case.agent for case in plan["cases"]):
        return measure(plan["cases"], options, is_sweep=True)


def _store_of_part(store: str, part: tuple[int, int] | None) -> str:
    """Return the path of the store of a part: that of the study, with the part in its name."""
    if part is None:
        return store
    number, parts = part
    return str(Path(store).with_suffix(f".{number}-of-{parts}{Path(store).suffix}"))


def _standings(cases: "list[Case]", options: argparse.Namespace) -> "list[Standing]":
    from upright.studies.estimate import standings
    from upright.studies.store import Store

    with Store(options.store) as store:
        return standings(cases, options.runs, options.seed, store, options.part)


def _plan(cases: "list[Case]", options: argparse.Namespace) -> str:
    from upright.reports.standing import plan_text
    from upright.studies.estimate import probe

    several = _standings(cases, options)
    with telling_of_compilation(case.agent for case in cases):
        probed = probe(several, options.seed)
    terminal.end_notice()
    return plan_text(probed, options.runs, options.store)


def _status(cases: "list[Case]", options: argparse.Namespace) -> str:
    from upright.reports.standing import status_text

    return status_text(_standings(cases, options), options.store)
