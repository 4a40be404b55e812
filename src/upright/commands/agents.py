"""List the agents, or show the settings of one."""

import argparse

from upright.agents import AGENTS
from upright.commands.options import add
from upright.commands.parser import Parser
from upright.commands.showing import print_settings

EXAMPLES = """\
examples:
  upright agents
  upright agents q-learning
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright agents`."""
    add(parser, "agent", nargs="?", help="show the settings of this agent")


def run(options: argparse.Namespace) -> int:
    """Carry out `upright agents`."""
    for agent in [options.agent] if options.agent else AGENTS:
        named = AGENTS.settings(agent)
        print(f"{agent}: {AGENTS.summary(agent)}")
        if options.agent:
            print_settings(named)
    return 0
