"""The ROS 2 package: what it says of itself, what it installs, and what its nodes read from it.

ROS 2's `launch` and RViz are in no wheel, so what they read is checked without them here;
test_launch.py launches the nodes where `launch` is installed.
"""

import ast
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest
import yaml
from helpers import ROOT, ros_domain

import upright
from upright.nodes.settings import LearnerSettings, SimulatorSettings
from upright.plants import urdf
from upright.support.exit_status import BAD_USE
from upright.support.settings import values_of

PACKAGE = ROOT / "ros2"
CONFIG = "config/cartpole.yaml"
NODES = {"simulator": SimulatorSettings(), "learner": LearnerSettings()}
LIMIT = 60
"""Time limit of every process [s]."""
needs_ros2 = pytest.mark.skipif(
    not (find_spec("rclpy") or os.environ.get("UPRIGHT_REQUIRE_ROS2")),
    reason="ROS 2 (rclpy) is not installed: no node is tested",
)
PROGRAMS = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
"""The PATH where the environment of this Python is active."""
needs_colcon = pytest.mark.skipif(
    not (shutil.which("colcon", path=PROGRAMS) or os.environ.get("UPRIGHT_REQUIRE_ROS2")),
    reason="colcon is not installed: no workspace is built",
)


@pytest.fixture(scope="module")
def about():
    return ElementTree.parse(PACKAGE / "package.xml").getroot()


@pytest.fixture(scope="module")
def needed(about):
    return {element.text for element in about.iter("exec_depend")}


@pytest.fixture(scope="module")
def launch_file():
    return ast.parse((PACKAGE / "launch/cartpole.launch.py").read_text())


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The package as colcon installs one of this kind."""
    folder = tmp_path_factory.mktemp("ament")
    prefix, source = folder / "install", folder / "source"
    shutil.copytree(PACKAGE, source, ignore=shutil.ignore_patterns("__pycache__"))
    line = "setup.py --quiet install --single-version-externally-managed --record ../record"
    command = [sys.executable, *line.split(), "--prefix", str(prefix)]
    done = subprocess.run(command, cwd=source, capture_output=True, text=True, timeout=LIMIT)
    assert done.returncode == 0, done.stderr
    (module,) = prefix.rglob("upright_ros/__init__.py")
    return SimpleNamespace(prefix=prefix, modules=module.parents[1])


def names(path):
    """Return top-level names of the modules that a file imports, whether at once or later."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module.split(".")[0]


def calls(tree, name):
    """Return the calls of a function, as their positional and their named arguments."""
    return [
        (node.args, {keyword.arg: keyword.value for keyword in node.keywords})
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == name
    ]


def keys(tree, name):
    """Return the keys of a dictionary that is a constant of a module."""
    (value,) = (
        node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and node.targets[0].id == name
    )
    return {key.value for key in value.keys}


# ------------------------------------------------------------------------------ package.xml


def test_package_xml_agrees_with_the_project(about):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert "version" in project["dynamic"]
    assert about.findtext("name") == "upright_ros"
    assert about.findtext("version") == upright.__version__
    assert about.findtext("license") == project["license"]
    assert about.findtext("maintainer") in (ROOT / "LICENSE").read_text()
    assert re.fullmatch(r"\S+@\S+\.\S+", about.find("maintainer").get("email"))
    assert about.get("format") == "3"
    assert about.findtext("export/build_type") == "ament_python"


def test_it_names_every_package_that_is_imported(needed, about):
    others = {"mcap", "numpy", "upright", "upright_ros", *sys.stdlib_module_names}
    files = [*PACKAGE.glob("upright_ros/*.py"), *PACKAGE.glob("launch/*.py")]
    for folder in ("nodes", "plants/ros2"):
        files += (ROOT / "src/upright" / folder).glob("*.py")
    imported = {name for path in files for name in names(path)}
    assert {"rclpy", "launch_ros"} <= imported
    assert imported - others <= needed
    tested_with = {element.text for element in about.iter("test_depend")}
    tests = {name for path in PACKAGE.glob("test/*.py") for name in names(path)}
    assert {"python3-pytest" if name == "pytest" else name for name in tests} == tested_with


# ------------------------------------------------------------------------------ what is installed


def test_every_file_is_where_ros_looks_for_it(installed):
    def below(folder):
        paths = (installed.prefix / folder).rglob("*")
        return {path.relative_to(installed.prefix / folder).as_posix() for path in paths}

    here = {"package.xml", CONFIG, "launch/cartpole.launch.py", "rviz/cartpole.rviz"}
    assert below("share/upright_ros") == here | {"config", "launch", "rviz"}
    assert below("share/ament_index/resource_index/packages") == {"upright_ros"}
    assert below("lib/upright_ros") == set(NODES)
    modules = {path.name for path in PACKAGE.glob("upright_ros/*.py")}
    assert {path.name for path in (installed.modules / "upright_ros").glob("*.py")} == modules


@pytest.mark.parametrize("node", NODES)
def test_programs_run_on_the_python_that_is_active(node, installed):
    """The Python that runs colcon may lack upright."""
    lines = (installed.prefix / "lib/upright_ros" / node).read_text().splitlines()
    assert lines[0] == "#!/usr/bin/env python3"


def test_the_metadata_is_that_of_the_package(installed, about):
    (metadata,) = installed.modules.glob("upright_ros-*.egg-info")
    told = (metadata / "PKG-INFO").read_text()
    assert f"Version: {about.findtext('version')}\n" in told
    assert "License: MIT\n" in told or "License-Expression: MIT\n" in told
    assert (metadata / "requires.txt").read_text().split() == ["upright", "[test]", "pytest"]


@needs_ros2
def test_the_index_of_ros_finds_it(installed, monkeypatch):
    find = import_module("ament_index_python.packages").get_package_share_directory
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(installed.prefix))
    assert (Path(find("upright_ros")) / "package.xml").samefile(
        installed.prefix / "share/upright_ros/package.xml"
    )


# ------------------------------------------------------------------------------ colcon


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    """A workspace of colcon that is built as docs/ros2.md says; what colcon lists is returned too.

    The programs of this Python come first, as in a virtual environment that is active.
    """
    folder = tmp_path_factory.mktemp("ws")
    listed = ["git", "-C", ROOT, "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    done = subprocess.run(listed, check=True, capture_output=True, text=True, timeout=LIMIT)
    for name in filter(None, done.stdout.split("\0")):
        if (ROOT / name).is_file():  # it may be removed, but not committed so
            path = folder / "src/upright" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, path)

    def colcon(verb):
        command = ["colcon", "--log-base", "log", verb]
        done = subprocess.run(
            command, cwd=folder, env=env, capture_output=True, text=True, timeout=LIMIT
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    env = os.environ | {"PATH": PROGRAMS, "PYTHONPATH": os.environ.get("PYTHONPATH", "")}
    packages = [line.split("\t")[:2] for line in colcon("list").splitlines()]
    colcon("build")
    return SimpleNamespace(folder=folder, env=env, packages=packages)


@pytest.mark.slow
@needs_colcon
def test_colcon_builds_the_package_and_nothing_else(workspace):
    assert workspace.packages == [["upright_ros", "src/upright/ros2"]]
    built = {path.name for path in (workspace.folder / "install").iterdir() if path.is_dir()}
    assert built == {"upright_ros"}
    programs = workspace.folder / "install/upright_ros/lib/upright_ros"
    assert {path.name for path in programs.iterdir()} == set(NODES)


@pytest.mark.slow
@needs_colcon
@needs_ros2
def test_a_program_that_colcon_installed_runs(workspace, tmp_path):
    program = "install/upright_ros/lib/upright_ros/simulator --ros-args -p plant:=mujoco"
    with ros_domain() as domain:
        simulator = subprocess.Popen(
            ["bash", "-c", f". install/setup.bash && exec {program}"],
            cwd=workspace.folder,
            env=workspace.env | domain | {"ROS_LOG_DIR": str(tmp_path)},
            stdout=subprocess.PIPE,
            text=True,
        )
        assert simulator.stdout.readline().startswith("simulating mujoco")
        simulator.send_signal(signal.SIGINT)
        simulator.communicate(timeout=LIMIT)
        assert simulator.returncode == 0


# ------------------------------------------------------------------------------ style

LINTERS = ["flake8", "flake8_quotes", "flake8_import_order", "pydocstyle"]
IGNORED = "D100,D101,D102,D103,D104,D105,D106,D107,D203,D212,D404"


@pytest.mark.skipif(
    not (all(map(find_spec, LINTERS)) or os.environ.get("UPRIGHT_REQUIRE_ROS2")),
    reason=f"a linter is not installed: {', '.join(LINTERS)}",
)
@pytest.mark.parametrize(
    "linter",
    [
        pytest.param(
            "flake8 --isolated --max-line-length 99 --import-order-style google "
            f"--extend-ignore B902,C816,{IGNORED},I202 .",
            id="flake8",
        ),
        pytest.param(f"pydocstyle --ignore={IGNORED} --match=.*\\.py .", id="pep257"),
    ],
)
def test_the_style_is_that_of_ros(linter):
    """With the settings of ament_flake8 and ament_pep257, which are in no wheel."""
    done = subprocess.run(
        [sys.executable, "-m", *linter.split()],
        cwd=PACKAGE,
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    assert done.returncode == 0, done.stdout + done.stderr


# ------------------------------------------------------------------------------ parameters


def test_the_parameters_are_the_default_settings():
    config = yaml.safe_load((PACKAGE / CONFIG).read_text())
    assert list(config) == [f"/**/{node}" for node in NODES]
    for node, settings in NODES.items():
        values = config[f"/**/{node}"]["ros__parameters"]
        expected = values_of(settings)
        assert list(values) == list(expected)
        for name, value in expected.items():
            value = list(value) if isinstance(value, tuple) else value
            assert type(values[name]) is type(value), name
            assert repr(values[name]) == repr(value), name  # nan is not equal to itself


@pytest.fixture
def start(installed, tmp_path):
    """Return a function that starts a node that was installed, with changed parameters."""

    def started(node, old, new, *arguments):
        text = (installed.prefix / "share/upright_ros" / CONFIG).read_text()
        assert text.count(old) == 1
        path = tmp_path / "changed.yaml"
        path.write_text(text.replace(old, new))
        own = {
            "ROS_LOG_DIR": str(tmp_path),
            "PYTHONPATH": os.pathsep.join(
                [str(installed.modules), *filter(None, [os.environ.get("PYTHONPATH")])]
            ),
        }
        program = installed.prefix / "lib/upright_ros" / node
        process = subprocess.Popen(
            [sys.executable, program, "--ros-args", "--params-file", path, *arguments],
            env=os.environ | domain | own,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        processes.append(process)
        return process

    processes = []
    with ros_domain() as domain:
        started.domain = domain
        yield started
        for process in processes:
            process.kill()
            process.communicate(timeout=LIMIT)


@needs_ros2
@pytest.mark.parametrize(
    ("arguments", "plant"),
    [
        pytest.param(["-r", "__ns:=/lab"], "mujoco", id="in any namespace"),
        pytest.param(["-p", "plant:=equations\n...\n"], "equations", id="as launch passes others"),
    ],
)
def test_a_node_has_the_parameters_of_the_file(start, arguments, plant):
    simulator = start("simulator", "plant: equations", "plant: mujoco", *arguments)
    assert simulator.stdout.readline().startswith(f"simulating {plant} in lock-step")
    simulator.send_signal(signal.SIGINT)
    assert simulator.wait(LIMIT) == 0


@pytest.mark.slow
@needs_ros2
def test_an_interrupted_program_ends_as_ros_expects(start):
    """The command `upright ros2 learn` ends with 130, which `launch` would report as a death."""
    learner = start("learner", "patience: 10.0", "patience: 60.0")
    time.sleep(3)  # it waits for a cart, or still imports
    learner.send_signal(signal.SIGINT)
    assert learner.wait(LIMIT) == 0


@pytest.mark.slow
@needs_ros2
@pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")  # what rclpy imports does
def test_each_namespace_has_a_clock_of_its_own(start, monkeypatch):
    """Two simulators on one clock would put it back again and again."""
    from rosgraph_msgs.msg import Clock

    from upright.plants.ros2.node import QOS, make_executor, new_node

    for name, value in start.domain.items():
        monkeypatch.setenv(name, value)
    for side in ("left", "right"):
        ros = ["-r", f"__ns:=/{side}"]
        simulator = start("simulator", "lock_step: true", "lock_step: false", *ros)
        assert simulator.stdout.readline().startswith("simulating")
    heard = {"/left/clock": [], "/right/clock": []}
    with new_node("listener", {}, []) as node:
        for name, messages in heard.items():
            node.create_subscription(Clock, name, messages.append, QOS)
        executor, end = make_executor(node), time.monotonic() + LIMIT
        while min(map(len, heard.values())) < 25 and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)
        assert node.count_publishers("/clock") == 0
    for messages in heard.values():
        times = [(message.clock.sec, message.clock.nanosec) for message in messages]
        assert len(times) >= 25
        assert times == sorted(times)


@pytest.mark.slow
@needs_ros2
@pytest.mark.parametrize(
    ("node", "old", "new", "refusal"),
    [
        ("simulator", "rate: 50.0", "rate: 0.5", "rate is 0.5"),
        ("simulator", "seed: 0                   # of noise", "seed: zero #", "seed is 'zero'"),
        ("learner", "watchdog: 0.5", "watchdog: -1.0", "watchdog is -1.0"),
    ],
)
def test_an_invalid_parameter_is_refused(start, node, old, new, refusal):
    process = start(node, old, new)
    _, told = process.communicate(timeout=LIMIT)
    assert process.returncode == BAD_USE
    assert refusal in told


# ------------------------------------------------------------------------------ launch and RViz


def test_no_argument_has_the_name_of_a_parameter(launch_file):
    own = keys(launch_file, "OWN_ARGUMENTS")
    assert own == {"simulator", "namespace", "config", "rviz"}
    parameters = {name for settings in NODES.values() for name in values_of(settings)}
    assert not own & parameters


def test_only_arguments_that_are_declared_are_used(launch_file):
    used = [args[0] for args, _ in calls(launch_file, "LaunchConfiguration")]
    constants = {arg.value for arg in used if isinstance(arg, ast.Constant)}
    assert constants == keys(launch_file, "OWN_ARGUMENTS")


def test_what_is_launched_is_there(launch_file, needed):
    started = [named for _, named in calls(launch_file, "Node")]
    packages = {named["package"].value for named in started}
    assert packages == {"upright_ros", "robot_state_publisher", "rviz2"}
    assert packages - {"upright_ros"} <= needed
    (own,) = (named for named in started if named["package"].value == "upright_ros")
    assert ast.unparse(own["on_exit"]) == "partial(shut_down, name)", "the launch would not end"
    assert keys(launch_file, "NODES") == set(NODES)


def test_files_that_launch_names_are_installed(launch_file, installed):
    paths = re.findall(r"SHARE((?: / '[^']+')+)", ast.unparse(launch_file))
    parts = ["/".join(re.findall(r"'([^']+)'", path)) for path in paths]
    assert sorted(parts) == [CONFIG, "rviz/cartpole.rviz"]
    share = installed.prefix / "share/upright_ros"
    assert all((share / part).is_file() for part in parts)
    launched = share / "launch/cartpole.launch.py"
    assert launched.parents[1] == share
    compile(launched.read_text(), launched, "exec")


def test_rviz_shows_the_cart():
    shown = yaml.safe_load((PACKAGE / "rviz/cartpole.rviz").read_text())["Visualization Manager"]
    displays = {display["Class"].split("/")[1]: display for display in shown["Displays"]}
    assert displays.keys() == {"Grid", "RobotModel", "TF"}
    assert all(display["Enabled"] for display in displays.values())
    assert displays["RobotModel"]["Description Topic"]["Value"] == "robot_description"
    robot = ElementTree.fromstring(urdf.text())
    links = {link.get("name") for link in robot.iter("link")}
    (root,) = links - {child.get("link") for child in robot.iter("child")}
    assert shown["Global Options"]["Fixed Frame"] == root
