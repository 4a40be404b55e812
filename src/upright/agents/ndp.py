"""Direct neural dynamic programming: Si & Wang's two networks that learn at every step.

The critic network puts out J, the cost to expect from a measurement and an action; the action
network puts out u, whose sign is the push. After each step both are trained on what is measured
then (J. Si, Y.-T. Wang, *On-line learning control by association and reinforcement*, IEEE Trans.
Neural Networks 12(2), 2001), with r = -1 at the fall, else 0:

    critic:  E_c = ½ (α J(t) - (J(t-1) - r(t)))²,    w_c ← w_c - l ∂E_c/∂w_c,
    action:  E_a = ½ J(t)²,                          w_a ← w_a - l ∂E_a/∂w_a,

the latter through the critic, ∂E_a/∂w_a = J ∂J/∂u ∂u/∂w_a. Each rule is repeated until its error is
below a threshold or its cycles are used up; the learning rate l falls with time. J(t-1) is what
the critic said a step before, and is held.

Either network has one hidden layer and no biases; its units put out φ(y) = (1 - e^-y) / (1 + e^-y).

What the paper leaves open is a setting here: whether weights are drawn anew, and when, and whether
the learning rate starts afresh with every trial. Fresh weights matter more than all the rest: with
weights that are never drawn anew, many runs get stuck. The original program draws
them when learning has stalled; the tuned settings after every trial that promises little.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from upright.agents.parts import policy_form
from upright.core.compiled import compiled
from upright.errors import require, require_one_of

STALLED_TRIALS, STALLED_STEPS = 6, 5
"""Learning has stalled when so many trials in a row differ by no more than so many steps."""
PROMISING_STEPS = 100
"""A trial promises something if it lasts so long, and longer than the one before."""


@dataclass(frozen=True)
class DirectNDP:
    """Settings of direct neural dynamic programming."""

    hidden: int = 4
    """Units in the hidden layer of each network."""
    learning_rate: float = 0.85
    """l at first."""
    rate_decrement: float = 0.01
    """How much lower l gets at a time."""
    rate_interval: int = 5
    """How many steps lie between two decrements."""
    rate_floor: float = 0.02
    """l gets no lower than this."""
    rate_restarts: bool = True
    """Whether l is as at first again when a trial begins."""
    critic_cycles: int = 50
    """How often the critic learns at one step, at most."""
    action_cycles: int = 100
    """How often the action network learns at one step, at most."""
    critic_threshold: float = 0.03
    """The critic stops when E_c is no more than this."""
    action_threshold: float = 0.05
    """The action network stops when E_a is no more than this."""
    discount: float = 0.95
    """α: how much less a fall costs for each step that it lies ahead."""
    redraw: str = "unpromising"
    """When a trial begins with new random weights: "always", "never", if learning has "stalled", or
    if the trial before was "unpromising".
    """
    spread: float = 2.0
    """Random weights are uniform between plus and minus this."""
    weight_limit: float = 0.0
    """A layer with a weight beyond this is scaled down to a largest weight of 1; 0 is no limit."""
    x_scale: float = 4.8
    """Cart position that counts as one unit of input [m]."""
    x_dot_scale: float = 2.5
    """Cart velocity that counts as one unit of input [m/s]."""
    theta_scale: float = math.radians(12)
    """Pole angle that counts as one unit of input [rad]."""
    theta_dot_scale: float = 0.93
    """Angular velocity that counts as one unit of input [rad/s]."""

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        require("hidden", self.hidden, 1, 1000, whole=True)
        for name in ("learning_rate", "rate_decrement", "rate_floor", "spread", "weight_limit"):
            require(name, getattr(self, name), 0)
        for name in ("critic_threshold", "action_threshold"):
            require(name, getattr(self, name), 0)
        require("rate_interval", self.rate_interval, 1, 10**9, whole=True)
        for name in ("critic_cycles", "action_cycles"):
            require(name, getattr(self, name), 0, 10**6, whole=True)
        require("discount", self.discount, 0, 1)
        require_one_of("redraw", self.redraw, ("always", "never", "stalled", "unpromising"))
        for name in ("x_scale", "x_dot_scale", "theta_scale", "theta_dot_scale"):
            require(name, getattr(self, name), 0, above=True)

    def agent(self, rng: np.random.Generator) -> "Memory":
        """Return a new agent with random weights."""
        scales = (self.x_scale, self.x_dot_scale, self.theta_scale, self.theta_dot_scale)
        action, critic = _network(4, self.hidden), _network(5, self.hidden)
        for layer in (action.layer_1, action.layer_2, critic.layer_1, critic.layer_2):
            layer[:] = rng.uniform(-self.spread, self.spread, layer.shape)
        return Memory(
            action=action,
            critic=critic,
            scales=np.array(scales),
            first=np.ones(1, np.bool_),
            rate=Rate(
                steps=np.zeros(1, np.int64),
                start=float(self.learning_rate),
                decrement=float(self.rate_decrement),
                interval=self.rate_interval,
                floor=float(self.rate_floor),
                restarts=self.rate_restarts,
            ),
            critic_cycles=self.critic_cycles,
            action_cycles=self.action_cycles,
            critic_threshold=float(self.critic_threshold),
            action_threshold=float(self.action_threshold),
            discount=float(self.discount),
            history=History(
                lengths=np.zeros(STALLED_TRIALS, np.int64),
                trials=np.zeros(1, np.int64),
            ),
            redraws_always=self.redraw == "always",
            redraws_stalled=self.redraw == "stalled",
            redraws_unpromising=self.redraw == "unpromising",
            spread=float(self.spread),
            weight_limit=float(self.weight_limit) or math.inf,
        )


SETTINGS = {
    "default": DirectNDP(),
    "as-published": DirectNDP(
        hidden=6,
        learning_rate=0.3,
        rate_decrement=0.05,
        rate_interval=5,
        rate_floor=0.005,
        rate_restarts=True,
        critic_cycles=50,
        action_cycles=100,
        critic_threshold=0.05,
        action_threshold=0.005,
        discount=0.95,
        redraw="stalled",
        spread=1.0,
        weight_limit=1.5,
        x_scale=2.4,
        x_dot_scale=1.5,
        theta_scale=math.radians(12),
        theta_dot_scale=math.radians(120),
    ),
}
"""As published: the numbers of the paper. It leaves open the scales of the inputs, the limit of the
weights, and what happens when learning stalls; these are those of the authors' program."""


class Network(NamedTuple):
    """A network's weights, and what its units put out at the last evaluation."""

    layer_1: np.ndarray
    layer_2: np.ndarray
    inputs: np.ndarray
    hidden: np.ndarray
    output: np.ndarray
    fan_in: tuple[int, ...]
    units: tuple[int, ...]
    """The numbers of the inputs and of the hidden units. Tuples: how many there are is known to the
    compiler, which then needs half the time.
    """


class Rate(NamedTuple):
    """The learning rate and how it falls."""

    steps: np.ndarray
    start: float
    decrement: float
    interval: int
    floor: float
    restarts: bool


class History(NamedTuple):
    """The trials since weights were drawn."""

    lengths: np.ndarray
    """How long the last ones were; a ring."""
    trials: np.ndarray
    """How many there have been."""


class Memory(NamedTuple):
    """What the agent carries from step to step and from trial to trial."""

    action: Network
    critic: Network
    scales: np.ndarray
    first: np.ndarray
    """Whether the networks have yet to be evaluated in this trial."""
    rate: Rate
    critic_cycles: int
    action_cycles: int
    critic_threshold: float
    action_threshold: float
    discount: float
    history: History
    redraws_always: bool
    redraws_stalled: bool
    redraws_unpromising: bool
    spread: float
    weight_limit: float

    @compiled
    def push_probability(self, observation):
        """Return 1 where the policy pushes to the right, else 0."""
        action, scales = self.action, self.scales
        total = 0.0
        for k in range(len(action.hidden)):
            y = 0.0
            for i in range(4):
                y += observation[i] / scales[i] * action.layer_1[i, k]
            total += squash(y) * action.layer_2[0, k]
        return 1.0 if total >= 0.0 else 0.0

    @compiled
    def begin_trial(self, rng):
        """Draw new weights if it is time to."""
        self.first[0] = True
        if self.rate.restarts:
            self.rate.steps[0] = 0
        history = self.history
        redraws = self.redraws_always
        redraws |= self.redraws_stalled and has_stalled(history)
        redraws |= self.redraws_unpromising and not is_promising(history)
        if redraws:
            draw(self.action, self.spread, rng)
            draw(self.critic, self.spread, rng)
            history.trials[0] = 0
        history.lengths[history.trials[0] % STALLED_TRIALS] = 0

    @compiled
    def act(self, observation, rng):
        """Push to the side of the action network's output."""
        if self.first[0]:
            look(self, observation)
            self.first[0] = False
        return self.action.output[0] >= 0.0

    @compiled
    def learn(self, before, action, after, fallen):
        """Train both networks on what is measured now."""
        target = self.critic.output[0] + (1.0 if fallen else 0.0)
        look(self, after)
        rate = learning_rate(self.rate)
        for _ in range(self.critic_cycles):
            error = self.discount * self.critic.output[0] - target
            if 0.5 * error * error <= self.critic_threshold:
                break
            train_critic(self.critic, rate * self.discount * error)
        if limit(self.critic, self.weight_limit):
            evaluate(self.critic)
        for _ in range(self.action_cycles):
            cost = self.critic.output[0]
            if 0.5 * cost * cost <= self.action_threshold:
                break
            train_action(self.action, self.critic, rate * cost)
        if limit(self.action, self.weight_limit):
            evaluate_both(self.action, self.critic)
        self.rate.steps[0] += 1
        history = self.history
        history.lengths[history.trials[0] % STALLED_TRIALS] += 1

    @compiled
    def end_trial(self, fallen):
        """Count the trial."""
        self.history.trials[0] += 1

    def policy_form(self):
        """Return the policy as data; squash(y) = tanh(y/2)."""
        layers = (
            policy_form.Layer(0.5 * self.action.layer_1, "tanh"),
            policy_form.Layer(self.action.layer_2.T, "not below zero"),
        )
        return policy_form.Network(layers, tuple(self.scales.tolist()))


def _network(inputs: int, hidden: int) -> Network:
    return Network(
        layer_1=np.zeros((inputs, hidden)),
        layer_2=np.zeros((1, hidden)),
        inputs=np.zeros(inputs),
        hidden=np.zeros(hidden),
        output=np.zeros(1),
        fan_in=tuple(range(inputs)),
        units=tuple(range(hidden)),
    )


@compiled
def squash(y):
    """Return a unit's output, (1 - e^-y) / (1 + e^-y) = tanh(y/2), to 1e-15.

    The C library's functions differ in their last bit between systems, which an unstable plant
    soon turns into another trajectory. So, with additions and multiplications: tanh of a 16th of
    y/2 by Lambert's continued fraction, then doubled four times, tanh 2a = 2nd / (n² + d²) where
    tanh a = n / d.
    """
    a = min(max(y / 32.0, -1.25), 1.25)
    s = a * a
    n = a * (34459425.0 + s * (4729725.0 + s * (135135.0 + s * (990.0 + s))))
    d = 34459425.0 + s * (16216200.0 + s * (945945.0 + s * (13860.0 + s * 45.0)))
    for _ in range(4):
        n, d = 2.0 * n * d, n * n + d * d
    return n / d


@compiled
def squash_slope(output):
    """Return the derivative of `squash`, from the unit's output."""
    return 0.5 * (1.0 - output * output)


@compiled
def evaluate(network):
    """Set a network's output to the sum over its hidden units, for its inputs."""
    for k in range(len(network.units)):
        y = 0.0
        for i in range(len(network.fan_in)):
            y += network.inputs[i] * network.layer_1[i, k]
        network.hidden[k] = y
    for k in range(len(network.units)):
        network.hidden[k] = squash(network.hidden[k])
    total = 0.0
    for k in range(len(network.units)):
        total += network.hidden[k] * network.layer_2[0, k]
    network.output[0] = total


@compiled
def evaluate_both(action, critic):
    """Evaluate the action network, then the critic with the action as its last input."""
    evaluate(action)
    critic.inputs[4] = squash(action.output[0])
    evaluate(critic)


@compiled
def look(memory, observation):
    """Evaluate both networks at a measurement."""
    for i in range(4):
        memory.action.inputs[i] = memory.critic.inputs[i] = observation[i] / memory.scales[i]
    evaluate_both(memory.action, memory.critic)


@compiled
def descend(network, step):
    """Move a network's weights by `step` times the gradient of its output, downwards."""
    for k in range(len(network.units)):
        error = step * network.layer_2[0, k] * squash_slope(network.hidden[k])
        network.layer_2[0, k] -= step * network.hidden[k]
        for i in range(len(network.fan_in)):
            network.layer_1[i, k] -= error * network.inputs[i]


@compiled
def train_critic(critic, step):
    """Move the critic's weights and evaluate it again."""
    descend(critic, step)
    evaluate(critic)


@compiled
def train_action(action, critic, step):
    """Move the action network's weights by the gradient of J, and evaluate both again."""
    slope = 0.0  # ∂J/∂u
    for k in range(len(critic.units)):
        slope += critic.layer_2[0, k] * squash_slope(critic.hidden[k]) * critic.layer_1[4, k]
    descend(action, step * slope * squash_slope(critic.inputs[4]))
    evaluate_both(action, critic)


@compiled
def limit(network, largest):
    """Scale down layers whose weights have grown too large; return whether any had."""
    first = scale_down(network.layer_1, largest)
    second = scale_down(network.layer_2, largest)
    return first or second


@compiled
def scale_down(layer, largest):
    """Divide a layer's weights by the largest of them if that is beyond the limit."""
    top = 0.0
    for i in range(layer.shape[0]):
        for k in range(layer.shape[1]):
            top = max(top, abs(layer[i, k]))
    if top > largest:
        for i in range(layer.shape[0]):
            for k in range(layer.shape[1]):
                layer[i, k] /= top
    return top > largest


@compiled
def learning_rate(rate):
    """Return the learning rate of this step."""
    fall = rate.decrement * (rate.steps[0] // rate.interval)
    return max(rate.floor, rate.start - fall)


@compiled
def has_stalled(history):
    """Return whether the last trials were all about as long."""
    lengths = history.lengths
    shortest, longest = lengths[0], lengths[0]
    for length in lengths:
        shortest, longest = min(shortest, length), max(longest, length)
    return history.trials[0] >= STALLED_TRIALS and longest - shortest <= STALLED_STEPS


@compiled
def is_promising(history):
    """Return whether the last trial was long, and longer than the one before with these weights."""
    trials, lengths = history.trials[0], history.lengths
    last = lengths[(trials - 1) % STALLED_TRIALS] if trials > 0 else 0
    before = lengths[(trials - 2) % STALLED_TRIALS] if trials > 1 else 0
    return last >= PROMISING_STEPS and last > before


@compiled
def draw(network, spread, rng):
    """Draw new weights."""
    for layer in (network.layer_1, network.layer_2):
        for i in range(layer.shape[0]):
            for k in range(layer.shape[1]):
                layer[i, k] = spread * (2.0 * rng.random() - 1.0)
