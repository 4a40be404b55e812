import pytest
from helpers import make_context, make_task

from upright.agents import AGENTS
from upright.commands import run
from upright.core.parameters import Parameters, State
from upright.errors import UprightError
from upright.plants import PLANTS, describe_plant, restore_plant
from upright.plants.equations import equations
from upright.plants.mujoco import Mujoco
from upright.studies.case import Case, make_case
from upright.studies.run import make_run
from upright.studies.store import Store
from upright.studies.study import stored as stored_cases
from upright.studies.study import study
from upright.support.exit_status import BAD_USE

ELSEWHERE = {"ros2", "gz-sim"}
"""Plants that need a running cart or modern Gazebo: they have tests of their own."""
HERE = [
    pytest.param(name, marks=pytest.mark.gazebo if name == "gazebo" else ())
    for name in PLANTS
    if name not in ELSEWHERE
]
STATE = State(0.1, -0.2, 0.03, 0.4)
RK4 = ("--plant-set", "integrator=rk4")


@pytest.mark.parametrize("name", HERE)
def test_every_plant_keeps_the_contract(name):
    plant, task = PLANTS.default(name).make(make_context())
    assert task == make_task()
    assert plant.reset(STATE) == STATE
    first = [plant.step(10.0) for _ in range(3)]
    assert first[-1].x_dot > STATE.x_dot + 0.3
    assert not plant.has_fallen(first[0])
    assert plant.has_fallen(STATE._replace(theta=0.3))
    assert plant.reset(STATE) == STATE
    assert [plant.step(10.0) for _ in range(3)] == first
    plant.close()


def test_a_state_may_have_whole_numbers():
    plant = equations()
    plant.reset(State(0, 0, 0.1, 0))
    pushed = plant.step(5)
    plant.reset(State(0.0, 0.0, 0.1, 0.0))
    assert plant.step(5.0) == pushed


@pytest.mark.parametrize("name", PLANTS)
def test_a_plant_is_restored_from_data(name):
    settings = PLANTS.default(name)
    assert restore_plant(describe_plant(settings)) == settings
    with pytest.raises(UprightError, match="the settings 'colour' are not those of"):
        restore_plant({"name": name, "colour": 1})


def test_a_case_knows_its_plant(tmp_path):
    cases = [
        make_case("random-search", steps=200, trials=50, plant=plant)
        for plant in (PLANTS.default("equations"), Mujoco(), Mujoco(0.01, "implicit"))
    ]
    assert len({case.key for case in cases}) == 3
    assert [case.name for case in cases] == ["random-search"] + ["random-search (mujoco)"] * 2
    with Store(tmp_path / "runs.sqlite") as store:
        study(cases, 3, 0, store)
    found = stored_cases(tmp_path / "runs.sqlite")
    assert {case for case, _, _ in found} == set(cases)
    assert all(len(results) == 3 for _, _, results in found)


def test_plain_agents_balance_other_plants():
    """The loop is Python then, and gives what the compiled one gives."""
    case = make_case("random-search", steps=200, trials=50, plant=Mujoco())
    _, result = make_run(case, 0, 0)
    plain = Case(**vars(case) | {"settings": Uncompiled()})
    assert make_run(plain, 0, 0)[1].lengths.tolist() == result.lengths.tolist()


class Uncompiled:
    def agent(self, rng):
        inner = AGENTS.settings("random-search")["default"].agent(rng)
        names = ("begin_trial", "act", "learn", "end_trial")
        methods = {name: staticmethod(getattr(inner, name)) for name in names}
        return type("Plain", (), methods)()


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            "--plant jelly",
            "plant is 'jelly'; it must be one of equations, mujoco, gazebo, ros2",
        ),
        ("--plant-set physics_step=1", "physics_step is a setting of the plant mujoco: --plant"),
        ("--plant mujoco --plant-set physics_step", "it must be NAME=VALUE"),
        ("--plant mujoco --plant-set physics_step=0.03", "physics_step is 0.03"),
        ("--plant mujoco --plant-set integrator=magic", "integrator is 'magic'"),
        (
            "--plant-set integrator=magic",
            "integrator is 'magic'; it must be one of euler, semi-implicit, rk4",
        ),
    ],
)
def test_invalid_plants_are_refused(line, message, capsys):
    try:
        status = run(["learn", "random-search", *line.split()])
    except SystemExit as ended:  # of the parser, which knows the names of plants
        status = ended.code
    assert status == BAD_USE
    assert message in capsys.readouterr().err


def test_the_plants_command_explains_settings(capsys):
    assert run(["plants"]) == 0
    plants, _, _ = capsys.readouterr().out.partition("\n\n")
    assert [line.partition(":")[0] for line in plants.splitlines()] == [*PLANTS]
    assert run(["plants", "mujoco"]) == 0
    assert "physics_step: MuJoCo's time step [s]" in capsys.readouterr().out


@pytest.mark.slow
def test_a_policy_learned_on_the_equations_plays_in_mujoco(tmp_path, capsys):
    path = str(tmp_path / "policy.npz")
    assert run(["learn", "adaptive-lqr", *RK4, "--quiet", "--save", path]) == 0
    assert run(["play", path, "--plant", "mujoco", "--episodes", "3", "--steps", "60000"]) == 0
    assert "balanced in 3 of 3 trials" in capsys.readouterr().out


def test_conditions_reach_mujoco():
    case = make_case("random-search", condition="friction-100", plant=Mujoco())
    plant, _ = case.plant.make(make_context(spec=case.spec))
    assert plant.parameters.cart_friction == pytest.approx(100 * Parameters().cart_friction)
