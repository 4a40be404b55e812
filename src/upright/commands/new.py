"""Write an agent that works, for you to change.

The file is a module with one agent, a class named after the file: MyAgent in my_agent.py. It learns
in a quarter of the trials that random guessing takes. Nothing is overwritten.
"""

import argparse
from typing import TYPE_CHECKING

from upright.commands.parser import Parser
from upright.support.terminal import visible

if TYPE_CHECKING:
    from pathlib import Path

EXAMPLES = """\
examples:
  upright new my_agent.py
  upright new pole_keeper.py --compiled
  upright check my_agent.py                then try all that an agent must do
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright new`."""
    parser.add_argument("file", metavar="FILE", help="the file to write, such as my_agent.py")
    parser.add_argument(
        "--compiled",
        action="store_true",
        help="write the same agent compiled: as fast as the package's own, with stricter rules",
    )


def run(options: argparse.Namespace) -> int:
    """Carry out `upright new`."""
    from pathlib import Path

    from upright.agents.starters import starter
    from upright.support.files import check_name, create_file

    path = Path(options.file)
    check_name("file", path)
    check_module_name(path)
    agent, text = starter(path.stem, compiled=options.compiled)
    create_file(path, text)
    print(f"{visible(str(path))}: an agent that works. Change it as you like, and try:")
    for command in next_commands(path, f"{path.stem}:{agent}"):
        print(f"  {visible(command)}")
    return 0


def next_commands(path: "Path", agent: str) -> list[str]:
    """Return the commands to try with a new agent."""
    import shlex
    from pathlib import Path

    elsewhere = path.parent.resolve() != Path.cwd()
    return [
        *([f"cd {shlex.quote(str(path.parent))}"] if elsewhere else []),
        f"upright check {path.name}",
        f"upright learn {agent} --window",
        f"upright table --agents {agent},random-search --noises none",
    ]


def check_module_name(path: "Path") -> None:
    """Raise UprightError unless this is the name of a module that can be imported and hides none.

    The error suggests another name.
    """
    import keyword
    import re
    import sys
    import unicodedata
    from importlib.util import find_spec

    from upright.errors import UprightError

    stem, folder = path.stem, path.parent
    letters = unicodedata.normalize("NFKD", stem).encode("ascii", "ignore").decode()
    words = re.sub(r"\W+", "_", letters).strip("_")
    if path.is_dir():
        folder, why, better = path, "it is a folder, a file is needed", "my_agent"
    elif path.suffix != ".py":
        why, better = "a module of Python ends in .py", words or "my_agent"
    elif not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", stem):
        why = "the name of a module is a letter, then letters, digits and _"
        better = words if words[:1].isalpha() else f"agent_{words}".rstrip("_")
    elif keyword.iskeyword(stem):
        why, better = f"{stem} is a word of Python", f"{stem}_agent"
    elif stem in sys.stdlib_module_names or (not path.exists() and find_spec(stem)):
        why, better = f"it would hide the module {stem}", f"{stem}_agent"
    else:
        return
    suggestion = str(folder / f"{better}.py")
    raise UprightError(f"file is {str(path)!r}; {why}; try {suggestion!r}")
