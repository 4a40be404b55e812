"""Measure the twin's agents over many runs, beside the published figures.

Run K draws what MATLAB's rand returns after rng(10^6 seed + K); so does
`upright learn --twister --run K-1`, which has the same trials.

MATLAB runs it where it is on the path, else Octave; the variable UPRIGHT_MATLAB names another
program. Q-learning is some hundred times as fast once upright.build_mex() has been called.
"""

import argparse

from upright.commands.options import (
    add,
    add_task_file,
    add_task_options,
    in_file,
    noises_of,
    save_task_of,
    split,
    task_of,
)
from upright.commands.parser import Parser
from upright.commands.table import add_measuring_options, measure
from upright.studies.matlab_twin import AGENTS

EXAMPLES = """\
examples:
  upright matlab table --agents q-learning,random-search --noises none --runs 20
  upright matlab table --runs 100 --store runs.sqlite   (interrupted? run it again)
  upright show runs.sqlite                              with the runs made in Python
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright matlab table`."""
    add(parser, "--agents", default=",".join(AGENTS))
    add(parser, "--noises")
    add_task_options(parser, ("--start", "--steps", "--trials"))
    add_task_file(parser)
    add(parser, "--settings")
    add_measuring_options(parser)


def run(options: argparse.Namespace) -> int:
    """Carry out `upright matlab table`."""
    from upright.studies.case import make_case
    from upright.studies.matlab_twin import check_seed, find_program

    task = {**in_file(options), **task_of(options), "language": "MATLAB"}
    cases = [
        make_case(agent, options.settings, **(task | {"noise": noise}))
        for agent in split(options.agents)
        for noise in noises_of(options)
    ]
    check_seed(options.seed)
    find_program()
    save_task_of(options, cases)
    return measure(cases, options)
