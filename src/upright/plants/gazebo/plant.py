"""The cart-pole in Gazebo 11, behind the same contract as the equations.

Gazebo loads the one URDF and makes so many physics steps as make up a control period, in lock-step
with the learner. A server that dies is started again and put into the state that it had, which four
numbers are, so that a trial goes on where it was.
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
from upright.plants.settings import RunContext, count_steps

ENGINES = ("dart", "ode")
"""Gazebo's engines that were compared with the equations."""
ODE_STEP = 0.001
"""The longest time step that ODE is right with [s]."""
RESTARTS = 3
"""How often a server is started again for the same step."""


@dataclass(frozen=True)
class Gazebo:
    """Settings of the plant in Gazebo."""

    engine: str = "dart"
    """The physics engine: dart or ode."""
    physics_step: float = 0.001
    """Gazebo's time step [s]; a whole number of them must make up the time between two pushes."""
    gui: bool = False
    """Whether a window shows the cart-pole as it moves."""
    real_time_factor: float = 0.0
    """How many times as fast as real time it moves at most; 0: as fast as it can."""

    name: ClassVar[str] = "gazebo"
    alone: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Refuse impossible settings, and those that are known to be wrong."""
        require_one_of("engine", self.engine, ENGINES)
        require("physics_step", self.physics_step, 0, above=True)
        require("real_time_factor", self.real_time_factor, 0)
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
            If Gazebo is missing or does not start, or the time steps do not fit.
        """
        parameters = check_parameters(context.task.parameters)
        return GazeboCart(self, parameters, context.stop), context.task

    def version(self) -> str:
        """Return the version of Gazebo."""
        return find_gazebo().version


class GazeboCart:
    """A plant in Gazebo.

    Parameters
    ----------
    settings
        How it is made.
    parameters
        Of the plant.
    stop
        Shape (1,), bool. Once it is set, there is no further step.

    Raises
    ------
    UprightError
        If Gazebo is missing or does not start, or the time steps do not fit.
    """

    def __init__(self, settings: Gazebo, parameters: Parameters, stop: np.ndarray) -> None:
        self._settings, self._parameters, self._stop = settings, parameters, stop
        self._steps = count_steps(settings.physics_step, parameters.time_step)
        self._state = State(0.0, 0.0, 0.0, 0.0)
        self._due = 0.0  # when the next step is, if it is not as soon as it can be [s]
        self._server = self._start()

    def reset(self, state: State) -> State:
        """Put the plant into `state` and return the state it is in."""
        self._state = state
        return self._ask(RESET, 0, state)

    def step(self, force: float) -> State:
        """Apply a force [N] for one time step and return the state then.

        Raises
        ------
        UprightError
            If the server dies again and again.
        Stopped
            If the run was stopped.
        """
        if self._stop[0]:
            raise Stopped
        if self._settings.real_time_factor:
            self._wait()
        return self._ask(STEP, self._steps, State(force, 0.0, 0.0, 0.0))

    def has_fallen(self, state: State) -> bool:
        """Whether a state is beyond the limits."""
        return bool(has_fallen(self._parameters, state))

    def close(self) -> None:
        """End Gazebo."""
        self._server.close()

    def _start(self) -> Server:
        settings = self._settings
        return Server(
            self._parameters, settings.engine, settings.physics_step, settings.gui, self._stop
        )

    def _wait(self) -> None:
        """Wait until a time step has passed since the last one was due."""
        time.sleep(max(0.0, self._due - time.monotonic()))
        period = self._parameters.time_step / self._settings.real_time_factor
        self._due = max(self._due, time.monotonic()) + period

    def _ask(self, kind: int, steps: int, values: State) -> State:
        """Have a request done, by a new server in the same state if the old one died."""
        for attempt in range(1 + RESTARTS):
            try:
                if attempt:
                    self._server.close()
                    self._server = self._start()
                    self._server.ask(RESET, 0, self._state)
                self._state = self._server.ask(kind, steps, values)
                return self._state
            except ServerGoneError as gone:
                print(f"upright: {gone}; it is started again", file=sys.stderr)
        raise UprightError(f"gzserver died {1 + RESTARTS} times in the same step")


SETTINGS = {"default": Gazebo()}
