"""A custom agent in plain Python: tabular Q-learning in thirty lines.

    upright table --agents examples.plain_agent:TinyQ,random-search --noises none --steps 1000

It is measured by the same protocol and in the same table as the package's agents, but is a hundred
times slower. `compiled_agent.py` shows how to write a fast agent.
"""

from collections import defaultdict

import numpy as np

from upright import State


class TinyQ:
    """Greedy Q-learning on boxes of the pole's angle and angular velocity."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Create a new agent for a run; all random numbers it uses must come from `rng`."""
        self.values: dict[tuple[float, float], list[float]] = defaultdict(lambda: [0.0, 0.0])

    def box(self, observation: State) -> tuple[float, float]:
        """Return the box that contains a measurement; boxes are 2° by 20°/s in size."""
        return round(observation.theta / 0.035), round(observation.theta_dot / 0.35)

    def begin_trial(self, rng: np.random.Generator) -> None:
        """Prepare for a trial from a new start."""

    def act(self, observation: State, rng: np.random.Generator) -> bool:
        """Choose a push: True to the right, False to the left."""
        left, right = self.values[self.box(observation)]
        return right > left or (right == left and rng.random() < 0.5)

    def learn(self, before: State, action: bool, after: State, fallen: bool) -> None:
        """Learn from one step: the measurement before, the push, and the measurement after."""
        target = -1.0 if fallen else 0.95 * max(self.values[self.box(after)])
        values = self.values[self.box(before)]
        values[action] += 0.3 * (target - values[action])

    def end_trial(self, fallen: bool) -> None:
        """Learn from the whole trial, which has ended in a fall or in success."""
