"""Numbers that no one would give, wherever a number can be given: refused, or harmless."""

import math
import re
import warnings
from contextlib import closing
from dataclasses import fields

import numpy as np
import pytest
from helpers import make_context

from upright.agents import AGENTS
from upright.commands import run
from upright.core.cartpole import INTEGRATORS
from upright.core.conditions import CONDITION_TERMS, NOISE_TERMS
from upright.core.parameters import Parameters
from upright.core.task import TaskSpec
from upright.core.terms import RANGE, VARIABLE
from upright.errors import AgentWarning, UprightError
from upright.plants import PLANTS
from upright.plants.equations import equations
from upright.policies.divergence import diverged_array
from upright.policies.files import export_policy, save_policy
from upright.studies.case import make_case
from upright.studies.learned import learned_policy
from upright.studies.run import make_run
from upright.support.exit_status import BAD_USE
from upright.support.settings import change_settings, with_values

TINY = (5e-324, 1e-300, 1e-12)
HUGE = (1e300, math.inf, -math.inf, math.nan, 10**20, -(10**20), 2**63, 10**5000)
"""Beyond the range of every number."""
NUMBERS = (0, -0.0, *TINY, 1e-9, 1e-3, 1, 1000, 10**9, 1e9, *HUGE)
NAMED = {
    f"{name}-{label}": (registry, name, label)
    for registry in (AGENTS, PLANTS)
    for name in registry
    for label in registry.settings(name)
}


def attempt(make, *arguments, **named):
    """Return what a function returns, and the line with which it refuses: one of the two."""
    try:
        return make(*arguments, **named), ""
    except UprightError as error:
        return None, str(error)


def refusal(settings, field, number):
    """Return the line with which settings refuse a number in place of a field's."""
    value = (number,) if isinstance(getattr(settings, field), tuple) else number
    return attempt(with_values, settings, {field: value})[1]


def numeric(settings):
    """Return the names of the settings that hold numbers, and not the answer to a question."""
    values = {field.name: getattr(settings, field.name) for field in fields(settings)}
    return [name for name, value in values.items() if not isinstance(value, (bool, str))]


@pytest.mark.parametrize(("registry", "name", "label"), NAMED.values(), ids=NAMED)
def test_every_setting_has_two_ends(registry, name, label):
    settings = registry.settings(name)[label]
    for field in numeric(settings):
        for number in HUGE:
            assert re.fullmatch(r".{10,500}", refusal(settings, field, number)), (field, number)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*learning diverged:upright.AgentWarning")
@pytest.mark.parametrize("name", AGENTS)
def test_an_agent_makes_a_run_with_every_number_that_its_settings_take(name):
    for label, settings in AGENTS.settings(name).items():
        for field in numeric(settings):
            if isinstance(getattr(settings, field), tuple):
                continue  # another number of edges is compiled anew
            for number in NUMBERS:
                if not refusal(settings, field, number):
                    case = make_case(name, label, settings={field: number}, steps=10, trials=2)
                    _, result = make_run(case, 0, 0)
                    assert 1 <= result.trials <= 2
                    assert result.lengths.max() <= 10


@pytest.mark.parametrize("name", Parameters._fields)
def test_a_plant_falls_before_its_state_is_nothing(name):
    """A state that is not finite must count as a fall: it is neither learned nor stored."""
    taken = 0
    for number in NUMBERS:
        spec, refused = attempt(TaskSpec, parameters={name: number}, start="zero")
        if refused:
            assert f"{name} is " in refused
            continue
        taken += 1
        for integrator in INTEGRATORS:
            plant = equations(spec.parameters, integrator)
            state = plant.reset(spec.task().start)
            for step in range(60):
                state = plant.step(math.copysign(spec.parameters.force, step % 3 - 1))
                assert plant.has_fallen(state) or np.isfinite([state.x, state.theta]).all()
                if plant.has_fallen(state):
                    break
    assert 0 < taken < len(NUMBERS)


@pytest.mark.parametrize("kind", ["noise", "condition"])
def test_every_term_is_refused_or_makes_a_task(kind):
    terms = {"noise": NOISE_TERMS, "condition": CONDITION_TERMS}[kind]
    for form, term in terms.items():
        names = {form.replace("STEP", "2").replace("PARAMETER", name) for name in VARIABLE}
        beside = ",gust=5" if form.startswith("gust-") else ""
        for name, number in ((name, number) for name in names for number in NUMBERS[:-1]):
            sizes = [f"{number}:{number}", f"{number}:1:log", f"0.1:{number}"]
            for size in sizes if term.unit == RANGE else [number] if term.unit else []:
                spec, refused = attempt(TaskSpec, **{kind: f"{name}={size}{beside}"})
                assert "\n" not in refused
                if refused:
                    continue
                task = spec.task()
                arrays = [task.parameters, task.noise, *(task.rig or ())]
                numbers = np.concatenate([np.ravel(array) for array in arrays])
                assert np.isfinite(numbers[numbers != math.inf]).all()  # inf is no saturation


@pytest.mark.parametrize("condition", ["each-run.half_length=1e-12:1e9:log", "lag=5e-324"])
@pytest.mark.parametrize("noise", ["none", "gaussian=10000,others=100%"])
def test_runs_of_extreme_tasks_end_as_others_do(condition, noise):
    case = make_case("random-search", condition=condition, noise=noise, steps=60, trials=3)
    for number in range(5):
        _, result = make_run(case, 0, number)
        assert all(1 <= length <= 60 for length in result.lengths)


def test_a_varied_plant_cannot_leave_the_range_in_one_of_its_runs():
    for value in (6e8, 1.5e-12):
        with pytest.raises(UprightError, match=r"^pole_mass is "):
            TaskSpec(condition="varied-plant", parameters={"pole_mass": value})


@pytest.mark.parametrize("number", [1e-300, 1e-7, 1e20, math.nan])
def test_a_simulator_makes_no_endless_number_of_steps(number):
    for name in ("mujoco", "gazebo"):
        with pytest.raises(
            UprightError, match=r"^physics_step is .* at least 1e-06 and at most 10"
        ):
            change_settings(PLANTS.default(name), {"physics_step": str(number)})


def test_a_simulator_makes_no_more_steps_than_a_run_can_wait_for():
    pytest.importorskip("mujoco")
    plant = change_settings(PLANTS.default("mujoco"), {"physics_step": "1e-6"})
    spec = TaskSpec(parameters={"time_step": 1.0})
    with pytest.raises(UprightError, match=r"pushes is 1000000; .* at most 100,000$"):
        plant.make(make_context(spec=spec))
    with closing(plant.make(make_context())[0]):
        pass


@pytest.mark.parametrize("value", ["1e20", "1e400", "nan", "inf", "9" * 5000, "-1", "1e-15"])
@pytest.mark.parametrize(
    "line",
    [
        "learn random-search --quiet --steps={}",
        "learn random-search --quiet --trials={}",
        "learn random-search --quiet --seed={}",
        "learn random-search --quiet --run={}",
        "learn random-search --quiet --parameter force={}",
        "learn random-search --quiet --set x_scale={}",
        "table --agents random-search --runs={}",
        "tune random-search --candidates={}",
        "tune random-search --validation-runs={}",
    ],
)
def test_options_refuse_numbers_out_of_range_in_one_line(
    line, value, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    try:
        status = run(line.format(value).split())
    except SystemExit as ended:  # of argparse
        status = ended.code
    assert status == BAD_USE
    assert capsys.readouterr().err.count("\n") == 1
    assert not list(tmp_path.iterdir())


# ------------------------------------------------------------------------------ diverging


@pytest.fixture(scope="module")
def diverged():
    case = make_case("ndp", settings={"learning_rate": 1000.0}, steps=60, trials=3)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        agent, result = make_run(case, 0, 0)
    return case, agent, result, [str(each.message) for each in told]


def test_a_run_whose_learning_diverged_says_so(diverged):
    _, agent, result, told = diverged
    assert diverged_array("ndp", agent) == "action.layer_1"
    assert not diverged_array("custom:Agent", agent), "which may hold what it likes"
    assert result.trials == 3
    assert told == [
        "agent is 'ndp'; learning diverged with the settings default, learning_rate=1000.0: its "
        "numbers are no longer finite"
    ]


@pytest.mark.parametrize("write", [save_policy, export_policy])
@pytest.mark.parametrize("ending", [".npz", ".json", ".h"])
def test_a_policy_that_diverged_is_not_written(diverged, write, ending, tmp_path):
    case, agent, result, _ = diverged
    policy = learned_policy(case, 0, 0, agent, result)
    with pytest.raises(UprightError, match="'ndp'; it is not written, because learning diverged"):
        write(tmp_path / f"policy{ending}", policy)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_commands_say_once_that_learning_diverged(diverged, capsys, tmp_path):
    options = ["--steps", "60", "--trials", "3", "--set", "learning_rate=1000"]
    table = ["table", "--agents", "ndp", "--noises", "none,sensor-5", "--runs", "3"]
    assert run([*table, *options]) == 0
    told = capsys.readouterr().err
    assert told.count("upright: warning: agent is 'ndp'; learning diverged with") == 1
    save = ["--quiet", "--save", str(tmp_path / "policy.npz")]
    assert run(["learn", "ndp", *save, *options]) == BAD_USE
    assert "error: policy is one of 'ndp'; it is not written" in capsys.readouterr().err


@pytest.mark.slow
def test_candidates_may_diverge_without_a_word(diverged, tmp_path):
    pytest.importorskip("optuna")
    from upright.studies.search_space import search_space
    from upright.studies.tuning import Search, search, validate

    case = make_case("ndp", settings={"learning_rate": 1000.0}, steps=60, trials=3)
    plan = Search((case,), tuple(search_space(case.settings, ["learning_rate=900:1000"])), 5, 0)
    found = search(plan, 2, tmp_path / "tune")  # warnings are errors here
    with pytest.warns(AgentWarning, match="learning diverged"):
        validate(plan, found.settings, 2)
