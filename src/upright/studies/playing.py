"""Plays learned policies, which balance without learning.

Each trial has its own random numbers, which no learner has drawn. Under a condition that varies the
plant, each trial also has its own plant.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from itertools import repeat
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from upright.agents import is_custom
from upright.core.compiled import compiled
from upright.core.contracts import Agent, Plant
from upright.core.parameters import State
from upright.core.task import Task
from upright.core.trials import Result, trial
from upright.errors import require
from upright.pictures.picture import picture
from upright.pictures.scene import Scene
from upright.pictures.video import write_video
from upright.plants import describe_plant, restore_plant
from upright.plants.equations import EQUATIONS
from upright.policies.policy import Policy
from upright.studies.case import Case, make_case
from upright.studies.random_streams import Stream, sequence
from upright.studies.run import choose_loop, make_plant, outcome

PAUSE = 25
"""Number of times that the last picture of a trial is repeated: half a second."""


class Player(NamedTuple):
    """A policy in the form that the compiled loop takes. It behaves like a `Policy`."""

    memory: Any
    """The trained agent."""

    @compiled
    def begin_trial(self, rng: np.random.Generator) -> None:
        """Do nothing; there is no history."""

    @compiled
    def act(self, observation: State, rng: np.random.Generator) -> bool:
        """Sample a push."""
        return rng.random() < self.memory.push_probability(observation)  # type: ignore[no-any-return]

    @compiled
    def learn(self, before: State, action: bool, after: State, fallen: bool) -> None:
        """Learn nothing."""

    @compiled
    def end_trial(self, fallen: bool) -> None:
        """Learn nothing."""


class RememberingPlayer(Player):
    """A policy that depends on earlier measurements, in the form that the compiled loop takes."""

    __slots__ = ()

    @compiled
    def begin_trial(self, rng: np.random.Generator) -> None:
        """Forget the previous trial."""
        self.memory.begin_trial(rng)

    @compiled
    def learn(self, before: State, action: bool, after: State, fallen: bool) -> None:
        """Remember the measurement and the push."""
        self.memory.remember(before, action)


class TrialOutcome(NamedTuple):
    """The outcome of a trial."""

    steps: int
    """Number of steps that the trial lasted."""
    balanced: bool
    """Whether it ended without a fall."""


def case_for(policy: Policy, **changes: Any) -> Case:
    """Return the case for playing a policy: the task it was trained on, with changes.

    The length of a trial is not that of training, but the usual 60,000 steps by default.

    Parameters
    ----------
    policy
        The policy.
    **changes
        Fields of `TaskSpec` by name; and `plant`, the settings of a plant, by default those of the
        equations.

    Raises
    ------
    UprightError
        If a name is unknown, or a number is not allowed.
    """
    learned = policy.learned_on.as_data()
    learned = {name: learned[name] for name in ("noise", "start", "condition", "parameters")}
    if isinstance(changed := changes.get("parameters"), Mapping):
        changes["parameters"] = learned["parameters"] | changed
    own = policy.plant if policy.plant["name"] == EQUATIONS.name else describe_plant(EQUATIONS)
    return make_case(policy.agent, **({"plant": restore_plant(own)} | learned | changes))


def play(
    policy: Policy,
    episodes: int = 10,
    seed: int = 0,
    *,
    video: Path | str | None = None,
    **changes: Any,
) -> list[TrialOutcome]:
    """Play a policy, which does not learn, and return the outcome of each trial.

    Parameters
    ----------
    policy
        The return value of `learn` or `load_policy`.
    episodes
        Number of trials.
    seed
        Seed of their random numbers, which no learner has drawn.
    video
        Path of a video of all trials, ending in .mp4 or .gif; by default none is made. A video
        needs pygame-ce and imageio-ffmpeg, but no display.
    **changes
        Parts of the task by name, as `make_case` takes them, that are to differ from the task the
        policy was trained on.

    Returns
    -------
    list
        For each trial `steps`, its length, and `balanced`, whether it ended without a fall.

    Raises
    ------
    UprightError
        If a name is unknown, a number is not allowed, or the video cannot be made.

    Examples
    --------
    >>> policy, _ = upright.learn("adaptive-lqr", steps=2000)
    >>> played = upright.play(policy, episodes=5, noise="sensor-10")
    >>> [outcome.balanced for outcome in played]
    [True, True, True, True, True]
    """
    require("episodes", episodes, 1, 10**6, whole=True)
    require("seed", seed, 0, 2**63 - 1, whole=True)
    case = case_for(policy, **({"steps": policy.learned_on.steps} | changes))
    if video is None:
        return list(play_trials(policy, case, episodes, seed))
    played: list[TrialOutcome] = []
    frames = pictures(policy, case, episodes, seed, played.append)
    write_video(video, frames, 1 / case.spec.time_step)
    return played


def play_trials(policy: Policy, case: Case, episodes: int, seed: int) -> Iterator[TrialOutcome]:
    """Play trial after trial and yield the outcome of each.

    Policies of the package's agents are played by the compiled loop if the plant is compiled; those
    of custom agents in Python.
    """
    agent = policy if is_custom(policy.agent) else player(policy)
    stop = np.zeros(1, np.bool_)
    thread = ThreadPoolExecutor(1)  # the main thread stays free for Ctrl-C
    try:
        for episode in range(episodes):
            lengths = np.zeros(1, np.int64)
            yield thread.submit(_play_once, agent, case, seed, episode, lengths, stop).result()
    finally:
        stop[0] = True
        thread.shutdown(wait=case.plant.alone)  # such a plant stops within a step


def _play_once(
    agent: Agent, case: Case, seed: int, episode: int, lengths: np.ndarray, stop: np.ndarray
) -> TrialOutcome:
    plant, task, rng = prepare(case, seed, episode, stop)
    with closing(plant):
        loop = choose_loop(case, agent, plant)
        succeeded = loop(agent, plant, task._replace(trials=1), rng, lengths, stop) > 0
    return TrialOutcome(int(lengths[0]), succeeded)


def play_run(
    policy: Policy, case: Case, seed: int, plant: Plant, lengths: np.ndarray, stop: np.ndarray
) -> Result | None:
    """Play on an existing plant until a trial succeeds; return None if that was stopped."""
    agent = policy if is_custom(policy.agent) else player(policy)
    rng = np.random.default_rng(sequence(seed, 0, Stream.PLAYING))
    with closing(plant):
        loop = choose_loop(case, agent, plant)
        began = time.perf_counter()
        balanced = loop(agent, plant, case.spec.task(), rng, lengths, stop) > 0
        seconds = time.perf_counter() - began
    return outcome(case, 0, balanced, lengths, seconds)


def player(policy: Policy) -> Player:
    """Return a policy of the package's agents in the form that the compiled loop takes."""
    kind = RememberingPlayer if hasattr(policy.memory, "remember") else Player
    return kind(policy.memory)


def prepare(
    case: Case, seed: int, episode: int, stop: np.ndarray
) -> tuple[Plant, Task, np.random.Generator]:
    """Return the plant of a trial, its task, and its random numbers."""
    plant, task = make_plant(case, seed, episode, stop)
    return plant, task, np.random.default_rng(sequence(seed, episode, Stream.PLAYING))


class _Recorder:
    """Stands between an agent and a plant, acts as both, and records what they exchange."""

    def __init__(self, agent: Agent, plant: Plant) -> None:
        self.agent, self.plant = agent, plant
        self.states: list[State] = []
        self.measured: list[State] = []
        self.forces = [0.0]

    def reset(self, state: State) -> State:
        self.states.append(self.plant.reset(state))
        return self.states[-1]

    def step(self, force: float) -> State:
        self.forces.append(force)
        self.states.append(self.plant.step(force))
        return self.states[-1]

    def has_fallen(self, state: State) -> bool:
        return self.plant.has_fallen(state)

    def close(self) -> None:
        self.plant.close()

    def begin_trial(self, rng: np.random.Generator) -> None:
        self.agent.begin_trial(rng)

    def act(self, observation: State, rng: np.random.Generator) -> bool:
        return self.agent.act(observation, rng)

    def learn(self, before: State, action: bool, after: State, fallen: bool) -> None:
        self.measured += [after] if self.measured else [before, after]
        self.agent.learn(before, action, after, fallen)

    def end_trial(self, fallen: bool) -> None:
        self.agent.end_trial(fallen)


def record(
    agent: Agent, plant: Plant, task: Task, rng: np.random.Generator
) -> tuple[list[Scene], TrialOutcome]:
    """Let an agent balance once in Python, and return the scenes and the outcome.

    There is one scene of the start and one after each step, with the force that led to it.
    """
    recorder = _Recorder(agent, plant)
    steps, fallen = trial(recorder, recorder, task, rng)
    moments = zip(recorder.states, recorder.measured, recorder.forces, strict=True)
    return [Scene(*moment) for moment in moments], TrialOutcome(steps, not fallen)


def pictures(
    policy: Policy, case: Case, episodes: int, seed: int, on_trial: Callable[[TrialOutcome], None]
) -> Iterator[np.ndarray]:
    """Play the same trials as `play_trials`, and yield a picture of every step.

    Parameters
    ----------
    on_trial
        Called with the outcome of each trial after its last picture.

    Raises
    ------
    UprightError
        If pygame-ce is missing.
    """
    for episode in range(episodes):
        plant, task, rng = prepare(case, seed, episode, np.zeros(1, np.bool_))
        with closing(plant):
            scenes, outcome = record(policy, plant, task, rng)
        for step, scene in enumerate(scenes):
            seconds = step * task.parameters.time_step
            ending = "   fallen" if step == outcome.steps and not outcome.balanced else ""
            caption = f"trial {episode + 1}   step {step:,}   {seconds:,.1f} s{ending}"
            pixels = picture(task.parameters, scene._replace(caption=caption))
            yield pixels
        on_trial(outcome)
        yield from repeat(pixels, PAUSE)
