"""EXPERIMENTAL: a plant in modern Gazebo (gz-sim: Harmonic, Ionic, Jetty), never run on a real one.

    upright learn adaptive-lqr --plant upright.plants.gazebo.gz_sim:GzSim

The world and the model are those of Gazebo 11. It was written from the sources of gz-sim 8, 9 and
10, and tried with stand-ins that have the layouts of their Python modules. If it fails on yours,
please report what it says.
"""

import ctypes
import os
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

from upright.core.parameters import Parameters, State
from upright.errors import UprightError
from upright.plants.gazebo.world import write_world

MODULES = ("gz.sim", "gz.sim9", "gz.sim8")
"""The Python modules of Jetty, Ionic and Harmonic."""
PHYSICS = {"name": "gz::sim::systems::Physics", "filename": "gz-sim-physics-system"}
"""The plugin that moves a world."""
MODELS = "GZ_SIM_RESOURCE_PATH"
"""Environment variable of the folders that models are in."""
STEP = 0.001
"""Gazebo's time step [s]."""
UNLIMITED = "1e9"
"""Effort limit of the slider [N]: noise may push beyond the greatest force of a command."""


def find_gz_sim() -> Any:
    """Return the newest Python module of gz-sim that is installed."""
    for name in MODULES:
        try:
            module = import_module(name)
        except ImportError:
            continue
        if hasattr(module, "TestFixture"):  # with Ionic and Harmonic, gz.sim may be an empty folder
            return module
    raise UprightError(f"modern Gazebo's Python module is missing: one of {', '.join(MODULES)}")


class GzSim:
    """A world in this process that is stepped on request."""

    def __init__(self, parameters: Parameters) -> None:
        self.sim = find_gz_sim()
        self.steps = round(parameters.time_step / STEP)
        self.force, self.state, self.is_new = 0.0, State(0.0, 0.0, 0.0, 0.0), True
        with ExitStack() as opened:
            folder = Path(opened.enter_context(TemporaryDirectory(prefix="upright-gz-sim-")))
            world = write_files(folder, parameters)
            os.environ[MODELS] = f"{folder}/models"
            with keep_signal_handlers():
                self.fixture = self.sim.TestFixture(str(world))
                self.fixture.on_pre_update(self.before)
                self.fixture.on_post_update(self.after)
                self.fixture.finalize()
                self.server = self.fixture.server()
            self.closing = opened.pop_all()

    def reset(self, state: State) -> State:
        """Have the next step begin in a state, and return the state."""
        self.state, self.is_new = state, True
        return state

    def step(self, force: float) -> State:
        """Apply a force [N] for one time step, and return the next state."""
        self.force, self.moved = force, False
        # Blocking, this many physics steps, not paused; False after a signal or an error.
        if not self.server.run(True, self.steps, False):
            raise RuntimeError("gz-sim did not run: it was interrupted, or failed (see its log)")
        if not self.moved:
            raise RuntimeError("gz-sim ran, but the joints have no position or velocity")
        return self.state

    def close(self) -> None:
        """Remove the files; the server ends with the last reference to it."""
        del self.server, self.fixture
        self.closing.close()

    def joints(self, ecm: Any) -> list[Any]:
        """Return slider and hinge from Gazebo's entity-component manager."""
        world = self.sim.World(self.sim.world_entity(ecm))
        model = self.sim.Model(world.model_by_name(ecm, "cartpole"))
        return [self.sim.Joint(model.joint_by_name(ecm, name)) for name in ("slider", "hinge")]

    def before(self, _info: Any, ecm: Any) -> None:
        """Push the cart, before each physics step; put the joints into a new state first."""
        slider, hinge = self.joints(ecm)
        if self.is_new:
            x, x_dot, theta, theta_dot = self.state
            for joint, position, velocity in ((slider, x, x_dot), (hinge, theta, theta_dot)):
                joint.enable_position_check(ecm, True)
                joint.enable_velocity_check(ecm, True)
                joint.reset_position(ecm, [position])
                joint.reset_velocity(ecm, [velocity])
            self.is_new = False
        slider.set_force(ecm, [self.force])

    def after(self, _info: Any, ecm: Any) -> None:
        """Store the state, after each physics step."""
        numbers = [each for joint in self.joints(ecm) for each in (joint.position, joint.velocity)]
        found = [number(ecm) for number in numbers]
        self.moved = all(found)
        if self.moved:
            self.state = State(*(number[0] for number in found))


def write_files(folder: Path, parameters: Parameters) -> Path:
    """Write the world and the model of Gazebo 11 with what gz-sim needs; return the world."""
    path = write_world(folder, parameters, "dart", STEP, PHYSICS)
    world = ElementTree.parse(path)
    physics = world.find("world/physics")
    assert physics is not None
    ElementTree.SubElement(physics, "real_time_factor").text = "0"  # as fast as it can
    world.write(path, encoding="utf-8", xml_declaration=True)
    model = folder / "models/cartpole/cartpole.urdf"
    robot = ElementTree.parse(model)
    for limit in robot.iterfind("joint[@name='slider']/limit"):
        limit.set("effort", UNLIMITED)
    robot.write(model, encoding="utf-8")
    return path


@contextmanager
def keep_signal_handlers() -> Iterator[None]:
    """Restore the handlers of Ctrl-C and SIGTERM after the block: gz-sim installs its own.

    In C, as Python sets handlers from its main thread alone.
    """
    set_handler = ctypes.CDLL(None).signal
    set_handler.restype, set_handler.argtypes = ctypes.c_void_p, (ctypes.c_int, ctypes.c_void_p)
    numbers = (signal.SIGINT, signal.SIGTERM)
    handlers = [set_handler(number, None) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, handlers, strict=True):
            set_handler(number, handler)
