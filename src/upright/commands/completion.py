"""Print a script for Tab completion in bash, zsh or fish.

It completes commands, options, files and names. After an upgrade of Upright, print it again.
"""

import argparse
from collections.abc import Collection, Iterator
from typing import Any

from upright.agents import AGENTS
from upright.commands import make_parser
from upright.commands.parser import Parser
from upright.core.conditions import CONDITION_TERMS, CONDITIONS, NOISE_TERMS, NOISES
from upright.core.terms import written
from upright.plants import PLANTS

SHELLS = ("bash", "zsh", "fish")
"""Shells that have a script."""
FREE = (
    "ADDRESS",
    "N",
    "K",
    "K/N",
    "ADDRESS",
    "NAME=VALUE",
    "NAME=VALUES",
    "AGENT.NAME=VALUES",
    "NAME[=LOW:HIGH]",
    "MODULE:NAME",
    "SIZE",
    "URL",
    "VALUE",
)
"""Metavariables of values that nothing completes."""
FILES = ("FILE", "POLICY", "PICTURE", "OUTPUT")
"""Metavariables of files."""
LISTS: dict[str, Collection[str]] = {
    "AGENTS": AGENTS,
    "CASES": ("all", *NOISES),
    "NOISE": (*NOISES, *written(NOISE_TERMS)),
    "TERMS": (*CONDITIONS, *written(CONDITION_TERMS)),
}
"""Metavariables of names with commas between, and the names."""

BASH_LIST = """
_upright_KIND() {
  local given=""
  [[ $1 == *,* ]] && given="${1%,*},"
  compgen -P "$given" -W "NAMES" -- "${1##*,}"
}
"""
FISH_LIST = """
function _upright_list
  printf '%s\\n' (string match -r '^(?:.*,)?' -- (commandline -ct))$argv
end
"""
"""What comes after the last comma is completed; zsh has a function of its own for that."""

EXAMPLES = """\
examples:
  upright completion bash                print the script
Installed so, it takes effect in a new shell:
  bash, with the package bash-completion:
    mkdir -p ~/.local/share/bash-completion/completions
    upright completion bash > ~/.local/share/bash-completion/completions/upright
  bash without it:
    upright completion bash > ~/.upright-completion.bash
    echo 'source ~/.upright-completion.bash' >> ~/.bashrc
  zsh, where ~/.zshrc has these two lines: fpath=(~/.zfunc $fpath)
                                           autoload -Uz compinit && compinit
    mkdir -p ~/.zfunc
    upright completion zsh > ~/.zfunc/_upright
  fish:
    mkdir -p ~/.config/fish/completions
    upright completion fish > ~/.config/fish/completions/upright.fish
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright completion`."""
    parser.add_argument(
        "shell", choices=SHELLS, metavar="SHELL", help="the shell that you use: %(choices)s"
    )


def run(options: argparse.Namespace) -> int:
    """Carry out `upright completion`."""
    import shtab

    parser = make_parser()
    for action in actions(parser):
        kind = str(action.metavar)
        action.help = (action.help or "").partition(": ")[0]  # shells list the names themselves
        if kind == "AGENT":
            action.choices = tuple(AGENTS)
        elif kind == "PLANT":
            action.choices = tuple(PLANTS)
        elif kind in FILES:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
        elif kind == "FOLDER":
            action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
        elif kind in LISTS:
            action.complete = _list_of(kind)  # type: ignore[attr-defined]
        elif action.choices and kind != "COMMAND":
            action.choices = tuple(action.choices)  # shtab takes a dictionary for commands
    print(shtab.complete(parser, options.shell))
    return 0


def actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Give every argument of a command and of those below it."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from actions(command)


def _list_of(kind: str) -> dict[str, Any]:
    """Return how each shell completes one of LISTS, in shtab's form."""
    names = " ".join(LISTS[kind])
    return {
        "bash": f"_upright_{kind}",
        "zsh": f"_values -s , {kind} {names}",
        "fish": f"(_upright_list {names})",
        "preamble": {
            "bash": BASH_LIST.replace("KIND", kind).replace("NAMES", names),
            "fish": FISH_LIST,
        },
    }
