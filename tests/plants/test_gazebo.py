"""Real Gazebo, moved in lock-step."""

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import numpy as np
import pytest
from helpers import PUSHES, FinePlant, make_context, make_task, ros_domain, trajectory
from matplotlib.image import imread

from upright.commands import run
from upright.core.parameters import Parameters, State
from upright.errors import UprightError
from upright.plants.gazebo import server, window
from upright.plants.gazebo.plant import Gazebo
from upright.studies.case import make_case
from upright.studies.run import make_run
from upright.support.exit_status import BAD_USE, INTERRUPTED

pytestmark = [pytest.mark.gazebo, pytest.mark.slow]
STATE = State(0.1, -0.2, 0.03, 0.4)
ROUGH = Parameters(cart_friction=0.05, pole_friction=0.0002)
"""A hundred times the friction, as in the condition friction-100."""
COMMAND = [sys.executable, "-m", "upright"]
LIMIT = 120
"""Time limit of every process [s]."""


@pytest.fixture(autouse=True)
def _none_is_left(monkeypatch, tmp_path_factory):
    """Give servers a folder of their own, and check that all of them end."""
    tmp_path_factory.getbasetemp()  # before there is another place for it
    with tempfile.TemporaryDirectory(prefix="gazebo-") as folder:
        monkeypatch.setenv("TMPDIR", folder)
        monkeypatch.setattr(tempfile, "tempdir", folder)
        yield
        until = time.monotonic() + 60
        while (left := running(f"gzserver.*{folder}")) and time.monotonic() < until:
            time.sleep(0.1)
        assert not left


def running(pattern):
    """Return the ids of the processes whose command line matches."""
    return subprocess.run(["pgrep", "-f", pattern], capture_output=True, text=True).stdout.split()


@pytest.fixture
def make():
    """Return a function that makes plants, which are closed in the end."""
    made = []

    def make_one(settings=None, parameters=None):
        task = make_task()
        task = task._replace(parameters=parameters or task.parameters)
        plant, left = (settings or Gazebo()).make(make_context(task))
        assert left == task
        made.append(plant)
        return plant

    yield make_one
    for plant in made:
        plant.close()


@pytest.fixture
def learner():
    """Return a function that starts commands, which are killed in the end."""
    started = []

    def start(line):
        pipe = subprocess.PIPE
        process = subprocess.Popen(
            [*COMMAND, *line.split()], stdout=pipe, stderr=pipe, text=True, start_new_session=True
        )
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.communicate(timeout=LIMIT)


# ---- The plant -----------------------------------------------------------------------------------


@pytest.mark.parametrize("parameters", [Parameters(), ROUGH], ids=["usual", "rough"])
@pytest.mark.parametrize(
    ("settings", "tolerance"),
    [(Gazebo(), 6e-3), (Gazebo("ode"), 6e-3), (Gazebo(physics_step=0.0005), 3e-3)],
    ids=["dart", "ode", "finer"],
)
def test_it_moves_like_the_equations(settings, tolerance, parameters, make):
    """Gazebo's engines are of first order, so that the error halves with the time step."""
    plant, exact = make(settings, parameters), FinePlant(parameters)
    for forces in PUSHES.values():
        error = np.abs(trajectory(plant, forces) - trajectory(exact, forces)).max()
        assert error < tolerance


@pytest.mark.parametrize("engine", ["dart", "ode"])
def test_a_reset_leaves_nothing_of_earlier_trials(engine, make):
    """Exactly: a fresh server and one after falls go the same way."""
    plant = make(Gazebo(engine))
    fresh = trajectory(plant, PUSHES["bang-bang"])
    for number in range(4):
        plant.reset(State(0.0, 0.0, 0.05 * number, 0.0))
        for step in range(60 + 17 * number):  # far beyond the limits
            plant.step(10.0 if step % 3 else -10.0)
        assert np.array_equal(trajectory(plant, PUSHES["bang-bang"]), fresh)


def test_a_push_may_exceed_that_of_a_command(make):
    """Noise is added to a command."""
    plant, exact = make(), FinePlant(Parameters())
    plant.reset(STATE)
    exact.reset(STATE)
    assert plant.step(11.0).x_dot == pytest.approx(exact.step(11.0).x_dot, abs=1e-3)


def test_two_plants_move_independently(make):
    one, other = make(), make()
    assert one.reset(STATE) == STATE
    assert other.reset(STATE._replace(x=-1.0)).x == -1.0
    assert one.step(10.0).x > 0
    assert other.step(-10.0).x < -1


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("engine=bullet", "engine is 'bullet'; it must be one of dart, ode"),
        ("engine=ode --plant-set physics_step=0.002", "with ODE it must be at most 0.001: in half"),
        ("physics_step=0.003", "physics_step is 0.003; it must be the time step of 0.02 s divided"),
    ],
)
def test_invalid_settings_are_refused(line, message, capsys):
    assert run(f"learn random-search --plant gazebo --plant-set {line}".split()) == BAD_USE
    assert message in capsys.readouterr().err


# ---- Learning ------------------------------------------------------------------------------------


def test_what_is_learned_there_balances_the_equations_and_the_reverse(tmp_path, capsys):
    there, here = str(tmp_path / "there.npz"), str(tmp_path / "here.npz")
    line = "learn adaptive-lqr --noise gaussian-0.1 --steps 3000 --quiet --save"
    assert run([*line.split(), there, "--plant", "gazebo"]) == 0
    assert run([*line.split(), here]) == 0
    assert run(["play", there, "--episodes", "3", "--steps", "60000"]) == 0
    assert run(["play", here, "--plant", "gazebo", "--episodes", "2", "--steps", "3000"]) == 0
    assert "balanced in 2 of 2 trials" in capsys.readouterr().out


def test_the_same_seed_makes_the_same_trials():
    case = make_case("random-search", steps=200, trials=30, plant=Gazebo())
    first, again = (make_run(case, 1, 0)[1].lengths.tolist() for _ in range(2))
    assert first == again


def test_the_ros_2_simulator_can_use_gazebo(learner, monkeypatch):
    pytest.importorskip("rclpy")
    with ros_domain() as own:
        for name, value in own.items():
            monkeypatch.setenv(name, value)
        process = learner("ros2 demo adaptive-lqr --plant gazebo --steps 500")
        out, told = process.communicate(timeout=LIMIT)
    assert process.returncode == 0, told
    assert out.startswith("simulating gazebo in lock-step")
    assert re.search(r"^trial +\d+ +500 steps", out, re.M)


# ---- What goes wrong -----------------------------------------------------------------------------


def test_a_trial_goes_on_when_its_server_is_killed(make, capsys):
    plant = make()
    plant.reset(STATE)
    expected = [plant.step(force) for force in PUSHES["bang-bang"][:20]]
    plant.reset(STATE)
    states = []
    for number, force in enumerate(PUSHES["bang-bang"][:20]):
        if number == 10:
            os.kill(plant._server._process.pid, signal.SIGKILL)
        states.append(plant.step(force))
    assert np.allclose(states, expected, atol=1e-9)
    assert "restarting it" in capsys.readouterr().err


def test_a_server_that_cannot_be_started_again_ends_the_run(make, monkeypatch):
    plant = make()
    plant.reset(STATE)

    def none():
        raise UprightError("Gazebo 11 is missing")

    monkeypatch.setattr(server, "find_gazebo", none)
    os.kill(plant._server._process.pid, signal.SIGKILL)
    with pytest.raises(UprightError, match="Gazebo 11 is missing"):
        plant.step(10.0)


def test_a_server_that_fails_to_start_says_why(make, monkeypatch):
    gazebo = server.find_gazebo()
    nowhere = gazebo.environment | {"GAZEBO_PLUGIN_PATH": ""}
    monkeypatch.setattr(server, "find_gazebo", lambda: gazebo._replace(environment=nowhere))
    monkeypatch.setattr(server, "STARTING", 15.0)  # enough for its complaint, on a busy machine
    with pytest.raises(UprightError, match=r"gzserver did not start within 15 s: .*stepper"):
        make()


def test_without_gazebo_there_is_a_clear_error(tmp_path, learner, monkeypatch):
    monkeypatch.setenv("UPRIGHT_GAZEBO", str(tmp_path))
    process = learner("learn random-search --plant gazebo")
    _, told = process.communicate(timeout=LIMIT)
    assert process.returncode == BAD_USE
    assert "`upright gazebo install`" in told


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_no_server_outlives_its_learner(number, learner):
    process = learner("learn random-search --plant gazebo --steps 100000000 --trials 100000")
    assert "logarithmic scale" in process.stdout.readline()
    assert process.stdout.readline().startswith("trial    1")
    process.send_signal(number)
    process.communicate(timeout=LIMIT)
    assert process.returncode == (INTERRUPTED if number == signal.SIGINT else -number)


# ---- Its window ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def policy(tmp_path_factory):
    path = str(tmp_path_factory.mktemp("policy") / "policy.npz")
    assert run(["learn", "adaptive-lqr", "--quiet", "--save", path]) == 0
    return path


needs_xvfb = pytest.mark.skipif(not shutil.which("Xvfb"), reason="Xvfb is not installed")
HIDE_QT = "for folder in /usr/lib/*/qt5; do mount -t tmpfs none $folder; done; exec "
"""For a shell with mounts of its own: the Qt of the machine is gone."""


@needs_xvfb
def test_a_picture_shows_cart_and_pole(policy, tmp_path, capsys):
    picture = tmp_path / "gazebo.png"
    view = ["gazebo", "view", policy, "--screenshot", str(picture)]
    assert 0 in (run(view) for _ in range(2))  # Gazebo's window sometimes stays empty
    assert f"picture: {picture}" in capsys.readouterr().out
    red, _, blue = np.moveaxis(imread(picture)[:, :, :3], 2, 0)
    assert (blue > red + 0.3).sum() > 1_000  # the cart
    assert (red > blue + 0.3).sum() > 300  # the pole
    assert not running("gzclient")


@needs_xvfb
def test_the_window_needs_no_qt_of_the_machine(policy, tmp_path, monkeypatch):
    """Nor is it led astray by the user's."""
    if subprocess.run(["unshare", "--mount", "true"], capture_output=True).returncode:
        pytest.skip("this user may not mount: the machine's Qt cannot be hidden")
    for name in ("QT_PLUGIN_PATH", "QT_QPA_PLATFORM_PLUGIN_PATH"):
        monkeypatch.setenv(name, "/nowhere")
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    view = ["gazebo", "view", policy, "--screenshot", str(tmp_path / "gazebo.png")]
    command = ["unshare", "--mount", "sh", "-c", HIDE_QT + shlex.join([*COMMAND, *view])]
    found = [subprocess.run(command, capture_output=True, timeout=LIMIT) for _ in range(2)]
    assert 0 in [done.returncode for done in found], found[0].stderr


@needs_xvfb
def test_a_window_that_fails_says_why_and_is_not_waited_for(policy, tmp_path, monkeypatch, capsys):
    gazebo = server.find_gazebo()
    without = gazebo.environment | {"QT_QPA_PLATFORM": "nonsense"}
    monkeypatch.setattr(server, "find_gazebo", lambda: gazebo._replace(environment=without))
    picture = tmp_path / "gazebo.png"
    began = time.monotonic()
    assert run(["gazebo", "view", policy, "--screenshot", str(picture)]) == BAD_USE
    assert time.monotonic() - began < window.WINDOW / 2
    (told,) = capsys.readouterr().err.splitlines()
    assert "Gazebo's window ended with status -6: " in told
    assert not picture.exists()


def test_a_picture_is_of_a_cart_and_a_pole():
    black = np.zeros((720, 1280, 3), np.uint8)
    cart = black.copy()
    cart[400:450, 600:700] = (30, 90, 160)
    both = cart.copy()
    both[300:400, 640:645] = (190, 90, 30)
    assert [window._shows_cart_pole(each) for each in (black, cart, both)] == [False, False, True]


def test_without_a_display_there_is_no_window(policy, monkeypatch, capsys):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert run(["gazebo", "view", policy]) == BAD_USE
    assert "there is no display" in capsys.readouterr().err


def test_a_picture_is_a_png(capsys):
    assert run(["gazebo", "view", "policy.npz", "--screenshot", "a.txt"]) == BAD_USE
    assert "'a.txt' is '.txt'; it must be one of .png" in capsys.readouterr().err
