"""Random search: a new random policy for every trial. The null hypothesis.

The policy is linear and bang-bang: push right when w · observation > 0, with w drawn afresh for
each trial. Nothing is learned, nothing is kept. A learner that needs as many trials has shown
nothing, so the guess stands in every table. Its input scales make it a strong opponent: weights
drawn alike in SI units need about five times as many trials.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from upright.agents.parts import policy_form
from upright.agents.parts.scales import check_scales, scales_of
from upright.core.compiled import compiled
from upright.support.short_repr import short_repr


class RandomSearchAgent(NamedTuple):
    """The one policy in use."""

    weights: np.ndarray
    """w, shape (4,)."""
    scales: np.ndarray

    def __repr__(self) -> str:
        return short_repr(self)

    @compiled
    def push_probability(self, observation):
        """Return 1 where the policy pushes to the right, else 0."""
        w = self.weights
        total = w[0] * observation.x + w[1] * observation.x_dot
        total += w[2] * observation.theta + w[3] * observation.theta_dot
        return 1.0 if total > 0.0 else 0.0

    @compiled
    def begin_trial(self, rng):
        """Draw a new policy: each weight uniform in ±1, per unit of its input."""
        for i in range(4):
            self.weights[i] = (2.0 * rng.random() - 1.0) / self.scales[i]

    @compiled
    def act(self, observation, rng):
        """Push to the side that the policy says."""
        return self.push_probability(observation) > 0.5

    @compiled
    def learn(self, before, action, after, fallen):
        """Learn nothing."""

    @compiled
    def end_trial(self, fallen):
        """Learn nothing."""

    def policy_form(self):
        """Return the policy as data."""
        return policy_form.Network((policy_form.Layer(self.weights[:, np.newaxis], "above zero"),))


@dataclass(frozen=True)
class RandomSearch:
    """Settings of random search."""

    x_scale: float = 2.4
    """Cart position that counts as one unit of input [m]."""
    x_dot_scale: float = 1.5
    """Cart velocity that counts as one unit of input [m/s]."""
    theta_scale: float = math.radians(6)
    """Pole angle that counts as one unit of input [rad]."""
    theta_dot_scale: float = 0.5
    """Angular velocity that counts as one unit of input [rad/s]."""

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        check_scales(self)

    def agent(self, rng: np.random.Generator) -> RandomSearchAgent:
        """Return a new agent; it draws its first policy when a trial begins."""
        return RandomSearchAgent(weights=np.zeros(4), scales=scales_of(self))


SETTINGS = {"default": RandomSearch()}
