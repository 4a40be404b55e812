"""The trial protocol for learners that only know Gymnasium.

`TrialProtocol` stands around an environment and counts the trials of one run, whoever makes them.
`run_learner` makes a run of a study so. docs/learners.md tells how to use both.
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
from upright.plants.equations import Equations


class RunOver(Exception):  # noqa: N818 - no error, as StopIteration is none
    """The run is over: the environment makes no further step for this learner.

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
    truncates it, is a trial that failed. An episode without any step is none. Whatever the learner
    makes its steps for, they count.

    Once the run is over, `reset` and `step` raise `RunOver`, which ends any learner. One that
    outlives exceptions can ask for `over`.

    Parameters
    ----------
    env
        One environment; trials of several in parallel would have no order.
    steps
        N: a trial of this many steps without a fall is a success.
    trials
        A run is at most this many trials.
    lengths
        Where the length of each trial is written as it ends, shape (trials,), int64; for a thread
        that watches.
    stop
        Set its one element, a bool, to end the run early.

    Raises
    ------
    UprightError
        If a number is none of the allowed ones, or the environment truncates episodes before N.
    TypeError
        If `env` is no environment, or a vector of them.

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
        """Whether a trial, the last one, was a success."""
        self._lengths = np.zeros(trials, np.int64) if lengths is None else lengths
        self._stop = np.zeros(1, np.bool_) if stop is None else stop
        self._ended = 0  # trials so far
        self._made = 0  # steps of the present trial
        self._begun = False  # whether there is one
        self._began = time.perf_counter()
        self._seconds = 0.0

    @property
    def lengths(self) -> NDArray[np.int64]:
        """Steps of each trial that has ended, in order."""
        return self._lengths[: self._ended]

    @property
    def over(self) -> bool:
        """Whether the run has ended: by success, with its last trial, or because it was stopped."""
        return self.succeeded or self._ended == self.trials or bool(self._stop[0])

    def result(self, run: int = 0) -> Result:
        """Return what came of the run.

        Parameters
        ----------
        run
            Number of the run within its study.

        Raises
        ------
        UprightError
            If it is not over.
        """
        if not self.over:
            raise UprightError(
                f"the run is at trial {self._ended + 1:,}; it is over after a success, or after "
                f"{self.trials:,} trials"
            )
        return Result(run, self.succeeded, self.lengths.copy(), self._seconds)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin a trial. One that is going on ends, and has failed.

        Raises
        ------
        RunOver
            If the run is over.
        """
        if self._made:
            self._end_trial()
        self._require_more()
        self._begun, self._made = True, 0
        return self.env.reset(seed=seed, options=options)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Make a step of a trial. Step N truncates it, if the pole stands.

        Raises
        ------
        RunOver
            If the run is over.
        ResetNeeded
            If no trial has begun, or it has ended.
        """
        self._require_more()
        if not self._begun:
            raise ResetNeeded("no trial is going on; call reset() before step()")
        observation, reward, fallen, truncated, info = self.env.step(action)
        self._made += 1
        self.succeeded = self._made == self.steps and not fallen
        truncated = truncated or self.succeeded
        if fallen or truncated:
            self._end_trial()
        return observation, reward, fallen, truncated, info

    def _end_trial(self) -> None:
        self._lengths[self._ended] = self._made
        self._ended += 1
        self._begun, self._made = False, 0
        self._seconds = time.perf_counter() - self._began

    def _require_more(self) -> None:
        if self.over:
            how = "a trial succeeded" if self.succeeded else "no trial succeeded"
            raise RunOver(f"the run is over after {self._ended:,} trials: {how}")


def run_learner(
    learner: GymnasiumLearner,
    plant: Equations,
    task: Task,
    rng: np.random.Generator,
    lengths: NDArray[np.int64],
    stop: NDArray[np.bool_],
) -> int:
    """Let a learner train on an environment until its run is over.

    It takes and returns what `trials.run` does. The environment draws from the run's own random
    numbers, unless the learner seeds it.

    Raises
    ------
    UprightError
        If the task delays pushes, or the learner ends before its run does.
    """
    if task.delay:
        raise UprightError(
            f"delay is {task.delay}; it must be 0: the environments of Gymnasium delay no push"
        )
    integrator = next(name for name, each in INTEGRATORS.items() if each == plant.integrator)
    env: gymnasium.Env[Any, Any] = CartPoleEnv(
        task.noise, task.start, task.parameters, integrator=integrator
    )
    env.np_random = rng
    counted = TrialProtocol(env, task.steps, task.trials, lengths, stop)
    with suppress(RunOver):
        learner.train(counted)
    if not counted.over:
        raise UprightError(
            f"the learner ended after {len(counted.lengths):,} trials; it must go on until the "
            f"environment raises RunOver, after a success or {task.trials:,} trials"
        )
    return len(counted.lengths) if counted.succeeded else 0
