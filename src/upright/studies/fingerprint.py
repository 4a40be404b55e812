"""Computes a digest of all the code that determines a run.

The files are found, not listed: all of `core/`, the modules here that make a run, and the modules
of the agent and the plant with everything that they import, including data files that they name. An
edit of any of them changes the key of runs, so a store never mixes results of two versions of a
rule. For code that a script or a notebook defines, definitions.py finds what it uses.
"""

import ast
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from upright.agents import AGENTS, is_custom
from upright.errors import UprightError
from upright.plants import PLANTS
from upright.studies.definitions import digest_of, is_in_main
from upright.support.custom_code import CustomCode
from upright.support.files import INSTALLED, PACKAGE, digest
from upright.support.registry import Registry

RUNNING = ("studies/run.py", "studies/random_streams.py")
"""Modules that make a run, besides core/."""
GYMNASIUM = "environments/trial_protocol.py"
"""Module that runs a learner that only knows Gymnasium."""
WITHOUT_EFFECT = ("errors.py", "support", "pictures")
"""Parts of the package that imported modules may use, but that no result depends on."""


_known: dict[tuple[str, str], tuple[object, str]] = {}
"""Fingerprints of agents on plants, each with the classes or functions it was computed for."""


def fingerprint(agent: str, plant: str) -> str:
    """Return a digest of the code that determines a run of this agent on this plant.

    It is that of the files when agent and plant were imported: later edits change it only once
    their modules are imported again. Code in a script or a notebook may change at any time.

    Parameters
    ----------
    agent
        Name of an agent, or `module:name` of a custom one.
    plant
        Name of a plant, or `module:name` of a custom one.
    """
    if is_in_main(agent) or is_in_main(plant):
        return _fingerprint(agent, plant)
    things = ((AGENTS, agent), (PLANTS, plant))
    make = [_code(registry, name).find() for registry, name in things if registry.is_path(name)]
    known = _known.get((agent, plant))
    if known is None or known[0] != make:
        known = _known[agent, plant] = make, _fingerprint(agent, plant)
    return known[1]


def _fingerprint(agent: str, plant: str) -> str:
    ours: list[Path] = []
    others: list[str] = []
    for registry, name in ((AGENTS, agent), (PLANTS, plant)):
        if name in registry.built_in:
            ours.append(_file_of(registry[name]))
            continue
        if is_in_main(name):
            code, used = digest_of(_code(registry, name).find())
            others.append(code)
            ours += [file for _, file in _sources(used) if file.is_relative_to(PACKAGE)]
        for root, files in _outside(registry, name):
            others.append(digest(sorted(files), root))
            ours += _used_of_this_package(files)
    if is_custom(agent):
        ours.append(PACKAGE / GYMNASIUM)
    return "-".join([digest(sorted(determining_files(*ours)), PACKAGE), *others])


def _outside(registry: Registry[Any], name: str) -> list[tuple[Path, set[Path]]]:
    """Return the root and the files of each module that defines an agent or a plant not ours."""
    if not is_in_main(name):
        return [outside_files(*_source(registry, name))]
    _, used = digest_of(_code(registry, name).find())
    return [outside_files(*source) for source in _sources(used) if _is_own(*source)]


def custom_files(agent: str, plant: str) -> dict[Path, set[Path]]:
    """Return the files of a custom agent and a custom plant, by the folder they are imported from.

    They are those that `fingerprint` covers, and the `__init__.py` of their packages with all that
    these import: what another machine needs to import the agent and the plant.
    """
    found: dict[Path, set[Path]] = {}
    for registry, name in ((AGENTS, agent), (PLANTS, plant)):
        for root, files in _outside(registry, name) if registry.is_path(name) else ():
            folders = {folder for file in files for folder in file.relative_to(root).parents}
            packages = {root / folder / "__init__.py" for folder in folders - {Path()}}
            within = import_closure(filter(Path.is_file, packages), [root], root)
            found.setdefault(root, set()).update(files, within)
    return found


def _code(registry: Registry[Any], name: str) -> CustomCode:
    """Return the class or function at a path `module:name`."""
    code: CustomCode = registry.default(name).code
    return code


def _file_of(module: str) -> Path:
    return PACKAGE.parent.joinpath(*module.split(".")).with_suffix(".py")


def _sources(modules: Iterable[str]) -> list[tuple[str, Path]]:
    """Return those of some modules that have a file, with it; not this package's public face."""
    found = []
    for module in sorted(modules):
        with suppress(ImportError, ValueError):  # it is missing, or was made by a program
            spec = find_spec(module)
            if spec and spec.has_location and spec.origin and module != "upright":
                found.append((module, Path(spec.origin)))
    return found


def _is_own(module: str, file: Path) -> bool:
    """Whether a module is neither Python's, nor of an installed package, nor of this one."""
    elsewhere = {*file.parts} & {*INSTALLED} or file.is_relative_to(PACKAGE)
    return module.partition(".")[0] not in sys.stdlib_module_names and not elsewhere


def _source(registry: Registry[Any], name: str) -> tuple[str, Path]:
    """Return the module of a thing that is not of this package, and the file of the module."""
    if registry.is_path(name):
        return name.partition(":")[0], _code(registry, name).source()
    file = registry.module(name).__file__
    if file is None:
        raise UprightError(f"{registry.kind} is {name!r}; its module has no file")
    return registry[name], Path(file)


def determining_files(*modules: Path, package: Path = PACKAGE) -> set[Path]:
    """Return all files of the package that determine runs which use these modules."""
    always = {*(package / "core").rglob("*.py"), *(package / name for name in RUNNING)}
    ignored = [package / name for name in WITHOUT_EFFECT]
    imported = import_closure(modules, [package.parent], package)
    return always | {p for p in imported if not any(p.is_relative_to(part) for part in ignored)}


def outside_files(module: str, file: Path) -> tuple[Path, set[Path]]:
    """Return the root and the files of a module outside this package and of its own it imports."""
    depth = module.count(".") + (file.name == "__init__.py")
    root = file.parents[depth]
    own = root / module.partition(".")[0] if root.name in INSTALLED else root
    return root, import_closure([file], [root], own) | {file}


def _used_of_this_package(files: Iterable[Path]) -> list[Path]:
    """Return the modules of this package that other files import, its public face excepted."""
    scripts = [path for path in files if path.suffix == ".py"]
    used = {module for path in scripts for module in _used_by(path, [PACKAGE.parent])}
    face = PACKAGE / "__init__.py"
    return [path for path in used if path.is_relative_to(PACKAGE) and path != face]


def import_closure(modules: Iterable[Path], roots: Iterable[Path], within: Path) -> set[Path]:
    """Return the files of modules, of all they import, and of data they name.

    All imports count: at the top, in functions, and for type checkers only. Modules are looked up
    below the roots, and included if they are within one folder, because an installed package also
    imports other packages beside it.

    Parameters
    ----------
    modules
        The files to start from.
    roots
        Folders that absolute imports are relative to.
    within
        Folder that all files are in, except those to start from.
    """
    roots = list(roots)
    closure: set[Path] = set()
    waiting = list(modules)
    while waiting:
        path = waiting.pop()
        if path not in closure:
            closure.add(path)
            if path.suffix == ".py":
                waiting += (used for used in _used_by(path, roots) if used.is_relative_to(within))
    return closure


def _used_by(path: Path, roots: list[Path]) -> Iterator[Path]:
    """Yield the files that one module imports or names."""
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from _data(path.parent, node.value)
        for base, name in _imported(node, path):
            for root in [base] if base else roots:
                place = root.joinpath(*name.split("."))
                for file in (place.with_suffix(".py"), place / "__init__.py"):
                    if file.is_file():
                        yield file


def _imported(node: ast.AST, path: Path) -> Iterator[tuple[Path | None, str]]:
    """Yield the dotted names that a statement may import, relative ones with their folder."""
    if isinstance(node, ast.Import):
        yield from ((None, alias.name) for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        base = path.parents[node.level - 1] if node.level else None
        module = node.module or ""
        if module:
            yield base, module
        yield from ((base, f"{module}.{alias.name}".lstrip(".")) for alias in node.names)


def _data(folder: Path, name: str) -> list[Path]:
    """Return the data files beside a module that a string in it names: a file or a folder."""
    if not name.replace(".", "").replace("_", "").replace("-", "").isalnum():
        return []
    place = folder / name
    if place.is_dir():
        files = [path for path in place.rglob("*") if path.is_file()]
        return [] if any(path.suffix == ".py" for path in files) else files
    return [place] if place.is_file() and place.suffix != ".py" else []
