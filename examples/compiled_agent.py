"""A compiled custom agent: hill climbing, as fast as the package's own agents.

    upright table --agents examples.compiled_agent:hill_climber,random-search --noises none

The policy is linear. Each trial tries half the best weights so far plus a random change, and keeps
the new weights if the pole stayed up longer. The change is as large as the weights, because a
climber that takes small steps stays on the first small hill that it finds. Compiled methods must
follow two rules: numbers that change are stored in arrays, and all arrays are allocated when the
agent is created.
"""

from typing import NamedTuple

import numpy as np

from upright import compiled


class HillClimber(NamedTuple):
    """The agent's state, which it keeps from step to step and from trial to trial."""

    best: np.ndarray
    """The best weights so far, for x/2.4 m, x_dot/1.5 m/s, theta/6° and theta_dot/0.5 rad/s."""
    tried: np.ndarray
    """The weights of the current trial."""
    steps: np.ndarray
    """The largest number of steps so far, and the steps of the current trial."""

    @compiled
    def begin_trial(self, rng):
        """Draw new weights around the best ones."""
        self.steps[1] = 0.0
        for i in range(4):
            self.tried[i] = 0.5 * self.best[i] + (2.0 * rng.random() - 1.0)

    @compiled
    def act(self, observation, rng):
        """Choose a push according to the weights: True to the right, False to the left."""
        w = self.tried
        total = w[0] * observation.x / 2.4 + w[1] * observation.x_dot / 1.5
        return total + w[2] * observation.theta / 0.105 + w[3] * observation.theta_dot / 0.5 > 0.0

    @compiled
    def learn(self, before, action, after, fallen):
        """Count the steps."""
        self.steps[1] += 1.0

    @compiled
    def end_trial(self, fallen):
        """Keep the weights if they did better than the best."""
        if self.steps[1] > self.steps[0]:
            self.steps[0] = self.steps[1]
            for i in range(4):
                self.best[i] = self.tried[i]


def hill_climber(rng: np.random.Generator) -> HillClimber:
    """Create a new agent for a run."""
    return HillClimber(best=np.zeros(4), tried=np.zeros(4), steps=np.zeros(2))
