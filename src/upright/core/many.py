"""Many cart-poles at once, each advanced exactly as `cartpole.step` advances one."""

from collections.abc import Callable

import numpy as np

from upright.core.cartpole import EULER, Integrator, step, step_small
from upright.core.compiled import compiled, guard, inlined
from upright.core.guards import require_array
from upright.core.parameters import Parameters, State
from upright.core.portable_math import SMALL

Rows = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""States of many cart-poles: their x, x_dot, theta and theta_dot."""
PART = 512
"""Number of cart-poles advanced at a time: their data fit into the first-level cache."""


@inlined
def _step_small(parameters: Parameters, state: State, force: float, _integrator: int) -> State:
    return step_small(parameters, state, force)


def _loop(advance: Callable[[Parameters, State, float, int], State]) -> Callable[..., None]:
    """Return a loop over many cart-poles that advances each of them with `advance`."""

    @inlined
    def loop(parameters: Parameters, states: Rows, forces: np.ndarray, integrator: int) -> None:
        x, x_dot, theta, theta_dot = states
        for i in range(len(forces)):
            previous = State(x[i], x_dot[i], theta[i], theta_dot[i])
            x[i], x_dot[i], theta[i], theta_dot[i] = advance(
                parameters, previous, forces[i], integrator
            )

    return loop


_small_loop, _any_loop = _loop(_step_small), _loop(step)


@inlined
def step_part(
    parameters: Parameters, states: Rows, forces: np.ndarray, integrator: int = EULER
) -> None:
    """Advance at most PART cart-poles, given the four rows of their states, like `step_many`."""
    theta = states[2]
    others = 0
    for i in range(len(theta)):
        others += 1 if abs(theta[i]) > SMALL else 0
    if others == 0 and integrator == Integrator.EULER and parameters.static_friction == 0.0:
        _small_loop(parameters, states, forces, integrator)
    else:
        _any_loop(parameters, states, forces, integrator)


@compiled
def step_many(
    parameters: Parameters, states: np.ndarray, forces: np.ndarray, integrator: int = EULER
) -> None:
    """Advance many independent cart-poles by one time step, in place.

    The resulting states are those of `step`, to the last bit.

    Parameters
    ----------
    states
        Shape (4, n), float64, rows in the order of `State`.
    forces
        Shape (n,), the force on each cart [N].
    integrator
        An `Integrator`, as an integer.

    Raises
    ------
    UprightError
        If Python calls it with arrays of other shapes or types.
    """
    for first in range(0, len(forces), PART):
        end = min(first + PART, len(forces))
        part = (
            states[0, first:end],
            states[1, first:end],
            states[2, first:end],
            states[3, first:end],
        )
        step_part(parameters, part, forces[first:end], integrator)


@guard(step_many)
def _check_arrays(
    _parameters: Parameters, states: np.ndarray, forces: np.ndarray, _integrator: int = EULER
) -> None:
    count = getattr(forces, "size", None)  # np.size takes as long as the rest
    require_array("forces", forces, None, count, written=False)
    require_array("states", states, np.float64, 4, count)
