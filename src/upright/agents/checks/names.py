"""Advise how to name a custom agent whose file was named instead: `mine.py:Pd` is `mine:Pd`."""

import ast
from pathlib import Path

from upright.support import code_names


def advice(name: str) -> str:
    """Return what to write in place of a name that looks like the file of a custom agent.

    Returns
    -------
    str
        The advice, such as "write 'mine:Pd'"; empty if the name looks like no file.
    """
    return code_names.advice(name, "agent", agents_in)


def agents_in(path: Path) -> list[str]:
    """Return the names in a file that look like agents, without importing it.

    These are classes that act or train, and functions of one argument `rng` that create an agent
    (which a NamedTuple needs). A class that another of these is derived from is left out.
    """
    body = code_names.statements(path) or []
    classes = [node for node in body if isinstance(node, ast.ClassDef)]
    bases = {node.name: {_name(base) for base in node.bases} for node in classes}
    derived_from = set().union(*bases.values())
    acting = [node.name for node in classes if _methods(node) & {"act", "train"}]
    made = [
        node.name
        for node in body
        if isinstance(node, ast.FunctionDef) and [a.arg for a in node.args.args] == ["rng"]
    ]
    tuples = {"NamedTuple", "typing.NamedTuple"}
    return [name for name in acting if not bases[name] & tuples and name not in derived_from] + made


def _name(base: ast.expr) -> str:
    """Return the dotted name of a class that another is derived from; empty if it has none."""
    if isinstance(base, ast.Attribute):
        return f"{_name(base.value)}.{base.attr}"
    return base.id if isinstance(base, ast.Name) else ""


def _methods(node: ast.ClassDef) -> set[str]:
    return {part.name for part in node.body if isinstance(part, ast.FunctionDef)}
