"""REINFORCE balances a pole on a cart: all of it on one page, to be read from top to bottom.

A network of 4-8-16-1 units turns a measurement o into the probability π(right | o), and the push a
is sampled from it. After a fall, pushes that were followed by a longer balance than expected are
made more likely, the others less (R. J. Williams, *Simple statistical gradient-following
algorithms*, 1992). With the return G_t = -γ^(T-1-t) of an episode of T steps:

    gradient = mean over steps of  ρ_t A_t ∇ log π(a_t | o_t),    A_t = (G_t - V(o_t)) / RMS

V is fitted by least squares: V(o) = cᵀ φ(o), where φ(o) holds 1 and the products of two
measurements. The last few episodes are used again: ρ_t = min(1, π now / π when the push was made).
The weights W follow the gradient by Adam (D. Kingma, J. Ba, 2015), and decay a little.
"""

import math
import sys
from collections import deque

import numpy as np

LEARNING_RATE = 0.01  # step size of Adam
BETA1, BETA2, EPSILON = 0.5, 0.97, 1e-8  # Adam's memory of the gradient and of its squares
WEIGHT_DECAY = 0.01  # part of every weight lost at each step of Adam
DISCOUNT = 0.99  # γ: how much less a push counts for each step that it lies before the fall
EPISODES = 8  # an update learns from this many last episodes
KEPT_STEPS = 1_000  # of a longer episode, only this many last steps are kept
EPOCHS = 12  # steps of Adam in one update
STRIDE = 3  # each step of Adam uses every third kept step, in turn, as neighbours are alike
BASELINE_DECAY = 0.9  # how much V's past counts after one more episode
RIDGE = 1e-3  # keeps the regression for V solvable
INIT_STD = 0.6  # standard deviation of the first weights, times √(number of a unit's inputs)
LOGIT_SCALE = 3.0  # from the network's last sum to the log-odds of a push to the right
OBS_SCALE = np.array([3.6, 2.2, math.radians(6), 0.35])  # what the network sees as 1 [m, m/s, …]


# --- The plant (Barto, Sutton & Anderson, 1983) ---

g, m_c, m, l = 9.8, 1.0, 0.1, 0.5  # gravity [m/s²], mass of cart and pole [kg], half-length [m]
mu_c, mu_p = 0.0005, 0.000002  # friction of the cart [N] and of the hinge [N m s]
FORCE, TIME_STEP = 10.0, 0.02  # size of a push [N], time between two pushes [s]
X_LIMIT, THETA_LIMIT = 2.4, math.radians(12)  # beyond these it has fallen [m, rad]
SIN = [(-1) ** k / math.factorial(2 * k + 1) for k in range(1, 7)]  # Taylor coefficients
COS = [(-1) ** k / math.factorial(2 * k) for k in range(1, 7)]


def series(c, z):
    """Return c_0 + c_1 z + … + c_5 z⁵, always summed in this order."""
    z2 = z * z
    return (c[0] + z * c[1]) + z2 * (c[2] + z * c[3]) + z2 * z2 * (c[4] + z * c[5])


def step(state, F):
    """Return the state one time step after a force F [N] on the cart, and whether the pole fell.

    With f, the force per total mass that both accelerations share:

    f = (F + m l θ̇² sin θ - μ_c sgn ẋ) / (m_c + m)
    θ̈ = (g sin θ - f cos θ - μ_p θ̇ / (m l)) / (l (4/3 - m cos² θ / (m_c + m)))
    ẍ = f - m l θ̈ cos θ / (m_c + m)
    """
    x, x_dot, theta, theta_dot = state
    z = theta * theta  # not math.sin, whose last bits differ between systems: see README.md
    sin, cos = theta + theta * z * series(SIN, z), 1.0 + z * series(COS, z)
    sgn = (x_dot > 0) - (x_dot < 0)
    per_mass = 1.0 / (m_c + m)
    f = (F + m * l * theta_dot * theta_dot * sin - mu_c * sgn) * per_mass
    theta_acc = g * sin - f * cos - mu_p / (m * l) * theta_dot
    theta_acc /= l * (4 / 3 - m * per_mass * (cos * cos))
    x_acc = f - m * l * per_mass * (theta_acc * cos)
    h = TIME_STEP  # explicit Euler: the old velocities move the positions
    x, x_dot = x + h * x_dot, x_dot + h * x_acc
    theta, theta_dot = theta + h * theta_dot, theta_dot + h * theta_acc
    return (x, x_dot, theta, theta_dot), abs(x) > X_LIMIT or abs(theta) > THETA_LIMIT


# --- The agent ---


def isrlu(z):
    """Return the activation: z above zero, bending towards -1 below."""
    return z / np.sqrt(1 + np.minimum(z, 0) ** 2)


def isrlu_slope(h):
    """Return the derivative of the activation, from its value h."""
    return (1 - np.minimum(h, 0) ** 2) ** 1.5


def features(o):  # (n, 4) -> (n, 11)
    """Return φ(o): 1, and the products of two measurements."""
    products = [o[:, i] * o[:, j] for i in range(4) for j in range(i + 1)]
    return np.stack([np.ones(len(o)), *products], axis=1)


class Reinforce:
    """The network, its optimiser, the baseline, and the last episodes."""

    def __init__(self, rng):
        fan_in = np.repeat([4, 8, 16], [32, 128, 16])
        self.W = INIT_STD * np.sqrt(3 / fan_in) * rng.uniform(-1, 1, 176)
        self.mean, self.mean_square, self.adam_steps = np.zeros(176), np.zeros(176), 0
        self.moments, self.targets = np.zeros((11, 11)), np.zeros(11)
        self.episodes = deque(maxlen=EPISODES)

    def layers(self):
        """Return the weights of the layers, (4, 8), (8, 16) and (16,)."""
        return self.W[:32].reshape(4, 8), self.W[32:160].reshape(8, 16), self.W[160:]

    def forward(self, o):
        """Return the hidden units' outputs and the probability of a push to the right."""
        W1, W2, W3 = self.layers()
        h1 = isrlu(o @ W1)  # (n, 8)
        h2 = isrlu(h1 @ W2)  # (n, 16)
        return h1, h2, 1 / (1 + np.exp(-LOGIT_SCALE * (h2 @ W3)))

    def gradient(self, o, a, p_old, A):
        """Return the mean of ρ A ∇ log π(a | o) over n steps."""
        _, W2, W3 = self.layers()
        h1, h2, right = self.forward(o)
        # Policy gradient
        rho = np.minimum(1, np.where(a, right, 1 - right) / p_old)
        dlogpi_dlogit = a - right  # (n,)
        delta3 = rho * A * dlogpi_dlogit * LOGIT_SCALE / len(o)  # (n,)
        # Backpropagation
        delta2 = np.outer(delta3, W3) * isrlu_slope(h2)  # (n, 16)
        delta1 = delta2 @ W2.T * isrlu_slope(h1)  # (n, 8)
        return np.concatenate([(o.T @ delta1).ravel(), (h1.T @ delta2).ravel(), h2.T @ delta3])

    def adam(self, gradient):
        """Make one step of Adam up the gradient; the weights decay."""
        self.adam_steps += 1
        self.mean += (1 - BETA1) * (gradient - self.mean)
        self.mean_square += (1 - BETA2) * (gradient * gradient - self.mean_square)
        rms = np.sqrt(self.mean_square / (1 - BETA2**self.adam_steps))
        mean = self.mean / (1 - BETA1**self.adam_steps)
        self.W = (1 - WEIGHT_DECAY) * (self.W + LEARNING_RATE * mean / (rms + EPSILON))

    def learn(self, episode):
        """Improve the policy after a fall: an episode is a list of (t, o, a, π(a | o))."""
        t, o, a, p = map(np.array, zip(*episode, strict=True))
        G = -(DISCOUNT ** (t[-1] - t))
        self.episodes.append((t, o, a, p, G))
        # Baseline V(o) = cᵀ φ(o): fitted to the newest episode, and ever less to those before
        phi = features(o)
        self.moments = BASELINE_DECAY * self.moments + RIDGE * np.eye(11) + phi.T @ phi
        self.targets = BASELINE_DECAY * self.targets + phi.T @ G
        c = np.linalg.solve(self.moments, self.targets)
        # Advantages, of all kept episodes
        t, o, a, p, G = map(np.concatenate, zip(*self.episodes, strict=True))
        A = G - np.clip(features(o) @ c, -1, 0)
        A /= np.sqrt(np.mean(A * A))
        # Update of the policy
        for epoch in range(EPOCHS):
            used = t % KEPT_STEPS % STRIDE == epoch % STRIDE
            self.adam(self.gradient(o[used], a[used], p[used], A[used]))


# --- The trials ---


def trial_lengths(rng, steps=60_000, trials=1_000):
    """Yield the length of trial after trial, up to the first that lasts for `steps`."""
    agent = Reinforce(rng)
    for _ in range(trials):
        state = tuple(0.05 * (2.0 * rng.random() - 1.0) for _ in range(4))  # uniform in ±0.05
        episode = deque(maxlen=KEPT_STEPS)
        t, fallen = 0, False
        while t < steps and not fallen:
            # Act: sample a push
            o = np.array(state) / OBS_SCALE
            right = agent.forward(o)[-1]
            a = rng.random() < right
            episode.append((t, o, a, right if a else 1 - right))
            state, fallen = step(state, FORCE if a else -FORCE)
            t += 1
        yield t
        if not fallen:
            return
        agent.learn(episode)


def main():
    """Print the length of each trial of run 0; its seed is an optional argument."""
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,)))
    for number, length in enumerate(trial_lengths(rng), 1):
        print(f"trial {number:4}: {length:5} steps", flush=True)


if __name__ == "__main__":
    main()
