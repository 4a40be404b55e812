"""Try your own agent: what it must do, whether its runs repeat, and whether it learns.

Each line is one check: ✓ passed, ✗ failed, with what to do, ! worth knowing, - not tried. The last
one is a small study beside random guessing. It all takes some 20 seconds at most, for which slow
agents get fewer steps and runs. Random numbers come from seeds that tables do not use. What the
agent prints is not shown.
"""

import argparse
import sys
from typing import TYPE_CHECKING

from upright.commands.options import CUSTOM_AGENTS
from upright.commands.parser import READ, WRITTEN, Parser
from upright.support.exit_status import AGENT_FAILED, FAILED
from upright.support.terminal import visible

if TYPE_CHECKING:
    from pathlib import Path

    from upright.reports.agent_check import Finding, Report

EXAMPLES = f"""\
examples:
  upright new my_agent.py                  writes an agent that passes
  upright check my_agent.py
  upright check my_agent:MyAgent           where a file has several
  upright check my_agent.py --json report.json
{CUSTOM_AGENTS}\
exit status: 0 if no check failed, however fast the agent learns (the file of --json has its
verdict: faster, similar or slower than guessing), 1 if one failed, 2 if something asked for is not
possible, 3 if the agent's code raised an exception.
"""
SIGNS = {"passed": "✓", "failed": "✗", "noted": "!", "skipped": "-"}
"""How the outcomes of checks are shown."""
INDENT = " " * 4


def add_options(parser: Parser) -> None:
    """Add the options of `upright check`."""
    parser.add_argument(
        "agent",
        metavar="AGENT",
        file=READ,
        help="the file of an agent, or module:name where it has several",
    )
    parser.add_argument(
        "--json", metavar="FILE", file=WRITTEN, help="write all that was found to this file"
    )


def run(options: argparse.Namespace) -> int:
    """Carry out `upright check`."""
    import json

    from rich.console import Console
    from rich.text import Text

    from upright.reports.agent_check import Finding, Report, check_agent
    from upright.studies.trace import unseen
    from upright.support.files import check_output, write_file

    if options.json:
        check_output(options.json)
    agent = agent_named(options.agent)
    console, findings = Console(stderr=True), list[Finding]()
    status = console.status("")
    checks = check_agent(agent, lambda text: status.update(Text(visible(f"{agent}: {text}"))))
    while True:
        with status, unseen():
            finding = next(checks, None)
        if finding is None:
            break
        findings.append(finding)
        show(finding)
    report = Report(agent, findings)
    print(summary(report))
    if options.json:
        write_file(options.json, json.dumps(report.as_data(), indent=2, allow_nan=False) + "\n")
    return AGENT_FAILED if report.raised else FAILED if report.failed else 0


def show(finding: "Finding") -> None:
    """Print what a check found, and what to do about it."""
    line, _, more = visible(finding.text, "\n").partition("\n")
    print(f"{SIGNS[finding.outcome]} {finding.check}: {line}")
    if finding.advice:
        print(f"{INDENT}{visible(finding.advice)}")
    for below in more.splitlines():
        print(f"{INDENT}{below}")
    sys.stdout.flush()


def summary(report: "Report") -> str:
    """Return the last line: what must be mended, if anything."""
    return f"to mend: {', '.join(report.failed)}" if report.failed else "nothing to mend"


def agent_named(given: str) -> str:
    """Return the name, module:name, of an agent that is given by this name or by its file.

    Raises
    ------
    UprightError
        If the file is missing, cannot be a module, or has no agent or several.
    """
    import os
    from pathlib import Path

    from upright.agents.checks.names import advice, agents_in
    from upright.errors import UprightError
    from upright.support.code_names import module_parts

    file, _, name = (given, "", "") if given.endswith(".py") else given.rpartition(":")
    if not file.endswith(".py"):
        return given
    path = Path(file)
    parts = module_parts(path) if os.path.isfile(path) else [""]
    if not all(part.isidentifier() for part in parts):
        raise UprightError(f"agent is {given!r}; {advice(given)}")
    module, names = ".".join(parts), [name] if name else agents_in(path) or classes_in(path)
    if len(names) > 1:
        choices = ", ".join(f"{module}:{each}" for each in names)
        raise UprightError(f"agent is {given!r}; it has several: name one of {choices}")
    if not names:
        raise UprightError(
            f"agent is {given!r}; it has no class with the methods of an agent: `upright new` "
            "writes one"
        )
    return f"{module}:{names[0]}"


def classes_in(path: "Path") -> list[str]:
    """Return the classes in a file, of which one may be meant to be an agent.

    If the file is not Python, return a name that leads to the error of importing it.
    """
    import ast

    from upright.support.code_names import statements

    body = statements(path)
    if body is None:
        return ["agent"]
    return [node.name for node in body if isinstance(node, ast.ClassDef)]
