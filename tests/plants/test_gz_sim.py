"""The plant in modern Gazebo, on stand-ins with the layouts of gz-sim 8, 9 and 10.

No gz-sim can be had here: these tests show that the plant does with such a module what the
sources of gz-sim say, and nothing about gz-sim itself.
"""

import ctypes
import os
import signal
import sys
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import pytest
from helpers import PUSHES, FinePlant, trajectory

from upright import Parameters, PlantError, State, UprightError, equations
from upright.commands import run
from upright.plants.gazebo import gz_sim

STATE = State(0.1, -0.2, 0.03, 0.4)
NAME = "upright.plants.gazebo.gz_sim:GzSim"


class Joint:
    """A joint of the stand-in: its names and arguments are those of gz-sim's Joint."""

    def __init__(self, index):
        self.index = index

    def enable_position_check(self, ecm, enable):
        ecm.checked |= enable

    enable_velocity_check = enable_position_check

    def reset_position(self, ecm, values):
        ecm.state[2 * self.index] = values[0]

    def reset_velocity(self, ecm, values):
        ecm.state[2 * self.index + 1] = values[0]

    def set_force(self, ecm, values):
        ecm.force = max(-ecm.limit, min(ecm.limit, values[0]))

    def position(self, ecm):
        return [ecm.state[2 * self.index]] if ecm.checked else None

    def velocity(self, ecm):
        return [ecm.state[2 * self.index + 1]] if ecm.checked else None


class Fixture:
    """A world, its server and its entity-component manager in one."""

    failing = False

    def __init__(self, path):
        world = ElementTree.parse(path)
        self.paced = world.findtext("world/physics/real_time_factor") != "0"
        folder = Path(os.environ["GZ_SIM_RESOURCE_PATH"])
        robot = ElementTree.parse(folder / "cartpole/cartpole.urdf")
        self.limit = float(robot.find("joint[@name='slider']/limit").get("effort"))
        step = float(world.findtext("world/physics/max_step_size"))
        self.body = equations(Parameters(time_step=step))
        self.state, self.force, self.checked = [0.0] * 4, 0.0, False
        for number in (signal.SIGINT, signal.SIGTERM):  # as its own handlers
            ctypes.CDLL(None).signal(number, 1)

    def on_pre_update(self, call):
        self.before = call

    def on_post_update(self, call):
        self.after = call

    def finalize(self):
        assert not self.paced, "it would run in real time"

    def server(self):
        return self

    def run(self, blocking, steps, paused):
        assert (blocking, paused) == (True, False)
        if self.failing:
            return False
        for _ in range(steps):
            self.before(None, self)
            self.body.reset(State(*self.state))
            self.state = list(self.body.step(self.force))
            self.after(None, self)
        return True


class Found:
    """World and model of the stand-in."""

    def __init__(self, _entity):
        pass

    def model_by_name(self, _ecm, name):
        assert name == "cartpole"

    def joint_by_name(self, _ecm, name):
        return ["slider", "hinge"].index(name)


@pytest.fixture(params=["gz.sim8", "gz.sim9", "gz.sim"])
def stub(request, monkeypatch):
    """Install a stand-in as one of the modules; gz.sim is there without content otherwise."""
    module = ModuleType(request.param)
    module.TestFixture, module.World, module.Model, module.Joint = Fixture, Found, Found, Joint
    module.world_entity = lambda _ecm: 0
    for name in gz_sim.MODULES:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setitem(sys.modules, "gz", ModuleType("gz"))
    monkeypatch.setitem(sys.modules, "gz.sim", ModuleType("gz.sim"))
    monkeypatch.setitem(sys.modules, request.param, module)
    monkeypatch.setenv(gz_sim.MODELS, "")


@pytest.fixture
def plant(stub):
    plant = gz_sim.GzSim(Parameters())
    yield plant
    plant.close()


def test_it_moves_like_the_equations(plant):
    exact = FinePlant(Parameters())
    for forces in PUSHES.values():
        error = abs(trajectory(plant, forces) - trajectory(exact, forces)).max()
        assert error < 0.05  # Euler's, at 1 ms


def test_a_push_may_exceed_that_of_a_command(plant):
    plant.reset(STATE)
    weak = plant.step(10.0)
    plant.reset(STATE)
    assert plant.step(11.0).x_dot > weak.x_dot + 0.01


def test_an_agent_learns_on_it(stub, capsys):
    assert run(["learn", "adaptive-lqr", "--plant", NAME, "--steps", "300"]) == 0
    assert "balanced at trial" in capsys.readouterr().out


def test_a_server_that_does_not_run_is_no_balanced_pole(stub, monkeypatch):
    monkeypatch.setattr(Fixture, "failing", True)
    from upright.studies.case import make_case
    from upright.studies.run import make_run

    with pytest.raises(PlantError, match="gz-sim did not run"):
        make_run(make_case("random-search", steps=50, plant=NAME), 0, 0)


def test_joints_without_numbers_are_no_balanced_pole(plant, monkeypatch):
    monkeypatch.setattr(Joint, "position", lambda self, ecm: None)
    plant.reset(STATE)
    with pytest.raises(RuntimeError, match="the joints have no position or velocity"):
        plant.step(10.0)


def test_signals_reach_python_again(stub):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        plant = gz_sim.GzSim(Parameters())
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        plant.close()
    finally:
        signal.signal(signal.SIGINT, before)


def test_without_gz_sim_there_is_a_clear_error(monkeypatch, capsys):
    for name in gz_sim.MODULES:
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(UprightError, match=r"missing: one of gz\.sim, gz\.sim9, gz\.sim8"):
        gz_sim.find_gz_sim()
    assert run(["learn", "random-search", "--plant", NAME, "--steps", "50"]) != 0
    assert "modern Gazebo's Python module is missing" in capsys.readouterr().err
