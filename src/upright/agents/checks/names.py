"""Advise how to name a custom agent whose file was named instead: `mine.py:Pd` is `mine:Pd`."""

import ast
import os
from pathlib import Path

LISTED = 5
"""At most this many agents of a file are named."""


def advice(name: str) -> str:
    """Return what to write in place of a name that looks like the file of a custom agent.

    Nothing is imported: the file is only read.

    Parameters
    ----------
    name
        What was given as the name of an agent.

    Returns
    -------
    str
        The advice, such as "write 'mine:Pd'"; empty if the name looks like no file.
    """
    file, made = _split(name)
    path = Path(file if file.endswith(".py") else f"{file}.py")
    if not (file.endswith(".py") or os.sep in file or path.is_file()):
        return ""
    if not path.is_file():
        return f"there is no file {str(path)!r}; a custom agent is named module:name"
    found = [made] if made else agents_in(path)
    parts = module_parts(path)
    folder = ""
    if os.pardir in parts:
        parts, folder = [path.stem], f" in the folder {str(path.resolve().parent)!r}"
    unusable = next((part for part in parts if not part.isidentifier()), None)
    if unusable:
        return (
            f"{unusable!r} is not the name of a module; rename it so that it has only letters, "
            "digits and underscores, and name the agent module:name"
        )
    module = ".".join(parts)
    if len(found) == 1:
        return f"write {f'{module}:{found[0]}'!r}{folder}"
    which = f", where NAME is one of {', '.join(found[:LISTED])}" if found else ""
    return f"write '{module}:NAME'{folder}{which}"


def module_parts(path: Path) -> list[str]:
    """Return the parts of the name of a file's module, as it is imported from this folder."""
    return os.path.relpath(path).removesuffix(".py").split(os.sep)


def agents_in(path: Path) -> list[str]:
    """Return the names in a file that look like agents, without importing it.

    These are classes that act or train, and functions of one argument `rng` that create an agent
    (which a NamedTuple needs). A class that another of these is derived from is left out.
    """
    try:
        body = ast.parse(path.read_text(encoding="utf-8")).body
    except (OSError, ValueError, SyntaxError):
        return []
    classes = [node for node in body if isinstance(node, ast.ClassDef)]
    bases = {node.name: {ast.unparse(base) for base in node.bases} for node in classes}
    derived_from = set().union(*bases.values())
    acting = [node.name for node in classes if _methods(node) & {"act", "train"}]
    made = [
        node.name
        for node in body
        if isinstance(node, ast.FunctionDef) and [a.arg for a in node.args.args] == ["rng"]
    ]
    tuples = {"NamedTuple", "typing.NamedTuple"}
    return [name for name in acting if not bases[name] & tuples and name not in derived_from] + made


def _methods(node: ast.ClassDef) -> set[str]:
    return {part.name for part in node.body if isinstance(part, ast.FunctionDef)}


def _split(name: str) -> tuple[str, str]:
    """Return the file and what follows its colon, if anything; a drive's colon is not one."""
    name = name.replace("\\", "/").replace("/", os.sep)
    file, colon, made = name.rpartition(":")
    if not colon or os.sep in made or made.endswith(".py"):
        return name, ""
    return file, made
