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

    V ← Q + Aᵀ V A - Aᵀ V b (R + bᵀ V b)⁻¹ bᵀ V A

gives the gains K of the best linear control over the horizon, for the state z of all that the
prediction rests on, and the agent pushes against K z. In the code u stands beside z in one vector,
the regressor w = (u, z). The model and the shift of the history lead from it to the next state,
z' = M w, and a step of the recursion is

    H = Mᵀ V M + diag(R, Q),    K = H_u· / H_uu,    V = H - H_·u K,

where wᵀ H w is the cost to go while the push is free, and zᵀ V z when it is the best one.

Why the history: fitted to noisy measurements, a model of the last one alone sees the pole as more
stable than it is, and never recovers. The best prediction from a history filters the noise, and
control designed on predictions needs no more than them; neither the noise nor which measurement it
enters has to be known. The history also makes up for delayed pushes and missing velocities.

Rare random pushes keep the data informative; in a trial that has lasted, the model has proved
itself, and the agent neither explores nor learns any more. A fall shows that the model was wrong:
what was learned then counts for few samples.
"""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from upright.agents.parts import policy_form
from upright.agents.parts.history import BLOCK, set_newest, shift, unchanged
from upright.agents.parts.least_squares import factorise, solve
from upright.core.compiled import compiled, inlined
from upright.core.parameters import LARGEST, SMALLEST
from upright.errors import require
from upright.support.short_repr import short_repr

REFIT = 1.02
"""The model is fitted anew when the data have grown by this factor."""


class Design(NamedTuple):
    """What the design of the control needs, and room for it; w is the regressor (u, z)."""

    q_matrix: np.ndarray
    """H: the cost to go while the present push is free, a quadratic form of w."""
    cost_to_go: np.ndarray
    """V: the cost to go with the best present push, a quadratic form of w that does not see u."""
    cost_to_go_times_model: np.ndarray
    """V M."""
    state_costs: np.ndarray
    """Q, a diagonal matrix, of the four measurements; shape (4,)."""
    push_cost: float
    """R."""
    horizon: int


class AdaptiveLQRAgent(NamedTuple):
    """What the agent carries from step to step and from trial to trial."""

    model: np.ndarray
    """Shape (4, 5 h): the next measurement is this times the regressor; the rest of M shifts."""
    moments: np.ndarray
    """Sums of products of two entries of the regressor, and the ridge; the lower triangle."""
    targets: np.ndarray
    """Sums of products of the change of each measurement and an entry of the regressor."""
    ridge: np.ndarray
    """Prior precision of each column of the model."""
    factor: np.ndarray
    """Room for the Cholesky factor of the moments."""
    gains: np.ndarray
    """K, shape (5 h,); that of the present push plays no part."""
    regressor: np.ndarray
    """w, what a prediction rests on: the present push u, then the state z. Laid out as a history: a
    block for each of the last steps, the newest first.
    """
    samples: np.ndarray
    """For how many samples the moments count; at how many the model is due to be fitted anew."""
    steps: np.ndarray
    """Steps of this trial, shape (1,)."""
    design: Design
    exploration: float
    learning_steps: int
    kept_samples: float

    def __repr__(self) -> str:
        return short_repr(self)

    @compiled
    def push_probability(self, observation):
        """Return 1 where the control pushes to the right, else 0."""
        return 1.0 if best_push(self, observation) > 0.0 else 0.0

    @compiled
    def begin_trial(self, rng):
        """Start a new history."""
        self.steps[0] = 0

    @compiled
    def act(self, observation, rng):
        """Push as the control says, or at random: rarely, or when it does not know."""
        push = best_push(self, observation)
        explores = self.steps[0] < self.learning_steps and rng.random() < self.exploration
        return rng.random() < 0.5 if explores or push == 0.0 else push > 0.0

    @compiled
    def learn(self, before, action, after, fallen):
        """Add the step to the data; from time to time, fit the model and design the control."""
        set_newest(self.regressor, before, action, self.steps[0] == 0)
        if self.steps[0] < self.learning_steps:
            add_sample(self, before, after)
            if self.samples[0] >= self.samples[1]:
                fit_and_design(self)
        shift(self.regressor)
        self.steps[0] += 1

    @compiled
    def end_trial(self, fallen):
        """Trust what was learned less after a fall."""
        if fallen:
            forget(self)
            fit_and_design(self)

    @compiled
    def remember(self, observation, action):
        """Take a step into the history without learning from it."""
        set_newest(self.regressor, observation, action, self.steps[0] == 0)
        shift(self.regressor)
        self.steps[0] += 1

    def policy_form(self):
        """Return the policy as data: linear in the measurement and the past steps."""
        weights = -self.gains[1:, np.newaxis]
        past = len(self.gains) // BLOCK - 1
        return policy_form.Network((policy_form.Layer(weights, "above zero"),), past=past)


@inlined
def best_push(agent, observation):
    """Return -K z, the push that the design asks for: any number, of which the sign counts."""
    gains, regressor = agent.gains, agent.regressor
    push = 0.0
    if agent.steps[0] == 0:
        for i in range(len(gains)):
            push -= gains[i] * unchanged(observation, i)
        return push
    for i in range(4):
        push -= gains[1 + i] * observation[i]
    for i in range(BLOCK, len(gains)):
        push -= gains[i] * regressor[i]
    return push


@inlined
def fit_and_design(agent):
    """Fit the model to all data, and find the gains of the best control for it."""
    fit_model(agent)
    design_control(agent.design, agent.model, agent.gains)
    agent.samples[1] = REFIT * agent.samples[0]


# ---- The model: recursive least squares ----------------------------------------------------------


@inlined
def add_sample(agent, before, after):
    """Add one step to the moments."""
    moments, targets, regressor = agent.moments, agent.targets, agent.regressor
    for i in range(len(regressor)):
        for j in range(i + 1):
            moments[i, j] += regressor[i] * regressor[j]
    for row in range(4):
        change = after[row] - before[row]
        for i in range(len(regressor)):
            targets[row, i] += change * regressor[i]
    agent.samples[0] += 1.0


@inlined
def fit_model(agent):
    """Fit the model: o' - o is the regression on w."""
    factorise(agent.moments, agent.factor)
    for row in range(4):
        solve(agent.factor, agent.targets[row], agent.model[row])
        agent.model[row, 1 + row] += 1.0


@inlined
def forget(agent):
    """Let the data count for fewer samples; the prior belief stays."""
    moments, targets, ridge = agent.moments, agent.targets, agent.ridge
    kept = min(1.0, agent.kept_samples / agent.samples[0])
    for i in range(len(ridge)):
        for j in range(i + 1):
            moments[i, j] *= kept
        moments[i, i] += (1.0 - kept) * ridge[i]
        for row in range(4):
            targets[row, i] *= kept
    agent.samples[0] *= kept


# ---- The control: the Riccati recursion ----------------------------------------------------------


@inlined
def design_control(design, model, gains):
    """Set the gains K of the best control for the model, over the horizon."""
    # After the last step nothing costs any more: H = diag(R, Q)
    design.q_matrix[:] = 0.0
    add_step_costs(design)
    for _ in range(design.horizon):
        riccati_step(design, model, gains)
    set_gains(design, gains)


@inlined
def riccati_step(design, model, gains):
    """Go one step back in time: from the H of a step to the H of the step before."""
    set_gains(design, gains)
    set_cost_to_go(design, gains)
    multiply_by_model(design, model)
    multiply_by_transposed_model(design, model)
    add_step_costs(design)


@inlined
def set_gains(design, gains):
    """Set K = H_u· / H_uu, the gains of the best present push."""
    h = design.q_matrix
    for i in range(len(gains)):
        gains[i] = h[0, i] / h[0, 0]


@inlined
def set_cost_to_go(design, gains):
    """Set V = H - H_·u K, the cost to go when the best push is made."""
    h, v = design.q_matrix, design.cost_to_go
    for i in range(len(gains)):
        for j in range(len(gains)):
            v[i, j] = h[i, j] - h[i, 0] * gains[j]


@inlined
def multiply_by_model(design, model):
    """Set V M: four rows of M are the model, which sets z's first block, all others shift."""
    v, vm = design.cost_to_go, design.cost_to_go_times_model
    size = len(v)
    for i in range(1, size):
        for j in range(size):
            vm[i, j] = (v[i, 1] * model[0, j] + v[i, 2] * model[1, j]) + (
                v[i, 3] * model[2, j] + v[i, 4] * model[3, j]
            )
        for j in range(size - BLOCK):
            vm[i, j] += v[i, j + BLOCK]


@inlined
def multiply_by_transposed_model(design, model):
    """Set H = Mᵀ V M, the cost to go one step earlier."""
    h, vm = design.q_matrix, design.cost_to_go_times_model
    size = len(h)
    for i in range(size):
        for j in range(size):
            h[i, j] = (model[0, i] * vm[1, j] + model[1, i] * vm[2, j]) + (
                model[2, i] * vm[3, j] + model[3, i] * vm[4, j]
            )
        if i < size - BLOCK:
            for j in range(size):
                h[i, j] += vm[i + BLOCK, j]


@inlined
def add_step_costs(design):
    """Add diag(R, Q), the costs of one step, to H."""
    design.q_matrix[0, 0] += design.push_cost
    for i in range(4):
        design.q_matrix[1 + i, 1 + i] += design.state_costs[i]


# ---- Settings ------------------------------------------------------------------------------------


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
    push_cost: float = 0.1
    """R: what the square of a push costs; the design assumes that a push may have any size."""
    horizon: int = 50
    """Over how many steps costs are minimised."""
    exploration: float = 0.015
    """Probability of a random push while learning."""
    learning_steps: int = 2_000
    """After this many steps of a trial the agent neither explores nor learns until the next."""
    kept_samples: float = 200.0
    """After a fall, what was learned counts for this many samples at most."""

    RENAMED: ClassVar = {"effort": "push_cost", "settled": "learning_steps"}
    RENAMED_ARRAYS: ClassVar = {
        "fit.ridge": "ridge",
        "fit.factor": "factor",
        "fit.total": "design.q_matrix",
        "fit.value": "design.cost_to_go",
        "fit.slope": "design.cost_to_go_times_model",
        "fit.costs": "design.state_costs",
    }

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        require("history", self.history, 1, 100, whole=True)
        for name in ("ridge", "push_ridge", "push_cost"):
            require(name, getattr(self, name), SMALLEST, LARGEST)
        require("ridge_growth", self.ridge_growth, 1, 1000)
        require("ridge_growth ** history", self.ridge_growth**self.history, 1, 1e100)
        for name in ("x_cost", "x_dot_cost", "theta_cost", "theta_dot_cost"):
            require(name, getattr(self, name), 0, LARGEST)
        require("horizon", self.horizon, 1, 10_000, whole=True)
        require("exploration", self.exploration, 0, 1)
        require("learning_steps", self.learning_steps, 0, 10**9, whole=True)
        require("kept_samples", self.kept_samples, 1 / LARGEST, LARGEST)

    def agent(self, rng: np.random.Generator) -> AdaptiveLQRAgent:
        """Return a new agent that has seen nothing."""
        size = BLOCK * self.history
        beliefs = np.array([self.push_ridge, *[self.ridge] * 4])
        ridge = np.outer(self.ridge_growth ** np.arange(self.history), beliefs).ravel()
        costs = (self.x_cost, self.x_dot_cost, self.theta_cost, self.theta_dot_cost)
        return AdaptiveLQRAgent(
            model=np.zeros((4, size)),
            moments=np.diag(ridge),
            targets=np.zeros((4, size)),
            ridge=ridge,
            factor=np.zeros((size, size)),
            gains=np.zeros(size),
            regressor=np.zeros(size),
            samples=np.zeros(2),
            steps=np.zeros(1, np.int64),
            design=Design(
                q_matrix=np.zeros((size, size)),
                cost_to_go=np.zeros((size, size)),
                cost_to_go_times_model=np.zeros((size, size)),
                state_costs=np.array(costs),
                push_cost=self.push_cost,
                horizon=self.horizon,
            ),
            exploration=self.exploration,
            learning_steps=self.learning_steps,
            kept_samples=self.kept_samples,
        )


SETTINGS = {"default": AdaptiveLQR()}
