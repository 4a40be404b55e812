"""REINFORCE: the policy gradient of the report, on its 4-8-16-1 network.

The network turns a measurement into the probability of a push to the right, and the push is sampled
from it. After a fall, pushes that were followed by a longer balance than expected are made more
likely, the others less (R. J. Williams, *Simple statistical gradient-following algorithms for
connectionist reinforcement learning*, Machine Learning 8, 1992):

    gradient = mean over steps of  A_t · ∇ log π(a_t | o_t),    A_t = (G_t - V(o_t)) / RMS

where G_t = -γ^(T-1-t) is the discounted return of a reward of -1 at the fall, in an episode of T
steps. (With a reward of +1 a step instead, G_t is the same but for a factor and an offset, which
normalised returns do not show.)

The tuned settings add three well-known helps: a baseline V fitted by regression; the last few
episodes used again, each step weighted by how likely the present policy makes its push; and weights
that decay a little.
"""

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from upright.agents.parts import policy_form
from upright.agents.parts.least_squares import factorise, solve
from upright.core.compiled import compiled
from upright.errors import require, require_one_of

HIDDEN_1, HIDDEN_2 = 8, 16
"""Units of the two hidden layers (the report's figure 2)."""
WEIGHTS = 4 * HIDDEN_1 + HIDDEN_1 * HIDDEN_2 + HIDDEN_2
FEATURES = 11
"""Of the baseline: a constant, and the products of two of the four inputs."""
BASELINE_MEMORY = 0.9
"""How much the baseline's past counts after one more episode."""
RIDGE = 1e-3
"""Keeps the baseline's regression solvable."""
MOST_KEPT = 5 * 10**6
"""Steps that may be kept in all: 8 episodes of 600,000; they take a quarter of a gigabyte."""


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
    """Of a longer episode only so many last steps are learned from."""
    passes: int = 12
    """Steps of Adam in one update."""
    thinning: int = 3
    """A step of Adam looks at every so many-th remembered step, in turn: neighbours are alike."""
    momentum: float = 0.5
    """Adam's β1: memory of the gradient."""
    square_memory: float = 0.97
    """Adam's β2: memory of the gradient's squares."""
    decay: float = 0.01
    """Part of every weight that is lost at each step of Adam."""
    spread: float = 0.6
    """Standard deviation of the first weights, times the root of a unit's number of inputs."""
    gain: float = 3.0
    """Factor from the network's last sum to the log-odds of a push to the right."""
    x_scale: float = 3.6
    """Cart position that counts as one unit of input [m]."""
    x_dot_scale: float = 2.2
    """Cart velocity that counts as one unit of input [m/s]."""
    theta_scale: float = math.radians(6)
    """Pole angle that counts as one unit of input [rad]."""
    theta_dot_scale: float = 0.35
    """Angular velocity that counts as one unit of input [rad/s]."""

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        require("learning_rate", self.learning_rate, 0, above=True)
        require("discount", self.discount, 0, 1)
        require_one_of("baseline", self.baseline, ("mean", "fitted"))
        for name in ("episodes", "kept_steps", "passes", "thinning"):
            require(name, getattr(self, name), 1, 10**6, whole=True)
        require("episodes * kept_steps", self.episodes * self.kept_steps, 1, MOST_KEPT, whole=True)
        for name in ("momentum", "square_memory", "decay"):
            require(name, getattr(self, name), 0, 0.999999)
        require("spread", self.spread, 0)
        for name in ("gain", "x_scale", "x_dot_scale", "theta_scale", "theta_dot_scale"):
            require(name, getattr(self, name), 0, above=True)

    def agent(self, rng: np.random.Generator) -> "Memory":
        """Return a new agent, its weights uniform with the settings' spread."""
        fan_ins = np.repeat([4, HIDDEN_1, HIDDEN_2], [4 * HIDDEN_1, HIDDEN_1 * HIDDEN_2, HIDDEN_2])
        weights = self.spread * np.sqrt(3.0 / fan_ins) * rng.uniform(-1.0, 1.0, WEIGHTS)
        gradient = np.zeros(WEIGHTS)
        scales = (self.x_scale, self.x_dot_scale, self.theta_scale, self.theta_dot_scale)
        steps = (self.episodes, self.kept_steps)
        return Memory(
            network=_network(weights),
            units=Units(np.zeros(4), np.zeros(HIDDEN_1), np.zeros(HIDDEN_2), np.zeros(HIDDEN_2)),
            scales=np.array(scales),
            gain=self.gain,
            probability=np.zeros(1),
            episodes=Episodes(
                inputs=np.zeros((*steps, 4)),
                actions=np.zeros(steps, np.bool_),
                probabilities=np.zeros(steps),
                advantages=np.zeros(steps),
                lengths=np.zeros(self.episodes, np.int64),
                newest=np.zeros(1, np.int64),
            ),
            discount=self.discount,
            fits_baseline=self.baseline == "fitted",
            baseline=Baseline(
                features=np.zeros(FEATURES),
                moments=np.zeros((FEATURES, FEATURES)),
                targets=np.zeros(FEATURES),
                factor=np.zeros((FEATURES, FEATURES)),
                coefficients=np.zeros(FEATURES),
            ),
            passes=self.passes,
            thinning=self.thinning,
            gradient=_network(gradient),
            adam=Adam(
                weights=weights,
                gradient=gradient,
                mean=np.zeros(WEIGHTS),
                mean_square=np.zeros(WEIGHTS),
                steps=np.zeros(1),
                learning_rate=self.learning_rate,
                momentum=self.momentum,
                square_memory=self.square_memory,
                decay=self.decay,
            ),
        )


SETTINGS = {
    "default": Reinforce(),
    "as-published": Reinforce(
        learning_rate=0.1,
        discount=0.97,
        baseline="mean",
        episodes=1,
        kept_steps=60_000,
        passes=1,
        thinning=1,
        momentum=0.9,
        square_memory=0.999,
        decay=0.0,
        spread=1.0,
        gain=1.0,
        x_scale=1.0,
        x_dot_scale=1.0,
        theta_scale=1.0,
        theta_dot_scale=1.0,
    ),
}
"""The report's learning rate, discount and network; what it leaves open as a student would choose:
Adam, one episode an update, normalised returns, raw measurements."""


class Network(NamedTuple):
    """The weights of the three layers, or their gradient: views of one row of numbers."""

    layer_1: np.ndarray
    layer_2: np.ndarray
    layer_3: np.ndarray


class Units(NamedTuple):
    """What the units put out at the last evaluation, and the error that came back."""

    inputs: np.ndarray
    hidden_1: np.ndarray
    hidden_2: np.ndarray
    error_2: np.ndarray


class Episodes(NamedTuple):
    """The last episodes: a ring of episodes, each a ring of its last steps."""

    inputs: np.ndarray
    actions: np.ndarray
    probabilities: np.ndarray
    advantages: np.ndarray
    lengths: np.ndarray
    newest: np.ndarray


class Baseline(NamedTuple):
    """The regression of the return on the inputs: its normal equations and their solution."""

    features: np.ndarray
    moments: np.ndarray
    targets: np.ndarray
    factor: np.ndarray
    coefficients: np.ndarray


class Adam(NamedTuple):
    """Adam (Kingma & Ba, 2015), with decay of the weights."""

    weights: np.ndarray
    gradient: np.ndarray
    mean: np.ndarray
    mean_square: np.ndarray
    steps: np.ndarray
    learning_rate: float
    momentum: float
    square_memory: float
    decay: float


class Memory(NamedTuple):
    """What the agent carries from step to step and from trial to trial."""

    network: Network
    units: Units
    scales: np.ndarray
    gain: float
    probability: np.ndarray
    episodes: Episodes
    discount: float
    fits_baseline: bool
    baseline: Baseline
    passes: int
    thinning: int
    gradient: Network
    adam: Adam

    @compiled
    def push_probability(self, observation):
        """Return the probability of a push to the right."""
        for i in range(4):
            self.units.inputs[i] = observation[i] / self.scales[i]
        return sigmoid(self.gain * evaluate(self.network, self.units))

    @compiled
    def begin_trial(self, rng):
        """Make room for a new episode in place of the oldest."""
        episodes = self.episodes
        episodes.newest[0] = (episodes.newest[0] + 1) % len(episodes.lengths)
        episodes.lengths[episodes.newest[0]] = 0

    @compiled
    def act(self, observation, rng):
        """Sample a push."""
        self.probability[0] = self.push_probability(observation)
        return rng.random() < self.probability[0]

    @compiled
    def learn(self, before, action, after, fallen):
        """Remember the step."""
        episodes = self.episodes
        episode = episodes.newest[0]
        row = episodes.lengths[episode] % episodes.actions.shape[1]
        episodes.lengths[episode] += 1
        for i in range(4):
            episodes.inputs[episode, row, i] = self.units.inputs[i]
        episodes.actions[episode, row] = action
        right = self.probability[0]
        episodes.probabilities[episode, row] = right if action else 1.0 - right

    @compiled
    def end_trial(self, fallen):
        """Improve the policy after a fall."""
        if fallen:
            if self.fits_baseline:
                fit_baseline(self.baseline, self.episodes, self.discount)
            set_advantages(self.episodes, self.baseline, self.discount, self.fits_baseline)
            for number in range(self.passes):
                set_gradient(self, number % self.thinning)
                ascend(self.adam)

    def policy_form(self):
        """Return the policy as data; the gain goes into the last weights."""
        layers = (
            policy_form.Layer(self.network.layer_1, "isrlu"),
            policy_form.Layer(self.network.layer_2, "isrlu"),
            policy_form.Layer(self.gain * self.network.layer_3[:, np.newaxis], "sigmoid"),
        )
        return policy_form.Network(layers, tuple(self.scales.tolist()))


def _network(row: np.ndarray) -> Network:
    first, second = 4 * HIDDEN_1, 4 * HIDDEN_1 + HIDDEN_1 * HIDDEN_2
    return Network(
        row[:first].reshape(4, HIDDEN_1),
        row[first:second].reshape(HIDDEN_1, HIDDEN_2),
        row[second:],
    )


@compiled
def sigmoid(z):
    """Return the logistic function."""
    return 1.0 / (1.0 + math.exp(-z))


@compiled
def activation(z):
    """Return a unit's output: z above zero, bending towards -1 below (ISRLU: ELU without exp)."""
    return z if z > 0.0 else z / math.sqrt(1.0 + z * z)


@compiled
def activation_slope(output):
    """Return the activation's derivative, from the unit's output."""
    rest = 1.0 - output * output
    return 1.0 if output > 0.0 else rest * math.sqrt(rest)


@compiled
def evaluate_layer(inputs, weights, outputs, fan_in, width):
    """Set outputs[k] to the activation of the sum over j of inputs[j] weights[j, k]."""
    for k in range(width):
        total = 0.0
        for j in range(fan_in):
            total += inputs[j] * weights[j, k]
        outputs[k] = total
    for k in range(width):
        outputs[k] = activation(outputs[k])


@compiled
def evaluate(network, units):
    """Return the network's last sum for the inputs in `units`, which keeps the units' outputs."""
    evaluate_layer(units.inputs, network.layer_1, units.hidden_1, 4, HIDDEN_1)
    evaluate_layer(units.hidden_1, network.layer_2, units.hidden_2, HIDDEN_1, HIDDEN_2)
    total = 0.0
    for k in range(HIDDEN_2):
        total += units.hidden_2[k] * network.layer_3[k]
    return total


@compiled
def add_gradient(gradient, network, units, error):
    """Add the gradient of `error` times the last evaluation (backpropagation)."""
    for k in range(HIDDEN_2):
        gradient.layer_3[k] += error * units.hidden_2[k]
        units.error_2[k] = error * network.layer_3[k] * activation_slope(units.hidden_2[k])
    for j in range(HIDDEN_1):
        error_1 = 0.0
        for k in range(HIDDEN_2):
            error_1 += units.error_2[k] * network.layer_2[j, k]
            gradient.layer_2[j, k] += units.error_2[k] * units.hidden_1[j]
        error_1 *= activation_slope(units.hidden_1[j])
        for i in range(4):
            gradient.layer_1[i, j] += error_1 * units.inputs[i]


@compiled
def steps_kept(episodes, episode):
    """Return how many steps of an episode are remembered."""
    return min(episodes.lengths[episode], episodes.actions.shape[1])


@compiled
def row_before_the_end(episodes, episode, back):
    """Return the row of the step that lies `back` steps before an episode's last."""
    return (episodes.lengths[episode] - 1 - back) % episodes.actions.shape[1]


@compiled
def fit_baseline(baseline, episodes, discount):
    """Fit V to the newest episode's returns, and ever less to the ones before."""
    features, moments, targets = baseline.features, baseline.moments, baseline.targets
    for i in range(FEATURES):
        targets[i] *= BASELINE_MEMORY
        for j in range(FEATURES):
            moments[i, j] *= BASELINE_MEMORY
        moments[i, i] += RIDGE
    newest = episodes.newest[0]
    discounted = -1.0
    for back in range(steps_kept(episodes, newest)):
        row = row_before_the_end(episodes, newest, back)
        set_features(features, episodes.inputs[newest, row])
        for i in range(FEATURES):
            targets[i] += discounted * features[i]
            for j in range(FEATURES):
                moments[i, j] += features[i] * features[j]
        discounted *= discount
    factorise(moments, baseline.factor)
    solve(baseline.factor, targets, baseline.coefficients)


@compiled
def set_features(features, inputs):
    """Set the features: a constant, and the products of two inputs."""
    features[0] = 1.0
    index = 1
    for i in range(4):
        for j in range(i + 1):
            features[index] = inputs[i] * inputs[j]
            index += 1


@compiled
def expected_return(baseline, inputs):
    """Return V of the inputs; returns lie between -1 and 0."""
    set_features(baseline.features, inputs)
    value = 0.0
    for i in range(FEATURES):
        value += baseline.coefficients[i] * baseline.features[i]
    return min(0.0, max(-1.0, value))


@compiled
def set_advantages(episodes, baseline, discount, fits_baseline):
    """Set the advantage of every remembered step, normalised over all of them."""
    count, total, squares = 0, 0.0, 0.0
    for episode in range(len(episodes.lengths)):
        discounted = -1.0
        for back in range(steps_kept(episodes, episode)):
            row = row_before_the_end(episodes, episode, back)
            advantage = discounted
            if fits_baseline:
                advantage -= expected_return(baseline, episodes.inputs[episode, row])
            episodes.advantages[episode, row] = advantage
            count += 1
            total += advantage
            squares += advantage * advantage
            discounted *= discount
    mean = 0.0 if fits_baseline else total / count
    deviation = math.sqrt(max(squares / count - mean * mean, 1e-12))
    for episode in range(len(episodes.lengths)):
        for row in range(steps_kept(episodes, episode)):
            advantage = episodes.advantages[episode, row]
            episodes.advantages[episode, row] = (advantage - mean) / deviation


@compiled
def set_gradient(memory, first):
    """Set the policy gradient: the mean of A ∇ log π(a | o) over remembered steps, thinned."""
    gradient, network, units = memory.gradient, memory.network, memory.units
    episodes, gain, thinning = memory.episodes, memory.gain, memory.thinning
    gradient.layer_1[:] = 0.0
    gradient.layer_2[:] = 0.0
    gradient.layer_3[:] = 0.0
    count = 0
    for episode in range(len(episodes.lengths)):
        count += len(range(first, steps_kept(episodes, episode), thinning))
    for episode in range(len(episodes.lengths)):
        for row in range(first, steps_kept(episodes, episode), thinning):
            for i in range(4):
                units.inputs[i] = episodes.inputs[episode, row, i]
            right = sigmoid(gain * evaluate(network, units))
            action = episodes.actions[episode, row]
            probability = right if action else 1.0 - right
            importance = min(1.0, probability / episodes.probabilities[episode, row])
            weight = importance * episodes.advantages[episode, row] / count
            slope = 1.0 - right if action else -right  # of log π along the log-odds
            add_gradient(gradient, network, units, weight * slope * gain)


@compiled
def ascend(adam):
    """Make one step of Adam up the gradient."""
    adam.steps[0] += 1.0
    mean_part = 1.0 - adam.momentum ** adam.steps[0]
    square_part = 1.0 - adam.square_memory ** adam.steps[0]
    for i in range(WEIGHTS):
        g = adam.gradient[i]
        adam.mean[i] += (1.0 - adam.momentum) * (g - adam.mean[i])
        adam.mean_square[i] += (1.0 - adam.square_memory) * (g * g - adam.mean_square[i])
        size = math.sqrt(adam.mean_square[i] / square_part) + 1e-8
        weight = adam.weights[i] + adam.learning_rate * adam.mean[i] / mean_part / size
        adam.weights[i] = (1.0 - adam.decay) * weight
