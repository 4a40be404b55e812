"""Adaptive LQR balances a pole on a cart: all of it on one page, to be read from top to bottom.

The agent knows that it sees four numbers o and may push to either side, u = ±1; no mass, no length,
not even to which side a push drives the pole. It learns a linear model of the next measurement

    o' = o + M r + error,    r = (u, z),    z = (o, u_-1, o_-1, u_-2, o_-2, …)

where z is the state: this measurement, and the last pushes and measurements, which make up for
noise, delayed pushes and missing velocities. M is found by least squares with a ridge. The model is
then taken for the truth (K. Åström, B. Wittenmark, *On self tuning regulators*, 1973): with
z' = A z + b u, the Riccati recursion (R. Kalman, 1960)

    V ← Q + Aᵀ V A - Aᵀ V b (R + bᵀ V b)⁻¹ bᵀ V A,    K = (R + bᵀ V b)⁻¹ bᵀ V A

gives the best linear control u = -K z, and the agent pushes to the side that it says.
"""

import math
import sys

import numpy as np

HISTORY = 6  # a prediction rests on this many last measurements and pushes
RIDGE = 1e-4  # weight of the prior belief that a measurement stays what it is, M = 0
PUSH_RIDGE = 1e-3  # the same for the columns of M that pushes meet
RIDGE_GROWTH = 2.0  # how much firmer the belief is for each step further back
COSTS = (0.3, 0.05, 10.0, 0.5)  # Q: cost of the squares of x, x_dot, theta, theta_dot
PUSH_COST = 0.1  # R: cost of the square of a push
HORIZON = 50  # the costs of this many steps are minimised
EXPLORATION = 0.015  # probability of a random push while learning
LEARNING_STEPS = 2_000  # after this many steps of a trial it neither explores nor learns
KEPT_SAMPLES = 200.0  # after a fall, the data count as at most this many samples
REFIT = 1.02  # fit the model again when the data have grown by this factor


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


class AdaptiveLQR:
    """The data so far, and the control designed on them."""

    def __init__(self):
        ridge = np.outer(RIDGE_GROWTH ** np.arange(HISTORY), [PUSH_RIDGE] + 4 * [RIDGE])
        self.ridge = np.diag(ridge.ravel())  # (30, 30)
        self.R = self.ridge.copy()  # Σ r rᵀ + ridge
        self.D = np.zeros((4, 5 * HISTORY))  # Σ (o' - o) rᵀ
        self.samples, self.refit_at = 0.0, 0.0
        self.K = np.zeros(5 * HISTORY - 1)

    def design(self):
        """Fit the model to the data, and find the best control for it."""
        # Least squares: o' = o + M r
        M = np.linalg.solve(self.R, self.D.T).T  # (4, 30)
        # z' = A z + b u: on top the model; below it, r moves one step into the past
        bA = np.vstack([M, np.eye(5 * HISTORY - 5, 5 * HISTORY)])  # (29, 30)
        bA[:4, 1:5] += np.eye(4)
        b, A = bA[:, 0], bA[:, 1:]
        # Riccati recursion
        Q = np.zeros_like(A)
        Q[:4, :4] = np.diag(COSTS)
        V = Q
        for _ in range(HORIZON):
            self.K = b @ V @ A / (PUSH_COST + b @ V @ b)
            V = Q + A.T @ V @ A - np.outer(A.T @ V @ b, self.K)
        self.refit_at = REFIT * self.samples

    def learn(self, r, change):
        """Add a step to the data, r = (u, z) and the change o' - o; refit from time to time."""
        self.R += np.outer(r, r)
        self.D += np.outer(change, r)
        self.samples += 1
        if self.samples >= self.refit_at:
            self.design()

    def forget(self):
        """After a fall the model was wrong: let the data count for fewer samples."""
        part = min(1.0, KEPT_SAMPLES / self.samples)
        self.R = part * self.R + (1 - part) * self.ridge
        self.D *= part
        self.samples *= part
        self.design()


# --- The trials ---


def trial_lengths(rng, steps=60_000, trials=1_000):
    """Yield the length of trial after trial, up to the first that lasts for `steps`."""
    agent = AdaptiveLQR()
    for _ in range(trials):
        state = tuple(0.05 * (2.0 * rng.random() - 1.0) for _ in range(4))  # uniform in ±0.05
        o = np.array(state)
        z = np.tile([0.0, *o], HISTORY)[1:]  # as if it had long been so, without pushes
        t, fallen = 0, False
        while t < steps and not fallen:
            # Act: push as the control says, or at random: rarely, or when it does not know
            wanted = -agent.K @ z
            explores = t < LEARNING_STEPS and rng.random() < EXPLORATION
            right = rng.random() < 0.5 if explores or wanted == 0.0 else wanted > 0.0
            state, fallen = step(state, FORCE if right else -FORCE)
            # Learn, until the model has proved itself
            r = np.array([1.0 if right else -1.0, *z])
            o, o_old = np.array(state), o
            if t < LEARNING_STEPS:
                agent.learn(r, o - o_old)
            z = np.concatenate([o, r[:-5]])
            t += 1
        yield t
        if not fallen:
            return
        agent.forget()


def main():
    """Print the length of each trial of run 0; its seed is an optional argument."""
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,)))
    for number, length in enumerate(trial_lengths(rng), 1):
        print(f"trial {number:4}: {length:5} steps", flush=True)


if __name__ == "__main__":
    main()
