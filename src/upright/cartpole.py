"""The plant: a pole hinged to a cart on a track. The only place with physics.

A state is (x, x_dot, theta, theta_dot): cart position [m] and velocity [m/s], pole angle from
upright [rad] and angular velocity [rad/s]. Positive angles lean to +x; the force acts on the cart
along +x. The equations are those of Barto, Sutton & Anderson (IEEE Trans. SMC 13, 1983), used by
Si & Wang (IEEE Trans. Neural Networks 12(2), 2001) and by the course report as (3) and (4); the
report prints (3) without the division by the total mass, which the units demand.
"""

import math
from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from upright.compiled import compiled, inlined
from upright.elementary import SMALL, sine_cosine, small_sine_cosine
from upright.errors import UprightError, require


class State(NamedTuple):
    """State of the plant, or a measurement of it."""

    x: float
    """Cart position [m]."""
    x_dot: float
    """Cart velocity [m/s]."""
    theta: float
    """Pole angle from upright [rad]."""
    theta_dot: float
    """Angular velocity of the pole [rad/s]."""


class Integrator(IntEnum):
    """How the equations of motion advance by one time step."""

    EULER = 0
    """Explicit Euler: the old velocities move the positions. The published tables use it."""
    SEMI_IMPLICIT = 1
    """Semi-implicit Euler: the new velocities move the positions."""
    RK4 = 2
    """Classical Runge-Kutta of order 4, the force held over the step."""


class Parameters(NamedTuple):
    """Parameters of the plant, with the values of Barto et al. (1983) and Si & Wang (2001)."""

    gravity: float = 9.8
    """Acceleration due to gravity [m/s^2]."""
    cart_mass: float = 1.0
    """Mass of the cart [kg]."""
    pole_mass: float = 0.1
    """Mass of the pole [kg]."""
    half_length: float = 0.5
    """Half of the pole's length [m]."""
    cart_friction: float = 0.0005
    """Friction of the cart on its track, a force by the sign of the velocity [N]."""
    pole_friction: float = 0.000002
    """Viscous friction at the hinge [N m s/rad]."""
    force: float = 10.0
    """Magnitude of a push [N]."""
    time_step: float = 0.02
    """Time between two pushes [s]."""
    position_limit: float = 2.4
    """A trial ends when the cart is further than this from the middle [m]."""
    angle_limit: float = math.radians(12)
    """A trial ends when the pole leans further than this [rad]."""
    integrator: int = int(Integrator.EULER)
    """How one time step is computed: an `Integrator`, as a number, which calls pass on faster."""


def check_parameters(parameters: Parameters) -> Parameters:
    """Return `parameters`, or raise an error that names the impossible value.

    Raises
    ------
    UprightError
        If a value is not finite, a friction is negative, or another quantity is not positive.
    """
    for name, value in parameters._asdict().items():
        if name == "integrator":
            continue
        zero_allowed = name in ("cart_friction", "pole_friction", "gravity")
        require(name, value, 0, above=not zero_allowed)
    try:
        return parameters._replace(integrator=int(Integrator(parameters.integrator)))
    except ValueError:
        names = ", ".join(f"{int(i)} ({i.name})" for i in Integrator)
        raise UprightError(
            f"integrator is {parameters.integrator!r}; it must be one of {names}"
        ) from None


@compiled
def accelerations(parameters: Parameters, state: State, force: float) -> tuple[float, float]:
    """Return the accelerations of cart [m/s^2] and pole [rad/s^2] under a force [N] on the cart.

    Report, equations (4) and (3), with the force per total mass, which both share, taken out.
    """
    sin, cos = sine_cosine(state.theta)
    return _accelerations(parameters, state, force, sin, cos)


@compiled
def _accelerations(
    parameters: Parameters, state: State, force: float, sin: float, cos: float
) -> tuple[float, float]:
    p = parameters
    mass_inverse = 1.0 / (p.cart_mass + p.pole_mass)  # once: to multiply takes a quarter as long
    moment = p.pole_mass * p.half_length
    sign_x_dot = (state.x_dot > 0.0) - (state.x_dot < 0.0)
    drive = (
        force + moment * state.theta_dot * state.theta_dot * sin - p.cart_friction * sign_x_dot
    ) * mass_inverse
    theta_acceleration = (
        p.gravity * sin - cos * drive - (p.pole_friction / moment) * state.theta_dot
    ) / (p.half_length * (4.0 / 3.0 - (p.pole_mass * mass_inverse) * (cos * cos)))
    x_acceleration = drive - (moment * mass_inverse) * (theta_acceleration * cos)
    return x_acceleration, theta_acceleration


@compiled
def _euler(parameters: Parameters, state: State, acceleration: tuple[float, float]) -> State:
    h = parameters.time_step
    x_acceleration, theta_acceleration = acceleration
    return State(
        state.x + h * state.x_dot,
        state.x_dot + h * x_acceleration,
        state.theta + h * state.theta_dot,
        state.theta_dot + h * theta_acceleration,
    )


@compiled
def _semi_implicit(
    parameters: Parameters, state: State, acceleration: tuple[float, float]
) -> State:
    h = parameters.time_step
    x_acceleration, theta_acceleration = acceleration
    x_dot = state.x_dot + h * x_acceleration
    theta_dot = state.theta_dot + h * theta_acceleration
    return State(state.x + h * x_dot, x_dot, state.theta + h * theta_dot, theta_dot)


@compiled
def _moved(state: State, slope: State, h: float) -> State:
    return State(
        state.x + h * slope.x,
        state.x_dot + h * slope.x_dot,
        state.theta + h * slope.theta,
        state.theta_dot + h * slope.theta_dot,
    )


@compiled
def _slope(parameters: Parameters, state: State, force: float) -> State:
    x_acceleration, theta_acceleration = accelerations(parameters, state, force)
    return State(state.x_dot, x_acceleration, state.theta_dot, theta_acceleration)


@compiled
def _rk4(parameters: Parameters, state: State, force: float) -> State:
    h = parameters.time_step
    a = _slope(parameters, state, force)
    b = _slope(parameters, _moved(state, a, 0.5 * h), force)
    c = _slope(parameters, _moved(state, b, 0.5 * h), force)
    d = _slope(parameters, _moved(state, c, h), force)
    state = _moved(state, a, h / 6.0)
    state = _moved(state, b, h / 3.0)
    state = _moved(state, c, h / 3.0)
    return _moved(state, d, h / 6.0)


@compiled
def step(parameters: Parameters, state: State, force: float) -> State:
    """Return the state one time step later, the force [N] acting throughout."""
    if parameters.integrator == Integrator.RK4:
        return _rk4(parameters, state, force)
    acceleration = accelerations(parameters, state, force)
    if parameters.integrator == Integrator.SEMI_IMPLICIT:
        return _semi_implicit(parameters, state, acceleration)
    return _euler(parameters, state, acceleration)


@compiled
def _step_small(parameters: Parameters, state: State, force: float) -> State:
    """Return what `step` does by Euler's rule, of an angle up to SMALL, without a branch."""
    sin, one_less_cos = small_sine_cosine(state.theta)
    acceleration = _accelerations(parameters, state, force, sin, 1.0 - one_less_cos)
    return _euler(parameters, state, acceleration)


Rows = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""States of many cart-poles: their x, x_dot, theta and theta_dot."""
PART = 512
"""Of many cart-poles, so many are moved at a time: they fit into the nearest cache."""


def _loop(advance: Callable[[Parameters, State, float], State]) -> Callable[..., None]:
    """Return a loop over many cart-poles, written once for the steps that it is made for."""

    @compiled
    def loop(parameters: Parameters, states: Rows, forces: np.ndarray) -> None:
        x, x_dot, theta, theta_dot = states
        for i in range(len(forces)):
            before = State(x[i], x_dot[i], theta[i], theta_dot[i])
            x[i], x_dot[i], theta[i], theta_dot[i] = advance(parameters, before, forces[i])

    return loop


_small_loop, _any_loop = _loop(_step_small), _loop(step)


@compiled
def step_part(parameters: Parameters, states: Rows, forces: np.ndarray) -> None:
    """Advance at most PART cart-poles, given the four rows of their states, as `step_many` does."""
    theta = states[2]
    others = 0
    for i in range(len(theta)):
        others += 1 if abs(theta[i]) > SMALL else 0
    if others == 0 and parameters.integrator == Integrator.EULER:
        _small_loop(parameters, states, forces)
    else:
        _any_loop(parameters, states, forces)


@compiled
def step_many(parameters: Parameters, states: np.ndarray, forces: np.ndarray) -> None:
    """Advance many independent cart-poles by one time step, in place.

    Each ends in the same state as `step` gives, to the last bit.

    Parameters
    ----------
    states
        Shape (4, n), float64, rows in the order of `State`.
    forces
        Shape (n,), force on each cart [N].
    """
    for first in range(0, len(forces), PART):
        end = min(first + PART, len(forces))
        part = (
            states[0, first:end],
            states[1, first:end],
            states[2, first:end],
            states[3, first:end],
        )
        step_part(parameters, part, forces[first:end])


@inlined
def has_fallen(parameters: Parameters, state: State) -> bool:
    """Whether the pole or the cart left its limits; a place that is no number has left them."""
    return not (
        abs(state.x) <= parameters.position_limit and abs(state.theta) <= parameters.angle_limit
    )


class Equations(NamedTuple):
    """The plant as compiled equations of motion, behind the contract of every body."""

    parameters: Parameters
    memory: np.ndarray
    """The present state, shape (4,), float64."""

    @compiled
    def reset(self, state: State) -> State:
        """Put the plant into `state`."""
        for i in range(4):
            self.memory[i] = state[i]
        return state

    @compiled
    def step(self, force: float) -> State:
        """Apply a force [N] for one time step and return the state then."""
        memory = self.memory
        after = step(self.parameters, State(memory[0], memory[1], memory[2], memory[3]), force)
        memory[0], memory[1], memory[2], memory[3] = after
        return after

    @inlined
    def has_fallen(self, state: State) -> bool:
        """Whether the pole or the cart left its limits."""
        return has_fallen(self.parameters, state)

    def close(self) -> None:
        """Release nothing: there is nothing to release."""


def equations(parameters: Parameters | None = None) -> Equations:
    """Return the plant as compiled equations, at rest and upright."""
    return Equations(check_parameters(parameters or Parameters()), np.zeros(4))
