"""Adaptive LQR: learn a linear model while balancing, and trust it.

The agent knows that it sees four numbers and may push to either side; no mass, no length, not even
to which side a push drives the pole. It learns to predict the next measurement o' from the last h
measurements and pushes u = ±1, all linear:

    o' = o + Σ_i A_i o_{-i} + Σ_i b_i u_{-i} + error,    i = 0 … h-1,

by recursive least squares: the moments of the data are summed up step by step, and a ridge (a prior
belief that a measurement stays what it is, firmer for what lies further back; R. Litterman,
*Forecasting with Bayesian vector autoregressions*, J. Business & Economic Statistics 4, 1986) makes
the fit unique from the first step on. The present model is taken for the truth (certainty
equivalence: K. Åström, B. Wittenmark, *On self tuning regulators*, Automatica 9, 1973): the
Riccati recursion (R. Kalman, *Contributions to the theory of optimal control*, Bol. Soc. Mat.
Mexicana 5, 1960)

    V ← Q + Aᵀ V A - Aᵀ V b (effort + bᵀ V b)⁻¹ bᵀ V A

gives the gains K of the best linear control over the horizon, for the state z of all that the
prediction rests on, and the agent pushes against K z.

Why the history: fitted to noisy measurements, a model of the last one alone sees the pole as more
stable than it is, and never recovers. The best prediction from a history filters the noise, and
control designed on predictions needs no more than them; neither the noise nor which measurement it
enters has to be known. The history also makes up for delayed pushes and missing velocities.

Rare random pushes keep the data telling; in a trial that has lasted, the model has proved itself,
and the agent neither explores nor learns any more. A fall says that the model was wrong: what was
learned then counts for few samples.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from upright.agents.parts import policy_form
from upright.agents.parts.least_squares import factorise, solve
from upright.agents.parts.policy_form import BLOCK
from upright.core.compiled import compiled
from upright.errors import require

REFIT = 1.02
"""The model is fitted anew when the data have grown by this factor."""


@dataclass(frozen=True)
class AdaptiveLQR:
    """Settings of adaptive LQR."""

    history: int = 6
    """h: how many of the last measurements and pushes a prediction rests on."""
    ridge: float = 1e-4
    """Squares of measurements that must be seen to outweigh the prior belief."""
    push_ridge: float = 1e-3
    """The same for pushes (which are ±1)."""
    ridge_growth: float = 2.0
    """How much firmer the belief is for each step further back."""
    x_cost: float = 0.3
    """What one square metre off the middle costs each step: Q, like the next three."""
    x_dot_cost: float = 0.05
    """What the square of a velocity of 1 m/s costs."""
    theta_cost: float = 10.0
    """What the square of an angle of 1 rad costs."""
    theta_dot_cost: float = 0.5
    """What the square of an angular velocity of 1 rad/s costs."""
    effort: float = 0.1
    """What the square of a push costs; the design takes pushes of any size for possible."""
    horizon: int = 50
    """Over how many steps costs are minimised."""
    exploration: float = 0.015
    """Probability of a random push while learning."""
    settled: int = 2_000
    """After so many steps of a trial the agent neither explores nor learns until the next."""
    kept_samples: float = 200.0
    """After a fall, what was learned counts for so many samples at most."""

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        require("history", self.history, 1, 100, whole=True)
        for name in ("ridge", "push_ridge", "effort"):
            require(name, getattr(self, name), 0, above=True)
        require("ridge_growth", self.ridge_growth, 1)
        for name in ("x_cost", "x_dot_cost", "theta_cost", "theta_dot_cost"):
            require(name, getattr(self, name), 0)
        require("horizon", self.horizon, 1, 10_000, whole=True)
        require("exploration", self.exploration, 0, 1)
        require("settled", self.settled, 0, whole=True)
        require("kept_samples", self.kept_samples, 0, above=True)

    def agent(self, rng: np.random.Generator) -> "Memory":
        """Return a new agent that has seen nothing."""
        size = BLOCK * self.history
        beliefs = np.array([self.push_ridge, *[self.ridge] * 4])
        ridge = np.outer(self.ridge_growth ** np.arange(self.history), beliefs).ravel()
        costs = (self.x_cost, self.x_dot_cost, self.theta_cost, self.theta_dot_cost)
        fit = Fit(
            ridge=ridge,
            factor=np.zeros((size, size)),
            value=np.zeros((size, size)),
            slope=np.zeros((size, size)),
            total=np.zeros((size, size)),
            costs=np.array(costs),
            effort=self.effort,
            horizon=self.horizon,
        )
        return Memory(
            model=np.zeros((4, size)),
            moments=np.diag(ridge),
            targets=np.zeros((4, size)),
            gains=np.zeros(size),
            regressor=np.zeros(size),
            samples=np.zeros(2),
            steps=np.zeros(1, np.int64),
            fit=fit,
            exploration=self.exploration,
            settled=self.settled,
            kept_samples=self.kept_samples,
        )


SETTINGS = {"default": AdaptiveLQR()}


class Fit(NamedTuple):
    """What fitting the model and designing the control need, and room to do so."""

    ridge: np.ndarray
    """Prior precision of each column of the model."""
    factor: np.ndarray
    value: np.ndarray
    """V: the cost to go, a quadratic form of the regressor that does not see the present push."""
    slope: np.ndarray
    """V times what leads from one regressor to the next."""
    total: np.ndarray
    """The cost to go with the present push still free: a quadratic form of the regressor."""
    costs: np.ndarray
    effort: float
    horizon: int


class Memory(NamedTuple):
    """What the agent carries from step to step and from trial to trial."""

    model: np.ndarray
    """Shape (4, 5 h): the next measurement is this times the regressor."""
    moments: np.ndarray
    """Sum of products of two entries of the regressor, and the ridge; the lower triangle."""
    targets: np.ndarray
    """Sum of products of the change of each measurement and an entry of the regressor."""
    gains: np.ndarray
    """K, shape (5 h,); that of the present push plays no part."""
    regressor: np.ndarray
    """What a prediction rests on: the present push, then the state z. A block for each of the last
    steps, the newest first, so that a step of time shifts it by one block.
    """
    samples: np.ndarray
    """For how many samples the moments count; at how many the model is due to be fitted anew."""
    steps: np.ndarray
    """Steps of this trial."""
    fit: Fit
    exploration: float
    settled: int
    kept_samples: float

    @compiled
    def push_probability(self, observation):
        """Return 1 where the control pushes to the right, else 0."""
        return 1.0 if wanted_push(self, observation) > 0.0 else 0.0

    @compiled
    def begin_trial(self, rng):
        """Start a new history."""
        self.steps[0] = 0

    @compiled
    def act(self, observation, rng):
        """Push as the control says, or at random: rarely, or when it does not know."""
        wanted = wanted_push(self, observation)
        explores = self.steps[0] < self.settled and rng.random() < self.exploration
        return rng.random() < 0.5 if explores or wanted == 0.0 else wanted > 0.0

    @compiled
    def learn(self, before, action, after, fallen):
        """Add the step to the data; from time to time, fit the model and design the control."""
        complete_regressor(self, before, action)
        if self.steps[0] < self.settled:
            add_sample(self, before, after)
            if self.samples[0] >= self.samples[1]:
                design(self)
        shift(self)

    @compiled
    def end_trial(self, fallen):
        """Trust what was learned less after a fall."""
        if fallen:
            forget(self)
            design(self)

    @compiled
    def remember(self, observation, action):
        """Take a step into the history without learning from it."""
        complete_regressor(self, observation, action)
        shift(self)

    def policy_form(self):
        """Return the policy as data: linear in the measurement and the past steps."""
        weights = -self.gains[1:, np.newaxis]
        past = len(self.gains) // BLOCK - 1
        return policy_form.Network((policy_form.Layer(weights, "above zero"),), past=past)


@compiled
def wanted_push(memory, observation):
    """Return -K z, the push that the design asks for."""
    gains, regressor = memory.gains, memory.regressor
    wanted = 0.0
    if memory.steps[0] == 0:  # nothing was seen before: as if it had always been like this
        for i in range(len(gains)):
            wanted -= gains[i] * (observation[i % BLOCK - 1] if i % BLOCK > 0 else 0.0)
        return wanted
    for i in range(4):
        wanted -= gains[1 + i] * observation[i]
    for i in range(BLOCK, len(gains)):
        wanted -= gains[i] * regressor[i]
    return wanted


@compiled
def complete_regressor(memory, observation, action):
    """Set the newest block; all blocks alike, without pushes, at the first step of a trial."""
    regressor = memory.regressor
    for start in range(0, len(regressor) if memory.steps[0] == 0 else BLOCK, BLOCK):
        regressor[start] = 0.0
        for i in range(4):
            regressor[start + 1 + i] = observation[i]
    regressor[0] = 1.0 if action else -1.0


@compiled
def shift(memory):
    """Move every block one step into the past."""
    regressor = memory.regressor
    for i in range(len(regressor) - 1, BLOCK - 1, -1):
        regressor[i] = regressor[i - BLOCK]
    memory.steps[0] += 1


@compiled
def add_sample(memory, before, after):
    """Add one step to the moments."""
    moments, targets, regressor = memory.moments, memory.targets, memory.regressor
    for i in range(len(regressor)):
        for j in range(i + 1):
            moments[i, j] += regressor[i] * regressor[j]
    for row in range(4):
        change = after[row] - before[row]
        for i in range(len(regressor)):
            targets[row, i] += change * regressor[i]
    memory.samples[0] += 1.0


@compiled
def forget(memory):
    """Let the data count for fewer samples; the prior belief stays."""
    moments, targets, ridge = memory.moments, memory.targets, memory.fit.ridge
    part = min(1.0, memory.kept_samples / memory.samples[0])
    for i in range(len(ridge)):
        for j in range(i + 1):
            moments[i, j] *= part
        moments[i, i] += (1.0 - part) * ridge[i]
        for row in range(4):
            targets[row, i] *= part
    memory.samples[0] *= part


@compiled
def design(memory):
    """Fit the model to all data, and find the gains of the best control for it."""
    fit, model = memory.fit, memory.model
    factorise(memory.moments, fit.factor)
    for row in range(4):
        solve(fit.factor, memory.targets[row], model[row])
        model[row, 1 + row] += 1.0
    fit.total[:] = 0.0
    add_costs(fit)
    for _ in range(fit.horizon):
        minimise(fit, memory.gains)
        set_slope(fit, model)
        set_total(fit, model)
        add_costs(fit)
    minimise(fit, memory.gains)
    memory.samples[1] = REFIT * memory.samples[0]


@compiled
def add_costs(fit):
    """Add what one step costs."""
    fit.total[0, 0] += fit.effort
    for i in range(4):
        fit.total[1 + i, 1 + i] += fit.costs[i]


@compiled
def minimise(fit, gains):
    """Set the gains of the best present push, and the cost to go when it is made."""
    value, total = fit.value, fit.total
    for i in range(len(gains)):
        gains[i] = total[0, i] / total[0, 0]
    for i in range(len(gains)):
        for j in range(len(gains)):
            value[i, j] = total[i, j] - total[i, 0] * gains[j]


@compiled
def set_slope(fit, model):
    """Set V times what leads to the next regressor: the model, and the shift of all blocks."""
    value, slope = fit.value, fit.slope
    size = len(value)
    for i in range(1, size):
        for j in range(size):
            slope[i, j] = (value[i, 1] * model[0, j] + value[i, 2] * model[1, j]) + (
                value[i, 3] * model[2, j] + value[i, 4] * model[3, j]
            )
        for j in range(size - BLOCK):
            slope[i, j] += value[i, j + BLOCK]


@compiled
def set_total(fit, model):
    """Set the cost to go before the present push: the slope, led back one step."""
    total, slope = fit.total, fit.slope
    size = len(total)
    for i in range(size):
        for j in range(size):
            total[i, j] = (model[0, i] * slope[1, j] + model[1, i] * slope[2, j]) + (
                model[2, i] * slope[3, j] + model[3, i] * slope[4, j]
            )
        if i < size - BLOCK:
            for j in range(size):
                total[i, j] += slope[i + BLOCK, j]
