"""The cart-pole in Gazebo 11.

Gazebo loads the one URDF and makes the physics steps of each control period in lock-step with the
learner. If the server dies, another is started and put into the last state, which is four numbers,
so that the trial continues.
"""

import sys
import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from upright.core.cartpole import has_fallen
from upright.core.contracts import Plant
from upright.core.parameters import Parameters, State, check_parameters
from upright.core.task import Task
from upright.errors import Stopped, UprightError, require, require_one_of
from upright.plants.gazebo.installation import find_gazebo
from upright.plants.gazebo.server import RESET, STEP, Server, ServerGoneError
from upright.plants.settings import (
    LONGEST_STEP,
    SHORTEST_STEP,
    RunContext,
    count_steps,
    refuse_breakaway,
)

ENGINES = ("dart", "ode")
"""Those of Gazebo's physics engines that were compared with the equations."""
ODE_STEP = 0.001
"""The longest time step with which ODE is accurate [s]."""
RESTARTS = 3
"""Maximum number of times that the server is restarted in the same step."""


@dataclass(frozen=True)
class Gazebo:
    """Settings of the plant in Gazebo."""

    engine: str = "dart"
    """The physics engine: dart or ode."""
    physics_step: float = 0.001
    """Gazebo's time step [s]; the time between two pushes must be a multiple of it."""
    gui: bool = False
    """Whether to show the cart-pole in Gazebo's window."""
    real_time_factor: float = 0.0
    """Highest speed relative to real time; 0: no limit."""

    name: ClassVar[str] = "gazebo"
    alone: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Refuse impossible settings, and those that are known to be inaccurate."""
        require_one_of("engine", self.engine, ENGINES)
        require("physics_step", self.physics_step, SHORTEST_STEP, LONGEST_STEP)
        if self.real_time_factor != 0:
            require("real_time_factor", self.real_time_factor, 0.001, 1000)
        if self.engine == "ode" and self.physics_step > ODE_STEP:
            raise UprightError(
                f"physics_step is {self.physics_step}; with ODE it must be at most {ODE_STEP}: in "
                "half a second the pole's angular velocity is off by 0.05 rad/s and more"
            )

    def make(self, context: RunContext) -> tuple[Plant, Task]:
        """Start Gazebo, and return its plant and the task.

        Raises
        ------
        UprightError
            If Gazebo is missing or does not start, or the time step is not a multiple of the
            physics step.
        """
        parameters = check_parameters(context.task.parameters)
        refuse_breakaway(parameters, "Gazebo")
        return GazeboCart(self, parameters, context.stop), context.task

    def version(self) -> str:
        """Return the version of Gazebo."""
        return find_gazebo().version


class GazeboCart:
    """A plant in Gazebo.

    Parameters
    ----------
    settings
        Settings of the plant.
    parameters
        Parameters of the plant.
    stop
        Shape (1,), bool. Once it is set, no further step is made.

    Raises
    ------
    UprightError
        If Gazebo is missing or does not start, or the time step is not a multiple of the physics
        step.
    """

    def __init__(self, settings: Gazebo, parameters: Parameters, stop: np.ndarray) -> None:
        self._settings, self._parameters, self._stop = settings, parameters, stop
        self._steps = count_steps(settings.physics_step, parameters.time_step)
        self._state = State(0.0, 0.0, 0.0, 0.0)
        self._due = 0.0  # time of the next step, if the speed is limited [s]
        self._server = self._start()

    def reset(self, state: State) -> State:
        """Put the plant into `state` and return the state it is in."""
        self._state = state
        return self._ask(RESET, 0, state)

    def step(self, force: float) -> State:
        """Apply a force [N] for one time step and return the next state.

        Raises
        ------
        UprightError
            If the server keeps dying.
        Stopped
            If the run was stopped.
        """
        if self._stop[0]:
            raise Stopped
        if self._settings.real_time_factor:
            self._wait()
        return self._ask(STEP, self._steps, State(force, 0.0, 0.0, 0.0))

    def has_fallen(self, state: State) -> bool:
        """Whether the pole or the cart has left its limits."""
        return bool(has_fallen(self._parameters, state))

    def close(self) -> None:
        """Terminate Gazebo."""
        self._server.close()

    def _start(self) -> Server:
        settings = self._settings
        return Server(
            self._parameters, settings.engine, settings.physics_step, settings.gui, self._stop
        )

    def _wait(self) -> None:
        """Wait until the next step is due."""
        time.sleep(max(0.0, self._due - time.monotonic()))
        period = self._parameters.time_step / self._settings.real_time_factor
        self._due = max(self._due, time.monotonic()) + period

    def _ask(self, kind: int, steps: int, values: State) -> State:
        """Send a request and return the answer; if the server has died, restart it in its state."""
        for attempt in range(1 + RESTARTS):
            try:
                if attempt:
                    self._server.close()
                    self._server = self._start()
                    self._server.ask(RESET, 0, self._state)
                self._state = self._server.ask(kind, steps, values)
                return self._state
            except ServerGoneError as gone:
                print(f"upright: {gone}; restarting it", file=sys.stderr)
        raise UprightError(f"gzserver died {1 + RESTARTS} times in the same step")


SETTINGS = {"default": Gazebo()}
