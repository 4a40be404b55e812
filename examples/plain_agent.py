"""An agent that learns from each fall to see the next one coming. Change it as you like.

The agent predicts the side to which pole or cart will fall: above 0 right, below 0 left. It pushes
to that side, as you move your hand under a broom. The prediction is a weighted sum of the four
measurements, and each fall corrects the weights a little (the rule of Widrow & Hoff 1960).
"""

from collections import deque

import numpy as np

from upright import State

RATE = 0.05  # size of a correction
FADE = 0.98  # factor on the prediction for each step by which the fall is farther away
LAST = 200  # a fall corrects what was predicted in this many steps before it


class PlainAgent:
    """Learns four weights."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Create an agent for a run. Draw all random numbers from `rng`: same seed, same run."""
        self.weights = [0.0, 0.0, 0.0, 0.0]
        self.recent: deque[State] = deque(maxlen=LAST)

    def predict(self, z: tuple[float, ...]) -> float:
        """Predict the side of the fall: 1 just before one to the right, -1 to the left."""
        w = self.weights
        return w[0] * z[0] + w[1] * z[1] + w[2] * z[2] + w[3] * z[3]

    def begin_trial(self, rng: np.random.Generator) -> None:
        """Prepare for a trial."""
        self.recent.clear()

    def act(self, observation: State, rng: np.random.Generator) -> bool:
        """Choose a push at each step: True to the right, False to the left."""
        side = self.predict(scaled(observation))
        return side > 0.0 if side != 0.0 else rng.random() < 0.5

    def learn(self, before: State, action: bool, after: State, fallen: bool) -> None:
        """Learn from one step."""
        self.recent.append(after)

    def end_trial(self, fallen: bool) -> None:
        """Learn from the whole trial: if it ended with a fall, from the last step backwards."""
        if fallen:
            x, _, theta, _ = scaled(self.recent[-1])
            target = 1.0 if x + theta > 0.0 else -1.0  # the one beyond its limit outweighs
            for z in map(scaled, reversed(self.recent)):
                error = target - self.predict(z)
                self.weights = [w + RATE * error * v for w, v in zip(self.weights, z, strict=True)]
                target *= FADE


def scaled(measured: State) -> tuple[float, float, float, float]:
    """Return a measurement in units that make its four numbers similar in size."""
    x, x_dot, theta, theta_dot = measured  # m, m/s, rad, rad/s; to the right is positive
    return x / 2.4, x_dot, theta / 0.21, theta_dot  # it has fallen beyond 2.4 m or 0.21 rad
