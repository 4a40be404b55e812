"""A compiled agent: hill climbing, as fast as the package's own agents.

    upright table --agents examples.compiled_agent:hill_climber,random-search --noises none

The policy is linear. Each trial tries the best weights so far, changed a little at random, and
keeps them if the pole stood longer. The rules for compiled methods: numbers that change live in
arrays, and arrays are allocated when the agent is made.
"""

from typing import NamedTuple

import numpy as np

from upright.core.compiled import compiled


class HillClimber(NamedTuple):
    """What the agent carries from step to step and from trial to trial."""

    best: np.ndarray
    """The best weights so far, for x/2.4 m, x_dot/1.5 m/s, theta/6° and theta_dot/0.5 rad/s."""
    tried: np.ndarray
    """The weights of this trial."""
    steps: np.ndarray
    """The most steps so far, and those of this trial."""

    @compiled
    def begin_trial(self, rng):
        """Try other weights."""
        self.steps[1] = 0.0
        for i in range(4):
            self.tried[i] = self.best[i] + (2.0 * rng.random() - 1.0)

    @compiled
    def act(self, observation, rng):
        """Push as the weights say: True to the right, False to the left."""
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
    """Return a new agent for a run."""
    return HillClimber(best=np.zeros(4), tried=np.zeros(4), steps=np.zeros(2))
