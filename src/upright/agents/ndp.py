"""Direct neural dynamic programming: Si & Wang's two networks that learn at every step.

The critic network puts out J, the cost to expect from a measurement and an action; the action
network puts out u, whose sign is the push. After each step both are trained on what is measured
then (J. Si, Y.-T. Wang, *On-line learning control by association and reinforcement*, IEEE Trans.
Neural Networks 12(2), 2001), with r = -1 at the fall, else 0:

    critic:  E_c = ½ (α J(t) - (J(t-1) - r(t)))²,    w_c ← w_c - l ∂E_c/∂w_c,
    action:  E_a = ½ J(t)²,                          w_a ← w_a - l ∂E_a/∂w_a,

the latter through the critic, ∂E_a/∂w_a = J ∂J/∂u ∂u/∂w_a. Each rule is repeated until its error is
below a threshold or its cycles are used up; the learning rate l falls with time. J(t-1) is what
the critic put out a step before, and is held.

Either network has one hidden layer and no biases; its units put out φ(y) = (1 - e^-y) / (1 + e^-y).

What the paper leaves open is a setting here: whether weights are drawn anew, and when, and whether
the learning rate starts afresh with every trial. Fresh weights matter more than all the rest: with
weights that are never drawn anew, many runs get stuck. The original program draws them when
learning has stalled; the tuned settings after every trial that promises little.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from upright.agents.parts import policy_form
from upright.agents.parts.scales import check_scales, scales_of
from upright.core.compiled import compiled, inlined
from upright.core.noise import uniform
from upright.core.parameters import LARGEST
from upright.errors import require, require_one_of
from upright.support.short_repr import short_repr

STALLED_TRIALS, STALLED_STEPS = 6, 5
"""Learning has stalled when this many trials in a row differ by no more than this many steps."""
PROMISING_STEPS = 100
"""A trial is promising if it lasts this long, and longer than the one before."""


class NDPNetwork(NamedTuple):
    """A network's weights, and what its units put out at the last evaluation."""

    layer_1: np.ndarray
    """Shape (inputs, hidden units)."""
    layer_2: np.ndarray
    """Shape (1, hidden units)."""
    inputs: np.ndarray
    hidden: np.ndarray
    output: np.ndarray
    """J of the critic, u of the action network; shape (1,)."""
    fan_in: tuple[int, ...]
    units: tuple[int, ...]
    """The numbers of the inputs and of the hidden units. Tuples: how many there are is known to the
    compiler, which then needs half the time.
    """


class LearningRate(NamedTuple):
    """The learning rate l and how it falls."""

    steps: np.ndarray
    start: float
    decrement: float
    interval: int
    floor: float
    restarts: bool


class TrialLengths(NamedTuple):
    """The trials since weights were drawn."""

    lengths: np.ndarray
    """How long the last ones were; a ring."""
    trials: np.ndarray
    """How many there have been."""


class DirectNDPAgent(NamedTuple):
    """What the agent carries from step to step and from trial to trial."""

    action: NDPNetwork
    critic: NDPNetwork
    scales: np.ndarray
    first: np.ndarray
    """Whether the networks have yet to be evaluated in this trial."""
    rate: LearningRate
    critic_cycles: int
    action_cycles: int
    critic_threshold: float
    action_threshold: float
    discount: float
    history: TrialLengths
    redraws_always: bool
    redraws_stalled: bool
    redraws_unpromising: bool
    init_range: float
    weight_limit: float

    def __repr__(self) -> str:
        return short_repr(self)

    @compiled
    def push_probability(self, observation):
        """Return 1 where the policy pushes to the right, else 0; the networks stay as they are."""
        action, scales = self.action, self.scales
        u = 0.0
        for k in range(len(action.hidden)):
            y = 0.0
            for i in range(4):
                y += observation[i] / scales[i] * action.layer_1[i, k]
            u += squash(y) * action.layer_2[0, k]
        return 1.0 if u >= 0.0 else 0.0

    @compiled
    def begin_run(self, rng):
        """Draw the first weights."""
        draw(self.action, self.init_range, rng)
        draw(self.critic, self.init_range, rng)

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
            draw(self.action, self.init_range, rng)
            draw(self.critic, self.init_range, rng)
            history.trials[0] = 0
        history.lengths[history.trials[0] % STALLED_TRIALS] = 0

    @compiled
    def act(self, observation, rng):
        """Push to the side of the action network's output."""
        if self.first[0]:
            evaluate_at(self, observation)
            self.first[0] = False
        return self.action.output[0] >= 0.0

    @compiled
    def learn(self, before, action, after, fallen):
        """Train both networks on what is measured now."""
        # J(t-1) - r(t), which α J(t) should be
        target = self.critic.output[0] + (1.0 if fallen else 0.0)
        evaluate_at(self, after)
        rate = learning_rate(self.rate)
        # Critic: w_c ← w_c - l ∂E_c/∂w_c
        for _ in range(self.critic_cycles):
            error = self.discount * self.critic.output[0] - target
            if 0.5 * error * error <= self.critic_threshold:
                break
            train_critic(self.critic, rate * self.discount * error)
        if limit(self.critic, self.weight_limit):
            evaluate(self.critic)
        # Action network: w_a ← w_a - l ∂E_a/∂w_a
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
        """Return the policy as data; φ(y) = tanh(y/2)."""
        layers = (
            policy_form.Layer(0.5 * self.action.layer_1, "tanh"),
            policy_form.Layer(self.action.layer_2.T, "not below zero"),
        )
        return policy_form.Network(layers, tuple(self.scales.tolist()))


# ---- Learning ------------------------------------------------------------------------------------


@inlined
def train_critic(critic, step):
    """Move the critic's weights by ∂J/∂w_c, and evaluate it again."""
    descend(critic, step)
    evaluate(critic)


@inlined
def train_action(action, critic, step):
    """Move the action network's weights by ∂J/∂u ∂u/∂w_a, and evaluate both again."""
    dj_du = 0.0
    for k in range(len(critic.units)):
        dj_du += critic.layer_2[0, k] * squash_slope(critic.hidden[k]) * critic.layer_1[4, k]
    descend(action, step * dj_du * squash_slope(critic.inputs[4]))
    evaluate_both(action, critic)


@inlined
def descend(network, step):
    """Move a network's weights by `step` times the gradient of its output, downwards."""
    for k in range(len(network.units)):
        error = step * network.layer_2[0, k] * squash_slope(network.hidden[k])
        network.layer_2[0, k] -= step * network.hidden[k]
        for i in range(len(network.fan_in)):
            network.layer_1[i, k] -= error * network.inputs[i]


@inlined
def limit(network, largest):
    """Scale down layers whose weights have grown too large; return whether any had."""
    first = scale_down(network.layer_1, largest)
    second = scale_down(network.layer_2, largest)
    return first or second


@inlined
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


@inlined
def learning_rate(rate):
    """Return the learning rate l of this step."""
    fall = rate.decrement * (rate.steps[0] // rate.interval)
    return max(rate.floor, rate.start - fall)


# ---- The networks --------------------------------------------------------------------------------


@inlined
def squash(y):
    """Return a unit's output, φ(y) = (1 - e^-y) / (1 + e^-y) = tanh(y/2), to 1e-15.

    The C library's functions differ in their last bit between systems, which an unstable plant
    soon turns into another trajectory. So, with additions and multiplications: tanh of a 16th of
    y/2 by Lambert's continued fraction, then doubled four times, tanh 2a = 2nd / (n² + d²) where
    tanh a = n / d.
    """
    a = min(max(np.float64(y) / 32.0, -1.25), 1.25)  # numbers of 32 bits would overflow below
    s = a * a
    n = a * (34459425.0 + s * (4729725.0 + s * (135135.0 + s * (990.0 + s))))
    d = 34459425.0 + s * (16216200.0 + s * (945945.0 + s * (13860.0 + s * 45.0)))
    for _ in range(4):
        n, d = 2.0 * n * d, n * n + d * d
    return n / d


@inlined
def squash_slope(output):
    """Return the derivative of `squash`, φ' = ½ (1 - φ²), from the unit's output."""
    return 0.5 * (1.0 - output * output)


@inlined
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


@inlined
def evaluate_both(action, critic):
    """Evaluate the action network, then the critic with φ(u) as its last input."""
    evaluate(action)
    critic.inputs[4] = squash(action.output[0])
    evaluate(critic)


@inlined
def evaluate_at(agent, observation):
    """Evaluate both networks at a measurement."""
    for i in range(4):
        agent.action.inputs[i] = agent.critic.inputs[i] = observation[i] / agent.scales[i]
    evaluate_both(agent.action, agent.critic)


# ---- Fresh weights -------------------------------------------------------------------------------


@inlined
def has_stalled(history):
    """Return whether the last trials were all about as long."""
    lengths = history.lengths
    shortest, longest = lengths[0], lengths[0]
    for length in lengths:
        shortest, longest = min(shortest, length), max(longest, length)
    return history.trials[0] >= STALLED_TRIALS and longest - shortest <= STALLED_STEPS


@inlined
def is_promising(history):
    """Return whether the last trial was long, and longer than the one before with these weights."""
    trials, lengths = history.trials[0], history.lengths
    last = lengths[(trials - 1) % STALLED_TRIALS] if trials > 0 else 0
    previous = lengths[(trials - 2) % STALLED_TRIALS] if trials > 1 else 0
    return last >= PROMISING_STEPS and last > previous


@inlined
def draw(network, init_range, rng):
    """Draw new weights."""
    for layer in (network.layer_1, network.layer_2):
        for i in range(layer.shape[0]):
            for k in range(layer.shape[1]):
                layer[i, k] = uniform(init_range, rng)


# ---- Settings ------------------------------------------------------------------------------------


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
    init_range: float = 2.0
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

    RENAMED: ClassVar = {"spread": "init_range"}

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        require("hidden", self.hidden, 1, 1000, whole=True)
        for name in ("learning_rate", "rate_decrement", "rate_floor", "init_range", "weight_limit"):
            require(name, getattr(self, name), 0, LARGEST)
        for name in ("critic_threshold", "action_threshold"):
            require(name, getattr(self, name), 0, LARGEST)
        require("rate_interval", self.rate_interval, 1, 10**9, whole=True)
        for name in ("critic_cycles", "action_cycles"):
            require(name, getattr(self, name), 0, 10**6, whole=True)
        require("discount", self.discount, 0, 1)
        require_one_of("redraw", self.redraw, ("always", "never", "stalled", "unpromising"))
        check_scales(self)

    def agent(self, rng: np.random.Generator) -> DirectNDPAgent:
        """Return a new agent with random weights."""
        agent = DirectNDPAgent(
            action=blank_network(4, self.hidden),
            critic=blank_network(5, self.hidden),
            scales=scales_of(self),
            first=np.ones(1, np.bool_),
            rate=LearningRate(
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
            history=TrialLengths(
                lengths=np.zeros(STALLED_TRIALS, np.int64),
                trials=np.zeros(1, np.int64),
            ),
            redraws_always=self.redraw == "always",
            redraws_stalled=self.redraw == "stalled",
            redraws_unpromising=self.redraw == "unpromising",
            init_range=float(self.init_range),
            weight_limit=float(self.weight_limit) or math.inf,
        )
        agent.begin_run(rng)
        return agent


def blank_network(inputs: int, hidden: int) -> NDPNetwork:
    """Return a network whose weights have yet to be drawn."""
    return NDPNetwork(
        layer_1=np.zeros((inputs, hidden)),
        layer_2=np.zeros((1, hidden)),
        inputs=np.zeros(inputs),
        hidden=np.zeros(hidden),
        output=np.zeros(1),
        fan_in=tuple(range(inputs)),
        units=tuple(range(hidden)),
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
        init_range=1.0,
        weight_limit=1.5,
        x_scale=2.4,
        x_dot_scale=1.5,
        theta_scale=math.radians(12),
        theta_dot_scale=math.radians(120),
    ),
}
"""As published: the numbers of the paper. It leaves open the scales of the inputs, the limit of the
weights, and what happens when learning stalls; these are those of the authors' program."""
