"""The package as users install it: built, put into an empty environment, used from there.

The environment borrows libraries from the one that runs the tests, so that nothing is downloaded,
but the package in it is the wheel, and no checkout is on its path.
"""

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
from helpers import ROOT

import upright
from upright.plants.urdf import text

NO_SOURCES = (
    "matlab/+upright/+internal/q_learning_mex.mex",
    "matlab/+upright/+internal/q_learning_mex.mexa64",
    "matlab/octave-workspace",
    "src/upright/core/__pycache__/task.cpython-311.pyc",
    ".ci/own",
)
"""What is made in the folder by its use, or is for its maintainers alone."""
KINDS = {"sdist": "*.tar.gz", "wheel": "*.whl"}

pytestmark = pytest.mark.slow


def build(source, kind, folder):
    """Build a package with the libraries that are here, and return its file."""
    words = f"-m build --no-isolation --{kind} --outdir".split()
    ended = subprocess.run(
        [sys.executable, *words, folder, source], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    (built,) = folder.glob(KINDS[kind])
    return built


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("package")


@pytest.fixture(scope="module")
def tree(place):
    """The sources, with files among them that must not be shipped."""
    caches = shutil.ignore_patterns(".git", ".venv", ".*_cache", "__pycache__", "results", "dist")
    tree = place / "tree"
    shutil.copytree(ROOT, tree, ignore=caches)
    for name in NO_SOURCES:
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        (tree / name).write_bytes(b"no source")
    return tree


@pytest.fixture(scope="module")
def sdist(place, tree):
    return build(tree, "sdist", place / "sdist")


@pytest.fixture(scope="module")
def wheel(place, tree):
    return build(tree, "wheel", place / "wheel")


class Installed:
    """An environment with the wheel in it, and an empty folder to work in."""

    def __init__(self, place, wheel):
        self.python = place / "environment" / "bin" / "python"
        self.work, self.cache = place / "work", place / "cache"
        self.work.mkdir()
        subprocess.run(
            [sys.executable, "-m", "venv", "--without-pip", place / "environment"], check=True
        )
        words = ["install", "--quiet", "--no-deps", "--no-index"]
        subprocess.run(
            [sys.executable, "-m", "pip", "--python", self.python, *words, wheel], check=True
        )
        (self.packages,) = (place / "environment").glob("lib/python*/site-packages")
        for folder in map(Path, sys.path):
            if folder.name in ("site-packages", "dist-packages"):
                self.borrow(folder)

    def borrow(self, folder):
        """Have all packages of a folder beside the wheel, but this one."""
        for path in folder.iterdir():
            place = self.packages / path.name
            if not path.name.lstrip("_").startswith("upright") and not place.exists():
                place.symlink_to(path)

    def run(self, *command):
        outside = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        return subprocess.run(
            command,
            cwd=self.work,
            env=outside | {"XDG_CACHE_HOME": str(self.cache)},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )

    def upright(self, line):
        ended = self.run(self.python.with_name("upright"), *line.split())
        assert ended.returncode == 0, ended.stderr
        return ended.stdout

    def evaluate(self, code):
        ended = self.run(self.python, "-c", code)
        assert ended.returncode == 0, ended.stderr
        return ended.stdout.strip()


@pytest.fixture(scope="module")
def installed(place, wheel):
    return Installed(place, wheel)


def test_the_sdist_has_all_that_the_wheel_is_made_of(sdist, wheel, place):
    with tarfile.open(sdist) as archive:
        archive.extractall(place / "unpacked", filter="data")
    (unpacked,) = (place / "unpacked").iterdir()
    for name in (
        "LICENSE",
        "README.md",
        "CHANGELOG.md",
        "CITATION.cff",
        "pyproject.toml",
        "matlab/+upright/step.m",
    ):
        assert (unpacked / name).is_file(), name
    again = build(unpacked, "wheel", place / "again")
    with zipfile.ZipFile(wheel) as ours, zipfile.ZipFile(again) as theirs:
        assert sorted(ours.namelist()) == sorted(theirs.namelist())
        for name in ours.namelist():
            assert ours.read(name) == theirs.read(name), name


def test_nothing_is_shipped_that_is_no_source(sdist, wheel, tree):
    with tarfile.open(sdist) as archive:
        sources = {name.partition("/")[2] for name in archive.getnames()}
    with zipfile.ZipFile(wheel) as archive:
        shipped = set(archive.namelist())
    for name in NO_SOURCES:
        assert name not in sources
        assert not any(each.endswith(f"/{Path(name).name}") for each in shipped)
    rooms = {name.split("/")[1] for name in shipped if name.startswith("upright/")}
    assert rooms == {path.name for path in (tree / "src/upright").iterdir()} | {"matlab_twin"}
    assert {name.partition("/")[0] for name in shipped} == {
        "upright",
        f"upright-{upright.__version__}.dist-info",
    }


def test_the_wheel_has_every_file_of_the_package(wheel, tree):
    with zipfile.ZipFile(wheel) as archive:
        shipped = set(archive.namelist())
    for folder, name in (("src/upright", "upright"), ("matlab", "upright/matlab_twin")):
        files = [path for path in (tree / folder).rglob("*") if path.is_file()]
        expected = {f"{name}/{path.relative_to(tree / folder).as_posix()}" for path in files}
        assert expected - shipped == {
            f"{name}/{Path(each).relative_to(folder).as_posix()}"
            for each in NO_SOURCES
            if each.startswith(folder)
        }


def test_it_is_the_wheel_that_is_used(installed):
    where = Path(installed.evaluate("import upright; print(upright.__file__)"))
    assert where.is_relative_to(installed.packages)


def test_its_version_is_told_everywhere(installed):
    assert installed.upright("--version") == f"upright {upright.__version__}\n"
    ended = installed.run(installed.python, "-m", "upright", "--version")
    assert ended.stdout == f"upright {upright.__version__}\n"
    code = "from importlib.metadata import version; print(version('upright'))"
    assert installed.evaluate(code) == upright.__version__


def test_it_learns(installed):
    told = installed.upright("learn random-search --steps 200")
    assert "balanced at trial" in told


def test_it_makes_a_table(installed):
    line = "table --agents random-search --noises none --runs 3 --steps 200 --store runs.sqlite"
    assert "random-search  none" in installed.upright(line)
    assert "3 runs per case, N = 200 steps" in installed.upright("show runs.sqlite")


def test_it_writes_an_agent_that_passes(installed):
    """So does the compiled one, in tests/commands/test_check.py."""
    installed.upright("new mine.py")
    assert "nothing to mend" in installed.upright("check mine.py")
    assert "mine_too.py: an agent that works" in installed.upright("new mine_too.py --compiled")


def test_the_matlab_twin_comes_with_it(installed):
    folder = Path(installed.upright("matlab path").strip())
    assert folder.is_relative_to(installed.packages)
    for name in ("+upright/q_learning.m", "+upright/+internal/lockstep.m", "mex/cartpole.h"):
        assert (folder / name).read_bytes() == (ROOT / "matlab" / name).read_bytes()


def test_the_urdf_comes_with_it(installed):
    code = "from upright.plants import urdf; print(urdf.ASSET.is_file(), urdf.text())"
    assert installed.evaluate(code) == f"True {text()}"


def test_gazebo_s_world_and_plugin_come_with_it(installed):
    code = """
from pathlib import Path
from upright import Parameters
from upright.plants.gazebo.installation import sources
from upright.plants.gazebo.world import write_world
print(write_world(Path("world"), Parameters(), "dart", 0.001).read_text().count("<plugin"))
print(*sorted(path.name for path in sources().iterdir()))
"""
    count, names = installed.evaluate(code).splitlines()
    assert int(count) == 1
    assert {"CMakeLists.txt", "cartpole.world", "stepper.cc"} <= set(names.split())
    assert (installed.work / "world/models/cartpole/cartpole.urdf").is_file()


USER_PROGRAM = '''
"""A program of a user, of which a strict type checker finds nothing to say."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

import upright
from upright import NOISES, Case, Noise, Parameters, Result, State, compiled


class Guess(NamedTuple):
    weights: np.ndarray

    @compiled
    def begin_trial(self, rng: np.random.Generator) -> None:
        for i in range(4):
            self.weights[i] = 2.0 * rng.random() - 1.0

    @compiled
    def act(self, observation: State, rng: np.random.Generator) -> bool:
        return bool(self.weights[2] * observation.theta > 0.0)


class Plain:
    def __init__(self, rng: np.random.Generator) -> None:
        self.gain = 20.0

    def begin_trial(self, rng: np.random.Generator) -> None: ...

    def act(self, observation: State, rng: np.random.Generator) -> bool:
        return self.gain * observation.theta + 3.0 * observation.theta_dot > 0.0

    def learn(self, before: State, action: bool, after: State, fallen: bool) -> None: ...

    def end_trial(self, fallen: bool) -> None: ...


def trials_of(case: Case, runs: int) -> list[int]:
    results: list[Result] = upright.study([case], runs=runs, seed=0)[case]
    return [result.trials for result in results]


def main() -> None:
    policy, result = upright.learn("random-search", noise="sensor-5", steps=500)
    print(f"balanced: {result.success}, {result.trials + 1} trials with one more")
    upright.save_policy(Path("policy.npz"), policy)
    again: upright.Policy = upright.load_policy("policy.npz")
    print(sum(outcome.steps for outcome in upright.play(again, episodes=3)) / 3)
    upright.export_policy("policy.h", again)

    case = upright.make_case("random-search", "default", steps=300)
    print(trials_of(case, runs=5)[0].bit_length(), case.spec.task().steps)
    with upright.Store("runs.sqlite") as store:
        results = upright.study([case], 5, 0, store)
    row = upright.summarise(case, 0, results[case])
    print(upright.render([row], "text").upper(), row.success_rate)

    compared = upright.compare(["random-search", Plain], "none", runs=2, steps=50, progress=False)
    print(compared, compared.rows[0].mean_trials, compared.frame().shape)
    learned: upright.Learned = upright.learn(Plain, steps=50)
    learned.plot().savefig("curve.png")
    print(learned.result.trials)

    plant = upright.equations(Parameters(half_length=1.0))
    state: State = plant.reset(upright.STARTS["zero"])
    print(plant.step(10.0).theta, state.x, upright.CONDITIONS["delay-1"].delay)

    noise: Noise = NOISES["gaussian-0.1"]
    env = upright.TrialProtocol(upright.CartPoleEnv(noise, render_mode=None), steps=100, trials=2)
    try:
        while True:
            env.reset(seed=1)
            while not env.step(1)[2]:
                pass
    except upright.RunOver:
        print(env.result().lengths.sum())
    envs = upright.CartPoleVectorEnv(4, noise="all-5")
    print(envs.reset(seed=0)[0].shape, sorted(upright.AGENTS), "ros2" in upright.PLANTS)


if __name__ == "__main__":
    try:
        main()
    except upright.UprightError as error:
        print(error)
'''


WRONG_PROGRAM = """\
import upright
upright.learn(3)
upright.learn("reinforce")[0].noise
upright.State(1.0, 2.0)
upright.Pendulum
upright.equations().step("left")
case = upright.make_case("reinforce")
upright.study([case], runs=2)[case][0].trials.lower()
"""


@pytest.fixture(scope="module")
def types_checked(installed):
    """What a strict type checker says of programs that use the installed package, of all at once.

    Nearly all the time goes into what they import.
    """
    programs = {"good.py": USER_PROGRAM, "wrong.py": WRONG_PROGRAM}
    for name, program in programs.items():
        (installed.work / name).write_text(program)
    words = ["-m", "mypy", "--strict", "--config-file=", "--python-executable", installed.python]
    words += ["--cache-dir", os.devnull]
    told = installed.run(sys.executable, *words, *programs).stdout
    assert "(checked 2 source files)" in told
    return told


def test_a_program_of_a_user_passes_a_strict_type_checker(types_checked):
    assert "good.py" not in types_checked
    assert "errors in 1 file " in types_checked


def test_that_program_runs(installed):
    (installed.work / "good.py").write_text(USER_PROGRAM)
    told = installed.run(installed.python, installed.work / "good.py")
    assert told.returncode == 0, told.stderr


def test_a_type_checker_sees_what_is_wrong(types_checked):
    for line in (2, 3, 4, 5, 6, 8):
        assert f"wrong.py:{line}: error" in types_checked
