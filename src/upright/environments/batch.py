"""Many environments at once, in lanes: what the vector environment computes.

A lane is an environment: a cart-pole, a stream of random numbers, a count of steps. Batch lie side
by side in memory, so that the processor works on several at a time. Each goes through exactly what
the scalar environment of the same seed goes through: the plant and the noise are the package's own.
"""

from typing import NamedTuple

import numpy as np

from upright.core.cartpole import has_fallen
from upright.core.compiled import compiled
from upright.core.conditions import Noise
from upright.core.many import PART, step_part
from upright.core.noise import disturb, draw_start, measure
from upright.core.parameters import Parameters, State

NEXT_STEP, SAME_STEP, DISABLED = range(3)
"""When a lane that ended starts again: instead of the next step, right away, or when told to."""
WRONG_ACTION, ENDED = -1, -2
"""Why no step was made."""


class Rules(NamedTuple):
    """What all lanes have in common."""

    parameters: Parameters
    integrator: int
    """An `Integrator`, as a number."""
    noise: Noise
    start: State
    """Half-widths of the start state."""
    step_reward: float
    """Reward for each step."""
    fall_reward: float
    """Added to it when the step ends by a fall."""
    steps: int
    """After so many steps an episode is truncated."""
    autoreset: int
    """NEXT_STEP, SAME_STEP or DISABLED."""


class Batch(NamedTuple):
    """The memory of n lanes."""

    states: np.ndarray
    """True states, shape (4, n), float64."""
    words: np.ndarray
    """States of the random streams, shape (4, n), uint64."""
    steps: np.ndarray
    """Steps of the present episodes, shape (n,), int64."""
    ended: np.ndarray
    """Whether an episode has ended and the next has not begun, shape (n,), bool."""
    forces: np.ndarray
    """Room for the forces [N] on a part of the lanes, shape (PART,), float64."""
    due: np.ndarray
    """Room for the numbers of lanes in it that begin_episode again, shape (PART,), int64."""
    kept_words: np.ndarray
    """Room for their streams, shape (4, PART), uint64."""


class Outcome(NamedTuple):
    """What a step of n lanes leads to."""

    observations: np.ndarray
    """Shape (4, n), float32 or float64."""
    rewards: np.ndarray
    """Shape (n,), float64."""
    terminations: np.ndarray
    """Shape (n,), bool."""
    truncations: np.ndarray
    """Shape (n,), bool."""
    states: np.ndarray
    """True states; shape (4, n), or (4, 0) if not asked for, float64."""
    final_observations: np.ndarray
    """Observations before lanes that ended began again; (4, n), or (4, 0) if not asked for."""
    final_states: np.ndarray
    """True states then, alike, float64."""


class Stream(NamedTuple):
    """The random numbers of one lane: NumPy's SFC64 (C. Doty-Humphrey's small fast chaotic).

    Additions, shifts and exclusive ors alone, so that several lanes are served at a time. It draws
    what ``numpy.random.Generator(numpy.random.SFC64(seed))`` does.
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    counter: np.ndarray
    lane: int

    @compiled
    def random(self):
        """Return a number from 0 to below 1."""
        a, b, c, counter, i = self
        word = a[i] + b[i] + counter[i]
        counter[i] += np.uint64(1)
        a[i] = b[i] ^ (b[i] >> np.uint64(11))
        b[i] = c[i] + (c[i] << np.uint64(3))
        c[i] = ((c[i] << np.uint64(24)) | (c[i] >> np.uint64(40))) + word
        return np.int64(word >> np.uint64(11)) * 2.0**-53


def make_lanes(count: int) -> Batch:
    """Return the memory of so many lanes, which have yet to be seeded and reset."""
    return Batch(
        states=np.full((4, count), np.nan),
        words=np.zeros((4, count), np.uint64),
        steps=np.zeros(count, np.int64),
        ended=np.ones(count, np.bool_),
        forces=np.zeros(PART),
        due=np.zeros(PART, np.int64),
        kept_words=np.zeros((4, PART), np.uint64),
    )


def seed_words(seed: np.random.SeedSequence) -> np.ndarray:
    """Return the state in which a lane's random stream begins, shape (4,)."""
    words: np.ndarray = np.random.SFC64(seed).state["state"]["state"]
    return words


@compiled
def step_lanes(rules: Rules, lanes: Batch, actions: np.ndarray, outcome: Outcome) -> int:
    """Make one step of every lane.

    Parameters
    ----------
    actions
        0 or 1, shape (n,), int64; or forces [N], shape (n, 1), float32.
    outcome
        Where results are written.

    Returns
    -------
    int
        How many lanes began again; WRONG_ACTION or ENDED if no step was made.
    """
    if count_wrong(rules.parameters.force, actions) > 0:
        return WRONG_ACTION
    if rules.autoreset == DISABLED and count_true(lanes.ended) > 0:
        return ENDED
    begun = 0
    for first in range(0, len(lanes.steps), PART):
        end = min(first + PART, len(lanes.steps))
        due = 0
        if rules.autoreset == NEXT_STEP:  # what the lanes due draw in this step is taken back
            due = list_ended(lanes, first, end)
            for k in range(due):
                copy_column(lanes.words, lanes.due[k], lanes.kept_words, k)
        push(rules, lanes, actions, first, end)
        move(rules, lanes, first, end)
        score_step(rules, lanes, outcome, first, end)
        observe_part(rules.noise, lanes, outcome.observations, first, end)
        if rules.autoreset == SAME_STEP:
            due = list_ended(lanes, first, end)
            copy_part(outcome.observations, outcome.final_observations, first, end)
            if outcome.final_states.shape[1] > 0:
                copy_part(lanes.states, outcome.final_states, first, end)
        for k in range(due):
            if rules.autoreset == NEXT_STEP:
                copy_column(lanes.kept_words, k, lanes.words, lanes.due[k])
            draw_state(rules, lanes, lanes.due[k])
            begin_episode(rules, lanes, outcome.observations, lanes.due[k])
        begun += due
        if outcome.states.shape[1] > 0:
            copy_part(lanes.states, outcome.states, first, end)
    return begun


@compiled
def reset_lanes(
    rules: Rules, lanes: Batch, chosen: np.ndarray, draws: bool, observations: np.ndarray
) -> None:
    """Begin new episodes.

    Parameters
    ----------
    chosen
        Which lanes, shape (n,), bool.
    draws
        Whether start states are drawn; otherwise they stand in ``lanes.states``.
    observations
        Where the measurements of these lanes are written, shape (4, n).
    """
    for i in range(len(chosen)):
        if chosen[i]:
            if draws:
                draw_state(rules, lanes, i)
            begin_episode(rules, lanes, observations, i)


@compiled
def stream(words, i):
    """Return the random numbers of a lane."""
    return Stream(words[0], words[1], words[2], words[3], i)


@compiled
def rows(array, first, end):
    """Return the four rows of a part of the lanes; to functions that compiled code calls only."""
    return array[0, first:end], array[1, first:end], array[2, first:end], array[3, first:end]


@compiled
def copy_part(source, target, first, end):
    """Copy the four rows of a part."""
    for row in range(4):
        copied, copies = source[row, first:end], target[row, first:end]
        for i in range(len(copied)):
            copies[i] = copied[i]


@compiled
def copy_column(source, i, target, k):
    """Copy what belongs to one lane."""
    for row in range(4):
        target[row, k] = source[row, i]


@compiled
def count_true(flags):
    """Return how many are true."""
    count = 0
    for i in range(len(flags)):
        count += flags[i]
    return count


@compiled
def count_wrong(force, actions):
    """Return how many actions are not allowed."""
    wrong = 0
    for i in range(len(actions)):
        if actions.ndim == 1:
            wrong += 1 if (actions[i] < 0) | (actions[i] > 1) else 0
        else:
            wrong += 1 if not abs(actions[i, 0]) <= np.float32(force) else 0
    return wrong


@compiled
def list_ended(lanes, first, end):
    """List the lanes of a part whose episodes have ended; return how many."""
    count, ended = 0, lanes.ended[first:end]
    for i in range(len(ended)):  # without a branch, which nothing could predict
        lanes.due[count] = first + i
        count += ended[i]
    return count


@compiled
def push(rules, lanes, actions, first, end):
    """Set the forces that act on a part."""
    forces, chosen, force = lanes.forces[: end - first], actions[first:end], rules.parameters.force
    for i in range(len(chosen)):
        if actions.ndim == 1:
            forces[i] = force if chosen[i] == 1 else -force
        else:
            forces[i] = chosen[i, 0]
    if rules.noise.actuator > 0.0:
        a, b, c, counter = rows(lanes.words, first, end)
        for i in range(len(forces)):
            forces[i] = disturb(rules.noise, forces[i], Stream(a, b, c, counter, i))


@compiled
def move(rules, lanes, first, end):
    """Move the cart-poles of a part."""
    states, forces = rows(lanes.states, first, end), lanes.forces[: end - first]
    step_part(rules.parameters, states, forces, rules.integrator)


@compiled
def score_step(rules, lanes, outcome, first, end):
    """Set rewards and ends of a part; lanes whose episodes had ended before make no step."""
    x, x_dot, theta, theta_dot = rows(lanes.states, first, end)
    steps, ended, rewards = (
        lanes.steps[first:end],
        lanes.ended[first:end],
        outcome.rewards[first:end],
    )
    terminations = outcome.terminations[first:end]
    truncations = outcome.truncations[first:end]
    for i in range(len(steps)):
        steps[i] += 1
        fallen = has_fallen(rules.parameters, State(x[i], x_dot[i], theta[i], theta_dot[i]))
        reward = rules.step_reward + (rules.fall_reward if fallen else 0.0)
        rewards[i] = 0.0 if ended[i] else reward
        terminations[i] = fallen & (not ended[i])
        truncations[i] = (steps[i] >= rules.steps) & (not ended[i])
        ended[i] = terminations[i] | truncations[i]


@compiled
def observe_part(noise, lanes, observations, first, end):
    """Measure a part; with what is known of the noise, so that no lane need ask."""
    states, words = rows(lanes.states, first, end), rows(lanes.words, first, end)
    seen = rows(observations, first, end)
    scaled, others = noise.angle > 0.0, noise.others > 0.0
    shifted, hidden = noise.angle_offset > 0.0, noise.hides_velocities
    if not (scaled or others or shifted or hidden):
        observe(Noise(0.0, 0.0, 0.0, 0.0, False), states, words, seen)
    elif scaled and not (others or shifted or hidden):
        observe(Noise(0.0, noise.angle, 0.0, 0.0, False), states, words, seen)
    elif scaled and others and not (shifted or hidden):
        observe(Noise(0.0, noise.angle, noise.others, 0.0, False), states, words, seen)
    elif shifted and not (scaled or others or hidden):
        observe(Noise(0.0, 0.0, 0.0, noise.angle_offset, False), states, words, seen)
    else:
        observe(noise, states, words, seen)


@compiled
def observe(noise, states, words, seen):
    """Measure lanes."""
    x, x_dot, theta, theta_dot = states
    a, b, c, counter = words
    for i in range(len(x)):
        true = State(x[i], x_dot[i], theta[i], theta_dot[i])
        observation = measure(noise, true, Stream(a, b, c, counter, i))
        seen[0][i], seen[1][i], seen[2][i], seen[3][i] = observation


@compiled
def draw_state(rules, lanes, i):
    """Put a lane into a start state."""
    state = draw_start(rules.start, stream(lanes.words, i))
    for row in range(4):
        lanes.states[row, i] = state[row]


@compiled
def begin_episode(rules, lanes, observations, i):
    """Begin an episode of a lane from the state it is in, with a measurement."""
    states = lanes.states
    lanes.steps[i] = 0
    lanes.ended[i] = False
    true = State(states[0, i], states[1, i], states[2, i], states[3, i])
    observation = measure(rules.noise, true, stream(lanes.words, i))
    for row in range(4):
        observations[row, i] = observation[row]
