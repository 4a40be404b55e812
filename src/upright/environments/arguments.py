"""Checks the arguments that all environments share."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete, Space
from numpy.typing import NDArray

from upright.core.cartpole import INTEGRATORS, has_fallen
from upright.core.conditions import Noise
from upright.core.parameters import Parameters, State
from upright.core.task import TaskSpec
from upright.environments import batch
from upright.environments.batch import Rules
from upright.errors import UprightError, require, require_one_of

REWARDS = {"survival": (1.0, 0.0), "failure": (0.0, -1.0)}
"""Reward of each step, and of a fall in addition: Gymnasium's convention, and the papers'."""
DTYPES = ("float32", "float64")
"""Types of an observation."""
FRAMES_PER_SECOND = 50
NO_RENDER_MODE = "render() shows nothing; pass a render_mode when making the environment"
"""Warning for environments that were made without a render mode."""
NO_LIMIT = 2**62
"""A limit on steps that is never reached."""

Array = NDArray[Any]


def make_rules(
    noise: str | Noise = "none",
    start: str | State = "random",
    parameters: Parameters | Mapping[str, Any] | None = None,
    integrator: str = "euler",
    reward: str = "survival",
    steps: int = NO_LIMIT,
    autoreset: int = batch.NEXT_STEP,
) -> Rules:
    """Return what all environments with these arguments have in common.

    Raises
    ------
    UprightError
        If a name is unknown, or a parameter or a size of the noise is impossible.
    """
    custom_noise, custom_start = isinstance(noise, Noise), isinstance(start, State)
    task = TaskSpec.from_data(
        {
            "noise": "none" if custom_noise else noise,
            "start": "random" if custom_start else start,
            "parameters": parameters or {},
        }
    ).task()
    noise = noise if isinstance(noise, Noise) else task.noise
    start = start if isinstance(start, State) else task.start
    for label, values in (("noise", noise), ("start", start)):
        for name in _numbers(values):
            require(f"{label}.{name}", getattr(values, name), 0)
    require_one_of("integrator", integrator, INTEGRATORS)
    require_one_of("reward", reward, REWARDS)
    return Rules(
        task.parameters,
        int(INTEGRATORS[integrator]),
        _in_floats(noise),
        _in_floats(start),
        *REWARDS[reward],
        steps,
        autoreset,
    )


def _numbers(values: Any) -> list[str]:
    return [name for name in values._fields if name != "hides_velocities"]


def _in_floats(values: Any) -> Any:
    """Return a tuple with ints converted to floats, as compiled code distinguishes the two."""
    return values._replace(**{name: float(getattr(values, name)) for name in _numbers(values)})


def make_spaces(parameters: Parameters, continuous: bool, dtype: str) -> tuple[Box, Space[Any]]:
    """Return the spaces of observations and of actions.

    Raises
    ------
    UprightError
        If the type of observations is unknown.
    """
    require_one_of("dtype", dtype, DTYPES)
    limits = (2 * parameters.position_limit, math.inf, 2 * parameters.angle_limit, math.inf)
    high = np.array(limits, dtype)
    force = np.float32(parameters.force)
    actions: Space[Any] = Box(-force, force, (1,)) if continuous else Discrete(2)
    return Box(-high, high, dtype=np.dtype(dtype).type), actions


def check_render_mode(mode: str | None, metadata: dict[str, Any]) -> None:
    """Raise UprightError unless an environment with this metadata has this render mode."""
    if mode is not None:
        require_one_of("render_mode", mode, metadata["render_modes"])


def check_state(parameters: Parameters, state: Any) -> Array:
    """Return one or several requested start states as an array.

    Returns
    -------
    np.ndarray
        Shape (4,) or (n, 4), float64.

    Raises
    ------
    UprightError
        If the shape is another, a number is not finite, or the pole has fallen in a state.
    """
    try:
        states = np.array(state, np.float64)
    except (TypeError, ValueError):
        raise UprightError(f"state is {state!r}; it must be four numbers") from None
    if states.shape[-1:] != (4,) or not np.isfinite(states).all():
        raise UprightError(f"state is {state!r}; it must be four finite numbers")
    for values in states.reshape(-1, 4).tolist():
        if has_fallen(parameters, State(*values)):
            raise UprightError(f"state is {values!r}; the pole has fallen in it")
    return states


def check_options(options: dict[str, Any] | None, *allowed: str) -> dict[str, Any]:
    """Return the options of a reset, empty if there are none.

    Raises
    ------
    UprightError
        If an option is unknown.
    """
    for name in options or {}:
        require_one_of("option", name, allowed)
    return options or {}


def is_noisy(noise: Noise) -> bool:
    """Whether there is any noise."""
    return noise != Noise()
