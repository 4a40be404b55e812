import math

import numpy as np
import pytest
from helpers import energy
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from upright.core.cartpole import EULER, INTEGRATORS, Integrator, accelerations, has_fallen, step
from upright.core.many import step_many
from upright.core.parameters import Parameters, State, check_parameters
from upright.errors import UprightError
from upright.plants.equations import EquationsSettings, equations

PARAMETERS = Parameters()
SMOOTH = Parameters(cart_friction=0.0, pole_friction=0.0)
"""Without friction, whose sign function no integrator resolves to a high order."""


def number(low, high):
    return st.floats(low, high, allow_subnormal=False)


states = st.builds(State, number(-3, 3), number(-5, 5), number(-math.pi, math.pi), number(-9, 9))
forces = number(-20, 20)
parameters = st.builds(
    Parameters,
    gravity=number(0, 30),
    cart_mass=number(0.05, 20),
    pole_mass=number(0.01, 10),
    half_length=number(0.05, 3),
    cart_friction=number(0, 0.5),
    pole_friction=number(0, 0.1),
    time_step=number(0.001, 0.05),
    gravity_along=number(-20, 20),
    static_friction=st.just(0.0),
)
integrators = st.sampled_from([int(each) for each in Integrator])
SEMI_IMPLICIT, RK4 = int(Integrator.SEMI_IMPLICIT), int(Integrator.RK4)


def minus(state):
    return State(*(-value for value in state))


def textbook_slope(p, state, force):
    """Return the slope from the Lagrangian: the mass matrix times accelerations, solved."""
    _, x_dot, theta, theta_dot = state
    coupling = p.pole_mass * p.half_length * math.cos(theta)
    mass_matrix = [
        [p.cart_mass + p.pole_mass, coupling],
        [coupling, 4 / 3 * p.pole_mass * p.half_length**2],
    ]
    generalised_forces = [
        force
        + p.pole_mass * p.half_length * theta_dot**2 * math.sin(theta)
        - p.cart_friction * np.sign(x_dot)
        - (p.cart_mass + p.pole_mass) * p.gravity_along,
        p.pole_mass
        * p.half_length
        * (p.gravity * math.sin(theta) - p.gravity_along * math.cos(theta))
        - p.pole_friction * theta_dot,
    ]
    x_acceleration, theta_acceleration = np.linalg.solve(mass_matrix, generalised_forces)
    return [x_dot, x_acceleration, theta_dot, theta_acceleration]


def reference(p, state, force, duration):
    """Return the state after a duration, by SciPy from the textbook's equations."""
    solution = solve_ivp(
        lambda _, s: textbook_slope(p, s, force),
        (0, duration),
        state,
        method="DOP853",
        rtol=1e-12,
        atol=1e-13,
    )
    return solution.y[:, -1]


def simulate(p, state, force, steps, integrator=EULER):
    for _ in range(steps):
        state = step(p, state, force, integrator)
    return state


# ------------------------------------------------------------------------------ equations


@given(parameters, states, forces)
def test_accelerations_are_those_of_the_lagrangian(p, state, force):
    _, x_acceleration, _, theta_acceleration = textbook_slope(p, state, force)
    scale = 1 + abs(x_acceleration) + abs(theta_acceleration)
    ours = accelerations(p, state, force)
    assert ours == pytest.approx((x_acceleration, theta_acceleration), abs=1e-10 * scale, rel=0)


def test_accelerations_by_hand_at_rest_and_upright():
    """θ̈ = -(F/M) / (l (4/3 - m/M)) and ẍ = (F - m l θ̈) / M, from the paper's equations."""
    theta_acceleration = -(10 / 1.1) / (0.5 * (4 / 3 - 0.1 / 1.1))
    x_acceleration = (10 - 0.05 * theta_acceleration) / 1.1
    ours = accelerations(PARAMETERS, State(0.0, 0.0, 0.0, 0.0), 10.0)
    assert ours == pytest.approx((x_acceleration, theta_acceleration), rel=1e-14)


@given(parameters, states, forces, integrators)
def test_a_mirrored_cart_pole_moves_as_in_a_mirror(p, state, force, integrator):
    tilted_back = p._replace(gravity_along=-p.gravity_along)
    mirrored = step(tilted_back, minus(state), -force, integrator)
    assert mirrored == minus(step(p, state, force, integrator))


@given(parameters, states, forces)
def test_cart_friction_opposes_motion(p, state, force):
    p = p._replace(cart_friction=0.5)
    with_friction = accelerations(p, state, force)[0]
    without = accelerations(p._replace(cart_friction=0.0), state, force)[0]
    assert np.sign(with_friction - without) == -np.sign(state.x_dot)


@given(parameters, states, forces)
def test_hinge_friction_opposes_rotation(p, state, force):
    p = p._replace(pole_friction=1.0)
    state = state._replace(theta_dot=max(abs(state.theta_dot), 0.1))
    without = p._replace(pole_friction=0.0)
    assert accelerations(p, state, force)[1] < accelerations(without, state, force)[1]
    state = state._replace(theta_dot=-state.theta_dot)
    assert accelerations(p, state, force)[1] > accelerations(without, state, force)[1]


@pytest.mark.parametrize("rest", [0.0, -0.0])
def test_a_cart_at_rest_feels_no_friction(rest):
    state = State(0.1, rest, 0.1, 0.2)
    rough, smooth = (PARAMETERS._replace(cart_friction=friction) for friction in (0.5, 0.0))
    assert accelerations(rough, state, 3.0) == accelerations(smooth, state, 3.0)


# ------------------------------------------------------------------------------ integration


@pytest.mark.parametrize(
    ("start", "force"),
    [
        (State(0.0, 0.0, 0.05, 0.0), 0.0),
        (State(0.5, 1.0, -0.2, 0.5), 10.0),
        (State(-1.0, 3.0, 2.0, -4.0), -2.0),
    ],
)
def test_runge_kutta_agrees_with_scipy(start, force):
    p = SMOOTH._replace(time_step=0.002, pole_friction=0.01)
    ours = simulate(p, start, force, 250, RK4)
    assert ours == pytest.approx(reference(p, start, force, 0.5), rel=1e-9, abs=1e-9)


def test_runge_kutta_agrees_with_scipy_with_friction_on_the_track():
    """While the cart's velocity keeps its sign, friction is smooth."""
    p = Parameters(cart_friction=0.3, time_step=0.002)
    start = State(0.0, 1.0, 0.1, 0.0)
    ours = simulate(p, start, 1.0, 250, RK4)
    assert ours == pytest.approx(reference(p, start, 1.0, 0.5), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ("integrator", "order"),
    [(EULER, 1), (SEMI_IMPLICIT, 1), (RK4, 4)],
)
def test_integrators_converge_with_their_order(integrator, order):
    start = State(0.0, 0.5, 0.3, -1.0)
    exact = reference(SMOOTH, start, 5.0, 0.4)
    errors = []
    for steps in (40, 80):
        p = SMOOTH._replace(time_step=0.4 / steps)
        errors.append(np.abs(simulate(p, start, 5.0, steps, integrator) - exact).max())
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.15)


@given(parameters, states, forces)
def test_euler_moves_positions_with_the_old_velocities(p, state, force):
    x_acceleration, theta_acceleration = accelerations(p, state, force)
    assert step(p, state, force) == step(p, state, force, EULER)
    assert step(p, state, force) == State(
        state.x + p.time_step * state.x_dot,
        state.x_dot + p.time_step * x_acceleration,
        state.theta + p.time_step * state.theta_dot,
        state.theta_dot + p.time_step * theta_acceleration,
    )


@given(parameters, states, forces)
def test_semi_implicit_euler_moves_positions_with_the_new_velocities(p, state, force):
    after = step(p, state, force, SEMI_IMPLICIT)
    euler = step(p, state, force, EULER)
    assert (after.x_dot, after.theta_dot) == (euler.x_dot, euler.theta_dot)
    assert after.x == state.x + p.time_step * after.x_dot
    assert after.theta == state.theta + p.time_step * after.theta_dot


def test_energy_is_conserved_without_friction_and_force():
    p = SMOOTH._replace(time_step=0.002)
    state = State(0.0, 0.3, 0.5, 0.0)
    begin, rotation = energy(p, state), []
    for _ in range(5000):
        state = step(p, state, 0.0, RK4)
        rotation.append(state.theta_dot)
        assert energy(p, state) == pytest.approx(begin, abs=1e-9)
    assert max(rotation) > 3, "the pole must swing for this to mean anything"
    assert min(rotation) < -3


def test_euler_does_not_conserve_energy():
    """The test above would notice: the energy it computes is no constant by itself."""
    p = SMOOTH._replace(time_step=0.002)
    state = State(0.0, 0.3, 0.5, 0.0)
    assert abs(energy(p, simulate(p, state, 0.0, 5000)) - energy(p, state)) > 1e-3


def test_friction_takes_energy_away():
    p = Parameters(pole_friction=0.01, time_step=0.002)
    state = State(0.0, 0.3, 0.5, 0.0)
    assert energy(p, simulate(p, state, 0.0, 2500, RK4)) < energy(p, state) - 0.05


@pytest.mark.parametrize("integrator", [EULER, SEMI_IMPLICIT, RK4])
@pytest.mark.parametrize("count", [1, 7, 4096])
def test_many_cart_poles_move_exactly_as_one(integrator, count):
    rng = np.random.default_rng(count)
    p = Parameters()
    before = rng.uniform(-2, 2, (4, count))
    push = rng.uniform(-10, 10, count)
    after = before.copy()
    step_many(p, after, push, integrator)
    for i in range(count):
        alone = step(p, State(*before[:, i].tolist()), float(push[i]), integrator)
        assert tuple(after[:, i]) == alone


@pytest.mark.parametrize(
    "change",
    [
        {"gravity": 3.7},
        {"cart_mass": 2.0},
        {"pole_mass": 0.3},
        {"half_length": 0.7},
        {"cart_friction": 0.1},
        {"pole_friction": 0.01},
        {"time_step": 0.01},
    ],
    ids=str,
)
def test_a_changed_parameter_changes_the_step(change):
    """Nothing derived from a parameter is kept from before."""
    start = State(0.1, 0.2, 0.15, 0.4)
    usual = step(PARAMETERS, start, 10.0)
    changed = PARAMETERS._replace(**change)
    plant = equations(changed)
    plant.reset(start)
    assert plant.step(10.0) == step(changed, start, 10.0) != usual
    plant = equations()._replace(parameters=changed)
    plant.reset(start)
    assert plant.step(10.0) != usual


@pytest.mark.parametrize("integrator", ["semi-implicit", "rk4"])
def test_another_integrator_changes_the_step(integrator):
    start = State(0.1, 0.2, 0.15, 0.4)
    usual = step(PARAMETERS, start, 10.0)
    plant = equations(integrator=integrator)
    plant.reset(start)
    assert plant.step(10.0) == step(PARAMETERS, start, 10.0, int(INTEGRATORS[integrator])) != usual


def test_the_plant_is_the_equations():
    plant, state = equations(), State(0.01, 0.02, 0.03, 0.04)
    assert plant.reset(state) == state
    for force in (10.0, -10.0, 3.0):
        state = step(PARAMETERS, state, force)
        assert plant.step(force) == state
    assert tuple(plant.memory) == state
    plant.close()


# ------------------------------------------------------------------------------ limits


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("name", "limit"), [("x", PARAMETERS.position_limit), ("theta", PARAMETERS.angle_limit)]
)
def test_it_has_fallen_beyond_the_limits_and_not_at_them(name, limit, sign):
    upright = State(0.0, 99.0, 0.0, -99.0)
    assert not has_fallen(PARAMETERS, upright)
    assert not has_fallen(PARAMETERS, upright._replace(**{name: sign * limit}))
    beyond = float(np.nextafter(limit, 9))
    assert has_fallen(PARAMETERS, upright._replace(**{name: sign * beyond}))


@pytest.mark.parametrize("name", ["x", "theta"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_state_of_nan_has_fallen(name, value):
    assert has_fallen(PARAMETERS, State(0.0, 0.0, 0.0, 0.0)._replace(**{name: value}))


def test_the_limits_are_those_of_the_protocol():
    assert PARAMETERS.position_limit == 2.4
    assert math.degrees(PARAMETERS.angle_limit) == pytest.approx(12)


# ------------------------------------------------------------------------------ bad parameters

POSITIVE = [
    "cart_mass",
    "pole_mass",
    "half_length",
    "force",
    "time_step",
    "position_limit",
    "angle_limit",
]
NOT_NEGATIVE = ["gravity", "cart_friction", "pole_friction"]


@pytest.mark.parametrize(
    ("name", "value"),
    [(name, 0.0) for name in POSITIVE]
    + [
        (name, value)
        for name in POSITIVE + NOT_NEGATIVE
        for value in (-1.0, math.nan, math.inf, "1", None, True)
    ],
)
def test_impossible_parameters_are_refused_by_name(name, value):
    with pytest.raises(UprightError) as error:
        check_parameters(PARAMETERS._replace(**{name: value}))
    assert str(error.value).startswith(f"{name} is {value!r}; it must be a number, ")


@pytest.mark.parametrize("value", [3, -1, "RK4", None, 0.5])
def test_an_unknown_integrator_is_refused_by_name(value):
    for make in (EquationsSettings, lambda name: equations(integrator=name)):
        with pytest.raises(UprightError) as error:
            make(value)
        said = f"integrator is {value!r}; it must be one of euler, semi-implicit, rk4"
        assert str(error.value).startswith(said)


@pytest.mark.parametrize("name", NOT_NEGATIVE)
def test_zero_gravity_and_friction_are_allowed(name):
    parameters = PARAMETERS._replace(**{name: 0.0})
    assert check_parameters(parameters) == parameters


# ------------------------------------------------------------------------------ static friction

STICKY = Parameters(cart_friction=2.0, static_friction=2.0)


def roll(p, state, force, steps, integrator=EULER):
    """Return the states of this many steps under a force."""
    states = [state]
    for _ in range(steps):
        states.append(step(p, states[-1], force, integrator))
    return states


@pytest.mark.parametrize("integrator", [EULER, SEMI_IMPLICIT, RK4])
def test_with_static_friction_a_free_cart_comes_to_rest(integrator):
    """Without it, in the published model, the cart chatters for ever."""
    hanging = State(0.0, 0.5, math.pi, 0.0)
    *_, last = roll(STICKY._replace(pole_friction=0.01), hanging, 0.0, 6000, integrator)
    assert last.x_dot == 0.0
    chattering = STICKY._replace(pole_friction=0.01, static_friction=0.0)
    speeds = [abs(s.x_dot) for s in roll(chattering, hanging, 0.0, 6000, integrator)[-100:]]
    assert max(speeds) > 0.005


def test_static_friction_holds_what_it_can_and_no_more():
    p = Parameters(cart_friction=1.0, static_friction=3.0, gravity=0.0)
    rest = State(0.0, 0.0, 0.0, 0.0)
    assert step(p, rest, 2.9).x_dot == step(p, rest, -2.9).x_dot == 0.0
    for force in (3.1, -3.1):
        slipping = accelerations(p, rest, force)
        free = accelerations(p._replace(static_friction=0.0), rest, force - math.copysign(1, force))
        assert slipping == pytest.approx(free, rel=1e-14)


def test_a_held_cart_lets_its_pole_swing():
    """The pole is then a pendulum with a fixed hinge: (4/3) l θ̈ = g sin θ."""
    p = Parameters(cart_friction=50.0, static_friction=50.0, pole_friction=0.0)
    leaning = State(0.0, 0.0, 0.3, 0.2)
    assert accelerations(p, leaning, 10.0) == pytest.approx(
        (0.0, p.gravity * math.sin(0.3) / (4 / 3 * p.half_length)), rel=1e-14
    )


def test_a_track_that_tilts_moves_a_cart_only_beyond_its_friction():
    p = Parameters(cart_friction=1.0, static_friction=1.0, gravity_along=0.5)
    hanging = State(0.0, 0.0, math.pi, 0.0)
    assert step(p, hanging, 0.0).x_dot == 0.0
    assert step(p._replace(gravity_along=1.5), hanging, 0.0).x_dot < 0.0


@given(states, forces, integrators)
def test_static_friction_never_adds_energy(state, force, integrator):
    """A cart that turns round either goes on as without static friction, or is at rest."""
    p = Parameters(cart_friction=1.0, static_friction=4.0)
    moved, free = (
        step(each, state, force, integrator) for each in (p, p._replace(static_friction=0.0))
    )
    if state.x_dot and integrator != RK4:
        assert moved in (free, free._replace(x_dot=0.0))
