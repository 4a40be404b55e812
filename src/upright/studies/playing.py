"""Plays learned policies, which balance without learning.

Each trial has its own random numbers, which no learner has drawn. Under a condition that varies the
plant, each trial also has its own plant.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from itertools import repeat
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from upright.agents import is_custom
from upright.core.compiled import compiled
from upright.core.contracts import Agent, Plant
from upright.core.parameters import State
from upright.core.task import Task
from upright.core.trials import Result, run
from upright.errors import require, require_kind
from upright.pictures.picture import picture
from upright.pictures.size import SIZE, Size
from upright.pictures.video import write_video
from upright.plants import describe_plant, restore_plant
from upright.plants.equations import EQUATIONS
from upright.policies.policy import Policy
from upright.studies.case import Case, make_case
from upright.studies.observing import Moment, Observer, observed_loop, scene_of
from upright.studies.random_streams import Stream, sequence
from upright.studies.run import choose_loop, make_plant, outcome

PAUSE = 25
"""Number of times that the last picture of a trial is repeated: half a second."""


class Player(NamedTuple):
    """A policy in the form that the compiled loop takes. It behaves like a `Policy`."""

    memory: Any
    """The trained agent."""
    greedy: bool = False
    """Whether it makes the more probable push, without a random number."""

    @compiled
    def begin_trial(self, rng: np.random.Generator) -> None:
        """Do nothing; there is no history."""

    @compiled
    def act(self, observation: State, rng: np.random.Generator) -> bool:
        """Sample a push, or make the more probable one."""
        probability = self.memory.push_probability(observation)
        return probability > 0.5 if self.greedy else rng.random() < probability  # type: ignore[no-any-return]

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
    greedy: bool = False,
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
    greedy
        Whether to make the more probable push at each step (the left one if both are equally
        probable) in place of drawing a push.
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
    require_kind("policy", policy, Policy, "what learn or load_policy returns")
    require("episodes", episodes, 1, 10**6, whole=True)
    require("seed", seed, 0, 2**63 - 1, whole=True)
    policy = replace(policy, greedy=True) if greedy else policy
    case = case_for(policy, **({"steps": policy.learned_on.steps} | changes))
    if video is None:
        return list(play_trials(policy, case, episodes, seed))
    played: list[TrialOutcome] = []
    frames = pictures(policy, case, episodes, seed, played.append)
    write_video(video, frames, 1 / case.spec.time_step)
    return played


def play_trials(
    policy: Policy,
    case: Case,
    episodes: int,
    seed: int,
    stop: np.ndarray | None = None,
    observer: Observer | None = None,
) -> Iterator[TrialOutcome]:
    """Play trial after trial and yield the outcome of each.

    Policies of the package's agents are played by the compiled loop if the plant is compiled; those
    of custom agents in Python.

    Parameters
    ----------
    policy, case, episodes, seed
        What is played.
    stop
        Shape (1,), bool; playing stops once it is set.
    observer
        Called after each start and each step. The loop then runs in Python; its trials are the
        same.
    """
    agent = policy if is_custom(policy.agent) else player(policy)
    stop = np.zeros(1, np.bool_) if stop is None else stop
    observer = None if observer is None else _Numbered(observer)
    thread = ThreadPoolExecutor(1)  # the main thread stays free for Ctrl-C
    try:
        for episode in range(episodes):
            played = thread.submit(_play_once, agent, case, seed, episode, stop, observer).result()
            if stop[0]:
                break
            yield played
    finally:
        stop[0] = True
        thread.shutdown(wait=case.plant.alone)  # such a plant stops within a step


def _play_once(
    agent: Agent, case: Case, seed: int, episode: int, stop: np.ndarray, observer: Observer | None
) -> TrialOutcome:
    plant, task, rng = prepare(case, seed, episode, stop)
    lengths = np.zeros(1, np.int64)
    with closing(plant):
        loop = choose_loop(case, agent, plant)
        if observer is not None:
            loop = observed_loop(loop, observer)
        succeeded = loop(agent, plant, task._replace(trials=1), rng, lengths, stop) > 0
    return TrialOutcome(int(lengths[0]), succeeded)


class _Numbered:
    """Passes on the moments of trials that are made one by one, with their numbers."""

    def __init__(self, observer: Observer) -> None:
        self._observer = observer
        self._trial = 0
        self._last_fall: State | None = None

    def __call__(self, moment: Moment) -> None:
        self._trial += moment.step == 0
        self._observer(moment._replace(trial=self._trial, last_fall=self._last_fall))
        if moment.ending == "fallen":
            self._last_fall = moment.state


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
    return kind(policy.memory, policy.greedy)


def prepare(
    case: Case, seed: int, episode: int, stop: np.ndarray
) -> tuple[Plant, Task, np.random.Generator]:
    """Return the plant of a trial, its task, and its random numbers."""
    plant, task = make_plant(case, seed, episode, stop)
    return plant, task, np.random.default_rng(sequence(seed, episode, Stream.PLAYING))


def record(
    agent: Agent, plant: Plant, task: Task, rng: np.random.Generator
) -> tuple[list[Moment], TrialOutcome]:
    """Let an agent balance once in Python, and return the moments and the outcome.

    There is one moment of the start and one after each step, with the force that led to it.
    """
    moments: list[Moment] = []
    lengths, stop = np.zeros(1, np.int64), np.zeros(1, np.bool_)
    loop = observed_loop(run, moments.append)
    succeeded = loop(agent, plant, task._replace(trials=1), rng, lengths, stop) > 0
    return moments, TrialOutcome(int(lengths[0]), succeeded)


def pictures(
    policy: Policy,
    case: Case,
    episodes: int,
    seed: int,
    on_trial: Callable[[TrialOutcome], None],
    size: Size = SIZE,
) -> Iterator[np.ndarray]:
    """Play the same trials as `play_trials`, and yield a picture of every step.

    Parameters
    ----------
    on_trial
        Called with the outcome of each trial after its last picture.
    size
        Size of the pictures.

    Raises
    ------
    UprightError
        If pygame-ce is missing.
    """
    shown: list[Moment] = []
    numbered = _Numbered(shown.append)
    for episode in range(episodes):
        plant, task, rng = prepare(case, seed, episode, np.zeros(1, np.bool_))
        with closing(plant):
            moments, outcome = record(policy, plant, task, rng)
        shown.clear()
        for moment in moments:
            numbered(moment)
        for moment in shown:
            pixels = picture(moment.task.parameters, scene_of(moment, policy.agent), size)
            yield pixels
        on_trial(outcome)
        yield from repeat(pixels, PAUSE)
