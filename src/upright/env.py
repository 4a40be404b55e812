"""The cart-pole as a Gymnasium environment, one at a time or many at once.

`CartPoleEnv` steps the plant and the noise of the package; `CartPoleVectorEnv` steps many, each
through exactly the same, by the compiled loop in `lanes.py`. docs/environment.md is the reference.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import InvalidAction, ResetNeeded
from gymnasium.spaces import Box, Discrete, Space
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from upright import lanes
from upright.cartpole import Parameters, State, check_parameters, has_fallen, step
from upright.compiled import compiled, machine_code
from upright.drawing import Scene, Window, picture, text_picture
from upright.errors import UprightError, require, require_one_of
from upright.lanes import Outcome, Rules, Stream, make_lanes, reset_lanes, seed_words, step_lanes
from upright.noise import NOISES, Noise, disturb, draw_start, measure
from upright.task import STARTS

REWARDS = {"survival": (1.0, 0.0), "failure": (0.0, -1.0)}
"""What a step is worth, and a fall on top of it: Gymnasium's convention, and the papers'."""
DTYPES = ("float32", "float64")
"""Types of an observation."""
MODES = {
    AutoresetMode.NEXT_STEP: lanes.NEXT_STEP,
    AutoresetMode.SAME_STEP: lanes.SAME_STEP,
    AutoresetMode.DISABLED: lanes.DISABLED,
}
"""What the loop calls Gymnasium's modes."""
_NO_WORD = np.zeros(1, np.uint64)
NOTHING_DRAWN = Stream(_NO_WORD, _NO_WORD, _NO_WORD, _NO_WORD, 0)
"""Stands for random numbers where none are drawn."""
FRAMES_PER_SECOND = 50
NO_LIMIT = 2**62
"""More steps than anybody will make."""

Array = NDArray[Any]


# ------------------------------------------------------------------------------------ arguments


def make_rules(
    noise: str | Noise = "none",
    start: str | State = "random",
    parameters: Parameters | Mapping[str, Any] | None = None,
    reward: str = "survival",
    steps: int = NO_LIMIT,
    autoreset: int = lanes.NEXT_STEP,
) -> Rules:
    """Return what all environments with these arguments have in common.

    Raises
    ------
    UprightError
        If a name is unknown, a parameter is impossible, or a size of the noise is none.
    """
    if not isinstance(noise, Noise):
        require_one_of("noise", noise, NOISES)
        noise = NOISES[noise]
    if not isinstance(start, State):
        require_one_of("start", start, STARTS)
        start = STARTS[start]
    for label, values in (("noise", noise), ("start", start)):
        for name in _numbers(values):
            require(f"{label}.{name}", getattr(values, name), 0)
    if not isinstance(parameters, Parameters):
        for name in parameters or {}:
            require_one_of("parameter", name, Parameters._fields)
        parameters = Parameters()._replace(**(parameters or {}))
    parameters = check_parameters(parameters)
    require_one_of("reward", reward, REWARDS)
    return Rules(
        _in_floats(parameters),
        _in_floats(noise),
        _in_floats(start),
        *REWARDS[reward],
        steps,
        autoreset,
    )


def _numbers(values: Any) -> list[str]:
    return [name for name in values._fields if name not in ("integrator", "hides_velocities")]


def _in_floats(values: Any) -> Any:
    """Return a tuple with float for int, which compiled code tells apart."""
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


def _check_render_mode(mode: str | None, metadata: dict[str, Any]) -> None:
    if mode is not None:
        require_one_of("render_mode", mode, metadata["render_modes"])


def check_state(parameters: Parameters, state: Any) -> Array:
    """Return a true state that was asked for, or several; shape (4,) or (n, 4), float64.

    Raises
    ------
    UprightError
        If it has another shape or is no number, or the pole has fallen.
    """
    try:
        states = np.array(state, np.float64)
    except (TypeError, ValueError):
        raise UprightError(f"state is {state!r}; it must be four numbers") from None
    if states.shape[-1:] != (4,) or not np.isfinite(states).all():
        raise UprightError(f"state is {state!r}; it must be four finite numbers")
    for each in states.reshape(-1, 4):
        if has_fallen(parameters, State(*each.tolist())):
            raise UprightError(f"state is {each.tolist()!r}; there the pole has fallen")
    return states


def check_options(options: dict[str, Any] | None, *allowed: str) -> dict[str, Any]:
    """Return the options of a reset, none if there are none.

    Raises
    ------
    UprightError
        If one is unknown.
    """
    for name in options or {}:
        require_one_of("option", name, allowed)
    return options or {}


# ---------------------------------------------------------------------------------- environment


class StreamOfLane(np.random.SFC64):
    """What a lane draws from; its state can be compared, as Gymnasium's checks do."""

    @property
    def state(self) -> Any:
        """All that determines what is drawn next, in plain numbers."""
        whole = super().state
        return whole | {"state": {"state": tuple(whole["state"]["state"].tolist())}}

    @state.setter
    def state(self, value: Any) -> None:
        words = np.array(value["state"]["state"], np.uint64)
        whole = value | {"state": {"state": words}}
        np.random.SFC64.state.__set__(self, whole)  # type: ignore[attr-defined]


@compiled
def advance(
    rules: Rules, state: State, force: float, rng: np.random.Generator
) -> tuple[State, State, float, bool]:
    """Return the state after a push of a force [N], what is seen of it, and the force that acted.

    The last tells whether the pole has fallen.
    """
    acting = disturb(rules.noise, force, rng)
    state = step(rules.parameters, state, acting)
    seen = measure(rules.noise, state, rng)
    return state, seen, acting, has_fallen(rules.parameters, state)


class CartPoleEnv(gymnasium.Env[Array, Any]):
    """A cart-pole with friction and noise, as the published tables have it.

    Observation: ``(x, x_dot, theta, theta_dot)`` as measured [m, m/s, rad, rad/s]. Action: 0 pushes
    left, 1 right; with `continuous` the force itself [N]. An episode ends when the true state
    leaves ±2.4 m or ±12°. Under noise, ``info["state"]`` has the true state.

    Parameters
    ----------
    noise
        Name of a noise case, or a `Noise` of one's own.
    start
        Name of a start, or half-widths of one's own.
    parameters
        The plant, or those of its parameters that differ.
    reward
        "survival": 1 for every step; or "failure": -1 for the step of the fall, else 0.
    continuous
        Whether an action is a force.
    dtype
        Type of observations; the plant always computes in float64.
    render_mode
        "human", "rgb_array", "ansi" or None.

    Raises
    ------
    UprightError
        If an argument is none of the allowed ones.
    """

    metadata = {  # noqa: RUF012 - as Gymnasium has it
        "render_modes": ["human", "rgb_array", "ansi"],
        "render_fps": FRAMES_PER_SECOND,
    }

    def __init__(
        self,
        noise: str | Noise = "none",
        start: str | State = "random",
        parameters: Parameters | Mapping[str, Any] | None = None,
        reward: str = "survival",
        continuous: bool = False,
        dtype: str = "float32",
        render_mode: str | None = None,
    ) -> None:
        _check_render_mode(render_mode, self.metadata)
        self.rules = make_rules(noise, start, parameters, reward)
        self.observation_space, self.action_space = make_spaces(
            self.rules.parameters, continuous, dtype
        )
        self.continuous, self.dtype, self.render_mode = continuous, np.dtype(dtype), render_mode
        self._tells = is_noisy(self.rules.noise)
        self._state: State | None = None
        self._seen: State | None = None
        self._force = 0.0
        self._steps = 0
        self._over = True
        self._advance: Any = None
        self._window: Window | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode.

        Parameters
        ----------
        seed
            Begins the random numbers anew; without it they go on.
        options
            ``{"state": four numbers}`` begins in this true state.

        Raises
        ------
        UprightError
            If an option is unknown, or there is no such state in which the pole stands.
        """
        super().reset(seed=seed)
        if seed is not None or self._np_random is None:
            sequence = np.random.SeedSequence(seed)
            self._np_random = np.random.Generator(StreamOfLane(sequence))
            self._np_random_seed = sequence.entropy  # type: ignore[assignment]
        wanted = check_options(options, "state").get("state")
        if wanted is None:
            state = draw_start(self.rules.start, self._np_random)
        else:
            state = State(*_one_state(self.rules.parameters, wanted))
        self._steps, self._over, self._force = 0, False, 0.0
        self._state, self._seen = state, measure(self.rules.noise, state, self._np_random)
        return self._tell()

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Push the cart for one time step.

        Raises
        ------
        InvalidAction
            If it is none of the action space.
        ResetNeeded
            If no episode has begun, or the pole has fallen.
        """
        if self._over:
            why = "no episode has begun" if self._state is None else "the pole has fallen"
            raise ResetNeeded(f"{why}; call reset() before step()")
        rules = self.rules
        arguments = rules, self._state, self._asked(action), self._rng()
        if self._advance is None:
            self._advance = machine_code(advance, *arguments)
        self._state, self._seen, self._force, self._over = self._advance(*arguments)
        self._steps += 1
        reward = rules.step_reward + (rules.fall_reward if self._over else 0.0)
        observation, info = self._tell()
        return observation, reward, self._over, False, info

    def _rng(self) -> Any:
        """Return what noise is drawn from; where there is none, what is passed on faster."""
        return self._np_random if self._tells else NOTHING_DRAWN

    def _asked(self, action: Any) -> float:
        """Return the force [N] that an action asks for."""
        limit = self.rules.parameters.force
        if self.continuous:
            asked = np.asarray(action)
            is_number = asked.shape == (1,) and asked.dtype.kind in "fiu"
            if is_number and abs(asked[0]) <= np.float32(limit):
                return float(asked[0])
        elif (type(action) is int and 0 <= action <= 1) or self.action_space.contains(action):
            return limit if action == 1 else -limit
        raise InvalidAction(f"action is {action!r}; it must be in {self.action_space}")

    def _tell(self) -> tuple[Array, dict[str, Any]]:
        """Return the observation and what else is told."""
        if self.render_mode == "human":
            self.render()
        info = {"state": np.array(self._state)} if self._tells else {}
        return np.array(self._seen, self.dtype), info

    def render(self) -> Any:
        """Show the cart-pole, or return its picture.

        Returns
        -------
        numpy.ndarray or str or None
            Shape (height, width, 3), uint8, for "rgb_array"; text for "ansi"; else None.
        """
        if self.render_mode is None:
            gymnasium.logger.warn("render() shows nothing; give a render_mode when making it")
            return None
        if self._state is None:
            raise ResetNeeded("no episode has begun; call reset() before render()")
        seconds = self._steps * self.rules.parameters.time_step
        caption = f"step {self._steps:,}, {seconds:.1f} s"
        scene = Scene(self._state, self._seen, self._force, caption)
        if self.render_mode == "ansi":
            return text_picture(self.rules.parameters, scene)
        pixels = picture(self.rules.parameters, scene)
        if self.render_mode == "rgb_array":
            return pixels
        if self._window is None:
            self._window = Window("Upright", FRAMES_PER_SECOND)
        self._window.show(pixels)
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled: all but the window and the machine code."""
        return self.__dict__ | {"_window": None, "_advance": None}


def is_noisy(noise: Noise) -> bool:
    """Whether there is any noise."""
    return noise != Noise()


def _one_state(parameters: Parameters, state: Any) -> list[float]:
    states = check_state(parameters, state)
    if states.ndim != 1:
        raise UprightError(f"state is {state!r}; it must be four numbers")
    return states.tolist()  # type: ignore[no-any-return]


# --------------------------------------------------------------------------- vector environment


class CartPoleVectorEnv(VectorEnv[Array, Array, Array]):
    """Many cart-poles at once, each like a `CartPoleEnv`.

    With one seed, environment i goes through what a `CartPoleEnv` goes through that is reset with
    the seed plus i.

    Parameters
    ----------
    num_envs
        How many.
    max_episode_steps
        After so many steps an episode is truncated; None or -1 is never.
    autoreset_mode
        When an episode that ended is followed by the next: an `AutoresetMode` or its value.
    render_mode
        "rgb_array", "ansi" or None.
    noise, start, parameters, reward, continuous, dtype
        As for `CartPoleEnv`.

    Raises
    ------
    UprightError
        If an argument is none of the allowed ones.
    """

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        noise: str | Noise = "none",
        start: str | State = "random",
        parameters: Parameters | Mapping[str, Any] | None = None,
        reward: str = "survival",
        continuous: bool = False,
        dtype: str = "float32",
    ) -> None:
        require("num_envs", num_envs, 1, 10**8, whole=True)
        if max_episode_steps in (None, -1):
            max_episode_steps = NO_LIMIT
        require("max_episode_steps", max_episode_steps, 1, NO_LIMIT, whole=True)
        if not isinstance(autoreset_mode, AutoresetMode):
            require_one_of("autoreset_mode", autoreset_mode, [mode.value for mode in MODES])
        mode = AutoresetMode(autoreset_mode)
        self.metadata = {
            "render_modes": ["rgb_array", "ansi"],
            "render_fps": FRAMES_PER_SECOND,
            "autoreset_mode": mode,
        }
        _check_render_mode(render_mode, self.metadata)
        self.render_mode, self.num_envs = render_mode, num_envs
        self.rules = make_rules(noise, start, parameters, reward, max_episode_steps, MODES[mode])
        self.single_observation_space, self.single_action_space = make_spaces(
            self.rules.parameters, continuous, dtype
        )
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._batch_type = self.action_space.shape, self.action_space.dtype
        self.dtype, self.continuous = np.dtype(dtype), continuous
        self._lanes = make_lanes(num_envs)
        self._seeds: list[int | None] = [None] * num_envs
        self._observations: Array | None = None
        self._told = is_noisy(self.rules.noise)
        self._final = mode == AutoresetMode.SAME_STEP
        self._nothing, self._no_seen = np.empty((4, 0)), np.empty((4, 0), self.dtype)
        self._step: Any = None

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Array, dict[str, Any]]:
        """Begin episodes.

        Parameters
        ----------
        seed
            Environment i is seeded with the seed plus i, or with the i-th of several; without one
            its random numbers go on.
        options
            ``{"state": ...}`` begins in these true states, shape (4,) or (num_envs, 4);
            ``{"reset_mask": ...}``, shape (num_envs,), bool, leaves environments as they are where
            it is False; for them the last observations are returned again.

        Raises
        ------
        UprightError
            If an option is unknown or there is no such state, or a seed, mask or state has another
            shape.
        """
        options = check_options(options, "state", "reset_mask")
        chosen = self._chosen(options.get("reset_mask"))
        states = options.get("state")
        if states is not None:
            states = np.broadcast_to(self._states(states), (self.num_envs, 4))
            self._lanes.states[:, chosen] = states[chosen].T
        self._seed(seed, chosen)
        observations = np.empty((4, self.num_envs), self.dtype)
        if self._observations is not None:
            observations[:] = self._observations.T
        reset_lanes(self.rules, self._lanes, chosen, states is None, observations)
        self._observations = observations.T
        infos = {"state": self._lanes.states.T.copy(), "_state": chosen} if self._told else {}
        return self._observations, infos

    def _chosen(self, mask: Any) -> NDArray[np.bool_]:
        """Return which environments are to be reset."""
        if mask is None:
            return np.ones(self.num_envs, np.bool_)
        chosen = np.array(mask)
        if chosen.shape != (self.num_envs,) or chosen.dtype != np.bool_ or not chosen.any():
            raise UprightError(
                f"reset_mask is {mask!r}; it must be {self.num_envs} bools, one of them True"
            )
        if self._observations is None and not chosen.all():
            raise ResetNeeded("the first reset() must be one of all environments")
        return chosen

    def _states(self, states: Any) -> Array:
        checked = check_state(self.rules.parameters, states)
        if checked.shape not in ((4,), (self.num_envs, 4)):
            raise UprightError(
                f"state has the shape {checked.shape}; it must be (4,) or ({self.num_envs}, 4)"
            )
        return checked

    def _seed(self, seed: int | Sequence[int | None] | None, chosen: NDArray[np.bool_]) -> None:
        """Begin the random numbers of the chosen environments anew, where they have a seed."""
        if seed is None or isinstance(seed, (int, np.integer)):
            seeds = [None if seed is None else int(seed) + i for i in range(self.num_envs)]
        else:
            seeds = list(seed)
        if len(seeds) != self.num_envs:
            raise UprightError(f"seed has {len(seeds)} values; it must have {self.num_envs}")
        for each in seeds:
            if each is not None:
                require("seed", each, 0, whole=True)
        for i in np.flatnonzero(chosen):
            if seeds[i] is not None or self._seeds[i] is None:
                sequence = np.random.SeedSequence(seeds[i])
                self._seeds[i] = sequence.entropy  # type: ignore[assignment]
                self._lanes.words[:, i] = seed_words(sequence)

    @property
    def np_random_seed(self) -> tuple[int | None, ...]:  # type: ignore[override]
        """The seeds of the environments, as in `gymnasium.vector.SyncVectorEnv`."""
        return tuple(self._seeds)

    def step(self, actions: Any) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """Push every cart for one time step.

        Where an episode has ended before and the mode is "NextStep", the next one begins instead.

        Parameters
        ----------
        actions
            Shape (num_envs,), 0 or 1; or (num_envs, 1), forces [N].

        Returns
        -------
        tuple
            Observations, shape (num_envs, 4); rewards, terminations and truncations, (num_envs,);
            and infos. Nobody keeps or changes these arrays later.

        Raises
        ------
        InvalidAction
            If an action is none of the action space; no environment has made a step then.
        ResetNeeded
            If no episode has begun, or, with autoreset disabled, one has ended.
        """
        if self._step is None:
            self._step = self._compile()
        if not self._is_batch(actions):
            actions = self._batch(actions)
        outcome = self._new_outcome()
        begun = self._step(self.rules, self._lanes, actions, outcome)
        if begun < 0:
            self._refuse(begun, actions)
        self._observations = observations = outcome.observations.T
        infos = self._infos(outcome, begun) if self._told or self._final else {}
        return observations, outcome.rewards, outcome.terminations, outcome.truncations, infos

    def _compile(self) -> Any:
        """Return the compiled step for arguments of these types."""
        if self._observations is None:
            raise ResetNeeded("no episode has begun; call reset() before step()")
        actions = np.zeros(self.action_space.shape or (), self.action_space.dtype)
        return machine_code(step_lanes, self.rules, self._lanes, actions, self._new_outcome())

    def _new_outcome(self) -> Outcome:
        """Return room for what a step leads to."""
        n, block = self.num_envs, (4, self.num_envs)
        terminations, truncations = np.empty((2, n), np.bool_)
        return Outcome(
            np.empty(block, self.dtype),
            np.empty(n),
            terminations,
            truncations,
            np.empty(block) if self._told else self._nothing,
            np.empty(block, self.dtype) if self._final else self._no_seen,
            np.empty(block) if self._told and self._final else self._nothing,
        )

    def _is_batch(self, actions: Any) -> bool:
        """Whether actions are of the type that the compiled step takes."""
        shape, dtype = self._batch_type
        return (
            type(actions) is np.ndarray
            and actions.dtype is dtype
            and actions.shape == shape
            and actions.flags.c_contiguous
        )

    def _batch(self, actions: Any) -> Array:
        """Return actions as the compiled step takes them."""
        space = self.action_space
        asked = np.asarray(actions)
        kinds = "fiu" if self.continuous else "iub"
        if asked.shape != space.shape or asked.dtype.kind not in kinds:
            raise InvalidAction(
                f"actions are of shape {asked.shape} and type {asked.dtype}; "
                f"they must be {space.shape} and {space.dtype}"
            )
        return np.ascontiguousarray(asked, space.dtype)

    def _refuse(self, why: int, actions: Array) -> None:
        """Raise the error for a step that was not made."""
        if why == lanes.ENDED:
            numbers = np.flatnonzero(self._lanes.ended)[:5].tolist()
            raise ResetNeeded(
                f"the episodes of environments {numbers} … have ended; reset them before step(): "
                'reset(options={"reset_mask": terminations | truncations})'
            )
        allowed = self.single_action_space
        first = next(i for i, action in enumerate(actions) if action not in allowed)
        raise InvalidAction(f"action {first} is {actions[first]!r}; it must be in {allowed}")

    def _infos(self, outcome: Outcome, begun: int) -> dict[str, Any]:
        """Return true states under noise, and what episodes ended with that the next replaced."""
        infos: dict[str, Any] = {}
        if self._final and begun > 0:
            ended = outcome.terminations | outcome.truncations
            infos["final_obs"], infos["_final_obs"] = outcome.final_observations.T, ended
            final = {"state": outcome.final_states.T, "_state": ended} if self._told else {}
            infos["final_info"], infos["_final_info"] = final, ended
        if self._told:
            infos["state"] = outcome.states.T
            infos["_state"] = np.ones(self.num_envs, np.bool_)
        return infos

    def render(self) -> tuple[Any, ...] | None:
        """Return a picture of each environment; of the true states, without forces.

        Returns
        -------
        tuple or None
            Arrays of shape (height, width, 3), uint8, for "rgb_array"; texts for "ansi".
        """
        if self.render_mode is None:
            gymnasium.logger.warn("render() shows nothing; give a render_mode when making it")
            return None
        if self._observations is None:
            raise ResetNeeded("no episode has begun; call reset() before render()")
        draw = picture if self.render_mode == "rgb_array" else text_picture
        states, seen = self._lanes.states.T.tolist(), self._observations.tolist()
        return tuple(
            draw(self.rules.parameters, Scene(State(*state), State(*measured), 0.0, f"cart {i}"))
            for i, (state, measured) in enumerate(zip(states, seen, strict=True))
        )

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled: all but the machine code."""
        return self.__dict__ | {"_step": None}
