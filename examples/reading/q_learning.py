"""Q-learning balances a pole on a cart: all of it on one page, to be read from top to bottom.

The four measurements are cut into boxes. A table holds, for each box b and push a, a value Q(b, a):
0 if the pole will stand, -γ^k if it falls after k more moves from box to box. The agent pushes as
the better value says, and keeps its moves. When the pole has fallen, it goes through them
backwards, the newest first, so that news of the fall travels along the way that led there
(C. Watkins, P. Dayan, *Q-learning*, 1992; L.-J. Lin, *Self-improving reactive agents*, 1992):

    G ← -1 at a fall, else γ ((1 - λ) max_a' Q(b', a') + λ G)
    Q(b, a) ← Q(b, a) + α (G - Q(b, a))

where b' is the box that the move led to. With λ = 0 this is the one-step rule of the textbooks.
"""

import math
import sys
from bisect import bisect_left
from collections import deque

import numpy as np

LEARNING_RATE = 0.08  # α: how far a value moves towards its target
DISCOUNT = 0.99  # γ: how much less a fall counts for each move that it lies ahead
TRACE_DECAY = 0.15  # λ: how much of the value given to the next move passes on to the one before
REPLAY_PASSES = 2  # passes through the kept moves after a fall
REPLAY_SIZE = 2_000  # only this many last moves are kept
INIT_WIDTH = 1e-6  # width of the random first values, which breaks ties
EDGES = (  # where each measurement is cut
    (-1.6, 1.6),  # x: position of the cart [m]
    (0.0,),  # x_dot: its velocity [m/s]
    [math.radians(edge) for edge in (-3, -1, 1, 3)],  # theta: angle of the pole [rad]
    [math.radians(edge) for edge in (-50, -30, -12, 0, 12, 30, 50)],  # theta_dot [rad/s]
)
VALUES = 2 * math.prod(len(edges) + 1 for edges in EDGES)  # two pushes in each of 240 boxes


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


def find_box(observation):
    """Return the number of the box that four measurements lie in."""
    box = 0
    for value, edges in zip(observation, EDGES, strict=True):
        box = box * (len(edges) + 1) + bisect_left(edges, value)
    return box


def place(box, action):
    """Return where Q(b, a) stands in the table: mirror images share their values."""
    index = 2 * box + action
    return min(index, VALUES - 1 - index)


def replay(Q, moves):
    """Learn from the moves, the newest first."""
    G = 0.0
    for index, next_box in reversed(moves):
        if next_box is None:  # the pole fell
            G = -1.0
        else:
            best = max(Q[place(next_box, False)], Q[place(next_box, True)])
            G = (1 - TRACE_DECAY) * (DISCOUNT * best) + TRACE_DECAY * DISCOUNT * G
        Q[index] += LEARNING_RATE * (G - Q[index])


# --- The trials ---


def trial_lengths(rng, steps=60_000, trials=1_000):
    """Yield the length of trial after trial, up to the first that lasts for `steps`."""
    Q = (INIT_WIDTH * (rng.random(VALUES) - 0.5)).tolist()
    moves = deque(maxlen=REPLAY_SIZE)
    for _ in range(trials):
        state = tuple(0.05 * (2.0 * rng.random() - 1.0) for _ in range(4))  # uniform in ±0.05
        box, t, fallen = find_box(state), 0, False
        while t < steps and not fallen:
            # Act: push as the better value says
            action = Q[place(box, True)] > Q[place(box, False)]
            state, fallen = step(state, FORCE if action else -FORCE)
            # Keep the move if it leads to another box
            next_box = None if fallen else find_box(state)
            if next_box != box:
                moves.append((place(box, action), next_box))
            box, t = next_box, t + 1
        yield t
        if not fallen:
            return
        for _ in range(REPLAY_PASSES):
            replay(Q, moves)


def main():
    """Print the length of each trial of run 0; its seed is an optional argument."""
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,)))
    for number, length in enumerate(trial_lengths(rng), 1):
        print(f"trial {number:4}: {length:5} steps", flush=True)


if __name__ == "__main__":
    main()
