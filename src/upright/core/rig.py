"""The rig: what stands between an agent and a plant, motor and sensors, and what changes the plant.

A task without such disturbances has no rig: `None` in its place, which costs nothing in compiled
code, as Numba leaves out what is done for a rig that has the type of None. Like everything random,
what a rig draws comes from the run's own numbers, and the order is that of the functions here.

A rig has lanes, one for every cart-pole that is stepped at once; the loop has a single one.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from upright.core.compiled import compiled, guard, inlined
from upright.core.conditions import Change, Condition, Draw, Noise
from upright.core.guards import once, require_array, require_lane, require_rows
from upright.core.noise import disturb, measure
from upright.core.parameters import Parameters, State
from upright.core.portable_math import exponential, logarithm
from upright.errors import require

STEPS, FORCE, GUST, GUST_STEPS, SEEN, X, THETA, RINGS = 0, 1, 2, 3, 4, 8, 9, 10
"""Rows of a rig's memory: steps made, force of the motor [N], force of the gust [N] and its
remaining steps, last measurement (four rows), position and angle measured before it; then the
pushes [N] in transit, a row for each step of the delay, and the measurements, four rows each."""
PARAMETER = {name: number for number, name in enumerate(Parameters._fields)}
"""Numbers of the parameters."""
FORCE_PARAMETER = PARAMETER["force"]
TIME_STEP = PARAMETER["time_step"]


class Rig(NamedTuple):
    """The numbers of a rig and its memory. Sizes of zero do nothing and draw no random number."""

    left: float
    """Magnitude of a push to the left, in parts of a push to the right."""
    delay: int
    """How many steps pass before a push acts."""
    lag: float
    """Time constant of the motor [s]."""
    dead_zone: float
    """Part of a push that is lost [N]."""
    saturation: float
    """Largest force of the motor [N]."""
    wind: float
    """Steady force on the cart [N]."""
    gust: float
    """Force of a gust [N]."""
    gust_every: float
    """Mean time from the end of a gust to the next [s]."""
    gust_for: float
    """Duration of a gust [s]."""
    angle_bias: float
    """Added to the measured angle [rad]."""
    position_bias: float
    """Added to the measured position [m]."""
    encoder: float
    """Counts per turn of the pole and per metre of the track."""
    takes_differences: bool
    """Whether velocities are differences of two measurements, over the time step."""
    measurement_delay: int
    """How many steps a measurement is late."""
    dropped: float
    """Probability that a measurement is lost."""
    changes: np.ndarray
    """Changes of parameters, shape (n, 3): step, number of the parameter, value; float64."""
    draws: np.ndarray
    """What is drawn for each trial, shape (n, 4): number of the parameter, low, high, whether
    log-uniform; float64."""
    present: np.ndarray
    """The present parameters of each lane's plant, shape (parameters, lanes), float64."""
    memory: np.ndarray
    """Shape (rows, lanes), float64; the rows are named above."""


def make_rig(condition: Condition, parameters: Parameters, lanes: int = 1) -> Rig | None:
    """Return the rig of a condition; None if the condition needs none.

    Parameters
    ----------
    condition
        The condition.
    parameters
        Parameters of the plant as it is at the start of a run.
    lanes
        Number of cart-poles.
    """
    elsewhere = Condition(  # in the parameters, in the noise, or drawn before the run
        varies_plant=condition.varies_plant,
        friction=condition.friction,
        hides_velocities=condition.hides_velocities,
        stick_slip=condition.stick_slip,
        tilt=condition.tilt,
        each_run=condition.each_run,
    )
    if condition == elsewhere:
        return None
    left = 1.0 if condition.left_force is None else condition.left_force / parameters.force
    rows = RINGS + condition.delay + 4 * condition.measurement_delay
    return Rig(
        left=left,
        delay=condition.delay,
        lag=float(condition.lag),
        dead_zone=float(condition.dead_zone),
        saturation=float(condition.saturation),
        wind=float(condition.wind),
        gust=float(condition.gust),
        gust_every=float(condition.gust_every),
        gust_for=float(condition.gust_for),
        angle_bias=float(condition.angle_bias),
        position_bias=float(condition.position_bias),
        encoder=float(condition.encoder),
        takes_differences=bool(condition.takes_differences),
        measurement_delay=condition.measurement_delay,
        dropped=float(condition.dropped),
        changes=_as_rows(condition.changes),
        draws=draw_rows(condition.each_episode),
        present=lanes_of(parameters, lanes),
        memory=np.zeros((rows, lanes)),
    )


def lanes_of(parameters: Parameters, lanes: int = 1) -> np.ndarray:
    """Return the parameters of several plants that are alike, shape (parameters, lanes)."""
    return np.repeat(np.array(parameters, np.float64)[:, np.newaxis], lanes, axis=1)


def _as_rows(changes: tuple[Change, ...]) -> np.ndarray:
    rows = [(each.step, PARAMETER[each.parameter], each.value) for each in changes]
    return np.array(rows, np.float64).reshape(-1, 3)


def draw_rows(draws: tuple[Draw, ...]) -> np.ndarray:
    """Return what is drawn as rows of numbers, shape (n, 4), for `draw_parameters`."""
    rows = [(PARAMETER[name], low, high, is_log) for name, (low, high, is_log) in draws]
    return np.array(rows, np.float64).reshape(-1, 4)


def largest_push(rig: Rig) -> float:
    """Return the largest force [N] with which the motor may push in a run."""
    changed = rig.changes[rig.changes[:, 1] == FORCE_PARAMETER, 2]
    drawn = rig.draws[rig.draws[:, 0] == FORCE_PARAMETER, 2]
    forces = np.abs(np.concatenate([rig.present[FORCE_PARAMETER], changed, drawn]))
    return min(float(forces.max()) * max(rig.left, 1.0), rig.saturation)


@compiled
def draw_parameters(
    draws: np.ndarray, present: np.ndarray, i: int, rng: np.random.Generator
) -> None:
    """Draw parameters of a lane's plant, uniformly or log-uniformly.

    Parameters
    ----------
    draws
        What is drawn, shape (n, 4), as in `Rig`.
    present
        Where the parameters are written to, shape (parameters, lanes).
    i
        The lane.
    rng
        Random numbers.
    """
    for k in range(len(draws)):
        low, high, u = draws[k, 1], draws[k, 2], rng.random()
        if draws[k, 3] > 0.0:
            value = low * exponential(u * logarithm(high / low))
        else:
            value = low + u * (high - low)
        present[int(draws[k, 0]), i] = value


@compiled
def parameters_of(present: np.ndarray, i: int) -> Parameters:
    """Return the present parameters of a lane's plant."""
    return Parameters(
        present[0, i],
        present[1, i],
        present[2, i],
        present[3, i],
        present[4, i],
        present[5, i],
        present[6, i],
        present[7, i],
        present[8, i],
        present[9, i],
        present[10, i],
        present[11, i],
    )


@inlined
def begin_episode(rig: Rig | None, rng: np.random.Generator, i: int = 0) -> None:
    """Draw the plant of a trial, before its start is drawn."""
    if rig is not None:
        _begin_episode(rig, rng, i)


@inlined
def first_measurement(
    rig: Rig | None, noise: Noise, state: State, rng: np.random.Generator, i: int = 0
) -> State:
    """Return what the agent measures at the start of a trial."""
    if rig is None:
        return measure(noise, state, rng)
    return _first_measurement(rig, noise, state, rng, i)


@inlined
def strength(rig: Rig | None, force: float, i: int = 0) -> float:
    """Return the present force of a push [N], which is `force` unless the plant changes."""
    return force if rig is None else rig.present[FORCE_PARAMETER, i]


@inlined
def acting_force(
    rig: Rig | None, noise: Noise, push: float, rng: np.random.Generator, i: int = 0
) -> float:
    """Return the force [N] that acts on the cart when the agent pushes with the force `push`."""
    if rig is None:
        return disturb(noise, push, rng)
    return _acting_force(rig, noise, push, rng, i)


@inlined
def measurement(
    rig: Rig | None, noise: Noise, state: State, rng: np.random.Generator, i: int = 0
) -> State:
    """Return what the agent measures after a step."""
    if rig is None:
        return measure(noise, state, rng)
    return _measurement(rig, noise, state, rng, i)


@compiled
def _begin_episode(rig: Rig, rng: np.random.Generator, i: int) -> None:
    draw_parameters(rig.draws, rig.present, i, rng)
    apply_changes(rig, 0.0, i)


@compiled
def apply_changes(rig: Rig, first: float, i: int) -> None:
    """Change a lane's plant as is due from this step of the run to the present one."""
    for k in range(len(rig.changes)):
        if first <= rig.changes[k, 0] <= rig.memory[STEPS, i]:
            rig.present[int(rig.changes[k, 1]), i] = rig.changes[k, 2]


@compiled
def _first_measurement(
    rig: Rig, noise: Noise, state: State, rng: np.random.Generator, i: int
) -> State:
    memory = rig.memory
    for row in range(FORCE, len(memory)):
        memory[row, i] = 0.0
    seen = _sense(rig, noise, state, rng)
    memory[X, i], memory[THETA, i] = seen.x, seen.theta
    if rig.takes_differences:
        seen = State(seen.x, 0.0, seen.theta, 0.0)
    for k in range(rig.measurement_delay):
        _write(memory, RINGS + rig.delay + 4 * k, i, seen)
    _write(memory, SEEN, i, seen)
    return seen


@compiled
def _acting_force(rig: Rig, noise: Noise, push: float, rng: np.random.Generator, i: int) -> float:
    memory, h = rig.memory, rig.present[TIME_STEP, i]
    if push < 0.0:
        push *= rig.left
    if rig.delay > 0:
        place = RINGS + int(memory[STEPS, i]) % rig.delay
        push, memory[place, i] = memory[place, i], push
    if rig.lag > 0.0:  # the exact response of a first-order motor to a push that holds for a step
        push += (memory[FORCE, i] - push) * exponential(-h / rig.lag)
        memory[FORCE, i] = push
    push = math.copysign(max(abs(push) - rig.dead_zone, 0.0), push)
    push = disturb(noise, min(max(push, -rig.saturation), rig.saturation), rng)
    if rig.gust > 0.0:
        if memory[GUST_STEPS, i] == 0.0 and rng.random() < h / rig.gust_every:
            memory[GUST_STEPS, i] = max(1.0, float(int(rig.gust_for / h + 0.5)))
            memory[GUST, i] = rig.gust if rng.random() < 0.5 else -rig.gust
        if memory[GUST_STEPS, i] > 0.0:
            memory[GUST_STEPS, i] -= 1.0
            push += memory[GUST, i]
    return push + rig.wind


@compiled
def _measurement(rig: Rig, noise: Noise, state: State, rng: np.random.Generator, i: int) -> State:
    memory, h = rig.memory, rig.present[TIME_STEP, i]
    memory[STEPS, i] += 1.0
    apply_changes(rig, memory[STEPS, i], i)
    seen = _sense(rig, noise, state, rng)
    if rig.takes_differences:
        x_dot, theta_dot = (seen.x - memory[X, i]) / h, (seen.theta - memory[THETA, i]) / h
        memory[X, i], memory[THETA, i] = seen.x, seen.theta
        seen = State(seen.x, x_dot, seen.theta, theta_dot)
    if rig.measurement_delay > 0:
        place = RINGS + rig.delay + 4 * (int(memory[STEPS, i]) % rig.measurement_delay)
        late = _read(memory, place, i)
        _write(memory, place, i, seen)
        seen = late
    if rig.dropped > 0.0 and rng.random() < rig.dropped:
        return _read(memory, SEEN, i)
    _write(memory, SEEN, i, seen)
    return seen


@inlined
def _sense(rig: Rig, noise: Noise, state: State, rng: np.random.Generator) -> State:
    """Return what the sensors give: with noise, biased, and in whole counts of the encoders."""
    seen = measure(noise, state, rng)
    x, theta = seen.x + rig.position_bias, seen.theta + rig.angle_bias
    if rig.encoder > 0.0:
        turn = 2.0 * math.pi
        x = np.floor(x * rig.encoder + 0.5) / rig.encoder
        theta = np.floor(theta / turn * rig.encoder + 0.5) * turn / rig.encoder
    return State(x, seen.x_dot, theta, seen.theta_dot)


@inlined
def _read(memory: np.ndarray, row: int, i: int) -> State:
    return State(memory[row, i], memory[row + 1, i], memory[row + 2, i], memory[row + 3, i])


@inlined
def _write(memory: np.ndarray, row: int, i: int, state: State) -> None:
    memory[row, i], memory[row + 1, i], memory[row + 2, i], memory[row + 3, i] = state


# ---- What Python may give to the functions above -------------------------------------------------


@once
def check_rig(rig: Rig) -> None:
    """Raise UprightError unless the arrays of a rig have the sizes that its numbers say."""
    for name in ("delay", "measurement_delay"):
        require(f"{name} of a rig", getattr(rig, name), 0, whole=True)
    rows = RINGS + rig.delay + 4 * rig.measurement_delay
    require_array("present of a rig", rig.present, np.float64, len(PARAMETER), None)
    require_array("memory of a rig", rig.memory, np.float64, rows, rig.present.shape[1])
    require_array("changes of a rig", rig.changes, np.float64, None, 3)
    require_rows("changes of a rig", rig.changes[:, 1], len(PARAMETER))
    check_draws(rig.draws)


def check_draws(draws: np.ndarray) -> None:
    """Raise UprightError unless these are `draws` of a rig."""
    require_array("draws", draws, np.float64, None, 4, written=False)
    require_rows("draws", draws[:, 0], len(PARAMETER))


@guard(_begin_episode)
@guard(apply_changes)
@guard(_first_measurement)
@guard(_acting_force)
@guard(_measurement)
def _check_rig_and_lane(rig: Rig, *others: Any) -> None:
    check_rig(rig)
    require_lane(others[-1], rig.memory.shape[1])


@guard(parameters_of)
def _check_parameters_of(present: np.ndarray, i: int) -> None:
    require_array("present", present, np.float64, len(PARAMETER), None, written=False)
    require_lane(i, present.shape[1])


@guard(draw_parameters)
def _check_draw_parameters(
    draws: np.ndarray, present: np.ndarray, i: int, _rng: np.random.Generator
) -> None:
    check_draws(draws)
    require_array("present", present, np.float64, len(PARAMETER), None)
    require_lane(i, present.shape[1])
