"""Compiled equations of motion: the plant of the published tables."""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from upright.core.cartpole import INTEGRATORS, has_fallen, step
from upright.core.compiled import compiled, inlined
from upright.core.contracts import Plant
from upright.core.parameters import Parameters, State, check_parameters
from upright.core.task import Task
from upright.errors import require_one_of
from upright.plants.settings import RunContext


class Equations(NamedTuple):
    """The compiled equations of motion, as a plant."""

    parameters: Parameters
    integrator: int
    """An `Integrator`, as a number."""
    memory: np.ndarray
    """The present state, shape (4,), float64."""

    @compiled
    def reset(self, state: State) -> State:
        """Put the plant into `state`."""
        for i in range(4):
            self.memory[i] = state[i]
        return state

    @compiled
    def step(self, force: float) -> State:
        """Apply a force [N] for one time step and return the next state."""
        memory = self.memory
        state = State(memory[0], memory[1], memory[2], memory[3])
        state = step(self.parameters, state, force, self.integrator)
        memory[0], memory[1], memory[2], memory[3] = state
        return state

    @inlined
    def has_fallen(self, state: State) -> bool:
        """Whether the pole or the cart has left its limits."""
        return has_fallen(self.parameters, state)

    def close(self) -> None:
        """Do nothing; the equations hold no resources."""


def equations(parameters: Parameters | None = None, integrator: str = "euler") -> Equations:
    """Return the plant as compiled equations, at rest and upright.

    Parameters
    ----------
    parameters
        Parameters of the plant; the published ones by default.
    integrator
        "euler" as in the published tables, "semi-implicit" or "rk4".

    Returns
    -------
    Equations
        A plant with the methods `reset`, `step` and `has_fallen`.

    Raises
    ------
    UprightError
        If a parameter is impossible, or there is no such integrator.

    Examples
    --------
    >>> plant = upright.equations()
    >>> state = plant.reset(upright.State(0.0, 0.0, 0.0, 0.0))
    >>> state = plant.step(10.0)  # a push of 10 N to the right, for 0.02 s
    >>> round(state.x_dot, 3), round(state.theta_dot, 3)
    (0.195, -0.293)
    >>> plant.has_fallen(state)
    False
    """
    require_one_of("integrator", integrator, INTEGRATORS)
    number = int(INTEGRATORS[integrator])
    return Equations(check_parameters(parameters or Parameters()), number, np.zeros(4))


@dataclass(frozen=True)
class EquationsSettings:
    """Settings of the equations."""

    integrator: str = "euler"
    """Method of computing a time step: euler (as published), semi-implicit or rk4."""

    name: ClassVar[str] = "equations"
    alone: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Refuse unknown integrators."""
        require_one_of("integrator", self.integrator, INTEGRATORS)

    def make(self, context: RunContext) -> tuple[Plant, Task]:
        """Return the equations with the parameters of the task, and the task."""
        return equations(context.task.parameters, self.integrator), context.task

    def version(self) -> str:
        """Return an empty string: there is no simulator behind the equations."""
        return ""


EQUATIONS = EquationsSettings()
"""The plant of the published tables."""
SETTINGS = {"default": EQUATIONS}
