"""One cart-pole as a Gymnasium environment; docs/environment.md is the reference."""

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import InvalidAction, ResetNeeded

from upright.core.cartpole import has_fallen, step
from upright.core.compiled import compiled, guard, machine_code
from upright.core.conditions import Noise
from upright.core.noise import draw_start
from upright.core.parameters import Parameters, State
from upright.core.rig import Rig, acting_force, first_measurement, make_rig, measurement
from upright.core.task import Task
from upright.environments.arguments import (
    FRAMES_PER_SECOND,
    NO_RENDER_MODE,
    Array,
    check_episodes,
    check_options,
    check_render_mode,
    is_noisy,
    make_setup,
    make_spaces,
)
from upright.environments.batch import Rules, Stream, scaled_force
from upright.environments.varying import (
    Plants,
    begin_plant,
    check_plants,
    given_parameters,
    make_plants,
    plant_of,
    report_one,
)
from upright.pictures.picture import picture
from upright.pictures.scene import Scene
from upright.pictures.text import text_picture
from upright.pictures.window import Window

_NO_WORD = np.zeros(1, np.uint64)
UNUSED_STREAM = Stream(_NO_WORD, _NO_WORD, _NO_WORD, _NO_WORD, 0)
"""Passed as random numbers where none are drawn."""


class LaneStream(np.random.SFC64):
    """The bit generator of a lane, with a state that Gymnasium's checks can compare."""

    @property
    def state(self) -> Any:
        """The state of the generator, in plain numbers."""
        whole = super().state
        return whole | {"state": {"state": tuple(whole["state"]["state"].tolist())}}

    @state.setter
    def state(self, value: Any) -> None:
        words = np.array(value["state"]["state"], np.uint64)
        whole = value | {"state": {"state": words}}
        np.random.SFC64.state.__set__(self, whole)  # type: ignore[attr-defined]


_ONE_LANE = np.ones(1, np.bool_)


@compiled
def advance(
    rules: Rules,
    rig: Rig | None,
    plants: Plants | None,
    state: State,
    push: float,
    rng: np.random.Generator,
) -> tuple[State, State, float, bool]:
    """Make one step in which the agent pushes with a force [N].

    Returns
    -------
    tuple
        The next state, its measurement, the force that acted [N], and whether the pole has fallen.
    """
    plant = plant_of(rules.parameters, plants, 0)
    acting = acting_force(rig, rules.noise, push, rng)
    state = step(plant, state, acting, rules.integrator)
    fallen = has_fallen(plant, state)
    return state, measurement(rig, rules.noise, state, rng), acting, fallen


@guard(advance)
def _check_advance(
    _rules: Rules, rig: Rig | None, plants: Plants | None, *_others: State | float | Any
) -> None:
    check_plants(rig, plants, 1)


class CartPoleEnv(gymnasium.Env[Array, Any]):
    """A cart-pole with friction and noise, as in the published tables.

    Observation: ``(x, x_dot, theta, theta_dot)`` as measured [m, m/s, rad, rad/s]. Action: 0 pushes
    left, 1 right; with `continuous` the force itself [N]. An episode ends when the true state
    leaves ±2.4 m or ±12°. Under noise, ``info["state"]`` is the true state; where parameters vary,
    ``info["parameters"]`` has the present ones.

    Parameters
    ----------
    noise
        Name of a noise case, or terms, or a custom `Noise`.
    start
        Name of a start, or custom half-widths of the start state.
    parameters
        The plant's parameters, or only those that differ from the published ones.
    reward
        "survival": 1 for every step; or "failure": -1 for the step of the fall, else 0.
    continuous
        Whether an action is a force.
    dtype
        Type of the observations; the plant always computes in float64.
    render_mode
        "human", "rgb_array", "ansi" or None.
    integrator
        "euler" as in the published tables, "semi-implicit" or "rk4".
    condition
        Name of a condition, or terms, such as "delay=1,encoder=1024".
    randomise
        Parameters that are drawn for each episode, with their lowest and highest value: uniformly,
        or log-uniformly, as in ``{"half_length": (0.25, 1.0), "cart_mass": (0.5, 2.0, "log")}``.

    Raises
    ------
    UprightError
        If an argument is not one of the allowed values, or episodes could begin beyond the limits.

    Examples
    --------
    >>> env = upright.CartPoleEnv(noise="gaussian-0.1")
    >>> observation, info = env.reset(seed=0)
    >>> observation, reward, fallen, truncated, info = env.step(1)
    >>> reward, fallen
    (1.0, False)

    Through Gymnasium, which truncates an episode after 60,000 steps by default:

    >>> import gymnasium
    >>> env = gymnasium.make("upright/CartPole-v0", noise="gaussian-0.1")
    """

    metadata = {  # noqa: RUF012 - as Gymnasium has it
        "render_modes": ["human", "rgb_array", "ansi"],
        "render_fps": FRAMES_PER_SECOND,
    }

    def __init__(
        self,
        noise: str | Noise | Sequence[Any] | Mapping[str, Any] = "none",
        start: str | State | Sequence[float] | Mapping[str, float] = "random",
        parameters: Parameters | Sequence[float] | Mapping[str, float] | None = None,
        reward: str = "survival",
        continuous: bool = False,
        dtype: str = "float32",
        render_mode: str | None = None,
        integrator: str = "euler",
        condition: str = "nominal",
        randomise: Mapping[str, Sequence[Any]] | None = None,
    ) -> None:
        check_render_mode(render_mode, self.metadata)
        self._setup = make_setup(noise, start, parameters, integrator, reward, condition, randomise)
        self.rules, self._start_name = self._setup.rules, start
        self.observation_space, self.action_space = make_spaces(
            self.rules.parameters, continuous, dtype
        )
        self.continuous, self.dtype, self.render_mode = continuous, np.dtype(dtype), render_mode
        self._equip(make_rig(self._setup.condition, self.rules.parameters), self._setup.draws)
        self._state: State | None = None
        self._measured: State | None = None
        self._force = 0.0
        self._steps = 0
        self._over = True
        self._advance: Any = None
        self._window: Window | None = None

    @classmethod
    def of_task(cls, task: Task, integrator: str = "euler") -> "CartPoleEnv":
        """Return the environment of a run's task, with the rig that the task has."""
        env = cls(task.noise, task.start, task.parameters, integrator=integrator)
        if task.rig is not None:
            env._equip(task.rig, task.rig.draws)
        return env

    def _equip(self, rig: Rig | None, draws: Array) -> None:
        """Take a rig, and what is drawn for each episode."""
        self._rig, self._draws = rig, draws
        self._reports_state = is_noisy(self.rules.noise) or rig is not None
        self._always_varies = rig is not None or len(draws) > 0
        self._plants: Plants | None = None
        if self._always_varies:
            self._plants = make_plants(self.rules.parameters, rig, draws, 1)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode.

        Parameters
        ----------
        seed
            Restarts the random numbers; without it they continue.
        options
            ``{"state": four numbers}`` sets the true state to start in; ``{"parameters": numbers by
            name}`` changes the plant for this episode alone.

        Raises
        ------
        UprightError
            If an option is unknown, a parameter is impossible, the state is not four finite
            numbers, or the episode could begin beyond its limits.
        """
        options = check_options(options, "state", "parameters")
        given = given_parameters(options.get("parameters"), self.rules.parameters, _ONE_LANE)
        states = check_episodes(
            self._setup, self._start_name, given, options.get("state"), _ONE_LANE
        )
        super().reset(seed=seed)
        if seed is not None or self._np_random is None:
            sequence = np.random.SeedSequence(seed)
            self._np_random = np.random.Generator(LaneStream(sequence))
            self._np_random_seed = sequence.entropy  # type: ignore[assignment]
        if seed is not None and self._rig is not None:
            self._rig.memory[:] = 0.0
        rules, rig, rng = self.rules, self._rig, self._np_random
        self._vary(given)
        begin_plant(rules.parameters, rig, self._plants, rng, 0)
        state = draw_start(rules.start, rng) if states is None else State(*states[0].tolist())
        self._steps, self._over, self._force = 0, False, 0.0
        self._state, self._measured = state, first_measurement(rig, rules.noise, state, rng)
        return self._observe()

    def _vary(self, given: Array | None) -> None:
        """Have a plant with parameters of its own just where an episode needs one."""
        needed = self._always_varies or given is not None
        if needed != (self._plants is not None):
            plants = make_plants(self.rules.parameters, self._rig, self._draws, 1)
            self._plants = plants if needed else None
            self._advance = None
        if self._plants is not None and given is not None:
            self._plants.given[:] = given

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Push the cart for one time step.

        Raises
        ------
        InvalidAction
            If the action is not in the action space.
        ResetNeeded
            If no episode has begun, or the pole has fallen.
        """
        if self._over:
            why = "no episode has begun" if self._state is None else "the pole has fallen"
            raise ResetNeeded(f"{why}; call reset() before step()")
        rules = self.rules
        push = self._requested_force(action)
        arguments = rules, self._rig, self._plants, self._state, push, self._rng()
        if self._advance is None:
            self._advance = machine_code(advance, *arguments)
        self._state, self._measured, self._force, self._over = self._advance(*arguments)
        self._steps += 1
        reward = rules.step_reward + (rules.fall_reward if self._over else 0.0)
        observation, info = self._observe()
        return observation, reward, self._over, False, info

    @property
    def _plant(self) -> Parameters:
        """The present parameters of the plant."""
        own = self.rules.parameters
        return own if self._plants is None else plant_of(own, self._plants, 0)

    def _rng(self) -> Any:
        """Return the generator of the noise; without noise, a stand-in that is quicker to pass."""
        return self._np_random if self._reports_state else UNUSED_STREAM

    def _requested_force(self, action: Any) -> float:
        """Return the force [N] that an action stands for."""
        own = self.rules.parameters
        if self.continuous:
            force = np.asarray(action)
            is_number = force.shape == (1,) and force.dtype.kind in "fiu"
            if is_number and abs(force[0]) <= np.float32(own.force):
                return scaled_force(own, self._plants, float(force[0]), 0)
        elif (type(action) is int and 0 <= action <= 1) or self.action_space.contains(action):
            strength = self._plant.force
            return strength if action == 1 else -strength
        meaning = "" if self.continuous else ": 1 pushes right, 0 pushes left"
        raise InvalidAction(f"action is {action!r}; it must be in {self.action_space}{meaning}")

    def _observe(self) -> tuple[Array, dict[str, Any]]:
        """Return the observation and the info."""
        if self.render_mode == "human":
            self.render()
        info: dict[str, Any] = {"state": np.array(self._state)} if self._reports_state else {}
        if self._plants is not None:
            info |= report_one(self._plants)
        return np.array(self._measured, self.dtype), info

    def render(self) -> Any:
        """Show the cart-pole, or return its picture.

        Returns
        -------
        numpy.ndarray or str or None
            Array of shape (height, width, 3), uint8, for "rgb_array"; text for "ansi"; else None.
        """
        if self.render_mode is None:
            gymnasium.logger.warn(NO_RENDER_MODE)
            return None
        scene, plant = self.scene(), self._plant
        if self.render_mode == "ansi":
            return text_picture(plant, scene)
        pixels = picture(plant, scene)
        if self.render_mode == "rgb_array":
            return pixels
        if self._window is None:
            self._window = Window("Upright", FRAMES_PER_SECOND)
        self._window.show(pixels)
        return None

    def scene(self) -> Scene:
        """Return what a picture of the present state shows."""
        if self._state is None:
            raise ResetNeeded("no episode has begun; call reset() before render()")
        seconds = self._steps * self._plant.time_step
        caption = f"step {self._steps:,}, {seconds:.1f} s"
        return Scene(self._state, self._measured, self._force, caption)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled: everything except the window and the machine code."""
        return self.__dict__ | {"_window": None, "_advance": None}
