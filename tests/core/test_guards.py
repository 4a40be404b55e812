import importlib
import pkgutil
from typing import get_type_hints

import numpy as np
import pytest
from helpers import UPRIGHT, make_context, make_task

import upright
from upright.agents import AGENTS
from upright.agents.parts.policy_form import Layer, Network, Table
from upright.core.cartpole import step
from upright.core.compiled import Compiled
from upright.core.guards import REMEMBERED, once, require_array
from upright.core.loops import compiled_run
from upright.core.many import step_many, step_part
from upright.core.parameters import Parameters, State
from upright.core.rig import (
    acting_force,
    apply_changes,
    begin_episode,
    draw_parameters,
    first_measurement,
    measurement,
    parameters_of,
)
from upright.core.task import TaskSpec
from upright.environments.batch import (
    Outcome,
    Stream,
    copy_part,
    list_ended,
    reset_batch,
    step_batch,
)
from upright.environments.cartpole_env import advance
from upright.environments.varying import begin_plant, make_plants, plant_of
from upright.environments.vector_env import CartPoleVectorEnv
from upright.errors import UprightError
from upright.plants.equations import EquationsSettings, equations
from upright.policies.form_player import make_memory

P = Parameters()
LANES = 6


def numbers(*shape):
    return np.zeros(shape)


@pytest.mark.parametrize(
    ("value", "shape"),
    [
        ([0.0] * 3, (3,)),
        (numbers(3), (4,)),
        (numbers(3), (3, 1)),
        (numbers(3, 4), (None, 3)),
        (np.zeros(3, np.float32), (3,)),
        (np.zeros(3, np.int64), (3,)),
        (np.broadcast_to(0.0, 3), (3,)),
        (None, (3,)),
    ],
)
def test_another_array_is_refused(value, shape):
    with pytest.raises(UprightError, match=r"^it is .*; it must be a writable array of float64"):
        require_array("it", value, np.float64, *shape)


def test_an_array_of_the_right_size_is_taken():
    require_array("it", numbers(3, 4), np.float64, None, 4)
    require_array("it", np.broadcast_to(0.0, 3), np.float64, 3, written=False)
    require_array("it", np.zeros(3, np.int8), None, 3)


def test_objects_are_checked_once():
    asked = []
    check = once(asked.append)
    things = [object() for _ in range(REMEMBERED)]
    for thing in things * 2:
        check(thing)
    assert asked == things


# ------------------------------------------------------------------------ what is called wrongly


@pytest.fixture(scope="module")
def good():
    env = CartPoleVectorEnv(LANES, condition="delay=2,encoder=100,at-100.half_length=1.0")
    env.reset(seed=0)
    return env


def outcome(lanes, **changed):
    flags = np.zeros((2, lanes), np.bool_)
    whole = Outcome(
        numbers(4, lanes), numbers(lanes), *flags, numbers(4, 0), numbers(4, 0), numbers(4, 0)
    )
    return whole._replace(**changed)


ACTIONS = np.zeros(LANES, np.int64)
"""An action for each lane."""
RNG = np.random.default_rng(0)


def test_step_many_takes_no_arrays_of_different_lengths():
    for states, forces in (
        (numbers(4, 3), numbers(5)),
        (numbers(4, 5), numbers(3)),
        (numbers(3, 5), numbers(5)),
        (numbers(5, 4), numbers(5)),
        (numbers(20), numbers(5)),
        (numbers(4, 5, 1), numbers(5)),
        (numbers(4, 5), numbers(5, 1)),
        (np.zeros((4, 5), np.float32), numbers(5)),
        (np.broadcast_to(0.0, (4, 5)), numbers(5)),
        ([[0.0] * 5] * 4, numbers(5)),
        (numbers(4, 5), [0.0] * 5),
        (numbers(4, 5), 0.0),
    ):
        with pytest.raises(UprightError, match=r"^(states|forces) is "):
            step_many(P, states, forces)
    with pytest.raises(IndexError):
        step_part(P, tuple(numbers(4, 3)), numbers(5))


def test_what_step_many_takes_otherwise():
    states = numbers(4, 6)[:, ::2]
    step_many(P, states, np.broadcast_to(np.float32(10.0), 3))
    assert np.array_equal(states.T, [step(P, UPRIGHT, 10.0)] * 3)


WRONG = {
    "lane of a rig": lambda e: begin_episode(e._batch.rig, RNG, LANES),
    "lane of a rig below 0": lambda e: begin_episode(e._batch.rig, RNG, -1),
    "lane of a change": lambda e: apply_changes(e._batch.rig, 0.0, LANES),
    "lane of a force": lambda e: acting_force(e._batch.rig, e.rules.noise, 1.0, RNG, LANES),
    "lane of a measurement": lambda e: measurement(e._batch.rig, e.rules.noise, UPRIGHT, RNG, 99),
    "lane of a first measurement": lambda e: first_measurement(
        e._batch.rig, e.rules.noise, UPRIGHT, RNG, LANES
    ),
    "rig with a short memory": lambda e: acting_force(
        e._batch.rig._replace(memory=numbers(10, LANES)), e.rules.noise, 1.0, RNG, 0
    ),
    "rig with a long delay": lambda e: acting_force(
        e._batch.rig._replace(delay=10**6), e.rules.noise, 1.0, RNG, 0
    ),
    "rig with a delay below 0": lambda e: acting_force(
        e._batch.rig._replace(delay=-2, memory=numbers(8, LANES)), e.rules.noise, 1.0, RNG, 0
    ),
    "rig with a wrong parameter": lambda e: begin_episode(
        e._batch.rig._replace(changes=np.array([[0.0, 12.0, 1.0]])), RNG, 0
    ),
    "rig with a NaN for a parameter": lambda e: begin_episode(
        e._batch.rig._replace(changes=np.array([[0.0, np.nan, 1.0]])), RNG, 0
    ),
    "parameters": lambda e: parameters_of(numbers(11, 2), 0),
    "lane of parameters": lambda e: parameters_of(numbers(12, 2), 2),
    "lane of plants": lambda e: plant_of(P, e._batch.plants, LANES),
    "parameter drawn": lambda e: draw_parameters(
        np.array([[-1.0, 1.0, 2.0, 0.0]]), numbers(12, 1), 0, RNG
    ),
    "draws": lambda e: draw_parameters(numbers(3, 3), numbers(12, 1), 0, RNG),
    "lane that begins": lambda e: begin_plant(P, e._batch.rig, e._batch.plants, RNG, LANES),
    "plants of fewer lanes": lambda e: begin_plant(
        P, e._batch.rig, make_plants(P, None, numbers(0, 4), 2), RNG, 0
    ),
    "advance with several lanes": lambda e: advance(
        e.rules, e._batch.rig, make_plants(P, None, numbers(0, 4), 1), UPRIGHT, 1.0, RNG
    ),
    "batch of fewer lanes": lambda e: step_batch(
        e.rules, e._batch._replace(states=numbers(4, 2)), ACTIONS, outcome(LANES)
    ),
    "batch without scratch space": lambda e: step_batch(
        e.rules, e._batch._replace(forces=numbers(2)), ACTIONS, outcome(LANES)
    ),
    "batch with another rig": lambda e: step_batch(
        e.rules, e._batch._replace(rig=e._batch.rig._replace(memory=numbers(12, 2))), ACTIONS, None
    ),
    "too few actions": lambda e: step_batch(e.rules, e._batch, ACTIONS[:2], outcome(LANES)),
    "actions of two numbers": lambda e: step_batch(
        e.rules, e._batch, np.zeros((LANES, 2), np.float32), outcome(LANES)
    ),
    "outcome of fewer lanes": lambda e: step_batch(e.rules, e._batch, ACTIONS, outcome(2)),
    "states of fewer lanes": lambda e: step_batch(
        e.rules, e._batch, ACTIONS, outcome(LANES, states=numbers(4, 2))
    ),
    "no place for final observations": lambda e: step_batch(
        e.rules._replace(autoreset=1), e._batch, ACTIONS, outcome(LANES)
    ),
    "mask of more lanes": lambda e: reset_batch(
        e.rules, e._batch, np.ones(9, np.bool_), True, numbers(4, LANES)
    ),
    "observations of fewer lanes": lambda e: reset_batch(
        e.rules, e._batch, np.ones(LANES, np.bool_), True, numbers(4, 2)
    ),
    "stream without words": lambda e: Stream(*[np.zeros(0, np.uint64)] * 4, 0).random(),
    "stream beyond": lambda e: Stream(*np.zeros((4, 3), np.uint64), 3).random(),
    "memory of equations": lambda e: equations()._replace(memory=numbers(3)).step(1.0),
    "memory of equations at a reset": lambda e: (
        equations()._replace(memory=numbers(3)).reset(UPRIGHT)
    ),
    "array as a state": lambda e: equations().reset(numbers(4)),
    "short tuple as a state": lambda e: step(P, (0.0, 0.0), 1.0),
    "text as a force": lambda e: step(P, UPRIGHT, "1.0"),
    "array for a table": lambda e: TABLE.push_probability(numbers(1)),
    "array for a network": lambda e: NETWORK.remember(numbers(1), True),
    "array as an observation": lambda e: (
        AGENTS.settings("ndp")["default"].agent(RNG).act(numbers(2), RNG)
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_python_cannot_have_arrays_read_or_written_beyond_their_ends(case, good):
    with pytest.raises(UprightError, match=r"^[^\n]*$"):
        WRONG[case](good)


def test_functions_for_compiled_code_alone_are_plain_in_python(good):
    with pytest.raises(IndexError):
        list_ended(good._batch._replace(ended=np.ones(2, np.bool_), due=numbers(1)), 0, 6)
    with pytest.raises(IndexError):
        copy_part(numbers(4, 6), numbers(3, 2), 0, 6)


def test_arguments_that_fit_are_taken(good):
    before = good._batch.states.copy()
    assert step_batch(good.rules, good._batch, ACTIONS, outcome(LANES)) == 0
    assert not np.array_equal(good._batch.states, before)
    assert np.isfinite(acting_force(good._batch.rig, good.rules.noise, 1.0, RNG, LANES - 1))


def run(**changed):
    task = make_task(steps=5, trials=3, condition=changed.pop("condition", "nominal"))
    if "rig" in changed:
        task = task._replace(rig=task.rig._replace(**changed.pop("rig")))
    agent = AGENTS.settings("random-search")["default"].agent(RNG)
    whole = {"lengths": np.zeros(3, np.int64), "stop": np.zeros(1, np.bool_)} | changed
    compiled_run(agent, equations(), task, RNG, *whole.values())


@pytest.mark.parametrize(
    "changed",
    [
        {"lengths": np.zeros(2, np.int64)},
        {"lengths": np.zeros(3)},
        {"stop": np.zeros(0, np.bool_)},
        {"condition": "delay=2", "rig": {"memory": numbers(3, 1)}},
        {"condition": "delay=2", "rig": {"delay": 7}},
    ],
)
def test_a_run_needs_arrays_of_its_size(changed):
    with pytest.raises(UprightError, match=r"^[^\n]*$"):
        run(**changed)


def test_changing_equations_need_all_their_parameters():
    spec = TaskSpec(condition="at-100.half_length=1.0")
    plant, _ = EquationsSettings().make(make_context(spec=spec))
    plant.step(1.0)
    with pytest.raises(UprightError, match="present parameters"):
        plant._replace(present=numbers(5, 1)).step(1.0)


TABLE = make_memory(Table(((0.0,), (), (), (0.0, 1.0)), (0.1,) * 6))
NETWORK = make_memory(
    Network((Layer(numbers(9, 3), "tanh"), Layer(numbers(3, 1), "sigmoid")), past=1)
)


@pytest.mark.parametrize(
    "player",
    [
        TABLE._replace(probabilities=numbers(5)),
        TABLE._replace(parts=(2, 1, 1, 4)),
        TABLE._replace(edges=TABLE.edges[:3], parts=TABLE.parts[:3]),
        NETWORK._replace(weights=numbers(29)),
        NETWORK._replace(widths=np.array([9, 4, 1])),
        NETWORK._replace(widths=np.array([9, 3])),
        NETWORK._replace(widths=np.array([9, -3, 1]), weights=numbers(0)),
        NETWORK._replace(history=numbers(3)),
        NETWORK._replace(history=numbers(10)),
        NETWORK._replace(scales=numbers(3)),
        NETWORK._replace(outputs=numbers(2)),
    ],
)
def test_a_player_whose_numbers_do_not_fit_is_refused(player):
    with pytest.raises(UprightError, match=r"^[^\n]*$"):
        player.push_probability(UPRIGHT)


def test_players_whose_numbers_fit_play():
    assert TABLE.push_probability(UPRIGHT) == 0.1
    assert NETWORK.push_probability(UPRIGHT) == 0.5


# ------------------------------------------------------------------------------ all are guarded

UNASKED = ("__main__", ".nodes", ".commands", ".starters")
"""Modules that are programs, or written for users to change."""
PLAIN = {Parameters, State, float, int, bool, tuple[float, float], np.random.Generator}
"""Types of arguments without arrays of unknown size."""
MADE_WHOLE = ("upright.agents.", "upright.studies.", "upright.plants.mujoco")
"""Where the methods of classes are, whose objects only their settings make."""


def called_from_python():
    """Yield names and functions of the package which Python calls compiled."""
    for info in pkgutil.walk_packages(upright.__path__, "upright."):
        if any(part in info.name for part in UNASKED):
            continue
        module = importlib.import_module(info.name)
        classes = [value for value in vars(module).values() if isinstance(value, type)]
        for value in [value for owner in (module, *classes) for value in vars(owner).values()]:
            if isinstance(value, Compiled) and value.py_func.__module__ == info.name:
                if value._outer is value.py_func:
                    continue
                yield f"{info.name}.{value.py_func.__qualname__}", value


def test_whatever_python_calls_compiled_takes_plain_numbers_or_is_guarded():
    open_ones = set()
    for name, function in called_from_python():
        is_method = "." in function.py_func.__qualname__.replace("<locals>.", "")
        if function._guard is not None or (is_method and name.startswith(MADE_WHOLE)):
            continue
        hints = get_type_hints(function.py_func)
        hints.pop("return", None)
        if not hints or not set(hints.values()) <= PLAIN:
            open_ones.add(name)
    assert open_ones <= {"upright.core.trials.trial"}
