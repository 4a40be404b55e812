"""Check a store, make some of its runs again, and compare them bit for bit."""

import argparse

from upright.commands.options import add
from upright.commands.parser import READ, Parser, as_whole
from upright.support.exit_status import FAILED

EXAMPLES = """\
examples:
  upright verify runs.sqlite                   check all that it holds, and make 100 runs again
  upright verify runs.sqlite --sample 10 --seed 1
  upright verify runs.sqlite --all             make every run again
  upright verify runs.sqlite --sample 0        only check the file
The file is checked first: its structure, and the checksum of each run. Then runs are made again,
on this machine, whichever made them first; what the store records of that environment is shown
where it differs from this one. Runs of other code than the present one are counted, but cannot be
compared. Of custom agents and plants, the code is imported and executed. The store is not changed.
exit status: 0 if all is the same, 1 if a run was different or something is damaged, 2 if something
asked for is not possible.
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright verify`."""
    parser.add_argument("store", metavar="STORE", file=READ, help="a store of runs")
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--sample",
        type=as_whole,
        metavar="N",
        help="how many runs to make again, drawn at random (default: 100)",
    )
    which.add_argument("--all", action="store_true", help="make every run again")
    add(parser, "--seed", help="seed of the sample (default: 0)")


def run(options: argparse.Namespace) -> int:
    """Carry out `upright verify`."""
    from upright.studies.progress import study_with_progress
    from upright.studies.reading import reading_bar
    from upright.studies.verify import SAMPLE, verify

    sample = SAMPLE if options.sample is None else options.sample
    with reading_bar([options.store], "checking") as on_read:
        found = verify(
            options.store,
            None if options.all else sample,
            options.seed,
            make=study_with_progress,
            on_read=on_read,
        )
    print(found)
    return 0 if found.is_sound else FAILED
