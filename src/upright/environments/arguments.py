"""Checks the arguments that all environments share."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar

import numpy as np
from gymnasium.spaces import Box, Discrete, Space
from numpy.typing import NDArray

from upright.core.cartpole import INTEGRATORS, has_fallen
from upright.core.conditions import Condition, Noise, condition_of
from upright.core.parameters import LARGEST, Parameters, State
from upright.core.rig import draw_rows
from upright.core.task import TaskSpec, check_start
from upright.environments import batch
from upright.environments.batch import Rules
from upright.environments.varying import all_draws, closest_limits
from upright.errors import UprightError, require, require_kind, require_one_of

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


class Setup(NamedTuple):
    """What all environments with the same arguments have in common."""

    rules: Rules
    condition: Condition
    """The condition, without what is drawn for each episode."""
    draws: NDArray[Any]
    """What is drawn for each episode, as in `core.rig.Rig`."""
    closest: Parameters
    """The parameters, with the closest limits that an episode can have unless others are given."""


def make_setup(
    noise: Any = "none",
    start: Any = "random",
    parameters: Any = None,
    integrator: str = "euler",
    reward: str = "survival",
    condition: str = "nominal",
    randomise: Mapping[str, Any] | None = None,
    steps: int = NO_LIMIT,
    autoreset: int = batch.NEXT_STEP,
) -> Setup:
    """Return what all environments with these arguments have in common.

    Raises
    ------
    UprightError
        If a name is unknown, a parameter or a size of the noise is impossible, episodes could
        begin beyond the limits, or the condition draws a plant for every run.
    """
    custom_noise = _as_tuple(Noise, "noise", noise)
    custom_start = _as_tuple(State, "start", start)
    spec = TaskSpec(
        noise="none" if custom_noise else noise,
        start="zero" if custom_start else start,
        condition=condition,
        parameters=_as_tuple(Parameters, "parameters", parameters) or parameters or Parameters(),
    )
    task, whole = spec.task(), condition_of(spec.condition)
    if whole.varies_plant or whole.each_run:
        raise UprightError(
            f"condition is {spec.condition!r}; an environment has no runs: use terms such as "
            "each-episode.half_length=0.25:1, or parameters"
        )
    draws = all_draws(randomise, whole, task.parameters)
    closest = closest_limits(task.parameters, draws)
    check_start(start, custom_start or task.start, closest)
    if custom_noise:
        hides = custom_noise.hides_velocities or whole.hides_velocities
        task = task._replace(noise=custom_noise._replace(hides_velocities=hides))
    require_one_of("integrator", integrator, INTEGRATORS)
    require_one_of("reward", reward, REWARDS)
    rules = Rules(
        task.parameters,
        int(INTEGRATORS[integrator]),
        task.noise,
        custom_start or task.start,
        *REWARDS[reward],
        steps,
        autoreset,
    )
    return Setup(rules, whole._replace(each_episode=()), draw_rows(draws), closest)


T = TypeVar("T", Noise, State, Parameters)


def _as_tuple(kind: type[T], label: str, value: Any) -> T | None:
    """Return custom noise, start or parameters; None for anything else.

    They may be as JSON gives them back: as a list. A dictionary by name is accepted too, except
    for parameters, where it means changes.

    Raises
    ------
    UprightError
        If a part is missing, unknown or impossible.
    """
    by_name = isinstance(value, Mapping) and kind is not Parameters
    if not by_name and not isinstance(value, (list, tuple)):
        return None
    if by_name:
        for name in value:
            require_one_of(f"part of {label}", name, kind._fields)
    try:
        whole = kind(**value) if by_name else kind(*value)
    except TypeError:
        raise UprightError(
            f"{label} is {value!r}; it must have the parts {', '.join(kind._fields)}"
        ) from None
    return whole if kind is Parameters else _in_floats(label, whole)


def _in_floats(label: str, values: Any) -> Any:
    """Return sizes with ints converted to floats, as compiled code distinguishes the two."""
    floats = {}
    for name, value in values._asdict().items():
        if name == "hides_velocities":
            require_kind(f"{label}.{name}", value, bool, "True or False")
        else:
            require(f"{label}.{name}", value, 0, LARGEST)
            floats[name] = float(value)
    return values._replace(**floats)


def make_spaces(parameters: Parameters, continuous: bool, dtype: str) -> tuple[Box, Space[Any]]:
    """Return the spaces of observations and of actions.

    Nothing bounds a measurement: an episode ends once a limit has been passed, by any distance that
    the pole or the cart goes in a time step, and noise may add to that.

    Raises
    ------
    UprightError
        If the type of observations is unknown.
    """
    require_one_of("dtype", dtype, DTYPES)
    force = np.float32(parameters.force)
    actions: Space[Any] = Box(-force, force, (1,)) if continuous else Discrete(2)
    return Box(-math.inf, math.inf, (4,), np.dtype(dtype).type), actions


def check_render_mode(mode: str | None, metadata: dict[str, Any]) -> None:
    """Raise UprightError unless an environment with this metadata has this render mode."""
    if mode is not None:
        require_one_of("render_mode", mode, metadata["render_modes"])


def check_episodes(
    setup: Setup, name: Any, given: Array | None, state: Any, lanes: NDArray[np.bool_]
) -> Array | None:
    """Return the requested start states of several lanes; None if they are drawn.

    Parameters
    ----------
    name
        What the user calls the start.
    given
        The parameters that `given_parameters` returned.
    state
        Four numbers, the same for each lane, or None.
    lanes
        Which lanes begin an episode, shape (n,), bool.

    Returns
    -------
    np.ndarray or None
        Shape (n, 4), float64.

    Raises
    ------
    UprightError
        If episodes could begin beyond their limits, the shape is another, or a number is not
        finite.
    """
    if given is None and state is None:
        return None  # the environment was checked when it was made
    closest = np.array(setup.closest)[:, np.newaxis]
    plants = np.where(np.isnan(given), closest, given) if given is not None else closest
    plants = np.broadcast_to(plants, (len(closest), len(lanes)))[:, lanes]
    if state is None:
        check_start(name, setup.rules.start, Parameters(*plants.min(axis=1).tolist()))
        return None
    states = np.broadcast_to(_states(state, len(lanes)), (len(lanes), 4))
    for values, plant in zip(states[lanes].tolist(), plants.T.tolist(), strict=True):
        if has_fallen(Parameters(*plant), State(*values)):
            raise UprightError(f"state is {values!r}; the pole has fallen in it")
    return states


def _states(state: Any, count: int) -> Array:
    """Return one or several requested start states as an array."""
    try:
        states = np.array(state, np.float64)
    except (TypeError, ValueError):
        raise UprightError(f"state is {state!r}; it must be four numbers") from None
    if states.shape[-1:] != (4,) or not (np.abs(states) <= LARGEST).all():
        raise UprightError(
            f"state is {state!r}; it must be four finite numbers, of at most {LARGEST:,} in size"
        )
    if states.shape not in ((4,), (count, 4)):
        allowed = "four numbers" if count == 1 else f"(4,) or ({count}, 4)"
        raise UprightError(f"shape of state is {states.shape}; it must be {allowed}")
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
