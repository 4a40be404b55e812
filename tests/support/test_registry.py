"""Registries by themselves, what every registered thing has, and a package that adds to them."""

import os
import subprocess
import sys
from dataclasses import dataclass, fields
from importlib.util import find_spec
from typing import Any, ClassVar

import pytest

from upright.agents import AGENTS
from upright.errors import UprightError
from upright.nodes.settings import LearnerSettings, SimulatorSettings
from upright.plants import PLANTS
from upright.support.registry import Registry
from upright.support.settings import describe_settings, values_of

CIRCLE = '''\
"""A circle.

What follows is not part of the summary.
"""

from dataclasses import dataclass
from typing import ClassVar

from upright.errors import require


@dataclass(frozen=True)
class Circle:
    radius: float = 1.0
    """How large it is [m]."""
    name: str = "round"

    RENAMED: ClassVar = {"size": "radius"}

    def __post_init__(self):
        require("radius", self.radius, 0)


SETTINGS = {"default": Circle(), "large": Circle(5.0)}
'''


@dataclass(frozen=True)
class CustomShape:
    """The settings of a shape that is not registered."""

    path: str

    def summary(self):
        return f"the shape {self.path}"


@pytest.fixture
def shapes(tmp_path, monkeypatch):
    """Return a registry of which one module exists; nothing of it is imported yet."""
    (tmp_path / "circle_of_tests.py").write_text(CIRCLE)
    monkeypatch.syspath_prepend(tmp_path)
    yield Registry(
        "shape",
        {"circle": "circle_of_tests", "square": "absent_square"},
        group="tests.shapes",
        custom=CustomShape,
    )
    sys.modules.pop("circle_of_tests", None)


def register(folder, *points):
    """Have a package of these modules installed in a folder, as installers write it there."""
    info = folder / "theirs-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("\n".join(["[tests.shapes]", *points, ""]))


# ------------------------------------------------------------------------------ by itself


def test_modules_are_imported_when_first_used(shapes):
    assert list(shapes) == ["circle", "square"]
    assert (len(shapes), "circle" in shapes, "line" in shapes) == (2, True, False)
    assert shapes["circle"] == "circle_of_tests"
    shapes.check("circle")
    assert "circle_of_tests" not in sys.modules
    assert shapes.default("circle") is shapes.settings("circle")["default"]
    assert "circle_of_tests" in sys.modules


def test_looking_for_agents_and_plants_imports_none_of_them():
    code = """
import sys
from upright.agents import AGENTS
from upright.plants import PLANTS
AGENTS.check("reinforce"), PLANTS.check("gazebo"), list(AGENTS), list(PLANTS)
modules = [*AGENTS.built_in.values(), *PLANTS.built_in.values(), "numba", "numpy"]
print([name for name in modules if name in sys.modules])
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ended.stdout == "[]\n", ended.stderr


def test_settings_have_labels(shapes):
    assert list(shapes.settings("circle")) == ["default", "large"]
    assert shapes.settings("circle")["large"].radius == 5.0
    assert shapes.default("circle").radius == 1.0


def test_a_summary_is_the_first_line(shapes):
    assert shapes.summary("circle") == "A circle."


@pytest.mark.parametrize("method", ["check", "module", "settings", "default", "summary"])
def test_unknown_names_are_refused_with_the_known_ones(shapes, method):
    with pytest.raises(UprightError) as error:
        getattr(shapes, method)("line")
    known = "circle, square, module:name"
    assert str(error.value) == f"shape is 'line'; it must be one of {known}"
    with pytest.raises(UprightError, match=r"it must be one of circle$"):
        getattr(Registry("shape", {"circle": "circle_of_tests"}), method)("elsewhere:Line")


def test_settings_are_restored_from_data(shapes):
    large = shapes.settings("circle")["large"]
    assert shapes.restore("circle", values_of(large)) == large
    assert shapes.restore("circle", {"size": 5, "name": "round"}) == large  # its former name
    for values, message in (
        ({"radius": 5.0}, "'radius' are not those of circle"),
        ({"radius": 5.0, "name": "round", "colour": 1}, "'colour' are not those of circle"),
        ({"radius": 5.0, "size": 5.0, "name": "round"}, "'size'.* are not those of circle"),
        ({"radius": "5", "name": "round"}, "radius is '5'; it must be like 1.0"),
        ({"radius": -1.0, "name": "round"}, "radius is -1.0; it must be a number, at least 0"),
    ):
        with pytest.raises(UprightError, match=message):
            shapes.restore("circle", values)
    with pytest.raises(UprightError, match="shape is 'line'"):
        shapes.restore("line", {})


def test_custom_things_are_named_by_module_and_name(shapes):
    name = "elsewhere:Line"
    assert shapes.is_path(name)
    assert not shapes.is_path("circle")
    shapes.check(name)
    assert name not in shapes
    assert shapes.settings(name) == {"default": CustomShape(name)}
    assert shapes.default(name) == CustomShape(name)
    assert shapes.summary(name) == "the shape elsewhere:Line"
    assert shapes.restore(name, {"path": name}) == CustomShape(name)
    with pytest.raises(UprightError, match=r"'other:Line'.*are not those of 'elsewhere:Line'"):
        shapes.restore(name, {"path": "other:Line"})


def test_where_nothing_is_custom_a_path_is_an_unknown_name():
    shapes = Registry("shape", {"circle": "shapes.circle"})
    assert not shapes.is_path("elsewhere:Shape")
    with pytest.raises(UprightError, match=r"shape is 'elsewhere:Shape'; it must be one of circle"):
        shapes.check("elsewhere:Shape")


def test_installed_packages_add_to_it_and_replace_nothing(shapes, tmp_path):
    register(
        tmp_path, "triangle = triangle_of_tests", "circle = triangle_of_tests", "bar = absent_bar"
    )
    (tmp_path / "triangle_of_tests.py").write_text('"""A triangle."""\nSETTINGS = {"default": 3}\n')
    assert list(shapes) == ["circle", "square", "bar", "triangle"]
    assert shapes["circle"] == "circle_of_tests"
    assert list(shapes.built_in) == ["circle", "square"]
    assert shapes.summary("triangle") == "A triangle."
    assert list(Registry("shape", dict(shapes.built_in))) == ["circle", "square"]
    with pytest.raises(UprightError, match=r"shape is 'line'; it must be one of .*bar, triangle, "):
        shapes.check("line")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "its module 'faulty_of_tests' cannot be imported: No module named"),
        ("import absent_library", "cannot be imported: No module named 'absent_library'"),
        ("no Python", "cannot be imported: invalid syntax"),
        ("1 / 0", "cannot be imported: ZeroDivisionError: division by zero"),
        ("raise KeyError('a\\nb')", "cannot be imported: KeyError: "),
        ("raise ValueError('a\\nb')", "cannot be imported: ValueError: a b"),
        ('"""Nothing to set."""', "SETTINGS of its module 'faulty_of_tests' has no 'default'"),
        ("SETTINGS = {'large': 1}", "SETTINGS of its module 'faulty_of_tests' has no 'default'"),
    ],
)
def test_a_faulty_module_of_an_installed_package_is_named(shapes, tmp_path, text, message):
    register(tmp_path, "faulty = faulty_of_tests")
    if text is not None:
        (tmp_path / "faulty_of_tests.py").write_text(text)
    try:
        with pytest.raises(UprightError, match=r"^shape is 'faulty'; ") as error:
            shapes.default("faulty")
        assert message in str(error.value)
    finally:
        sys.modules.pop("faulty_of_tests", None)


# ------------------------------------------------------------------------------ all that there is


def settings_classes():
    """Return the class of every settings that there are, by what they are settings of."""
    classes = {"simulator": SimulatorSettings, "learner": LearnerSettings}
    registries: tuple[Registry[Any], ...] = (AGENTS, PLANTS)
    for registry in registries:
        for name in registry:
            for label, settings in registry.settings(name).items():
                classes[f"{registry.kind} {name}, {label}"] = type(settings)
    return classes


@pytest.mark.parametrize("kind", settings_classes().values(), ids=list(settings_classes()))
def test_a_sentence_stands_under_every_setting(kind):
    sentences = describe_settings(kind)
    assert list(sentences) == [field.name for field in fields(kind)]
    assert all(sentence.endswith(".") for sentence in sentences.values())


def test_a_setting_without_a_sentence_is_noticed():
    assert describe_settings(Silent) == {"told": "What it is."}


@dataclass(frozen=True)
class Silent:
    """Settings that do not say all."""

    silent: int = 0
    told: int = 1
    """What it is."""
    last: int = 2

    name: ClassVar[str] = "silent"


@pytest.mark.parametrize("registry", [AGENTS, PLANTS], ids=lambda registry: registry.kind)
def test_everything_registered_has_a_summary_and_default_settings(registry):
    for name in registry:
        assert registry.summary(name).endswith(".")
        assert registry.default(name) is registry.settings(name)["default"]


# ------------------------------------------------------------------------------ a package

PROJECT = """\
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"

[project]
name = "their-pendulum"
version = "1.0"

[project.entry-points."upright.agents"]
their-agent = "their_pendulum.guess"
plain-agent = "their_pendulum.plain"
reinforce = "their_pendulum.guess"

[project.entry-points."upright.plants"]
their-plant = "their_pendulum.moon"

[tool.hatch.build.targets.wheel]
packages = ["their_pendulum"]
"""
GUESS = '''\
"""Guess a linear policy in every trial."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

import upright
from their_pendulum.weights import SIZE
from upright.errors import require


class Guess(NamedTuple):
    """A policy that is forgotten as soon as it falls."""

    weights: np.ndarray
    spread: float

    @upright.compiled
    def begin_trial(self, rng):
        for i in range(SIZE):
            self.weights[i] = self.spread * rng.standard_normal()

    @upright.compiled
    def push_probability(self, observation):
        total = 0.0
        for i in range(SIZE):
            total += self.weights[i] * observation[i]
        return 1.0 if total > 0.0 else 0.0

    @upright.compiled
    def act(self, observation, rng):
        return self.push_probability(observation) > 0.5

    @upright.compiled
    def learn(self, before, action, after, fallen):
        pass

    @upright.compiled
    def end_trial(self, fallen):
        pass


@dataclass(frozen=True)
class GuessSettings:
    """Settings of the guesses."""

    spread: float = 1.0
    """Standard deviation of the weights."""

    def __post_init__(self):
        require("spread", self.spread, 0, above=True)

    def agent(self, rng):
        return Guess(np.zeros(SIZE), self.spread)


SETTINGS = {"default": GuessSettings()}
'''
PLAIN = '''\
"""Push at random."""

from dataclasses import dataclass


class Plain:
    def begin_trial(self, rng):
        pass

    def act(self, observation, rng):
        return rng.random() < 0.5

    def learn(self, before, action, after, fallen):
        pass

    def end_trial(self, fallen):
        pass


@dataclass(frozen=True)
class PlainSettings:
    """There is nothing to set."""

    def agent(self, rng):
        return Plain()


SETTINGS = {"default": PlainSettings()}
'''
MOON = '''\
"""The cart-pole on the moon."""

from dataclasses import dataclass
from typing import ClassVar

from upright.errors import require
from upright.plants.equations import equations


@dataclass(frozen=True)
class Moon:
    """Settings of the moon."""

    gravity: float = 1.62
    """Acceleration due to gravity [m/s^2]."""

    name: ClassVar[str] = "their-plant"
    alone: ClassVar[bool] = False

    def __post_init__(self):
        require("gravity", self.gravity, 0)

    def make(self, context):
        return equations(context.task.parameters._replace(gravity=self.gravity)), context.task

    def version(self):
        return ""


SETTINGS = {"default": Moon()}
'''
FILES = {
    "pyproject.toml": PROJECT,
    "their_pendulum/__init__.py": "",
    "their_pendulum/guess.py": GUESS,
    "their_pendulum/plain.py": PLAIN,
    "their_pendulum/moon.py": MOON,
    "their_pendulum/weights.py": "SIZE = 4\n",
    "their_pendulum/unused.py": "",
}
KEYS = """
from upright.plants import PLANTS
from upright.studies.case import make_case
moon = PLANTS.default("their-plant")
for agent, plant in (("their-agent", moon), ("random-search", moon), ("their-agent", None)):
    print(make_case(agent, steps=100, **({"plant": plant} if plant else {})).key)
"""


class Installed:
    """A package that is built and installed in a folder of its own, and an empty one to work in."""

    def __init__(self, place):
        self.work, self.target = place / "work", place / "site-packages"
        self.work.mkdir()
        for name, text in FILES.items():
            file = place / "source" / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)
        how = ("--quiet", "--no-deps", "--no-index", "--no-build-isolation", "--target")
        command = [sys.executable, "-m", "pip", "install", *how, self.target, place / "source"]
        ended = subprocess.run(command, capture_output=True, text=True)
        assert ended.returncode == 0, ended.stdout + ended.stderr

    def python(self, *words):
        """Return what Python prints that finds the package."""
        path = os.pathsep.join([str(self.target), *filter(None, sys.path)])
        return subprocess.run(
            [sys.executable, *words],
            cwd=self.work,
            env=os.environ | {"PYTHONPATH": path},
            capture_output=True,
            text=True,
            timeout=300,
        )

    def upright(self, line, status=0):
        ended = self.python("-m", "upright", *line.split())
        assert ended.returncode == status, ended.stdout + ended.stderr
        return ended.stdout

    def keys(self):
        ended = self.python("-c", KEYS)
        assert ended.returncode == 0, ended.stderr
        return ended.stdout.splitlines()

    def append(self, name, text="# edited\n"):
        with (self.target / "their_pendulum" / name).open("a") as file:
            file.write(text)


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    if not find_spec("hatchling"):
        pytest.skip("hatchling is not installed: no package is built")
    return Installed(tmp_path_factory.mktemp("theirs"))


@pytest.mark.slow
def test_things_of_an_installed_package_are_listed_with_their_settings(installed):
    listed = installed.upright("agents").splitlines()
    assert [line.partition(":")[0] for line in listed] == [
        *AGENTS.built_in,
        "plain-agent",
        "their-agent",
    ]
    assert listed[-1] == "their-agent: Guess a linear policy in every trial."
    assert "spread" in (told := installed.upright("agents their-agent"))
    assert "Standard deviation of the weights." in told
    assert "their-plant: The cart-pole on the moon." in installed.upright("plants")
    assert "Acceleration due to gravity" in installed.upright("plants their-plant")


@pytest.mark.slow
def test_an_installed_agent_learns_on_an_installed_plant(installed):
    line = "learn their-agent --plant their-plant --steps 100 --trials 30 --seed 3"
    line += " --set spread=2 --plant-set gravity=1.5 --save policy.npz"
    assert "balanced at trial" in installed.upright(line)
    shown = installed.upright("show policy.npz")
    assert '"plant": {"name": "their-plant", "gravity": 1.5}' in shown
    installed.upright("play policy.npz --steps 2 --episodes 2")
    refused = installed.python("-m", "upright", *line.replace("spread=2", "spread=0").split())
    assert "spread is 0.0; it must be a number, above 0" in refused.stderr


@pytest.mark.slow
def test_runs_of_an_installed_agent_are_stored_and_shown(installed):
    line = "table --agents their-agent,random-search,plain-agent --noises none --runs 2"
    line += " --steps 100 --plant their-plant --store runs.sqlite --format markdown"
    made = installed.upright(line)
    again = installed.upright("show runs.sqlite --format markdown")
    for agent in ("their-agent", "random-search", "plain-agent"):
        assert f"{agent} (their-plant)" in made
        assert f"{agent} (their-plant)" in again
    assert installed.upright(line) == made


@pytest.mark.slow
def test_code_outside_the_package_has_a_loop_of_its_own_that_is_not_kept(installed):
    ended = installed.python(
        "-c",
        """
from helpers import make_context
from upright.core.loops import compiled_run, custom_run
from upright.core.trials import run
from upright.plants import PLANTS
from upright.plants.equations import EQUATIONS
from upright.studies.case import make_case
from upright.studies.run import choose_loop, make_run
moon = PLANTS.default("their-plant")
for agent in ("their-agent", "random-search", "plain-agent"):
    for plant in (EQUATIONS, moon):
        case = make_case(agent, steps=50, trials=3, plant=plant)
        memory, _ = make_run(case, 0, 0)
        body, _ = plant.make(make_context(spec=case.spec))
        loop = choose_loop(case, memory, body)
        own = custom_run(type(memory), type(body))
        kind = {id(compiled_run): "kept", id(run): "plain", id(own): "own"}[id(loop)]
        print(case.agent, plant.name, kind)
""",
    )
    assert ended.stdout.splitlines() == [
        "their-agent equations own",
        "their-agent their-plant own",
        "random-search equations kept",
        "random-search their-plant own",
        "plain-agent equations plain",
        "plain-agent their-plant plain",
    ], ended.stderr


@pytest.mark.slow
def test_an_edit_of_an_installed_module_changes_the_key_of_its_runs(installed):
    both, on_their_plant, by_their_agent = installed.keys()
    assert installed.keys() == [both, on_their_plant, by_their_agent]
    installed.append("unused.py")
    assert installed.keys() == [both, on_their_plant, by_their_agent]
    installed.append("weights.py")  # which the agent imports
    first = installed.keys()
    assert first[0] != both
    assert first[1] == on_their_plant
    assert first[2] != by_their_agent
    installed.append("moon.py")
    second = installed.keys()
    assert second[0] != first[0]
    assert second[1] != first[1]
    assert second[2] == first[2]
    installed.append("guess.py")
    third = installed.keys()
    assert third[0] != second[0]
    assert third[1] == second[1]
    assert third[2] != second[2]
