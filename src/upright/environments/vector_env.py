"""Many cart-poles as a Gymnasium vector environment, by the compiled loop in `batch.py`.

Each goes through exactly what a `CartPoleEnv` with its seed goes through.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import InvalidAction, ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from upright.core.compiled import machine_code
from upright.core.conditions import Noise
from upright.core.parameters import Parameters, State
from upright.environments import batch
from upright.environments.arguments import (
    FRAMES_PER_SECOND,
    NO_LIMIT,
    Array,
    check_options,
    check_render_mode,
    check_state,
    is_noisy,
    make_rules,
    make_spaces,
)
from upright.environments.batch import Outcome, make_lanes, reset_lanes, seed_words, step_lanes
from upright.errors import UprightError, require, require_one_of
from upright.pictures.picture import picture
from upright.pictures.scene import Scene
from upright.pictures.text import text_picture

MODES = {
    AutoresetMode.NEXT_STEP: batch.NEXT_STEP,
    AutoresetMode.SAME_STEP: batch.SAME_STEP,
    AutoresetMode.DISABLED: batch.DISABLED,
}
"""What the loop calls Gymnasium's modes."""


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
    noise, start, parameters, reward, continuous, dtype, integrator
        As for `CartPoleEnv`.

    Raises
    ------
    UprightError
        If an argument is none of the allowed ones.

    Examples
    --------
    >>> envs = upright.CartPoleVectorEnv(num_envs=8, start="wide")
    >>> observations, infos = envs.reset(seed=0)
    >>> observations.shape
    (8, 4)
    >>> observations, rewards, fallen, truncated, infos = envs.step(envs.action_space.sample())
    >>> rewards.sum()
    np.float64(8.0)
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
        integrator: str = "euler",
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
        check_render_mode(render_mode, self.metadata)
        self.render_mode, self.num_envs = render_mode, num_envs
        self.rules = make_rules(
            noise, start, parameters, integrator, reward, max_episode_steps, MODES[mode]
        )
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
        if why == batch.ENDED:
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
