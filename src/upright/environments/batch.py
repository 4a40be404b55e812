"""The compiled loop of the vector environment, which steps a batch of environments.

A lane of the batch is one environment: a cart-pole, a stream of random numbers, a count of steps.
Lanes lie side by side in memory, so that the processor works on several at a time. Each goes
through exactly the same states as the scalar environment with the same seed, because both use the
package's own plant and noise.
"""

from typing import NamedTuple

import numpy as np

from upright.core.cartpole import EULER, has_fallen, step, step_small
from upright.core.compiled import compiled, guard, inlined
from upright.core.conditions import Noise
from upright.core.guards import require_array, require_lane
from upright.core.many import PART, step_part
from upright.core.noise import draw_start
from upright.core.parameters import Parameters, State
from upright.core.portable_math import SMALL
from upright.core.rig import (
    PARAMETER,
    STEPS,
    Rig,
    acting_force,
    first_measurement,
    measurement,
    parameters_of,
)
from upright.environments.varying import Plants, begin_plant, check_plants, plant_of

NEXT_STEP, SAME_STEP, DISABLED = range(3)
"""When a lane whose episode ended restarts: instead of its next step, at once, or on request."""
WRONG_ACTION, ENDED = -1, -2
"""Reasons why no step was made."""
STATIC_FRICTION = PARAMETER["static_friction"]


class Rules(NamedTuple):
    """The task that all lanes share."""

    parameters: Parameters
    integrator: int
    """An `Integrator`, as a number."""
    noise: Noise
    start: State
    """Half-widths of the start state."""
    step_reward: float
    """Reward for each step."""
    fall_reward: float
    """Added to it if the step ends in a fall."""
    steps: int
    """Number of steps after which an episode is truncated."""
    autoreset: int
    """NEXT_STEP, SAME_STEP or DISABLED."""


class Batch(NamedTuple):
    """The memory of n lanes.

    The last three arrays are scratch space for the part of the lanes that is being stepped.
    """

    states: np.ndarray
    """True states, shape (4, n), float64."""
    words: np.ndarray
    """States of the random streams, shape (4, n), uint64."""
    steps: np.ndarray
    """Steps of the present episodes, shape (n,), int64."""
    ended: np.ndarray
    """Whether an episode has ended and the next has not begun, shape (n,), bool."""
    rig: Rig | None
    """What a condition puts between agent and plant."""
    plants: Plants | None
    """The lanes' own plants; None if all have those of the rules."""
    forces: np.ndarray
    """Forces [N], shape (PART,), float64."""
    due: np.ndarray
    """Numbers of the lanes that are due to begin an episode, shape (PART,), int64."""
    kept_words: np.ndarray
    """States of the streams of the lanes that are due, shape (4, PART), uint64."""


class Outcome(NamedTuple):
    """The outcome of a step of n lanes."""

    observations: np.ndarray
    """Shape (4, n), float32 or float64."""
    rewards: np.ndarray
    """Shape (n,), float64."""
    terminations: np.ndarray
    """Shape (n,), bool."""
    truncations: np.ndarray
    """Shape (n,), bool."""
    states: np.ndarray
    """True states; shape (4, n), or (4, 0) if not requested, float64."""
    final_observations: np.ndarray
    """Last observations of episodes that ended; shape (4, n), or (4, 0) if not requested."""
    final_states: np.ndarray
    """Last true states of episodes that ended; shape (4, n) or (4, 0) likewise, float64."""


class Stream(NamedTuple):
    """The random numbers of one lane: NumPy's SFC64 (C. Doty-Humphrey's small fast chaotic).

    The generator consists of additions, shifts and exclusive ors only, so the processor can serve
    several lanes at a time. It draws the same numbers as
    ``numpy.random.Generator(numpy.random.SFC64(seed))``.
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    counter: np.ndarray
    lane: int

    @compiled
    def random(self):
        """Return a number in [0, 1)."""
        a, b, c, counter, i = self
        word = a[i] + b[i] + counter[i]
        counter[i] += np.uint64(1)
        a[i] = b[i] ^ (b[i] >> np.uint64(11))
        b[i] = c[i] + (c[i] << np.uint64(3))
        c[i] = ((c[i] << np.uint64(24)) | (c[i] >> np.uint64(40))) + word
        return np.int64(word >> np.uint64(11)) * 2.0**-53


def make_batch(count: int, rig: Rig | None, plants: Plants | None) -> Batch:
    """Return the memory of this many lanes, which have yet to be seeded and reset."""
    return Batch(
        states=np.full((4, count), np.nan),
        words=np.zeros((4, count), np.uint64),
        steps=np.zeros(count, np.int64),
        ended=np.ones(count, np.bool_),
        rig=rig,
        plants=plants,
        forces=np.zeros(PART),
        due=np.zeros(PART, np.int64),
        kept_words=np.zeros((4, PART), np.uint64),
    )


def seed_words(seed: np.random.SeedSequence) -> np.ndarray:
    """Return the state in which a lane's random stream begins, shape (4,)."""
    words: np.ndarray = np.random.SFC64(seed).state["state"]["state"]
    return words


@compiled
def step_batch(rules: Rules, batch: Batch, actions: np.ndarray, outcome: Outcome) -> int:
    """Make one step in every lane.

    Parameters
    ----------
    actions
        0 or 1, shape (n,), int64; or forces [N], shape (n, 1), float32.
    outcome
        Arrays that the results are written to.

    Returns
    -------
    int
        Number of lanes that restarted; WRONG_ACTION or ENDED if no step was made.
    """
    if count_wrong(rules.parameters.force, actions) > 0:
        return WRONG_ACTION
    if rules.autoreset == DISABLED and count_true(batch.ended) > 0:
        return ENDED
    restarts = 0
    for first in range(0, len(batch.steps), PART):
        end = min(first + PART, len(batch.steps))
        due = 0
        if rules.autoreset == NEXT_STEP:  # lanes that are due draw in this step: undo that below
            due = list_ended(batch, first, end)
            for k in range(due):
                copy_column(batch.words, batch.due[k], batch.kept_words, k)
        push(rules, batch, actions, first, end)
        move(rules, batch, first, end)
        score_step(rules, batch, outcome, first, end)
        observe_part(rules.noise, batch.rig, batch, outcome.observations, first, end)
        if rules.autoreset == SAME_STEP:
            due = list_ended(batch, first, end)
            copy_part(outcome.observations, outcome.final_observations, first, end)
            if outcome.final_states.shape[1] > 0:
                copy_part(batch.states, outcome.final_states, first, end)
        for k in range(due):
            if rules.autoreset == NEXT_STEP:
                copy_column(batch.kept_words, k, batch.words, batch.due[k])
                take_back_step(batch.rig, batch.due[k])
            begin_plant_of(rules, batch, batch.due[k])
            draw_state(rules, batch, batch.due[k])
            begin_episode(rules, batch, outcome.observations, batch.due[k])
        restarts += due
        if outcome.states.shape[1] > 0:
            copy_part(batch.states, outcome.states, first, end)
    return restarts


@compiled
def reset_batch(
    rules: Rules,
    batch: Batch,
    chosen: np.ndarray,
    draws: bool,
    observations: np.ndarray,
) -> None:
    """Begin new episodes.

    Parameters
    ----------
    chosen
        The lanes to reset, shape (n,), bool.
    draws
        Whether start states are drawn; otherwise they are already in ``batch.states``.
    observations
        Array that the measurements of these lanes are written to, shape (4, n).
    """
    for i in range(len(chosen)):
        if chosen[i]:
            begin_plant_of(rules, batch, i)
            if draws:
                draw_state(rules, batch, i)
            begin_episode(rules, batch, observations, i)


@inlined
def stream(words, i):
    """Return the random numbers of a lane."""
    return Stream(words[0], words[1], words[2], words[3], i)


@inlined
def rows(array, first, end):
    """Return the four rows of a part of the lanes; usable only by functions called compiled."""
    return array[0, first:end], array[1, first:end], array[2, first:end], array[3, first:end]


@inlined
def copy_part(source, target, first, end):
    """Copy the four rows of a part of the lanes."""
    for row in range(4):
        copied, copies = source[row, first:end], target[row, first:end]
        for i in range(len(copied)):
            copies[i] = copied[i]


@inlined
def copy_column(source, i, target, k):
    """Copy the column of one lane."""
    for row in range(4):
        target[row, k] = source[row, i]


@inlined
def count_true(flags):
    """Return how many are true."""
    count = 0
    for i in range(len(flags)):
        count += flags[i]
    return count


@inlined
def count_wrong(force, actions):
    """Return how many actions are not allowed."""
    wrong = 0
    for i in range(len(actions)):
        if actions.ndim == 1:
            wrong += 1 if (actions[i] < 0) | (actions[i] > 1) else 0
        else:
            wrong += 1 if not abs(actions[i, 0]) <= np.float32(force) else 0
    return wrong


@inlined
def list_ended(batch, first, end):
    """List the lanes of a part whose episodes have ended in ``batch.due``; return how many."""
    count, ended = 0, batch.ended[first:end]
    for i in range(len(ended)):  # no branch, which the processor could not predict
        batch.due[count] = first + i
        count += ended[i]
    return count


@inlined
def push(rules, batch, actions, first, end):
    """Set the forces that act on a part of the lanes."""
    forces, chosen = batch.forces[: end - first], actions[first:end]
    choose_forces(rules.parameters, batch.plants, chosen, forces, first)
    if (batch.rig is not None) | (rules.noise.actuator > 0.0):
        disturb_forces(rules.noise, batch.rig, rows(batch.words, first, end), forces, first)


@inlined
def choose_forces(shared, plants, actions, forces, first):
    """Set the forces [N] with which agents push."""
    for i in range(len(actions)):
        if actions.ndim == 1:
            force = plant_of(shared, plants, first + i).force
            forces[i] = force if actions[i] == 1 else -force
        else:
            forces[i] = scaled_force(shared, plants, actions[i, 0], first + i)


@inlined
def scaled_force(shared: Parameters, plants: Plants | None, force: float, i: int) -> float:
    """Return the force [N] with which a lane's motor does what an action asks for."""
    if plants is None:
        return force
    return force * (plant_of(shared, plants, i).force / shared.force)


@inlined
def disturb_forces(noise, rig, words, forces, first):
    """Set the forces [N] that act where agents push with these."""
    a, b, c, counter = words
    for i in range(len(forces)):
        forces[i] = acting_force(rig, noise, forces[i], Stream(a, b, c, counter, i), first + i)


@inlined
def move(rules, batch, first, end):
    """Move the cart-poles of a part of the lanes."""
    states, forces = rows(batch.states, first, end), batch.forces[: end - first]
    move_plants(rules.parameters, batch.plants, states, forces, rules.integrator, first)


@inlined
def move_plants(shared, plants, states, forces, integrator, first):
    """Move cart-poles, which all have the same parameters unless plants vary."""
    if plants is None:
        step_part(shared, states, forces, integrator)
    elif integrator == EULER and count_others(plants.present, states[2], first) == 0:
        small_loop(plants.present, states, forces, first)
    else:
        any_loop(plants.present, states, forces, integrator, first)


@inlined
def count_others(present, theta, first):
    """Return how many cart-poles of a part `step_small` cannot move."""
    others, static_friction = 0, present[STATIC_FRICTION]
    for i in range(len(theta)):
        others += 1 if (abs(theta[i]) > SMALL) | (static_friction[first + i] > 0.0) else 0
    return others


@inlined
def small_loop(present, states, forces, first):
    """Move cart-poles that lean little, without branches."""
    x, x_dot, theta, theta_dot = states
    for i in range(len(forces)):
        previous = State(x[i], x_dot[i], theta[i], theta_dot[i])
        moved = step_small(parameters_of(present, first + i), previous, forces[i])
        x[i], x_dot[i], theta[i], theta_dot[i] = moved


@inlined
def any_loop(present, states, forces, integrator, first):
    """Move any cart-poles."""
    x, x_dot, theta, theta_dot = states
    for i in range(len(forces)):
        previous = State(x[i], x_dot[i], theta[i], theta_dot[i])
        moved = step(parameters_of(present, first + i), previous, forces[i], integrator)
        x[i], x_dot[i], theta[i], theta_dot[i] = moved


@inlined
def score_step(rules, batch, outcome, first, end):
    """Set rewards and endings in a part; lanes whose episodes had already ended make no step."""
    x, x_dot, theta, theta_dot = rows(batch.states, first, end)
    steps, ended, rewards = (
        batch.steps[first:end],
        batch.ended[first:end],
        outcome.rewards[first:end],
    )
    terminations = outcome.terminations[first:end]
    truncations = outcome.truncations[first:end]
    for i in range(len(steps)):
        steps[i] += 1
        plant = plant_of(rules.parameters, batch.plants, first + i)
        fallen = has_fallen(plant, State(x[i], x_dot[i], theta[i], theta_dot[i]))
        reward = rules.step_reward + (rules.fall_reward if fallen else 0.0)
        rewards[i] = 0.0 if ended[i] else reward
        terminations[i] = fallen & (not ended[i])
        truncations[i] = (steps[i] >= rules.steps) & (not ended[i])
        ended[i] = terminations[i] | truncations[i]


@inlined
def observe_part(noise, rig, batch, observations, first, end):
    """Measure a part of the lanes.

    The common kinds of noise are passed with zeros as constants, so that the compiler removes the
    branches on the noise from the loop over lanes.
    """
    states, words = rows(batch.states, first, end), rows(batch.words, first, end)
    seen = rows(observations, first, end)
    scaled, others = noise.angle > 0.0, noise.others > 0.0
    shifted, hidden = noise.angle_offset > 0.0, noise.hides_velocities
    if rig is not None:
        observe(noise, rig, states, words, seen, first)
    elif not (scaled or others or shifted or hidden):
        observe(Noise(0.0, 0.0, 0.0, 0.0, False), rig, states, words, seen, first)
    elif scaled and not (others or shifted or hidden):
        observe(Noise(0.0, noise.angle, 0.0, 0.0, False), rig, states, words, seen, first)
    elif scaled and others and not (shifted or hidden):
        observe(Noise(0.0, noise.angle, noise.others, 0.0, False), rig, states, words, seen, first)
    elif shifted and not (scaled or others or hidden):
        observe(Noise(0.0, 0.0, 0.0, noise.angle_offset, False), rig, states, words, seen, first)
    else:
        observe(noise, rig, states, words, seen, first)


@inlined
def observe(noise, rig, states, words, seen, first):
    """Measure the states of lanes and write the results to the rows `seen`."""
    x, x_dot, theta, theta_dot = states
    a, b, c, counter = words
    for i in range(len(x)):
        true = State(x[i], x_dot[i], theta[i], theta_dot[i])
        observation = measurement(rig, noise, true, Stream(a, b, c, counter, i), first + i)
        seen[0][i], seen[1][i], seen[2][i], seen[3][i] = observation


@inlined
def take_back_step(rig, i):
    """Let a lane's rig not count a step that the lane did not make."""
    if rig is not None:
        rig.memory[STEPS, i] -= 1.0


@inlined
def begin_plant_of(rules, batch, i):
    """Give a lane the plant of its next episode."""
    words = stream(batch.words, i)
    begin_plant(rules.parameters, batch.rig, batch.plants, words, i)


@inlined
def draw_state(rules, batch, i):
    """Put a lane into a start state that is drawn at random."""
    state = draw_start(rules.start, stream(batch.words, i))
    for row in range(4):
        batch.states[row, i] = state[row]


@inlined
def begin_episode(rules, batch, observations, i):
    """Begin an episode of a lane from its present state, and measure that."""
    states = batch.states
    batch.steps[i] = 0
    batch.ended[i] = False
    true = State(states[0, i], states[1, i], states[2, i], states[3, i])
    observation = first_measurement(batch.rig, rules.noise, true, stream(batch.words, i), i)
    for row in range(4):
        observations[row, i] = observation[row]


# ---- What Python may give to the functions above -------------------------------------------------


@guard(Stream.random)
def _check_stream(stream: Stream) -> None:
    lanes = len(stream.a)
    for name in ("a", "b", "c", "counter"):
        require_array(f"{name} of a stream", getattr(stream, name), np.uint64, lanes)
    require_lane(stream.lane, lanes)


def _check_batch(batch: Batch) -> int:
    """Return the number of lanes, or raise UprightError unless all arrays are for so many."""
    require_array("steps of the batch", batch.steps, np.int64, None)
    lanes = len(batch.steps)
    require_array("states of the batch", batch.states, np.float64, 4, lanes)
    require_array("words of the batch", batch.words, np.uint64, 4, lanes)
    require_array("ended of the batch", batch.ended, np.bool_, lanes)
    require_array("forces of the batch", batch.forces, np.float64, PART)
    require_array("due of the batch", batch.due, np.int64, PART)
    require_array("kept_words of the batch", batch.kept_words, np.uint64, 4, PART)
    check_plants(batch.rig, batch.plants, lanes)
    return lanes


@guard(step_batch)
def _check_step(rules: Rules, batch: Batch, actions: np.ndarray, outcome: Outcome) -> None:
    lanes = _check_batch(batch)
    require_array("actions", actions, None, lanes, *[1] * (np.ndim(actions) - 1), written=False)
    require_array("observations", outcome.observations, None, 4, lanes)
    require_array("rewards", outcome.rewards, np.float64, lanes)
    require_array("terminations", outcome.terminations, np.bool_, lanes)
    require_array("truncations", outcome.truncations, np.bool_, lanes)
    ends = rules.autoreset == SAME_STEP
    for name, needed in (("states", False), ("final_observations", ends), ("final_states", False)):
        value = getattr(outcome, name)
        require_array(name, value, None, 4, lanes if needed or np.size(value) else 0)


@guard(reset_batch)
def _check_reset(
    _rules: Rules, batch: Batch, chosen: np.ndarray, _draws: bool, observations: np.ndarray
) -> None:
    lanes = _check_batch(batch)
    require_array("chosen", chosen, np.bool_, lanes, written=False)
    require_array("observations", observations, None, 4, lanes)
