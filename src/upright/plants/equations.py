"""The equations of motion, compiled: the plant of the published tables."""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from upright.core.cartpole import has_fallen, step
from upright.core.compiled import compiled, inlined
from upright.core.contracts import Plant
from upright.core.parameters import Parameters, State, check_parameters
from upright.core.task import Task


class Equations(NamedTuple):
    """The plant as compiled equations of motion, behind the contract of every body."""

    parameters: Parameters
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
        """Apply a force [N] for one time step and return the state then."""
        memory = self.memory
        after = step(self.parameters, State(memory[0], memory[1], memory[2], memory[3]), force)
        memory[0], memory[1], memory[2], memory[3] = after
        return after

    @inlined
    def has_fallen(self, state: State) -> bool:
        """Whether the pole or the cart left its limits."""
        return has_fallen(self.parameters, state)

    def close(self) -> None:
        """Release nothing: there is nothing to release."""


def equations(parameters: Parameters | None = None) -> Equations:
    """Return the plant as compiled equations, at rest and upright.

    Parameters
    ----------
    parameters
        Of the plant; the published ones unless given.

    Returns
    -------
    Equations
        A plant with the methods `reset`, `step` and `has_fallen`.

    Raises
    ------
    UprightError
        If a parameter is impossible.

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
    return Equations(check_parameters(parameters or Parameters()), np.zeros(4))


@dataclass(frozen=True)
class EquationsSettings:
    """None: the integrator is part of the task."""

    name: ClassVar[str] = "equations"
    alone: ClassVar[bool] = False

    def make(self, task: Task, noise: str, seed: int, stop: np.ndarray) -> tuple[Plant, Task]:
        """Return the equations with the parameters of the task, and the task."""
        return equations(task.parameters), task

    def version(self) -> str:
        """Return nothing: there is no simulator behind the equations."""
        return ""


SETTINGS = EquationsSettings()
