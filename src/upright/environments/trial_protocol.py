"""The trial protocol for learners that only know Gymnasium.

`TrialProtocol` wraps an environment and counts the trials of one run. `run_learner` uses it to run
such a learner in a study. docs/learners.md explains how to use both.
"""

import time
from contextlib import suppress
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from upright.core.cartpole import INTEGRATORS
from upright.core.conditions import STEPS, TRIALS
from upright.core.contracts import GymnasiumLearner
from upright.core.task import Task
from upright.core.trials import Result
from upright.environments.cartpole_env import CartPoleEnv
from upright.errors import UprightError, require
from upright.plants.equations import ChangingEquations, Equations
from upright.support.words import count


class RunOver(Exception):  # noqa: N818 - not an error, just as StopIteration is not
    """Raised when the run is over and the environment makes no further steps.

    Examples
    --------
    >>> env = upright.TrialProtocol(upright.CartPoleEnv(), steps=500, trials=3)
    >>> try:
    ...     while True:
    ...         env.reset(seed=0)[1]
    ...         while not env.step(1)[2]:
    ...             pass
    ... except upright.RunOver as over:
    ...     print(over)
    {}
    {}
    {}
    the run is over after 3 trials: no trial succeeded
    """


class TrialProtocol(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Counts the trials of one learner, and ends its run.

    A trial begins with `reset` and ends with a fall, or with step N, which is a success and ends
    the run. An episode that ends otherwise, because the learner resets it or the environment
    truncates it, is a failed trial. An episode without any step is not a trial. Every step counts,
    whether the learner makes it to train or to evaluate.

    Once the run is over, `reset` and `step` raise `RunOver`, which ends the learner's training. A
    learner that catches all exceptions can check `over`.

    Parameters
    ----------
    env
        A single environment; trials of several in parallel would have no order.
    steps
        N: a trial of this many steps without a fall is a success.
    trials
        Maximum number of trials in the run.
    lengths
        Array that the length of each trial is written to as it ends, shape (trials,), int64, so
        that another thread can watch.
    stop
        Set its one element, a bool, to end the run early.

    Raises
    ------
    UprightError
        If a number is out of range, or the environment truncates episodes before N.
    TypeError
        If `env` is not an environment, or is a vector environment.

    Examples
    --------
    A learner that only ever pushes to the right, and its result:

    >>> env = upright.TrialProtocol(upright.CartPoleEnv(), steps=500, trials=3)
    >>> while not env.over:
    ...     observation, info = env.reset(seed=0)
    ...     fallen = False
    ...     while not fallen:
    ...         observation, reward, fallen, truncated, info = env.step(1)
    >>> result = env.result()
    >>> result.success, result.trials
    (False, 3)
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        steps: int = STEPS,
        trials: int = TRIALS,
        lengths: NDArray[np.int64] | None = None,
        stop: NDArray[np.bool_] | None = None,
    ) -> None:
        super().__init__(env)
        require("steps", steps, 1, 10**9, whole=True)
        require("trials", trials, 1, 10**6, whole=True)
        limit = env.spec.max_episode_steps if env.spec else None
        if limit is not None:
            require("max_episode_steps", limit, steps)
        self.steps, self.trials = steps, trials
        self.succeeded = False
        """Whether the last trial was a success."""
        self._lengths = np.zeros(trials, np.int64) if lengths is None else lengths
        self._stop = np.zeros(1, np.bool_) if stop is None else stop
        self._ended = 0  # trials that have ended
        self._steps_made = 0  # steps of the present trial
        self._in_trial = False  # whether a trial has begun and not ended
        self._began = time.perf_counter()
        self._seconds = 0.0  # time from the beginning to the end of the last trial [s]

    @property
    def lengths(self) -> NDArray[np.int64]:
        """Steps of each trial that has ended, in order."""
        return self._lengths[: self._ended]

    @property
    def over(self) -> bool:
        """Whether the run has ended: by success, with its last trial, or because it was stopped."""
        return self.succeeded or self._ended == self.trials or bool(self._stop[0])

    @property
    def position(self) -> tuple[int, int]:
        """The trial and the step that come next or are in progress, both counted from 1."""
        return self._ended + 1, self._steps_made + 1

    def result(self, run: int = 0) -> Result:
        """Return the result of the run.

        Parameters
        ----------
        run
            Number of the run within its study.

        Raises
        ------
        UprightError
            If the run is not over.
        """
        if not self.over:
            raise UprightError(
                f"the run is at trial {self._ended + 1:,}; it is over after a success, or after "
                f"{count(self.trials, 'trial')}"
            )
        return Result(run, self.succeeded, self.lengths.copy(), self._seconds)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin a trial. A trial that is in progress ends and counts as failed.

        Raises
        ------
        RunOver
            If the run is over.
        """
        if self._steps_made:
            self._end_trial()
        self._refuse_if_over()
        self._in_trial, self._steps_made = True, 0
        return self.env.reset(seed=seed, options=options)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Make a step of a trial. Step N truncates it if the pole is still up.

        Raises
        ------
        RunOver
            If the run is over.
        ResetNeeded
            If no trial has begun, or the last one has ended.
        """
        self._refuse_if_over()
        if not self._in_trial:
            raise ResetNeeded("no trial is in progress; call reset() before step()")
        observation, reward, fallen, truncated, info = self.env.step(action)
        self._steps_made += 1
        self.succeeded = self._steps_made == self.steps and not fallen
        truncated = truncated or self.succeeded
        if fallen or truncated:
            self._end_trial()
        return observation, reward, fallen, truncated, info

    def _end_trial(self) -> None:
        self._lengths[self._ended] = self._steps_made
        self._ended += 1
        self._in_trial, self._steps_made = False, 0
        self._seconds = time.perf_counter() - self._began

    def _refuse_if_over(self) -> None:
        """Raise RunOver if the run is over."""
        if self.over:
            reason = "a trial succeeded" if self.succeeded else "no trial succeeded"
            raise RunOver(f"the run is over after {count(self._ended, 'trial')}: {reason}")


def run_learner(
    learner: GymnasiumLearner,
    plant: Equations | ChangingEquations,
    task: Task,
    rng: np.random.Generator,
    lengths: NDArray[np.int64],
    stop: NDArray[np.bool_],
) -> int:
    """Let a learner train on an environment until its run is over.

    Parameters and return value are those of `trials.run`. The environment draws from the run's own
    random numbers, unless the learner seeds it.
    """
    integrator = next(name for name, number in INTEGRATORS.items() if number == plant.integrator)
    env = CartPoleEnv.of_task(task, integrator)
    env.np_random = rng
    protocol = TrialProtocol(env, task.steps, task.trials, lengths, stop)
    with suppress(RunOver):
        learner.train(protocol)
    return len(protocol.lengths) if protocol.succeeded else 0
