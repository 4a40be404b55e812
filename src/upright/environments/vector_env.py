"""Many cart-poles as a Gymnasium vector environment, stepped by the compiled loop in `batch.py`.

Each goes through exactly the same states as a `CartPoleEnv` with the same seed.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
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
from upright.core.rig import make_rig
from upright.environments import batch
from upright.environments.arguments import (
    FRAMES_PER_SECOND,
    NO_LIMIT,
    NO_RENDER_MODE,
    Array,
    check_episodes,
    check_options,
    check_render_mode,
    is_noisy,
    make_setup,
    make_spaces,
)
from upright.environments.batch import Outcome, make_batch, reset_batch, seed_words, step_batch
from upright.environments.cartpole_env import LaneStream
from upright.environments.varying import given_parameters, make_plants, plant_of, report
from upright.errors import UprightError, require, require_one_of
from upright.pictures.picture import picture
from upright.pictures.scene import Scene
from upright.pictures.text import text_picture

MODES = {
    AutoresetMode.NEXT_STEP: batch.NEXT_STEP,
    AutoresetMode.SAME_STEP: batch.SAME_STEP,
    AutoresetMode.DISABLED: batch.DISABLED,
}
"""The compiled loop's numbers for Gymnasium's modes."""


class CartPoleVectorEnv(VectorEnv[Array, Array, Array]):
    """Many cart-poles at once, each like a `CartPoleEnv`.

    When reset with one seed, environment i goes through the same states as a `CartPoleEnv` that is
    reset with that seed plus i.

    Parameters
    ----------
    num_envs
        Number of environments.
    max_episode_steps
        Number of steps after which an episode is truncated; None or -1: never.
    autoreset_mode
        When the next episode begins after one has ended: an `AutoresetMode` or its value.
    render_mode
        "rgb_array", "ansi" or None.
    noise, start, parameters, reward, continuous, dtype, integrator, condition, randomise
        As for `CartPoleEnv`.

    Raises
    ------
    UprightError
        If an argument is not one of the allowed values.

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
        noise: str | Noise | Sequence[Any] | Mapping[str, Any] = "none",
        start: str | State | Sequence[float] | Mapping[str, float] = "random",
        parameters: Parameters | Sequence[float] | Mapping[str, float] | None = None,
        reward: str = "survival",
        continuous: bool = False,
        dtype: str = "float32",
        integrator: str = "euler",
        condition: str = "nominal",
        randomise: Mapping[str, Sequence[Any]] | None = None,
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
        self._setup = make_setup(
            noise,
            start,
            parameters,
            integrator,
            reward,
            condition,
            randomise,
            max_episode_steps,
            MODES[mode],
        )
        self.rules, self._start_name = self._setup.rules, start
        self.single_observation_space, self.single_action_space = make_spaces(
            self.rules.parameters, continuous, dtype
        )
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._action_type = self.action_space.shape, self.action_space.dtype
        self.dtype, self.continuous = np.dtype(dtype), continuous
        rig = make_rig(self._setup.condition, self.rules.parameters, num_envs)
        self._always_vary = rig is not None or len(self._setup.draws) > 0
        self._batch = make_batch(num_envs, rig, None)
        self._step: Any = None
        self._vary(self._always_vary)
        self._seeds: list[int | None] = [None] * num_envs
        self._observations: Array | None = None
        self._reports_states = is_noisy(self.rules.noise) or rig is not None
        self._reports_finals = mode == AutoresetMode.SAME_STEP
        self._no_states = np.empty((4, 0))
        self._no_observations = np.empty((4, 0), self.dtype)

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
            Environment i is seeded with the seed plus i, or with the i-th of several seeds; without
            a seed its random numbers continue.
        options
            ``{"state": ...}`` sets the true states to start in, shape (4,) or (num_envs, 4);
            ``{"parameters": ...}`` changes plants for these episodes alone, each parameter by name
            to a number or an array of shape (num_envs,);
            ``{"reset_mask": ...}``, shape (num_envs,), bool, leaves environments unchanged where it
            is False; for them the last observations are returned again.

        Raises
        ------
        UprightError
            If an option is unknown, a parameter is impossible, an episode could begin beyond its
            limits, or a seed, mask, state or parameter has the wrong shape.
        """
        options = check_options(options, "state", "parameters", "reset_mask")
        chosen = self._chosen(options.get("reset_mask"))
        given = given_parameters(options.get("parameters"), self.rules.parameters, chosen)
        requested = options.get("state")
        states = check_episodes(self._setup, self._start_name, given, requested, chosen)
        self._seed(self._checked_seeds(seed), chosen)
        if states is not None:
            self._batch.states[:, chosen] = states[chosen].T
        varied = self._batch.plants is not None and not chosen.all()
        self._vary(self._always_vary or given is not None or varied)
        if self._batch.plants is not None and given is not None:
            self._batch.plants.given[:, chosen] = given[:, chosen]
        observations = np.empty((4, self.num_envs), self.dtype)
        if self._observations is not None:
            observations[:] = self._observations.T
        reset_batch(self.rules, self._batch, chosen, states is None, observations)
        self._observations = observations.T
        infos: dict[str, Any] = {}
        if self._reports_states:
            infos = {"state": self._batch.states.T.copy(), "_state": chosen}
        return self._observations, infos | self._present_parameters(chosen)

    def _vary(self, needed: bool) -> None:
        """Have plants with parameters of their own just where episodes need them."""
        if needed != (self._batch.plants is not None):
            setup, rig = self._setup, self._batch.rig
            plants = make_plants(setup.rules.parameters, rig, setup.draws, self.num_envs)
            self._batch = self._batch._replace(plants=plants if needed else None)
            self._step = None

    def _present_parameters(self, lanes: NDArray[np.bool_]) -> dict[str, Any]:
        """Return the infos about parameters that vary in these environments."""
        plants = self._batch.plants
        return {} if plants is None else report(plants.present, plants.varied, lanes)

    def _chosen(self, mask: Any) -> NDArray[np.bool_]:
        """Return which environments a reset applies to, shape (num_envs,)."""
        if mask is None:
            return np.ones(self.num_envs, np.bool_)
        chosen = np.array(mask)
        if chosen.shape != (self.num_envs,) or chosen.dtype != np.bool_ or not chosen.any():
            raise UprightError(
                f"reset_mask is {mask!r}; it must be {self.num_envs} bools, one of them True"
            )
        if self._observations is None and not chosen.all():
            raise ResetNeeded("the first reset() must include all environments")
        return chosen

    def _checked_seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        """Return a seed, or None, for each environment."""
        if seed is None or isinstance(seed, (int, np.integer)):
            seeds = [None if seed is None else int(seed) + i for i in range(self.num_envs)]
        else:
            seeds = list(seed)
        if len(seeds) != self.num_envs:
            raise UprightError(f"seed has {len(seeds)} values; it must have {self.num_envs}")
        for value in seeds:
            if value is not None:
                require("seed", value, 0, whole=True)
        return seeds

    def _seed(self, seeds: list[int | None], chosen: NDArray[np.bool_]) -> None:
        """Restart the random numbers of the chosen environments that are given a seed."""
        rig = self._batch.rig
        for i in np.flatnonzero(chosen):
            if seeds[i] is not None or self._seeds[i] is None:
                sequence = np.random.SeedSequence(seeds[i])
                self._seeds[i] = sequence.entropy  # type: ignore[assignment]
                self._batch.words[:, i] = seed_words(sequence)
            if seeds[i] is not None and rig is not None:
                rig.memory[:, i] = 0.0

    def _seed_all(self) -> None:
        """Seed the environments that have not been, with numbers from the system."""
        self._seed([None] * self.num_envs, np.ones(self.num_envs, np.bool_))

    @property
    def np_random_seed(self) -> tuple[int | None, ...]:  # type: ignore[override]
        """The seeds of the environments, as in `gymnasium.vector.SyncVectorEnv`."""
        self._seed_all()
        return tuple(self._seeds)

    @property  # type: ignore[override]
    def np_random(self) -> tuple[np.random.Generator, ...]:
        """The random numbers of the environments: a generator for each, in its present state.

        They are copies: drawing from them changes nothing. To change what environments draw, assign
        generators; ``envs.np_random = envs.np_random`` repeats what is drawn next.

        Raises
        ------
        UprightError
            On assignment, unless there is one generator for each environment, all of the kind SFC64
            that environments use.
        """
        self._seed_all()
        return tuple(_generator(words) for words in self._batch.words.T)

    @np_random.setter  # type: ignore[override]
    def np_random(self, value: Sequence[np.random.Generator]) -> None:
        values = list(value) if isinstance(value, Iterable) else []
        if len(values) != self.num_envs or not all(map(_draws_alike, values)):
            raise UprightError(
                f"np_random is {value!r}; it must be {self.num_envs} generators such as "
                "numpy.random.Generator(numpy.random.SFC64(seed)), one for each environment"
            )
        for i, generator in enumerate(values):
            self._batch.words[:, i] = generator.bit_generator.state["state"]["state"]
        self._seeds = [-1] * self.num_envs

    def step(self, actions: Any) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """Push every cart for one time step.

        In the mode "NextStep", an environment whose episode has ended begins the next one instead.

        Parameters
        ----------
        actions
            Shape (num_envs,), 0 or 1; or (num_envs, 1), forces [N].

        Returns
        -------
        tuple
            Observations, shape (num_envs, 4); rewards, terminations and truncations, (num_envs,);
            and infos. The environment neither keeps nor modifies these arrays.

        Raises
        ------
        InvalidAction
            If an action is not in the action space; then no environment has made a step.
        ResetNeeded
            If no episode has begun, or, with autoreset disabled, one has ended.
        """
        if self._step is None:
            self._step = self._compile()
        if not self._has_action_type(actions):
            actions = self._convert(actions)
        outcome = self._new_outcome()
        restarts = self._step(self.rules, self._batch, actions, outcome)
        if restarts < 0:
            self._refuse(restarts, actions)
        self._observations = observations = outcome.observations.T
        reports = self._reports_states or self._reports_finals or self._batch.plants is not None
        infos = self._infos(outcome, restarts) if reports else {}
        return observations, outcome.rewards, outcome.terminations, outcome.truncations, infos

    def _compile(self) -> Any:
        """Return the compiled step for arguments of these types."""
        if self._observations is None:
            raise ResetNeeded("no episode has begun; call reset() before step()")
        actions = np.zeros(self.action_space.shape or (), self.action_space.dtype)
        return machine_code(step_batch, self.rules, self._batch, actions, self._new_outcome())

    def _new_outcome(self) -> Outcome:
        """Return empty arrays for the outcome of a step."""
        n, block = self.num_envs, (4, self.num_envs)
        terminations, truncations = np.empty((2, n), np.bool_)
        states, finals = self._reports_states, self._reports_finals
        return Outcome(
            np.empty(block, self.dtype),
            np.empty(n),
            terminations,
            truncations,
            np.empty(block) if states else self._no_states,
            np.empty(block, self.dtype) if finals else self._no_observations,
            np.empty(block) if states and finals else self._no_states,
        )

    def _has_action_type(self, actions: Any) -> bool:
        """Whether actions are of the type that the compiled step takes."""
        shape, dtype = self._action_type
        return (
            type(actions) is np.ndarray
            and actions.dtype is dtype
            and actions.shape == shape
            and actions.flags.c_contiguous
        )

    def _convert(self, actions: Any) -> Array:
        """Return actions in the type that the compiled step takes."""
        space = self.action_space
        array = np.asarray(actions)
        kinds = "fiu" if self.continuous else "iub"
        if array.shape != space.shape or array.dtype.kind not in kinds:
            raise InvalidAction(
                f"actions are of shape {array.shape} and type {array.dtype}; "
                f"they must be {space.shape} and {space.dtype}"
            )
        return np.ascontiguousarray(array, space.dtype)

    def _refuse(self, reason: int, actions: Array) -> None:
        """Raise the error for a step that was not made."""
        if reason == batch.ENDED:
            numbers = np.flatnonzero(self._batch.ended)[:5].tolist()
            raise ResetNeeded(
                f"the episodes of environments {numbers} … have ended; reset them before step(): "
                'reset(options={"reset_mask": terminations | truncations})'
            )
        allowed = self.single_action_space
        first = next(i for i, action in enumerate(actions) if action not in allowed)
        raise InvalidAction(f"action {first} is {actions[first]!r}; it must be in {allowed}")

    def _infos(self, outcome: Outcome, restarts: int) -> dict[str, Any]:
        """Return true states, parameters, and how episodes ended that the next ones replaced."""
        infos: dict[str, Any] = {}
        if self._reports_finals and restarts > 0:
            ended = outcome.terminations | outcome.truncations
            infos["final_obs"], infos["_final_obs"] = outcome.final_observations.T, ended
            states = {"state": outcome.final_states.T, "_state": ended}
            infos["final_info"] = states if self._reports_states else {}
            if self._batch.plants is not None:
                plants = self._batch.plants
                infos["final_info"] |= report(plants.last, plants.last_varied, ended)
            infos["_final_info"] = ended
        if self._reports_states:
            infos["state"] = outcome.states.T
            infos["_state"] = np.ones(self.num_envs, np.bool_)
        return infos | self._present_parameters(np.ones(self.num_envs, np.bool_))

    def render(self) -> tuple[Any, ...] | None:
        """Return a picture of each environment in its true state, without the force.

        Returns
        -------
        tuple or None
            Arrays of shape (height, width, 3), uint8, for "rgb_array"; texts for "ansi".
        """
        if self.render_mode is None:
            gymnasium.logger.warn(NO_RENDER_MODE)
            return None
        if self._observations is None:
            raise ResetNeeded("no episode has begun; call reset() before render()")
        draw = picture if self.render_mode == "rgb_array" else text_picture
        plant = partial(plant_of, self.rules.parameters, self._batch.plants)
        states, observations = self._batch.states.T.tolist(), self._observations.tolist()
        return tuple(
            draw(plant(i), Scene(State(*state), State(*measured), 0.0, f"cart {i}"))
            for i, (state, measured) in enumerate(zip(states, observations, strict=True))
        )

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled: everything except the machine code."""
        return self.__dict__ | {"_step": None}


def _generator(words: NDArray[np.uint64]) -> np.random.Generator:
    """Return a generator that draws what a lane with this state draws."""
    stream = LaneStream(0)
    stream.state = stream.state | {"state": {"state": words}}
    return np.random.Generator(stream)


def _draws_alike(generator: Any) -> bool:
    """Whether a generator draws as the lanes do."""
    is_generator = isinstance(generator, np.random.Generator)
    return is_generator and isinstance(generator.bit_generator, np.random.SFC64)
