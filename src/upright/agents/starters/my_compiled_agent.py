"""An agent that learns from each fall to see the next one coming, compiled. Change it as you like.

The agent predicts the side to which pole or cart will fall: above 0 right, below 0 left. It pushes
to that side, as you move your hand under a broom. The prediction is a weighted sum of the four
measurements, and each fall corrects the weights a little (the rule of Widrow & Hoff 1960).

It is as fast as the package's own agents. Compiled methods must follow two rules: numbers that
change are kept in arrays, and all arrays are allocated when the agent is created.
"""

from typing import NamedTuple

import numpy as np

from upright import State, compiled

RATE = 0.05  # size of a correction
FADE = 0.98  # factor on the prediction for each step by which the fall is farther away
LAST = 200  # a fall corrects what was predicted in this many steps before it


class MyAgent(NamedTuple):
    """Learns four weights."""

    weights: np.ndarray  # shape (4,)
    recent: np.ndarray  # the last measurements, shape (LAST, 4); after the last row comes the first
    steps: np.ndarray  # the number of steps of this trial, shape (1,)

    @compiled
    def begin_trial(self, rng: np.random.Generator) -> None:
        """Prepare for a trial."""
        self.steps[0] = 0

    @compiled
    def act(self, observation: State, rng: np.random.Generator) -> bool:
        """Choose a push at each step: True to the right, False to the left."""
        side = predict(self.weights, scaled(observation))
        return side > 0.0 if side != 0.0 else rng.random() < 0.5

    @compiled
    def learn(self, before: State, action: bool, after: State, fallen: bool) -> None:
        """Learn from one step."""
        row = self.steps[0] % LAST
        for i in range(4):
            self.recent[row, i] = after[i]
        self.steps[0] += 1

    @compiled
    def end_trial(self, fallen: bool) -> None:
        """Learn from the whole trial: if it ended with a fall, from the last step backwards."""
        if fallen:
            last = self.steps[0] - 1
            x, _, theta, _ = scaled(self.recent[last % LAST])
            target = 1.0 if x + theta > 0.0 else -1.0  # the one beyond its limit outweighs
            for step in range(last, max(-1, last - LAST), -1):
                z = scaled(self.recent[step % LAST])
                error = target - predict(self.weights, z)
                for i in range(4):
                    self.weights[i] += RATE * error * z[i]
                target *= FADE

    @compiled
    def push_probability(self, observation: State) -> float:
        """Return the probability of a push to the right, for pictures and for playing."""
        side = predict(self.weights, scaled(observation))
        return 0.5 if side == 0.0 else 1.0 if side > 0.0 else 0.0


@compiled
def predict(w: np.ndarray, z: tuple[float, ...]) -> float:
    """Predict the side of the fall: 1 just before one to the right, -1 to the left."""
    return w[0] * z[0] + w[1] * z[1] + w[2] * z[2] + w[3] * z[3]  # type: ignore[no-any-return]


@compiled
def scaled(measured: State | np.ndarray) -> tuple[float, float, float, float]:
    """Return a measurement in units that make its four numbers similar in size."""
    x, x_dot = measured[0], measured[1]  # m, m/s; to the right is positive
    theta, theta_dot = measured[2], measured[3]  # rad, rad/s
    return x / 2.4, x_dot, theta / 0.21, theta_dot  # it has fallen beyond 2.4 m or 0.21 rad


def my_agent(rng: np.random.Generator) -> MyAgent:
    """Create an agent for a run. Draw all random numbers from `rng`: same seed, same run."""
    return MyAgent(np.zeros(4), np.zeros((LAST, 4)), np.zeros(1, np.int64))
