"""What a cart-pole is in numbers: its state and its parameters. Data only: no compiled code.

A state is (x, x_dot, theta, theta_dot): cart position [m] and velocity [m/s], pole angle from
upright [rad] and angular velocity [rad/s]. Positive angles lean to +x; the force acts on the cart
along +x.
"""

import math
from enum import IntEnum
from typing import NamedTuple

from upright.errors import UprightError, require


class State(NamedTuple):
    """State of the plant, or a measurement of it.

    Examples
    --------
    >>> leaning = upright.State(x=0.0, x_dot=0.0, theta=0.05, theta_dot=0.0)
    >>> leaning.theta
    0.05
    """

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
    """Parameters of the plant, with the values of Barto et al. (1983) and Si & Wang (2001).

    Examples
    --------
    The pole of the published task is 1 m long; this one has twice the length:

    >>> upright.Parameters().half_length
    0.5
    >>> plant = upright.equations(upright.Parameters(half_length=1.0))
    """

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
