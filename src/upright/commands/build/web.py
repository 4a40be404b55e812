"""Build learners for browsers and Node.js, with a page that uses them.

The folder gets, for each agent, a module of WebAssembly and a JSON file that says where everything
lies in its memory; upright.js, which makes learners of them; and index.html. It is an npm package
as well, and any static host serves it. What the options say is what a new learner begins with: the
page may choose another seed, noise, start or plant, and other settings.
"""

import argparse

from upright.agents import AGENTS
from upright.commands.options import (
    CUSTOM_AGENTS,
    add,
    add_case_options,
    add_task_options,
    cases_of,
    task_of,
)
from upright.commands.parser import Parser
from upright.commands.showing import tell_file
from upright.support import terminal

EXAMPLES = f"""\
examples:
  upright build web q-learning reinforce adaptive-lqr --output page
  upright build web my_agent:MyAgent --output page           a compiled custom agent
  upright build web q-learning --set discount=0.98 --condition delay=2 --output page
  python -m http.server --directory page                     then open http://localhost:8000
  npm pack ./page                                            an npm package
{CUSTOM_AGENTS}\
exit status: 0 if everything was built, 2 if something asked for is not possible.
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright build web`."""
    text = f"agents: {', '.join(AGENTS.built_in)}, or module:name of a compiled custom one"
    parser.add_argument("agents", metavar="AGENT", nargs="+", help=text)
    help_text = "the folder to write to; it is created if it is missing (default: %(default)s)"
    add(parser, "--output", default="page", metavar="FOLDER", help=help_text)
    add_task_options(parser)
    add_case_options(parser)


def run(options: argparse.Namespace) -> int:
    """Carry out `upright build web`."""
    for agent in options.agents:
        AGENTS.check(agent)
    from upright.builds.web_package import build_web

    cases = cases_of(options, options.agents, **task_of(options))
    terminal.notice(f"building {', '.join(options.agents)}, which takes some 15 seconds each …")
    for module in build_web(cases, options.output):
        tell_file("module", module)
    return 0
