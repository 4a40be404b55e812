import shutil
from pathlib import Path

import pytest

from upright.agents import AGENTS
from upright.plants import PLANTS
from upright.studies import fingerprint as fingerprints
from upright.studies.fingerprint import determining_files, fingerprint, import_closure
from upright.support.files import PACKAGE, digest

AGENT = "agents/ase_ace.py"


@pytest.fixture
def package(tmp_path):
    """Return a copy of the package that may be edited."""
    unwanted = shutil.ignore_patterns("__pycache__")
    return Path(shutil.copytree(PACKAGE, tmp_path / "upright", ignore=unwanted))


def key_of(package, plant="plants/equations.py"):
    """Return the digest of what runs of an agent on a plant depend on, in a copy."""
    files = determining_files(package / AGENT, package / plant, package=package)
    return digest(sorted(files), package)


@pytest.mark.parametrize(
    "name",
    [
        "core/cartpole.py",
        "core/compiled.py",
        "core/conditions.py",
        "core/contracts.py",
        "core/noise.py",
        "core/parameters.py",
        "core/portable_math.py",
        "core/task.py",
        "core/trials.py",
        "agents/ase_ace.py",
        "agents/parts/boxes.py",
        "plants/equations.py",
        "studies/run.py",
        "studies/random_streams.py",
    ],
)
def test_an_edit_of_a_file_that_determines_runs_changes_their_key(package, name):
    before = key_of(package)
    with (package / name).open("a") as file:
        file.write("# edited\n")
    assert key_of(package) != before


@pytest.mark.parametrize(
    "name",
    [
        "agents/reinforce.py",
        "agents/parts/least_squares.py",
        "plants/mujoco.py",
        "plants/cartpole.urdf",
        "support/files.py",
        "studies/store.py",
        "reports/tables.py",
        "errors.py",
    ],
)
def test_an_edit_of_a_file_that_does_not_keeps_their_key(package, name):
    before = key_of(package)
    with (package / name).open("a") as file:
        file.write("\n")
    assert key_of(package) == before


def test_packages_that_are_installed_beside_it_do_not_count(package):
    """The libraries that it imports lie there, too, where it is installed."""
    before = key_of(package)
    neighbour = package.parent / "numpy"
    neighbour.mkdir()
    (neighbour / "__init__.py").write_text("this is not Python: nobody reads it")
    assert key_of(package) == before


@pytest.mark.parametrize(
    ("plant", "name"),
    [
        ("plants/mujoco.py", "plants/mujoco.py"),
        ("plants/mujoco.py", "plants/urdf.py"),
        ("plants/mujoco.py", "plants/cartpole.urdf"),
        ("plants/gazebo/plant.py", "plants/cartpole.urdf"),
        ("plants/gazebo/plant.py", "plants/gazebo/server.py"),
        ("plants/gazebo/plant.py", "plants/gazebo/plugin/stepper.cc"),
        ("plants/gazebo/plant.py", "plants/gazebo/plugin/cartpole.world"),
        ("plants/ros2/plant.py", "plants/ros2/cart.py"),
    ],
)
def test_the_files_of_a_plant_count_for_runs_on_it(package, plant, name):
    before = key_of(package, plant)
    with (package / name).open("a") as file:
        file.write("\n")
    assert key_of(package, plant) != before


def test_every_agent_and_every_plant_has_a_fingerprint_of_its_own():
    pairs = [(agent, plant) for agent in AGENTS for plant in PLANTS]
    assert len({fingerprint(*pair) for pair in pairs}) == len(pairs)


def test_imports_count_wherever_they_stand(tmp_path):
    texts = {
        "start.py": "import upper\ndef f():\n    from package import inner\n    open('data.csv')\n",
        "upper.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import typed\n",
        "typed.py": "",
        "package/__init__.py": "",
        "package/inner.py": "from . import neighbour\nfrom .last import name\n",
        "package/neighbour.py": "import math, start\n",
        "package/last.py": "",
        "data.csv": "1,2",
        "other.py": "",
        "other.csv": "3",
    }
    (tmp_path / "package").mkdir()
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    found = import_closure([tmp_path / "start.py"], [tmp_path], tmp_path)
    names = {str(path.relative_to(tmp_path)) for path in found}
    assert names == texts.keys() - {"other.py", "other.csv"}


def test_the_parts_of_the_package_that_a_custom_agent_imports_count(tmp_path):
    text = (
        "from upright.agents.parts import boxes\nfrom upright import compiled\nimport neighbour\n"
    )
    (tmp_path / "mine.py").write_text(text)
    (tmp_path / "neighbour.py").write_text("import upright.agents.parts.least_squares\n")
    root, files = fingerprints.outside_files("mine", tmp_path / "mine.py")
    assert (root, {path.name for path in files}) == (tmp_path, {"mine.py", "neighbour.py"})
    used = fingerprints._used_of_this_package(files)
    names = {path.relative_to(PACKAGE).as_posix() for path in used}
    assert {"agents/parts/boxes.py", "agents/parts/least_squares.py"} <= names
    assert "__init__.py" not in names
