"""Observes a run or a play step by step, whatever the agent and the plant.

The loop runs in Python with the agent's own methods, those of compiled agents in machine code; or
the environment of a learner that only knows Gymnasium is observed. Observing draws no random number
and changes none, so the trials are those of a run that nobody observes.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from upright.agents.checks.contract import is_learner
from upright.core.compiled import is_compiled
from upright.core.contracts import Agent, GymnasiumLearner, Plant
from upright.core.loops import bind
from upright.core.parameters import State
from upright.core.task import Task, present_task
from upright.core.trials import run
from upright.errors import Stopped, UprightError
from upright.pictures.scene import History, Scene
from upright.studies.case import Case


class Moment(NamedTuple):
    """A step of a trial, or its start."""

    task: Task
    """The task, with the run's own plant as it then is: a condition may change it."""
    lengths: np.ndarray
    """Steps of each trial that has ended, as the loop keeps them."""
    trial: int
    """Number of the trial, from 1."""
    step: int
    """Number of steps made; 0 at the start."""
    state: State
    """The true state."""
    measured: State
    """The state as the agent measured it."""
    force: float
    """The force that led to the state [N]; 0 at the start."""
    ending: str
    """How the trial ended with this step: "fallen", "balanced", or empty if it goes on."""
    last_fall: State | None
    """The state in which the last trial that fell ended."""


Observer = Callable[[Moment], None]
"""Called after the start and after each step, in the thread of the run, which waits for it."""


def check_observable(case: Case) -> None:
    """Raise UprightError if a case's plant moves by itself, and cannot be held up for pictures."""
    if case.plant.alone:
        raise UprightError(
            f"plant is {case.plant.name!r}; it moves in real time, and pictures would hold up its "
            "pushes; the plants that can be drawn wait for the next push, such as equations"
        )


def observed_loop(loop: Callable[..., int], observer: Observer) -> Callable[..., int]:
    """Return a loop that does what `loop` does while an observer is told of every step.

    It stops within a step, where `loop` only stops between trials.
    """

    def observed_run(
        agent: Any,
        plant: Plant,
        task: Task,
        rng: np.random.Generator,
        lengths: np.ndarray,
        stop: np.ndarray,
    ) -> int:
        watch = _Watch(task, lengths, stop, observer)
        rest = task, rng, lengths, stop
        with suppress(Stopped):
            if is_learner(agent):
                return loop(_ObservedLearner(agent, watch), plant, *rest)
            if is_compiled(agent):
                both = _Both(bind(agent, rng), plant, watch)
                return run(both, both, *rest)
            both = _Both(agent, plant, watch)
            return loop(both, both, *rest)
        return 0

    return observed_run


class _Watch:
    """Tells an observer of the steps of a run."""

    def __init__(
        self, task: Task, lengths: np.ndarray, stop: np.ndarray, observer: Observer
    ) -> None:
        self._task, self._lengths = task, lengths
        self._stop, self._observer = stop, observer
        self._last_fall: State | None = None

    def tell(
        self, trial: int, step: int, state: State, measured: State, force: float, fallen: bool
    ) -> None:
        """Tell of a step, or, as step 0, of a start; raise Stopped if the run is to stop."""
        if self._stop[0]:
            raise Stopped
        ending = "fallen" if fallen else "balanced" if step == self._task.steps else ""
        now = present_task(self._task), self._lengths, trial, step
        self._observer(Moment(*now, state, measured, force, ending, self._last_fall))
        if fallen:
            self._last_fall = state


class _Both:
    """Stands between an agent and a plant, acts as both, and tells what they exchange."""

    def __init__(self, agent: Agent, plant: Plant, watch: _Watch) -> None:
        self._agent, self._plant, self._watch = agent, plant, watch
        self._trial, self._step, self._force = 0, 0, 0.0
        self._state = State(0.0, 0.0, 0.0, 0.0)
        self.has_fallen, self.close = plant.has_fallen, plant.close
        self.begin_trial, self.end_trial = agent.begin_trial, agent.end_trial

    def reset(self, state: State) -> State:
        self._trial, self._step, self._force = self._trial + 1, 0, 0.0
        self._state = self._plant.reset(state)
        return self._state

    def step(self, force: float) -> State:
        self._step, self._force = self._step + 1, force
        self._state = self._plant.step(force)
        return self._state

    def act(self, observation: State, rng: np.random.Generator) -> bool:
        if self._step == 0:
            self._tell(observation, fallen=False)
        return self._agent.act(observation, rng)

    def learn(self, before: State, action: bool, after: State, fallen: bool) -> None:
        self._agent.learn(before, action, after, fallen)
        self._tell(after, fallen)

    def _tell(self, measured: State, fallen: bool) -> None:
        self._watch.tell(self._trial, self._step, self._state, measured, self._force, fallen)


class _ObservedLearner:
    """A learner that only knows Gymnasium, whose environment is observed."""

    def __init__(self, learner: GymnasiumLearner, watch: _Watch) -> None:
        self._learner, self._watch = learner, watch

    def train(self, protocol: Any) -> None:
        from upright.studies.observed_env import ObservedEnv

        protocol.env = ObservedEnv(protocol.env, protocol, self._watch.tell)
        self._learner.train(protocol)


def scene_of(moment: Moment, who: str, *, chart: bool = False) -> Scene:
    """Return the scene of a moment, with a title that says who plays and which trial.

    Parameters
    ----------
    moment
        What is shown.
    who
        Name of the agent.
    chart
        Whether to show the trials so far.
    """
    seconds = moment.step * moment.task.parameters.time_step
    ended = moment.lengths[: moment.trial - 1]
    return Scene(
        moment.state,
        moment.measured,
        moment.force,
        caption=f"{who} · trial {moment.trial:,}",
        detail=f"step {moment.step:,} · {seconds:,.1f} s",
        ending=moment.ending,
        last_fall=moment.last_fall,
        history=History(ended, moment.step, moment.task.steps) if chart else None,
    )
