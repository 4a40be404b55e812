"""The state and the parameters of a cart-pole. Data only: no compiled code.

A state is (x, x_dot, theta, theta_dot): cart position [m] and velocity [m/s], pole angle from
upright [rad] and angular velocity [rad/s]. Positive angles lean to +x; the force acts on the cart
along +x.
"""

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from upright.errors import UprightError, require, require_one_of, said
from upright.support.settings import pairs


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
    """Coulomb friction of the cart on its track, a force against the velocity [N]."""
    pole_friction: float = 0.000002
    """Viscous friction at the hinge [N m s/rad]."""
    force: float = 10.0
    """Magnitude of a push [N]."""
    time_step: float = 0.02
    """Time between two pushes [s]."""
    position_limit: float = 2.4
    """A trial ends when the cart is further than this from the centre of the track [m]."""
    angle_limit: float = math.radians(12)
    """A trial ends when the pole leans further than this [rad]."""
    gravity_along: float = 0.0
    """Gravity along the track, towards -x [m/s^2]: a track that rises by α to the right has g sin α
    here, and g cos α as `gravity`."""
    static_friction: float = 0.0
    """Friction that holds a cart at rest [N]: a cart that stops stays until more than this pushes
    it. 0 is the published model, in which friction never lets a cart rest."""


SMALLEST, LARGEST = 1e-12, 10**9
"""The smallest value of a parameter that may not be zero, and the largest of any; beyond them,
quotients and sums overflow."""
ZERO_ALLOWED = ("gravity", "cart_friction", "pole_friction", "gravity_along", "static_friction")
"""Parameters that may be zero."""


def lowest(name: str) -> float:
    """Return the smallest value that a parameter may have."""
    if name == "gravity_along":
        return -LARGEST
    return 0 if name in ZERO_ALLOWED else SMALLEST


def check_parameters(parameters: Parameters) -> Parameters:
    """Return `parameters` with every value as a float, or raise an error that names the wrong one.

    Raises
    ------
    UprightError
        If a value is not finite or beyond LARGEST, a friction is negative, another quantity is
        below SMALLEST, or a cart at rest has less friction than a moving one.
    """
    for name, value in parameters._asdict().items():
        require(name, value, lowest(name), LARGEST)
    if 0.0 < parameters.static_friction < parameters.cart_friction:
        raise UprightError(
            f"static_friction is {parameters.static_friction}; it must be 0, or at least the "
            f"cart_friction of {parameters.cart_friction}"
        )
    return Parameters(*(value + 0.0 for value in parameters))  # floats, and no -0


def make_parameters(changes: Mapping[str, float]) -> Parameters:
    """Return the published parameters, with those given by name changed.

    Raises
    ------
    UprightError
        If a name is not a parameter's, or its value is out of range.
    """
    for name in changes:
        require_one_of("parameter", name, Parameters._fields)
    return check_parameters(Parameters()._replace(**changes))


def parse_parameters(texts: Iterable[str], option: str = "parameters") -> dict[str, float]:
    """Return the parameters given by texts of the form NAME=VALUE.

    Parameters
    ----------
    texts
        The texts.
    option
        Name of the option that they belong to, for errors.

    Raises
    ------
    UprightError
        If a name is not a parameter's, or its value is not a number.
    """
    values = {}
    for name, text in pairs(option, texts):
        require_one_of("parameter", name, Parameters._fields)
        try:
            values[name] = float(text)
        except ValueError:
            raise UprightError(f"{name} is {said(text)}; it must be a number") from None
    return values


def changed_parameters(parameters: Parameters) -> dict[str, float]:
    """Return the parameters that differ from the published ones, by name."""
    published = Parameters()._asdict()
    return {name: value for name, value in parameters._asdict().items() if value != published[name]}
