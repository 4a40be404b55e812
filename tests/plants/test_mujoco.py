import copy
import gc
import math
import pickle
import sys
import threading
import weakref

import numpy as np
import pytest
from helpers import (
    GOOD_WEIGHTS,
    HARD_START,
    LEANING,
    POOR_WEIGHTS,
    PUSHES,
    FinePlant,
    LinearAgent,
    energy,
    make_task,
    python,
    trajectory,
)

from upright.agents import AGENTS
from upright.core.compiled import is_compiled
from upright.core.loops import compiled_run
from upright.core.parameters import Parameters, State
from upright.core.trials import run
from upright.errors import UprightError
from upright.plants.equations import equations
from upright.plants.mujoco import INTEGRATORS, Mujoco, _warn
from upright.studies.case import make_case
from upright.studies.playing import Player
from upright.studies.run import make_run

SMOOTH = Parameters(cart_friction=0.0, pole_friction=0.0)
ROUGH = Parameters(cart_friction=0.05, pole_friction=0.0002)
"""A hundred times the friction, as in the condition friction-100."""
OTHER = Parameters(
    gravity=3.7,
    cart_mass=2.5,
    pole_mass=0.3,
    half_length=0.8,
    pole_friction=0.003,
    time_step=0.01,
)


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    """Let MuJoCo write its log of warnings into a temporary folder."""
    monkeypatch.chdir(tmp_path)


def error(plant, parameters, pushes):
    """Return the largest error of a plant in any part of the state [SI units]."""
    forces = PUSHES[pushes]
    exact = trajectory(FinePlant(parameters), forces)
    return float(np.abs(trajectory(plant, forces) - exact).max())


def outcome(loop, agent, plant, task):
    lengths = np.zeros(task.trials, np.int64)
    loop(agent, plant, task, np.random.default_rng(1), lengths, np.zeros(1, np.bool_))
    return lengths.tolist()


# ------------------------------------------------------------------------------ agreement


@pytest.mark.parametrize("pushes", PUSHES)
@pytest.mark.parametrize(("physics_step", "tolerance"), [(0.02, 1e-5), (0.002, 1.5e-9)])
def test_without_friction_it_moves_like_the_equations(pushes, physics_step, tolerance):
    assert error(Mujoco(physics_step).plant(SMOOTH), SMOOTH, pushes) < tolerance


@pytest.mark.parametrize("pushes", PUSHES)
@pytest.mark.parametrize(
    ("parameters", "tolerance"), [(Parameters(), 2e-4), (ROUGH, 1.5e-2)], ids=["usual", "rough"]
)
def test_with_friction_it_moves_like_the_equations(pushes, parameters, tolerance):
    """MuJoCo smooths dry friction around rest, which the bang-bang pushes pass through."""
    tolerance = tolerance if pushes == "bang-bang" else 5e-6
    assert error(Mujoco().plant(parameters), parameters, pushes) < tolerance
    assert error(Mujoco().plant(SMOOTH), parameters, pushes) > 2 * tolerance


@pytest.mark.parametrize("pushes", PUSHES)
def test_other_parameters_work(pushes):
    assert error(Mujoco(0.01).plant(OTHER), OTHER, pushes) < 2e-5


@pytest.mark.parametrize("name", OTHER._fields[:6])
def test_every_physical_parameter_has_an_effect(name):
    changed = Parameters()._replace(**{name: 1.1 * getattr(Parameters(), name)})
    forces = PUSHES["constant"]
    usual, other = (trajectory(Mujoco().plant(p), forces) for p in (Parameters(), changed))
    assert np.abs(usual - other).max() > 1e-7


@pytest.mark.parametrize("integrator", ["euler", "implicit", "implicitfast"])
def test_the_other_integrators_are_of_order_one(integrator):
    errors = [
        error(Mujoco(physics_step, integrator).plant(), Parameters(), "constant")
        for physics_step in (0.002, 0.001)
    ]
    assert errors[1] < 5e-3
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.05)


def test_energy_is_kept_without_friction():
    plant = Mujoco(0.001).plant(SMOOTH)
    start = plant.reset(State(0.0, 0.0, 0.5, 0.0))
    energies = [energy(SMOOTH, plant.step(0.0)) for _ in range(500)]
    assert energies == pytest.approx([energy(SMOOTH, start)] * 500, rel=1e-9)


def test_the_angle_counts_turns():
    """As in the equations, angles are not wrapped."""
    plant = Mujoco().plant()
    assert plant.reset(State(0.0, 0.0, 7.0, 9.0)) == State(0.0, 0.0, 7.0, 9.0)
    assert plant.step(0.0).theta > 7.0
    assert plant.has_fallen(plant.step(0.0))


@pytest.mark.parametrize("x", [2.39, 2.41, 4.5])
def test_there_is_no_stop_where_a_trial_ends(x):
    start = State(x, 3.0, 0.1, 0.2)
    plant, exact = Mujoco().plant(), equations(integrator="rk4")
    assert plant.reset(start) == exact.reset(start)
    for _ in range(3):
        after, expected = plant.step(10.0), exact.step(10.0)
        assert after == pytest.approx(expected, abs=1e-6)
        assert plant.has_fallen(after) == exact.has_fallen(expected) == (after.x > 2.4)


# ------------------------------------------------------------------------------ settings


def test_the_integrator_matters():
    """Though with so little damping implicitfast does what euler does."""
    plants = [Mujoco(0.02, name).plant() for name in ("euler", "implicit", "rk4")]
    ends = {trajectory(plant, PUSHES["constant"])[-1].tobytes() for plant in plants}
    assert len(ends) == 3


@pytest.mark.parametrize(("physics_step", "substeps"), [(0.02, 1), (0.004, 5), (0.0001, 200)])
def test_physics_steps_make_up_the_time_step(physics_step, substeps):
    plant = Mujoco(physics_step).plant()
    assert plant.substeps == substeps
    model = plant.force.base.owners[0]
    assert substeps * model.opt.timestep == pytest.approx(0.02, rel=1e-15)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"physics_step": -0.02}, "physics_step is -0.02; it must be a number, at least 1e-06"),
        ({"physics_step": math.nan}, "physics_step is nan"),
        ({"physics_step": "0.02"}, "physics_step is '0.02'"),
        ({"integrator": "RK4"}, "integrator is 'RK4'; it must be one of euler, implicit, "),
    ],
)
def test_invalid_settings_are_refused(settings, message):
    with pytest.raises(UprightError, match=message):
        Mujoco(**settings)


@pytest.mark.parametrize("physics_step", [0.04, 0.015, 0.003, 0.0200001])
def test_a_physics_step_that_does_not_fit_is_refused(physics_step):
    message = f"physics_step is {physics_step}; .* 0.02 s .* such as 0.02, 0.01, 0.005, 0.004"
    with pytest.raises(UprightError, match=message):
        Mujoco(physics_step).plant()


def test_a_physics_step_fits_to_rounding():
    assert Mujoco(0.02 / 3).plant().substeps == 3
    assert Mujoco(0.0066666666667).plant().substeps == 3


def test_impossible_parameters_are_refused():
    with pytest.raises(UprightError, match="cart_mass is 0"):
        Mujoco().plant(Parameters(cart_mass=0.0))


def test_a_missing_mujoco_is_reported_with_the_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(UprightError, match=r"needs MuJoCo: pip install .*'mujoco' of upright"):
        Mujoco().plant()


# ------------------------------------------------------------------------------ resets


def spoil(plant):
    for force in (10.0, math.nan, 1e300, -3.0):
        plant.step(force)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_reset_leaves_no_trace_of_the_trial_before(integrator):
    plant = Mujoco(0.01, integrator).plant(ROUGH)
    first = trajectory(plant, PUSHES["bang-bang"])
    spoil(plant)
    assert plant.reset(LEANING) == LEANING
    assert trajectory(plant, PUSHES["bang-bang"]).tobytes() == first.tobytes()
    new = trajectory(Mujoco(0.01, integrator).plant(ROUGH), PUSHES["bang-bang"])
    assert new.tobytes() == first.tobytes()


def test_a_state_may_be_made_of_integers():
    plant = Mujoco().plant()
    plant.reset(State(0, 0, 0, 0))
    assert plant.step(0) == State(0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("force", [math.nan, math.inf, -math.inf, 1e300, 1e12, -1e6])
def test_an_absurd_force_always_counts_as_a_fall(force, integrator):
    plant = Mujoco(0.02, integrator).plant()
    plant.reset(LEANING)
    assert plant.has_fallen(plant.step(force))
    for _ in range(5):
        assert plant.has_fallen(plant.step(0.0)), "MuJoCo did not reset itself"


def test_a_state_of_nan_stays_fallen():
    plant = Mujoco().plant()
    assert plant.has_fallen(plant.reset(State(math.nan, 0.0, 0.0, 0.0)))
    assert plant.has_fallen(plant.step(0.0))


def test_a_warning_goes_to_standard_error_and_into_no_file(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    _warn.cache_clear()
    for _ in range(2):
        plant = Mujoco().plant()
        plant.reset(State(1e300, 0.0, 0.0, 0.0))
        plant.step(0.0)
    assert not [*tmp_path.iterdir()]
    error = capfd.readouterr().err
    assert error.startswith("upright: MuJoCo warns: Nan, Inf or huge value in QPOS at DOF 0. ")
    assert error.count("QPOS") == 1


# ------------------------------------------------------------------------------ more than one


def test_two_plants_do_not_disturb_each_other():
    one, other = Mujoco().plant(), Mujoco().plant(ROUGH)
    alone = [trajectory(plant, PUSHES["bang-bang"]) for plant in (one, other)]
    one.reset(LEANING)
    other.reset(LEANING)
    together = [(one.step(force), other.step(force)) for force in PUSHES["bang-bang"]]
    assert np.array(together).swapaxes(0, 1).tolist() == np.array(alone).tolist()


def test_plants_in_two_threads_do_not_disturb_each_other():
    task = make_task(noise="all-10", steps=3000, trials=50)._replace(start=HARD_START)
    alone = outcome(compiled_run, player(GOOD_WEIGHTS), Mujoco().plant(), task)
    outcomes = [[], []]

    def play(lengths):
        lengths += outcome(compiled_run, player(GOOD_WEIGHTS), Mujoco().plant(), task)

    threads = [threading.Thread(target=play, args=(lengths,)) for lengths in outcomes]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert outcomes == [alone, alone]


def test_what_mujoco_allocated_lives_as_long_as_any_array_of_the_plant():
    plant = Mujoco().plant()
    owners = [weakref.ref(owner) for owner in plant.force.base.owners]
    array = plant.velocity
    del plant
    gc.collect()
    assert all(owner() is not None for owner in owners)
    del array
    gc.collect()
    assert all(owner() is None for owner in owners)


@pytest.mark.parametrize("leave", [pickle.dumps, copy.deepcopy])
def test_a_plant_cannot_be_pickled_or_copied(leave):
    with pytest.raises(TypeError, match="cannot be pickled or copied"):
        leave(Mujoco().plant())


# ------------------------------------------------------------------------------ the loops


def player(weights):
    """Return a linear policy for the compiled loop."""
    memory = AGENTS.settings("random-search")["default"].agent(np.random.default_rng(0))
    memory.weights[:] = np.array(weights) * memory.scales
    return Player(memory)


@pytest.mark.parametrize("weights", [GOOD_WEIGHTS, POOR_WEIGHTS])
@pytest.mark.parametrize("noise", ["none", "all-10"])
def test_the_compiled_loop_is_the_python_loop(weights, noise):
    task = make_task(noise=noise, steps=300, trials=8)._replace(start=HARD_START)
    plant = Mujoco().plant()
    assert is_compiled(plant)
    lengths = outcome(compiled_run, player(weights), plant, task)
    assert lengths == outcome(run, player(weights), plant, task)
    assert len(set(lengths)) > 1


def test_an_agent_in_plain_python_balances_it():
    task = make_task(steps=2000, trials=5)
    lengths = outcome(run, LinearAgent(*GOOD_WEIGHTS), Mujoco().plant(), task)
    assert lengths == [2000, 0, 0, 0, 0]


def test_a_policy_learned_on_the_equations_balances_it():
    memory, result = make_run(make_case("reinforce"), 0, 0)
    assert result.success
    task = make_task(steps=60_000, trials=1)
    assert outcome(compiled_run, Player(memory), Mujoco().plant(), task) == [60_000]


def test_a_policy_is_learned_on_it():
    agent = AGENTS.settings("reinforce")["default"].agent(np.random.default_rng(0))
    lengths = outcome(compiled_run, agent, Mujoco().plant(), make_task(steps=5000, trials=300))
    assert 5000 in lengths


@pytest.mark.slow
def test_machine_code_is_found_by_the_next_process(tmp_path):
    """And it calls MuJoCo at its address in that process."""
    code = """
import numpy as np
from upright.agents import AGENTS
from upright.plants.mujoco import Mujoco
from upright.core.task import TaskSpec
from upright.core.loops import compiled_run
agent = AGENTS.settings("random-search")["default"].agent(np.random.default_rng(0))
lengths = np.zeros(20, np.int64)
compiled_run(agent, Mujoco().plant(), TaskSpec(trials=20).task(), np.random.default_rng(0), lengths,
             np.zeros(1, np.bool_))
loop = compiled_run._outer.stats
print(lengths.tolist(), sum(loop.cache_hits.values()), sum(loop.cache_misses.values()))
"""
    first, second = (python(code, NUMBA_CACHE_DIR=str(tmp_path)) for _ in range(2))
    assert first.returncode == second.returncode == 0, first.stderr + second.stderr
    assert first.stdout.endswith("] 0 1\n")
    assert second.stdout == first.stdout.replace("] 0 1", "] 1 0")


def test_a_cart_with_static_friction_comes_to_rest_as_in_mujoco():
    """MuJoCo's friction always lets a cart rest; it creeps by no more than its own smoothing."""
    parameters = Parameters(cart_friction=2.0, static_friction=2.0, pole_friction=0.01)
    ours, theirs = equations(parameters, "rk4"), Mujoco(physics_step=0.001).plant(parameters)
    hanging = State(0.0, 1.0, math.pi, 0.0)
    for plant in (ours, theirs):
        plant.reset(hanging)
    pairs = [(ours.step(0.0), theirs.step(0.0)) for _ in range(150)]
    assert all(abs(a.x - b.x) < 0.01 for a, b in pairs)
    assert pairs[-1][0].x_dot == 0.0
    assert abs(pairs[-1][1].x_dot) < 0.01
    held = [(ours.step(1.0), theirs.step(1.0)) for _ in range(50)]
    assert held[-1][0].x == held[0][0].x
    assert abs(held[-1][1].x - held[0][1].x) < 0.01


def test_a_simulated_cart_sticks_only_at_its_friction():
    with pytest.raises(
        UprightError, match=r"static_friction is 3\.0; in MuJoCo it must be 0 or 2\.0"
    ):
        Mujoco().plant(Parameters(cart_friction=2.0, static_friction=3.0))


@pytest.mark.parametrize("pushes", PUSHES)
def test_a_tilted_track_is_the_same_in_mujoco(pushes):
    angle = math.radians(5)
    tilted = SMOOTH._replace(gravity=9.8 * math.cos(angle), gravity_along=9.8 * math.sin(angle))
    assert error(Mujoco(0.002).plant(tilted), tilted, pushes) < 1e-8
