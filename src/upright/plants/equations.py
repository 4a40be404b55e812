"""Compiled equations of motion: the plant of the published tables."""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from upright.core.cartpole import INTEGRATORS, has_fallen, step
from upright.core.compiled import compiled, guard, inlined
from upright.core.conditions import condition_of
from upright.core.contracts import Plant
from upright.core.guards import once, require_array
from upright.core.parameters import Parameters, State, check_parameters
from upright.core.rig import PARAMETER, parameters_of
from upright.core.task import Task
from upright.errors import require_kind, require_one_of
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
        return put(self.memory, state)

    @compiled
    def step(self, force: float) -> State:
        """Apply a force [N] for one time step and return the next state."""
        return advance(self.parameters, self.memory, force, self.integrator)

    @inlined
    def has_fallen(self, state: State) -> bool:
        """Whether the pole or the cart has left its limits."""
        return has_fallen(self.parameters, state)

    def close(self) -> None:
        """Do nothing; the equations hold no resources."""


class ChangingEquations(NamedTuple):
    """The same for a plant whose parameters change in a run, at the cost of some speed."""

    present: np.ndarray
    """The present parameters, shape (parameters, 1), float64: those of the task's rig."""
    integrator: int
    """An `Integrator`, as a number."""
    memory: np.ndarray
    """The present state, shape (4,), float64."""

    @compiled
    def reset(self, state: State) -> State:
        """Put the plant into `state`."""
        return put(self.memory, state)

    @compiled
    def step(self, force: float) -> State:
        """Apply a force [N] for one time step and return the next state."""
        return advance(parameters_of(self.present, 0), self.memory, force, self.integrator)

    @compiled
    def has_fallen(self, state: State) -> bool:
        """Whether the pole or the cart has left its limits."""
        return has_fallen(parameters_of(self.present, 0), state)

    def close(self) -> None:
        """Do nothing; the equations hold no resources."""


@inlined
def put(memory: np.ndarray, state: State) -> State:
    """Write a state to the memory of a plant, shape (4,), and return it."""
    memory[0], memory[1], memory[2], memory[3] = state  # also numbers of several types
    return state


@inlined
def advance(parameters: Parameters, memory: np.ndarray, force: float, integrator: int) -> State:
    """Advance the state in the memory of a plant by a time step, and return it."""
    state = State(memory[0], memory[1], memory[2], memory[3])
    return put(memory, step(parameters, state, force, integrator))


@once
def _check_plant(plant: Equations | ChangingEquations) -> None:
    require_array("memory of the plant", plant.memory, np.float64, 4)
    if isinstance(plant, ChangingEquations):
        require_array("present parameters", plant.present, np.float64, len(PARAMETER), 1)


@guard(Equations.reset)
@guard(ChangingEquations.reset)
def _check_reset(plant: Equations | ChangingEquations, state: State) -> None:
    _check_plant(plant)
    require_kind("state", state, State, "a State")


@guard(Equations.step)
@guard(ChangingEquations.step)
@guard(ChangingEquations.has_fallen)
def _check_step(plant: Equations | ChangingEquations, _argument: float | State) -> None:
    _check_plant(plant)


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
    can_change: ClassVar[bool] = True
    """Whether parameters can change within a run; plants that do not say so cannot."""

    def __post_init__(self) -> None:
        """Refuse unknown integrators."""
        require_one_of("integrator", self.integrator, INTEGRATORS)

    def make(self, context: RunContext) -> tuple[Plant, Task]:
        """Return the equations with the parameters of the task, and the task."""
        task = context.task
        plant = equations(task.parameters, self.integrator)
        if task.rig is None or not condition_of(context.spec.condition).changes_plant:
            return plant, task
        return ChangingEquations(task.rig.present, plant.integrator, plant.memory), task

    def version(self) -> str:
        """Return an empty string: there is no simulator behind the equations."""
        return ""


EQUATIONS = EquationsSettings()
"""The plant of the published tables."""
SETTINGS = {"default": EQUATIONS}
