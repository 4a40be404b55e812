"""The `upright` command: one command a file, and the options that several share.

The file of a command has a docstring, whose first line is its summary; EXAMPLES, the end of its
help; `add_options(parser)`; and `run(options)`, which imports what the work needs and returns the
exit status. A command with others below it is a folder whose `__init__.py` has SUBCOMMANDS instead.
May import everything.
"""

import argparse
import os
import sys
from collections.abc import Iterable, Sequence
from typing import Any, NoReturn

from upright import __version__
from upright.commands.parser import Parser
from upright.support.exit_status import INTERRUPTED, exit_status
from upright.support.registry import Registry

COMMANDS: Registry[Any] = Registry(
    "command",
    {
        "new": "upright.commands.new",
        "check": "upright.commands.check",
        "learn": "upright.commands.learn",
        "play": "upright.commands.play",
        "table": "upright.commands.table",
        "study": "upright.commands.study",
        "reproduce": "upright.commands.reproduce",
        "leaderboard": "upright.commands.leaderboard",
        "robust": "upright.commands.robust",
        "show": "upright.commands.show",
        "verify": "upright.commands.verify",
        "merge": "upright.commands.merge",
        "plot": "upright.commands.plot",
        "export": "upright.commands.export",
        "build": "upright.commands.build",
        "watch": "upright.commands.watch",
        "agents": "upright.commands.agents",
        "plants": "upright.commands.plants",
        "terms": "upright.commands.terms",
        "tune": "upright.commands.tune",
        "matlab": "upright.commands.matlab",
        "ros2": "upright.commands.ros2",
        "gazebo": "upright.commands.gazebo",
        "cite": "upright.commands.cite",
        "completion": "upright.commands.completion",
    },
)
"""Every command, in the order of the help, and its module."""

EXAMPLES = """\
examples:
  upright learn reinforce                      watch one run learn, trial by trial
  upright play results/reinforce.npz --window  watch a trained policy
  upright table --agents reinforce,random-search --runs 20
                                               a study: success rate and mean trials
  upright study lengths.toml                   the same, described by a file
  upright reproduce                            the published tables again, with pictures
  upright leaderboard                          all agents, ranked, on the published cases
  upright show results/runs.sqlite             the table of a store of runs
  upright show runs.sqlite --each run          the runs themselves, as CSV
  upright verify runs.sqlite                   some of them made again, and compared bit for bit
  upright merge a.sqlite b.sqlite --output all.sqlite
                                               one store of several machines' runs
  upright plot policy results/reinforce.npz    a picture of a trained policy
  upright export policy.npz policy.h           the same in C, for a microcontroller
  upright build web q-learning --output page   a learner for browsers, and a page with it
  upright tune q-learning                      search for better settings
  upright new my_agent.py                      begin an agent of your own
  upright check my_agent.py                    try all that it must do, and see if it learns
  upright matlab table                         Q-learning in MATLAB code, run by Octave
  upright cite                                 how to cite Upright and its sources
`upright COMMAND --help` describes each.
"""


GREETING = """\
Upright: agents learn to balance a pole on a cart, and are measured.

Five commands to try:
  upright learn reinforce --save policy.npz   watch an agent learn
  upright play policy.npz --noise sensor-10   let it balance with a noisy sensor
  upright show policy.npz                     what was learned, on which task
  upright agents                              the agents that are there
  upright table --noises none                 compare them over 20 runs each
`upright --help` lists all commands, `upright COMMAND --help` describes one.
"""


def main() -> NoReturn:
    """Run the command of this process and end with its status."""
    status = run(sys.argv[1:])
    if status == INTERRUPTED:
        from upright.support.processes import release_semaphores

        release_semaphores()
        os._exit(status)  # a thread may still be compiling, which nothing can interrupt
    sys.exit(status)


def run(arguments: Sequence[str]) -> int:
    """Carry out a command line and return the exit status."""

    def work() -> int:
        if not arguments:
            print(GREETING, end="")
            return 0
        asked = arguments[0]
        if asked in COMMANDS:
            parser = make_parser([asked])
        else:
            parser = make_parser(listed_only=not any(word in COMMANDS for word in arguments))
        options = parse(parser, arguments)
        status: int = options.command(options)
        return status

    return exit_status(work)


def parse(parser: Parser, arguments: Sequence[str]) -> argparse.Namespace:
    """Return the options of a command line; a file of a task gives the defaults of others.

    Raises
    ------
    UprightError
        If the file of --task cannot be read.
    """
    options = parser.parse(arguments)
    if vars(options).get("task") is not None:
        from upright.commands.options import defaults_in_file

        options.parser.set_defaults(**defaults_in_file(options.task))
        options = parser.parse(arguments)
    return options


def make_parser(names: Iterable[str] | None = None, *, listed_only: bool = False) -> Parser:
    """Return the parser of the `upright` command.

    Parameters
    ----------
    names
        The commands to be known, whose modules are imported: all unless given.
    listed_only
        Whether it is only to list them: their options and those below them are left out.
    """
    parser = Parser(
        prog="upright",
        description="Learn to balance an inverted pendulum, and measure how fast it was learned.",
        epilog=EXAMPLES,
    )
    parser.add_argument("--version", action="version", version=f"upright {__version__}")
    parser.add_commands(COMMANDS, names, listed_only=listed_only)
    return parser
