"""Imports go one way: a package imports only what stands to its left."""

import ast
from pathlib import Path

import pytest

from upright.support.files import PACKAGE

DIRECTION = """
errors < support < core < agents, plants, pictures < policies, environments < studies
< reports, builds < live, nodes < commands
"""
FLOORS = [set(floor.split(", ")) for floor in " ".join(DIRECTION.split()).split(" < ")]
FLOOR_OF = {room: number for number, floor in enumerate(FLOORS) for room in floor}
DOORS = {"__init__", "__main__"}
"""Files that open the whole house, and what they hold: the version."""

WRITTEN_FOR_USERS = "agents/starters/my_*.py"
"""What `upright new` writes, which uses the package as users do."""


def room_of(module):
    """Return the room of a dotted name in the package: its second part."""
    return module.split(".")[1] if "." in module else None


def imported(path):
    """Give line and dotted name of everything in the package that a file imports, anywhere."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: a relative import"
            whole = node.module == "upright"
            names = [f"upright.{a.name}" for a in node.names] if whole else [node.module]
        else:
            continue
        yield from ((node.lineno, name) for name in names if name.split(".")[0] == "upright")


def wrong_imports(package):
    """Return a line for every import against the direction."""
    wrong = []
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package).with_suffix("").parts
        room = parts[0]
        if room in DOORS or path.relative_to(package).match(WRITTEN_FOR_USERS):
            continue
        for line, name in imported(path):
            other = room_of(name)
            if other == "__version__" or other == room:
                continue
            if other not in FLOOR_OF or FLOOR_OF[other] >= FLOOR_OF[room]:
                wrong.append(f"{path.relative_to(package)}:{line}: {room} imports {name}")
    return wrong


def test_every_room_has_its_place():
    rooms = {path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or path.is_dir()}
    assert rooms - DOORS - {"__pycache__", "py"} == set(FLOOR_OF)


def test_imports_go_one_way():
    assert wrong_imports(PACKAGE) == []


def test_no_two_modules_import_each_other():
    uses = {}
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        if module != "upright":
            uses[module] = modules_used(path) - {module}

    def reached_from(module):
        found, waiting = set(), [module]
        while waiting:
            for name in uses.get(waiting.pop(), ()):
                if name not in found:
                    found.add(name)
                    waiting.append(name)
        return found

    assert [module for module in uses if module in reached_from(module)] == []


def modules_used(path):
    """Return the modules of the package that a file imports, in full."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                below = f"{node.module}.{alias.name}"
                file = PACKAGE.parent.joinpath(*below.split("."))
                is_module = file.with_suffix(".py").exists() or (file / "__init__.py").exists()
                found.add(below if is_module else node.module)
    return {name for name in found if name.startswith("upright.")}


@pytest.mark.parametrize(
    "line",
    [
        "from upright.commands import show",
        "def late():\n    import upright.studies.store",
        "if TYPE_CHECKING:\n    from upright.agents import AGENTS",
        "from upright import plants",
    ],
)
def test_an_import_against_the_direction_is_named_with_its_line(tmp_path, line):
    (tmp_path / "core").mkdir()
    (tmp_path / "core" / "wrong.py").write_text(f'"""Wrong."""\n{line}\n')
    (told,) = wrong_imports(Path(tmp_path))
    number = 2 + line.count("\n")
    assert told.startswith(f"core/wrong.py:{number}: core imports upright.")
