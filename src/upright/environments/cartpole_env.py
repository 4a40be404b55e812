"""One cart-pole as a Gymnasium environment; docs/environment.md is the reference."""

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import InvalidAction, ResetNeeded

from upright.core.cartpole import has_fallen, step
from upright.core.compiled import compiled, machine_code
from upright.core.conditions import Noise
from upright.core.noise import disturb, draw_start, measure
from upright.core.parameters import Parameters, State
from upright.environments.arguments import (
    FRAMES_PER_SECOND,
    Array,
    check_options,
    check_render_mode,
    check_state,
    is_noisy,
    make_rules,
    make_spaces,
)
from upright.environments.batch import Rules, Stream
from upright.errors import UprightError
from upright.pictures.picture import picture
from upright.pictures.scene import Scene
from upright.pictures.text import text_picture
from upright.pictures.window import Window

_NO_WORD = np.zeros(1, np.uint64)
NOTHING_DRAWN = Stream(_NO_WORD, _NO_WORD, _NO_WORD, _NO_WORD, 0)
"""Stands for random numbers where none are drawn."""


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
    state = step(rules.parameters, state, acting, rules.integrator)
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
    integrator
        "euler" as in the published tables, "semi-implicit" or "rk4".

    Raises
    ------
    UprightError
        If an argument is none of the allowed ones.

    Examples
    --------
    >>> env = upright.CartPoleEnv(noise="gaussian-0.1")
    >>> observation, info = env.reset(seed=0)
    >>> observation, reward, fallen, truncated, info = env.step(1)
    >>> reward, fallen
    (1.0, False)

    Through Gymnasium, which ends an episode after 60,000 steps unless told otherwise:

    >>> import gymnasium
    >>> env = gymnasium.make("upright/CartPole-v0", noise="gaussian-0.1")
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
        integrator: str = "euler",
    ) -> None:
        check_render_mode(render_mode, self.metadata)
        self.rules = make_rules(noise, start, parameters, integrator, reward)
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


def _one_state(parameters: Parameters, state: Any) -> list[float]:
    states = check_state(parameters, state)
    if states.ndim != 1:
        raise UprightError(f"state is {state!r}; it must be four numbers")
    return states.tolist()  # type: ignore[no-any-return]
