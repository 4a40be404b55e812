"""Custom plants, named module:name: they are balanced, checked, and their errors are their own."""

import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from helpers import ROOT, forget, make_context

from upright.commands import run
from upright.core.parameters import Parameters, State
from upright.errors import PlantError, UprightError
from upright.plants import PLANTS, describe_plant, restore_plant
from upright.plants.custom import CustomPlant
from upright.plants.equations import equations
from upright.policies.files import load_policy, save_policy
from upright.reports.learning import learn
from upright.studies.case import make_case
from upright.studies.executors import local_executor
from upright.studies.playing import play
from upright.studies.run import make_run
from upright.studies.store import Store
from upright.studies.study import stored, study
from upright.support.exit_status import AGENT_FAILED, BAD_USE

sys.path.insert(0, str(ROOT))

from examples.own_plant import SlowMotor, compiled_motor

PLAIN, COMPILED = "examples.own_plant:SlowMotor", "examples.own_plant:compiled_motor"
UPRIGHT = State(0.0, 0.0, 0.0, 0.0)

BODY = """
import upright

class Body:
    def __init__(self, parameters):
        self.inner = upright.equations(parameters)
        self.steps = 0

    def reset(self, state):
        return self.inner.reset(state)

    def step(self, force):
        self.steps += 1
        return self.inner.step(force)
"""
COMPILED_BODY = """
from typing import NamedTuple
import numpy as np
import upright

class Body(NamedTuple):
    inner: object
    steps: np.ndarray

    @upright.compiled
    def reset(self, state):
        return self.inner.reset(state)

    @upright.compiled
    def step(self, force):
        self.steps[0] += 1
        return self.inner.step(force)

    @upright.compiled
    def has_fallen(self, state):
        return self.inner.has_fallen(state)

    def close(self):
        pass

def make(parameters):
    return Body(upright.equations(parameters), np.zeros(1))
"""


def first_run(plant, agent="random-search", **task):
    task = {"steps": 200, "trials": 50} | task
    return make_run(make_case(agent, plant=plant, **task), 0, 0)[1]


# ------------------------------------------------------------------------------ it is balanced


@pytest.mark.slow
def test_plain_and_compiled_plants_have_the_same_trials():
    plain, fast = first_run(SlowMotor), first_run(compiled_motor)
    assert plain.lengths.tolist() == fast.lengths.tolist()
    assert plain.success
    assert plain.lengths.tolist() != first_run("equations").lengths.tolist()


def test_a_class_is_known_by_its_path():
    case = make_case("random-search", plant=SlowMotor)
    assert case == make_case("random-search", plant=PLAIN)
    assert case.name == f"random-search ({PLAIN})"
    assert case.plant == CustomPlant(PLAIN) == restore_plant(describe_plant(case.plant))
    assert PLANTS.summary(PLAIN).startswith("The equations of the published cart-pole, pushed by")


def test_the_parameters_of_the_task_reach_it():
    longer = first_run(PLAIN, parameters={"half_length": 1.0})
    assert longer.lengths.tolist() != first_run(PLAIN).lengths.tolist()
    plant, _ = CustomPlant(PLAIN).make(make_context())
    assert plant.has_fallen(State(0.0, 0.0, 0.3, 0.0))
    wide = CustomPlant(PLAIN).new(Parameters(angle_limit=0.4))
    assert not wide.has_fallen(State(0.0, 0.0, 0.3, 0.0))


def test_it_may_say_itself_when_it_has_fallen_and_is_closed(write):
    lasting = BODY + "    def has_fallen(self, state): return self.steps == 7\n"
    name = write(lasting + "    def close(self): __import__('pathlib').Path('closed').touch()\n")
    result = first_run(f"{name}:Body", trials=1)
    assert result.lengths.tolist() == [7]
    assert Path("closed").exists()


def test_a_learned_policy_plays_on_it(tmp_path):
    policy, result = learn("random-search", plant=SlowMotor, steps=200)
    assert result.success
    assert policy.plant == {"name": PLAIN, "plant_name": PLAIN}
    save_policy(tmp_path / "policy.npz", policy)
    assert load_policy(tmp_path / "policy.npz").plant == policy.plant
    assert play(policy, 1, plant=PLAIN, start="zero", steps=20)[0].balanced


def test_states_may_be_any_four_numbers(write):
    """Compiled agents are given floats in any case: their machine code would misread others."""
    name = write(BODY.replace("return self.inner.step(force)", "return [0, 0, 0, 0]"))
    plant = CustomPlant(f"{name}:Body").new(Parameters())
    state = plant.step(10.0)
    assert type(state) is State
    assert {type(part) for part in state} == {float}


def test_plain_plants_have_processes_and_compiled_ones_threads():
    kinds = {PLAIN: ProcessPoolExecutor, COMPILED: ThreadPoolExecutor}
    for plant, kind in kinds.items():
        with local_executor([make_case("random-search", plant=plant)]) as workers:
            assert type(workers) is kind


@pytest.mark.slow
def test_runs_in_other_processes_are_the_same(tmp_path):
    case = make_case("random-search", plant=PLAIN, steps=200, trials=50)
    results = study([case], 2)[case]
    again = [make_run(case, 0, number)[1] for number in range(2)]
    assert [r.lengths.tolist() for r in results] == [r.lengths.tolist() for r in again]


@pytest.mark.slow
def test_compiled_loops_are_not_confused(write):
    """Two plants of one form: the second one is not run with the first one's machine code."""
    first = write(COMPILED_BODY)
    second = write(COMPILED_BODY.replace("self.inner.step(force)", "self.inner.step(-force)"))
    lengths = [first_run(f"{name}:make").lengths.tolist() for name in (first, second)]
    assert lengths[0] == first_run("equations").lengths.tolist() != lengths[1]


# ------------------------------------------------------------------------------ stores and keys


def test_an_edit_changes_the_key_and_stored_runs_stay_readable(write, tmp_path, capsys):
    name = write(BODY)
    case = make_case("random-search", plant=f"{name}:Body", steps=100)
    with Store(tmp_path / "runs.sqlite") as store:
        store.add(case.key, 0, make_run(case, 0, 0)[1])
    forget(name)
    write(BODY.replace("+= 1", "+= 2"), name)
    assert make_case("random-search", plant=f"{name}:Body", steps=100).key != case.key
    (tmp_path / f"{name}.py").unlink()
    forget(name)
    assert stored(tmp_path / "runs.sqlite")[0][0] == case
    assert run(["show", str(tmp_path / "runs.sqlite")]) == 0
    assert f"({name}:Body)" in capsys.readouterr().out


# ------------------------------------------------------------------------------ what is refused


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("class Body: pass", "it must be callable with the parameters alone: too many"),
        (
            "class Body:\n def __init__(self, p): pass\n def reset(self, state): return state",
            r"it lacks step\(force\); a plant has the methods reset\(state\), step\(force\)",
        ),
        (BODY.replace("step(self, force)", "step(self)"), r"step\(self\) must be step\(self, for"),
        (BODY.replace("self.steps = 0", "self.x = self.y"), "it cannot be created: AttributeErr"),
        ("class Body:\n def __new__(cls, p): return cls", "it returned the class Body; it must"),
        ("Body = nothing", "its module cannot be imported: NameError: name 'nothing'"),
        (
            COMPILED_BODY.replace("def close(self)", "def end(self)") + "Body_ = make",
            r"it lacks close\(\); a compiled plant has the methods reset.*has_fallen.*close",
        ),
        (
            COMPILED_BODY.replace("self.inner.step(force)", "(0.0, 0.0, 0.0, 0.0)"),
            r"step returned \(0.0, 0.0, 0.0, 0.0\), of type tuple; it must be upright.State",
        ),
        (COMPILED_BODY.replace("+= 1", "+= 'a'"), "step cannot be compiled: "),
    ],
)
def test_what_is_no_plant_is_refused(text, message, write):
    name = write(text)
    path = f"{name}:make" if "def make" in text else f"{name}:Body"
    with pytest.raises(PlantError, match=f"plant is '{path}'; {message}"):
        make_case("random-search", plant=path)


STATE = "it must return the state: x, x_dot, theta and theta_dot, four finite numbers"
FAULTS = {
    "return None": (
        f"step returned None in run 2, trial 1, step 1; {STATE}; did it forget to return a value?"
    ),
    "return [0.0] * 3": f"step returned [0.0, 0.0, 0.0] in run 2, trial 1, step 1; {STATE}",
    "return [float('nan')] * 4": (
        f"step returned [nan, nan, nan, nan] in run 2, trial 1, step 1; {STATE}"
    ),
    "return 'upright'": f"step returned 'upright' in run 2, trial 1, step 1; {STATE}",
    "return self.inner.step(force / (self.steps - 3))": (
        "step failed in run 2, trial 1, step 3: ZeroDivisionError: float division by zero"
    ),
}


@pytest.mark.parametrize("code", FAULTS)
def test_errors_of_a_plant_say_where(code, write):
    path = f"{write(BODY.replace('return self.inner.step(force)', code))}:Body"
    with pytest.raises(PlantError) as caught:
        make_run(make_case("random-search", plant=path), 0, 2)
    first, *traceback = str(caught.value).splitlines()
    assert first == f"plant is '{path}'; {FAULTS[code]}"
    assert bool(traceback) == ("ZeroDivision" in first)


@pytest.mark.parametrize("said", ["None", "0.0", "'no'"])
def test_a_fall_is_true_or_false(said, write):
    path = f"{write(BODY + f'    def has_fallen(self, state): return {said}')}:Body"
    with pytest.raises(PlantError, match=r"has_fallen returned .* it must return True or False"):
        first_run(path)


@pytest.mark.slow
def test_an_error_of_a_compiled_plant_names_the_trial(write):
    late = "self.steps[0] += 1\n        if self.steps[0] > 40: raise ValueError('worn out')"
    path = f"{write(COMPILED_BODY.replace('self.steps[0] += 1', late))}:make"
    with pytest.raises(PlantError, match=r"it failed in run 0, trial [2-9]: ValueError: worn"):
        first_run(path)


def test_an_error_of_the_agent_stays_the_agents(write):
    name = write(
        BODY
        + "class Agent:\n"
        + "    def __init__(self, rng): pass\n"
        + "    def act(self, observation, rng): return 7\n"
        + "    def begin_trial(self, rng): pass\n"
        + "    def learn(self, before, action, after, fallen): pass\n"
        + "    def end_trial(self, fallen): pass\n"
    )
    with pytest.raises(UprightError, match=f"agent is '{name}:Agent'; act returned 7"):
        first_run(f"{name}:Body", f"{name}:Agent")


@pytest.mark.parametrize(
    ("plant", "message"),
    [
        ("nowhere_42:Body", "plant is 'nowhere_42:Body'; there is no module 'nowhere_42' in this"),
        ("examples.own_plant:SlowMoter", "no class or function 'SlowMoter' .*did you mean 'SlowM"),
        (
            "examples/own_plant.py",
            "plant is 'examples/own_plant.py'; write 'examples.own_plant:NAM",
        ),
        (lambda parameters: None, "it must be defined at the top level of a module, a script"),
        (SlowMotor(Parameters()), "plant is <.*SlowMotor.*>; it must be one of equations, mujoco"),
        (equations(), "it must be one of equations, mujoco, gazebo, ros2, or its settings, or a"),
    ],
)
def test_other_things_are_refused(plant, message, monkeypatch):
    monkeypatch.chdir(ROOT)
    with pytest.raises(UprightError, match=message):
        make_case("random-search", plant=plant)


# ------------------------------------------------------------------------------ commands


@pytest.mark.slow
def test_commands_take_a_custom_plant(capsys):
    line = ["learn", "random-search", "--plant", COMPILED, "--steps", "100"]
    assert run([*line, "--quiet"]) == 0
    table = ["table", "--plant", COMPILED, "--agents", "random-search", "--noises", "none"]
    assert run([*table, "--runs", "2", "--steps", "100"]) == 0
    assert f"random-search ({COMPILED})" in capsys.readouterr().out
    assert run(["plants", PLAIN]) == 0
    assert capsys.readouterr().out.startswith(f"{PLAIN}: The equations of the published cart-pole")
    assert run([*line, "--plant-set", "plant_name=a:b"]) == BAD_USE
    assert "it has no settings that --plant-set could change" in capsys.readouterr().err


def test_an_error_has_an_exit_status_of_its_own(write, capsys):
    name = write(BODY.replace("self.steps += 1", "self.steps += one"))
    assert run(["learn", "random-search", "--plant", f"{name}:Body"]) == AGENT_FAILED
    error = capsys.readouterr().err
    assert f"plant is '{name}:Body'; step failed in run 0, trial 1, step 1: NameError" in error
    assert f'{name}.py", line ' in error
    assert "/src/upright/" not in error


def test_reset_returns_where_it_is_put():
    plant = CustomPlant(PLAIN).new(Parameters())
    state = State(0.1, -0.2, 0.03, 0.4)
    assert plant.reset(state) == state
    assert np.isfinite(plant.step(10.0)).all()
    assert plant.reset(UPRIGHT) == UPRIGHT
