"""REINFORCE: the policy gradient of the report, on its 4-8-16-1 network.

The network turns a measurement into the probability of a push to the right, and the push is sampled
from it. After a fall, pushes that were followed by a longer balance than expected are made more
likely, the others less (R. J. Williams, *Simple statistical gradient-following algorithms for
connectionist reinforcement learning*, Machine Learning 8, 1992):

    gradient = mean over steps of  ρ_t A_t ∇ log π(a_t | o_t),    A_t = (G_t - V(o_t)) / RMS,

where G_t = -γ^(T-1-t) is the discounted return of a reward of -1 at the fall, in an episode of T
steps. (With a reward of +1 a step instead, G_t is the same but for a factor and an offset, which
normalised returns do not show.)

The tuned settings add three well-known aids: a baseline V fitted by regression; the last few
episodes used again, each step weighted by how likely the present policy makes its push, compared
with the policy that made it, ρ = min(1, π / π_then); and weights that decay a little.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from upright.agents.parts import policy_form
from upright.agents.parts.adam import Adam, ascend, make_adam
from upright.agents.parts.episodes import (
    Episodes,
    begin_episode,
    count_kept,
    make_episodes,
    record_step,
    row_before_end,
)
from upright.agents.parts.least_squares import factorise, solve
from upright.agents.parts.network import (
    WEIGHTS,
    Activations,
    PolicyNetwork,
    add_gradient,
    blank_activations,
    draw_weights,
    evaluate,
    network_of,
    set_to_zero,
    sigmoid,
)
from upright.agents.parts.scales import check_scales, scales_of
from upright.core.compiled import compiled, inlined
from upright.core.parameters import LARGEST
from upright.errors import require, require_one_of
from upright.support.short_repr import short_repr

FEATURES = 11
"""Of the baseline: a constant, and the products of two of the four inputs."""
BASELINE_MEMORY = 0.9
"""How much the baseline's past counts after one more episode."""
RIDGE = 1e-3
"""Keeps the baseline's regression solvable."""
MOST_KEPT = 5 * 10**6
"""Steps that may be kept in all: 8 episodes of 600,000; they take a quarter of a gigabyte."""


class Baseline(NamedTuple):
    """V: the regression of the return on the inputs, by its normal equations."""

    features: np.ndarray
    moments: np.ndarray
    """Sums of products of two features, and the ridge, shape (FEATURES, FEATURES)."""
    targets: np.ndarray
    """Sums of products of the return and a feature."""
    factor: np.ndarray
    coefficients: np.ndarray
    """The solution: V is this times the features."""


class ReinforceAgent(NamedTuple):
    """What the agent carries from step to step and from trial to trial."""

    network: PolicyNetwork
    units: Activations
    scales: np.ndarray
    init_std: float
    logit_scale: float
    probability: np.ndarray
    """Of a push to the right at the present step, shape (1,)."""
    episodes: Episodes
    discount: float
    fits_baseline: bool
    baseline: Baseline
    epochs: int
    stride: int
    gradient: PolicyNetwork
    """Layers that view the gradient in `adam`, as those of `network` view its weights."""
    adam: Adam

    def __repr__(self) -> str:
        return short_repr(self)

    @compiled
    def push_probability(self, observation):
        """Return π(right | o), the probability of a push to the right."""
        for i in range(4):
            self.units.inputs[i] = observation[i] / self.scales[i]
        return sigmoid(self.logit_scale * evaluate(self.network, self.units))

    @compiled
    def begin_run(self, rng):
        """Draw the first weights."""
        draw_weights(self.network, self.init_std, rng)

    @compiled
    def begin_trial(self, rng):
        """Begin a new episode."""
        begin_episode(self.episodes)

    @compiled
    def act(self, observation, rng):
        """Sample a push."""
        self.probability[0] = self.push_probability(observation)
        return rng.random() < self.probability[0]

    @compiled
    def learn(self, before, action, after, fallen):
        """Remember the step."""
        probability_right = self.probability[0]
        probability = probability_right if action else 1.0 - probability_right
        record_step(self.episodes, self.units.inputs, action, probability)

    @compiled
    def end_trial(self, fallen):
        """Improve the policy after a fall."""
        if not fallen:
            return
        if self.fits_baseline:
            fit_baseline(self.baseline, self.episodes, self.discount)
        set_advantages(self.episodes, self.baseline, self.discount, self.fits_baseline)
        for epoch in range(self.epochs):
            set_policy_gradient(self, epoch % self.stride)
            ascend(self.adam)

    def policy_form(self):
        """Return the policy as data; the logit scale goes into the last weights."""
        layers = (
            policy_form.Layer(self.network.layer_1, "isrlu"),
            policy_form.Layer(self.network.layer_2, "isrlu"),
            policy_form.Layer(self.logit_scale * self.network.layer_3[:, np.newaxis], "sigmoid"),
        )
        return policy_form.Network(layers, tuple(self.scales.tolist()))


# ---- The policy gradient -------------------------------------------------------------------------


@inlined
def set_policy_gradient(agent, first):
    """Set the mean of ρ A ∇ log π(a | o) over every stride-th remembered step, from `first` on."""
    gradient, network, units = agent.gradient, agent.network, agent.units
    episodes, logit_scale, stride = agent.episodes, agent.logit_scale, agent.stride
    set_to_zero(gradient)
    count = 0
    for episode in range(len(episodes.lengths)):
        count += len(range(first, count_kept(episodes, episode), stride))
    for episode in range(len(episodes.lengths)):
        for row in range(first, count_kept(episodes, episode), stride):
            # π(a | o), by the present policy
            for i in range(4):
                units.inputs[i] = episodes.inputs[episode, row, i]
            probability_right = sigmoid(logit_scale * evaluate(network, units))
            action = episodes.actions[episode, row]
            probability = probability_right if action else 1.0 - probability_right
            # ρ A / count
            importance = min(1.0, probability / episodes.probabilities[episode, row])
            weight = importance * episodes.advantages[episode, row] / count
            # ∇ log π(a | o)
            dlogpi_dlogit = 1.0 - probability_right if action else -probability_right
            add_gradient(gradient, network, units, weight * dlogpi_dlogit * logit_scale)


@inlined
def set_advantages(episodes, baseline, discount, fits_baseline):
    """Set A of every remembered step: G less V, or less the mean G, normalised over all steps."""
    # G_t - V(o_t), from the last step of each episode backwards
    count, total, squares = 0, 0.0, 0.0
    for episode in range(len(episodes.lengths)):
        discounted_return = -1.0
        for back in range(count_kept(episodes, episode)):
            row = row_before_end(episodes, episode, back)
            advantage = discounted_return
            if fits_baseline:
                advantage -= expected_return(baseline, episodes.inputs[episode, row])
            episodes.advantages[episode, row] = advantage
            count += 1
            total += advantage
            squares += advantage * advantage
            discounted_return *= discount
    # ... / RMS
    mean = 0.0 if fits_baseline else total / count
    deviation = math.sqrt(max(squares / count - mean * mean, 1e-12))
    for episode in range(len(episodes.lengths)):
        for row in range(count_kept(episodes, episode)):
            advantage = episodes.advantages[episode, row]
            episodes.advantages[episode, row] = (advantage - mean) / deviation


# ---- The baseline V ------------------------------------------------------------------------------


@inlined
def fit_baseline(baseline, episodes, discount):
    """Fit V to the newest episode's returns, and ever less to the ones before."""
    features, moments, targets = baseline.features, baseline.moments, baseline.targets
    # The past counts less; the ridge is added anew
    for i in range(FEATURES):
        targets[i] *= BASELINE_MEMORY
        for j in range(FEATURES):
            moments[i, j] *= BASELINE_MEMORY
        moments[i, i] += RIDGE
    # Add every step of the newest episode, the last one first
    newest = episodes.newest[0]
    discounted_return = -1.0
    for back in range(count_kept(episodes, newest)):
        row = row_before_end(episodes, newest, back)
        set_features(features, episodes.inputs[newest, row])
        for i in range(FEATURES):
            targets[i] += discounted_return * features[i]
            for j in range(FEATURES):
                moments[i, j] += features[i] * features[j]
        discounted_return *= discount
    # Solve the normal equations
    factorise(moments, baseline.factor)
    solve(baseline.factor, targets, baseline.coefficients)


@inlined
def set_features(features, inputs):
    """Set the features: a constant, and the products of two inputs."""
    features[0] = 1.0
    index = 1
    for i in range(4):
        for j in range(i + 1):
            features[index] = inputs[i] * inputs[j]
            index += 1


@inlined
def expected_return(baseline, inputs):
    """Return V of the inputs; returns lie between -1 and 0."""
    set_features(baseline.features, inputs)
    value = 0.0
    for i in range(FEATURES):
        value += baseline.coefficients[i] * baseline.features[i]
    return min(0.0, max(-1.0, value))


# ---- Settings ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Reinforce:
    """Settings of REINFORCE."""

    learning_rate: float = 0.01
    """Step size of Adam."""
    discount: float = 0.99
    """γ: how much less a push counts for each step that it lies before the fall."""
    baseline: Literal["fitted", "mean"] = "fitted"
    """What returns are compared with: their "mean", or a regression "fitted" on the inputs."""
    episodes: int = 8
    """How many of the last episodes an update learns from."""
    kept_steps: int = 1000
    """Of a longer episode only this many last steps are learned from."""
    epochs: int = 12
    """Steps of Adam in one update."""
    stride: int = 3
    """A step of Adam looks at every stride-th remembered step, in turn: neighbours are alike."""
    beta1: float = 0.5
    """Adam's β1: how much of the mean gradient is kept at a step."""
    beta2: float = 0.97
    """Adam's β2: how much of the mean square of the gradient is kept at a step."""
    weight_decay: float = 0.01
    """Part of every weight that is lost at each step of Adam."""
    init_std: float = 0.6
    """Standard deviation of the first weights, times the root of a unit's number of inputs."""
    logit_scale: float = 3.0
    """Factor from the network's last sum to the log-odds of a push to the right."""
    x_scale: float = 3.6
    """Cart position that counts as one unit of input [m]."""
    x_dot_scale: float = 2.2
    """Cart velocity that counts as one unit of input [m/s]."""
    theta_scale: float = math.radians(6)
    """Pole angle that counts as one unit of input [rad]."""
    theta_dot_scale: float = 0.35
    """Angular velocity that counts as one unit of input [rad/s]."""

    RENAMED: ClassVar = {
        "passes": "epochs",
        "thinning": "stride",
        "momentum": "beta1",
        "square_memory": "beta2",
        "decay": "weight_decay",
        "spread": "init_std",
        "gain": "logit_scale",
    }

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        require("learning_rate", self.learning_rate, 1 / LARGEST, LARGEST)
        require("discount", self.discount, 0, 1)
        require_one_of("baseline", self.baseline, ("mean", "fitted"))
        for name in ("episodes", "kept_steps", "epochs", "stride"):
            require(name, getattr(self, name), 1, 10**6, whole=True)
        require("episodes * kept_steps", self.episodes * self.kept_steps, 1, MOST_KEPT, whole=True)
        for name in ("beta1", "beta2", "weight_decay"):
            require(name, getattr(self, name), 0, 0.999999)
        require("init_std", self.init_std, 0, LARGEST)
        require("logit_scale", self.logit_scale, 1 / LARGEST, LARGEST)
        check_scales(self)

    def agent(self, rng: np.random.Generator) -> ReinforceAgent:
        """Return a new agent with random weights."""
        weights = np.zeros(WEIGHTS)
        adam = make_adam(weights, self.learning_rate, self.beta1, self.beta2, self.weight_decay)
        agent = ReinforceAgent(
            network=network_of(weights),
            units=blank_activations(),
            scales=scales_of(self),
            init_std=self.init_std,
            logit_scale=self.logit_scale,
            probability=np.zeros(1),
            episodes=make_episodes(self.episodes, self.kept_steps),
            discount=self.discount,
            fits_baseline=self.baseline == "fitted",
            baseline=Baseline(
                features=np.zeros(FEATURES),
                moments=np.zeros((FEATURES, FEATURES)),
                targets=np.zeros(FEATURES),
                factor=np.zeros((FEATURES, FEATURES)),
                coefficients=np.zeros(FEATURES),
            ),
            epochs=self.epochs,
            stride=self.stride,
            gradient=network_of(adam.gradient),
            adam=adam,
        )
        agent.begin_run(rng)
        return agent


SETTINGS = {
    "default": Reinforce(),
    "as-published": Reinforce(
        learning_rate=0.1,
        discount=0.97,
        baseline="mean",
        episodes=1,
        kept_steps=60_000,
        epochs=1,
        stride=1,
        beta1=0.9,
        beta2=0.999,
        weight_decay=0.0,
        init_std=1.0,
        logit_scale=1.0,
        x_scale=1.0,
        x_dot_scale=1.0,
        theta_scale=1.0,
        theta_dot_scale=1.0,
    ),
}
"""The report's learning rate, discount and network; what it leaves open as a student would choose:
Adam, one episode an update, normalised returns, raw measurements."""
