"""EXPERIMENTAL: the cart-pole in modern Gazebo (gz-sim: Harmonic, Ionic, Jetty).

Its Python module steps a world in this process. World and model are those of Gazebo 11. It was
written from gz-sim's documentation and has never met a gz-sim: tests cover what needs none.
"""

import os
import tempfile
from contextlib import ExitStack
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from upright.cartpole import Parameters, State, check_parameters, has_fallen
from upright.errors import UprightError, require
from upright.files import digest
from upright.gazebo.world import write_world
from upright.plants import count_steps
from upright.plants.urdf import HINGE, SLIDER
from upright.task import Task
from upright.trials import Plant

MODULES = ("gz.sim10", "gz.sim9", "gz.sim8")
"""Of Jetty, Ionic and Harmonic."""
PHYSICS = {"name": "gz::sim::systems::Physics", "filename": "gz-sim-physics-system"}
"""The plugin by which its worlds move."""
MODELS = "GZ_SIM_RESOURCE_PATH"
"""Environment variable of the folders in which it looks for models."""


@dataclass(frozen=True)
class GzSim:
    """Settings of the plant in modern Gazebo (experimental)."""

    physics_step: float = 0.001
    """Gazebo's time step [s]; a whole number of them must make up the time between two pushes."""

    name: ClassVar[str] = "gz-sim"
    alone: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        require("physics_step", self.physics_step, 0, above=True)

    def make(self, task: Task, noise: str, seed: int, stop: np.ndarray) -> tuple[Plant, Task]:
        """Return the plant, and the task.

        Raises
        ------
        UprightError
            If modern Gazebo is missing, or the time steps do not fit.
        """
        return GzSimCart(self, check_parameters(task.parameters), stop), task

    def version(self) -> str:
        """Return which module it is, and a digest of this file."""
        return f"{_gz_sim().__name__}-{digest([Path(__file__)], Path(__file__).parent)}"


def _gz_sim() -> Any:
    """Return the newest of the modules."""
    for name in MODULES:
        try:
            return import_module(name)
        except ImportError:
            continue
    raise UprightError(f"modern Gazebo's Python module is missing; one of {', '.join(MODULES)}")


class GzSimCart:
    """A plant in modern Gazebo (experimental).

    Parameters
    ----------
    settings
        How it is made.
    parameters
        Of the plant.
    stop
        Shape (1,), bool. Once it is set, there is no further step.
    """

    def __init__(self, settings: GzSim, parameters: Parameters, stop: np.ndarray) -> None:
        self._sim = _gz_sim()
        self._parameters, self._stop = parameters, stop
        self._steps = count_steps(settings.physics_step, parameters.time_step)
        self._force = 0.0
        self._state = State(0.0, 0.0, 0.0, 0.0)
        self._put = True  # whether the joints are still to be put into the state
        with ExitStack() as opened:
            folder = opened.enter_context(tempfile.TemporaryDirectory(prefix="upright-gz-sim-"))
            os.environ[MODELS] = f"{folder}/models"
            world = write_world(Path(folder), parameters, "dart", settings.physics_step, PHYSICS)
            self._fixture = self._sim.TestFixture(str(world))
            self._fixture.on_pre_update(self._before)
            self._fixture.on_post_update(self._after)
            self._fixture.finalize()
            self._server = self._fixture.server()
            self._closing = opened.pop_all()

    def reset(self, state: State) -> State:
        """Have the next step begin in `state`, and return it."""
        self._state, self._put = state, True
        return state

    def step(self, force: float) -> State:
        """Apply a force [N] for one time step and return the state then."""
        if self._stop[0]:
            raise KeyboardInterrupt
        self._force = force
        self._server.run(True, self._steps, False)  # until it is done, so many steps, not paused
        return self._state

    def has_fallen(self, state: State) -> bool:
        """Whether a state is beyond the limits."""
        return bool(has_fallen(self._parameters, state))

    def close(self) -> None:
        """Remove its files; Gazebo ends with the last that refers to it."""
        self._closing.close()

    def _joints(self, ecm: Any) -> list[Any]:
        """Return slider and hinge, found in the entity-component manager of this step."""
        world = self._sim.World(self._sim.world_entity(ecm))
        model = self._sim.Model(world.model_by_name(ecm, "cartpole"))
        return [self._sim.Joint(model.joint_by_name(ecm, name)) for name in (SLIDER, HINGE)]

    def _before(self, _info: Any, ecm: Any) -> None:
        """Push the cart, before a physics step."""
        slider, hinge = self._joints(ecm)
        if self._put:
            x, x_dot, theta, theta_dot = self._state
            for joint, position, velocity in ((slider, x, x_dot), (hinge, theta, theta_dot)):
                joint.enable_position_check(ecm, True)
                joint.enable_velocity_check(ecm, True)
                joint.reset_position(ecm, [position])
                joint.reset_velocity(ecm, [velocity])
            self._put = False
        slider.set_force(ecm, [self._force])

    def _after(self, _info: Any, ecm: Any) -> None:
        """Note the state, after a physics step."""
        numbers = [(joint.position(ecm), joint.velocity(ecm)) for joint in self._joints(ecm)]
        if all(position and velocity for position, velocity in numbers):
            (x, x_dot), (theta, theta_dot) = ((p[0], v[0]) for p, v in numbers)
            self._state = State(x, x_dot, theta, theta_dot)


SETTINGS = GzSim()
