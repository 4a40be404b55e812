"""The physics: a pole hinged to a cart on a track. No other module has equations of motion.

The equations are those of Barto, Sutton & Anderson (IEEE Trans. SMC 13, 1983), used by Si & Wang
(IEEE Trans. Neural Networks 12(2), 2001) and by the course report as (3) and (4); the report prints
(3) without the division by the total mass, which the units require.
"""

from enum import IntEnum

from upright.core.compiled import compiled, inlined
from upright.core.parameters import Parameters, State
from upright.core.portable_math import sine_cosine, small_sine_cosine


class Integrator(IntEnum):
    """How the equations of motion advance by one time step."""

    EULER = 0
    """Explicit Euler: positions advance with the old velocities. Used by the published tables."""
    SEMI_IMPLICIT = 1
    """Semi-implicit Euler: positions advance with the new velocities."""
    RK4 = 2
    """Classical Runge-Kutta of order 4, with the force held constant over the step."""


INTEGRATORS = {each.name.lower().replace("_", "-"): each for each in Integrator}
"""The integrators by name."""
EULER = int(Integrator.EULER)
"""`Integrator.EULER` as a plain integer, which is faster to pass to compiled code."""


@compiled
def accelerations(parameters: Parameters, state: State, force: float) -> tuple[float, float]:
    """Return ẍ [m/s²] and θ̈ [rad/s²], the accelerations under a force F [N] on the cart.

    With g the acceleration of gravity, m the pole's mass, l half its length, m_c the cart's mass,
    and μ_c and μ_p the frictions of cart and pole (report, equations (4) and (3)):

        u = (F + m l θ̇² sin θ - μ_c sgn ẋ) / (m_c + m)
        θ̈ = (g sin θ - u cos θ - μ_p θ̇ / (m l)) / (l (4/3 - m cos² θ / (m_c + m)))
        ẍ = u - m l θ̈ cos θ / (m_c + m)

    Along a tilted track, gravity accelerates cart and pole alike: ẍ is less by `gravity_along`.
    """
    sin, cos = sine_cosine(state.theta)
    if parameters.static_friction > 0.0 and state.x_dot == 0.0:
        return _accelerations_from_rest(parameters, state, force, sin, cos)
    sign_x_dot = int(state.x_dot > 0.0) - int(state.x_dot < 0.0)
    return _accelerations(parameters, state, force, sin, cos, sign_x_dot)


@compiled
def _accelerations_from_rest(
    parameters: Parameters, state: State, force: float, sin: float, cos: float
) -> tuple[float, float]:
    """Return the same as `accelerations` for a cart at rest that static friction may hold.

    It holds the cart if it is not less than the force that then accelerates the cart, which is

        F + m l (θ̇² sin θ - θ̈ cos θ) - (m_c + m) gravity_along, with
        θ̈ = (g sin θ - μ_p θ̇ / (m l)) / (4/3 l)

    for a pole on a cart at rest. Otherwise, the cart slips in the direction of that force.
    """
    p, theta_dot = parameters, state.theta_dot
    ml = p.pole_mass * p.half_length
    held = (p.gravity * sin - (p.pole_friction / ml) * theta_dot) / (4.0 / 3.0 * p.half_length)
    pull = force + ml * (theta_dot * theta_dot * sin - held * cos)
    pull -= (p.cart_mass + p.pole_mass) * p.gravity_along
    if abs(pull) <= p.static_friction:
        return 0.0, held
    return _accelerations(parameters, state, force, sin, cos, 1 if pull > 0.0 else -1)


@compiled
def _accelerations(
    parameters: Parameters, state: State, force: float, sin: float, cos: float, sign_x_dot: int
) -> tuple[float, float]:
    """Return the same as `accelerations`, given sin θ, cos θ and sgn ẋ."""
    p = parameters
    g, m, l, theta_dot = p.gravity, p.pole_mass, p.half_length, state.theta_dot  # noqa: E741
    ml = m * l
    mass_inverse = 1.0 / (p.cart_mass + m)  # a division takes as long as four products
    u = (force + ml * theta_dot * theta_dot * sin - p.cart_friction * sign_x_dot) * mass_inverse
    theta_acceleration = (g * sin - cos * u - (p.pole_friction / ml) * theta_dot) / (
        l * (4.0 / 3.0 - (m * mass_inverse) * (cos * cos))
    )
    x_acceleration = u - (ml * mass_inverse) * (theta_acceleration * cos)
    return x_acceleration - p.gravity_along, theta_acceleration


@compiled
def _euler(parameters: Parameters, state: State, acceleration: tuple[float, float]) -> State:
    """Explicit Euler, order 1: x ← x + h ẋ and ẋ ← ẋ + h ẍ, both from the old state."""
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
    """Semi-implicit (symplectic) Euler, order 1: ẋ ← ẋ + h ẍ, then x ← x + h ẋ with the new ẋ."""
    h = parameters.time_step
    x_acceleration, theta_acceleration = acceleration
    x_dot = state.x_dot + h * x_acceleration
    theta_dot = state.theta_dot + h * theta_acceleration
    return State(state.x + h * x_dot, x_dot, state.theta + h * theta_dot, theta_dot)


@compiled
def _moved(state: State, slope: State, h: float) -> State:
    """Return y + h y'."""
    return State(
        state.x + h * slope.x,
        state.x_dot + h * slope.x_dot,
        state.theta + h * slope.theta,
        state.theta_dot + h * slope.theta_dot,
    )


@compiled
def _slope(parameters: Parameters, state: State, force: float) -> State:
    """Return y' = (ẋ, ẍ, θ̇, θ̈), the time derivative of a state y."""
    x_acceleration, theta_acceleration = accelerations(parameters, state, force)
    return State(state.x_dot, x_acceleration, state.theta_dot, theta_acceleration)


@compiled
def _rk4(parameters: Parameters, state: State, force: float) -> State:
    """Classical Runge-Kutta, order 4: y ← y + h/6 (a + 2 b + 2 c + d)."""
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
def step(parameters: Parameters, state: State, force: float, integrator: int = EULER) -> State:
    """Return the state one time step later; the force [N] acts throughout the step.

    Parameters
    ----------
    integrator
        An `Integrator`, as an integer.
    """
    if integrator == Integrator.RK4:
        moved = _rk4(parameters, state, force)
    else:
        acceleration = accelerations(parameters, state, force)
        if integrator == Integrator.SEMI_IMPLICIT:
            moved = _semi_implicit(parameters, state, acceleration)
        else:
            moved = _euler(parameters, state, acceleration)
    if parameters.static_friction > 0.0 and state.x_dot * moved.x_dot < 0.0:
        return _at_rest_if_held(parameters, moved, force)
    return moved


@compiled
def _at_rest_if_held(parameters: Parameters, state: State, force: float) -> State:
    """Return the state of a cart that turned round in a step, at rest if friction now holds it."""
    rest = State(state.x, 0.0, state.theta, state.theta_dot)
    x_acceleration, _ = accelerations(parameters, rest, force)
    return rest if x_acceleration == 0.0 else state


@compiled
def step_small(parameters: Parameters, state: State, force: float) -> State:
    """Return what `step` returns by explicit Euler; branch-free, for angles up to SMALL only.

    Static friction must be zero.
    """
    sin, one_less_cos = small_sine_cosine(state.theta)
    sign_x_dot = int(state.x_dot > 0.0) - int(state.x_dot < 0.0)
    acceleration = _accelerations(parameters, state, force, sin, 1.0 - one_less_cos, sign_x_dot)
    return _euler(parameters, state, acceleration)


@inlined
def has_fallen(parameters: Parameters, state: State) -> bool:
    """Whether the pole or the cart is outside its limits; a NaN counts as outside."""
    return not (
        abs(state.x) <= parameters.position_limit and abs(state.theta) <= parameters.angle_limit
    )
