"""An agent in plain Python: tabular Q-learning in thirty lines.

    upright table --agents examples.plain_agent:TinyQ,random-search --noises none --steps 1000

It runs through the same protocol as the package's agents, into the same table, a hundred times
slower. `compiled_agent.py` shows the fast form.
"""

from collections import defaultdict

import numpy as np

from upright.core.parameters import State


class TinyQ:
    """Q-learning on boxes of the pole's angle and angular velocity, greedy."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Make a new agent for a run; every random number it uses must come from `rng`."""
        self.values: dict[tuple[float, float], list[float]] = defaultdict(lambda: [0.0, 0.0])

    def box(self, observation: State) -> tuple[float, float]:
        """Return the box that a measurement lies in: steps of 2° and 20°/s."""
        return round(observation.theta / 0.035), round(observation.theta_dot / 0.35)

    def begin_trial(self, rng: np.random.Generator) -> None:
        """Get ready for a trial from a new start."""

    def act(self, observation: State, rng: np.random.Generator) -> bool:
        """Choose a push: True to the right, False to the left."""
        left, right = self.values[self.box(observation)]
        return right > left or (right == left and rng.random() < 0.5)

    def learn(self, before: State, action: bool, after: State, fallen: bool) -> None:
        """Learn from one step: what was measured, what was done, what was measured then."""
        target = -1.0 if fallen else 0.95 * max(self.values[self.box(after)])
        values = self.values[self.box(before)]
        values[action] += 0.3 * (target - values[action])

    def end_trial(self, fallen: bool) -> None:
        """Learn from the trial as a whole, which ended by a fall or by success."""
