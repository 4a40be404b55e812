import re
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from helpers import ROOT
from hypothesis import given, settings
from hypothesis import strategies as st

from upright.core.conditions import CONDITIONS, NOISES, STARTS
from upright.core.parameters import Parameters
from upright.core.task import TaskSpec
from upright.errors import UprightError
from upright.plants import PLANTS
from upright.plants.mujoco import Mujoco
from upright.studies.case import make_case
from upright.studies.task_file import PARTS, read_task, save_task, task_text
from upright.support.settings import describe_settings

CASE = make_case("random-search")


def read(text, monkeypatch, tmp_path):
    """Read a file in the present folder."""
    monkeypatch.chdir(tmp_path)
    Path("my-cart.toml").write_text(text)
    return read_task("my-cart.toml")


def test_a_file_may_say_everything(monkeypatch, tmp_path):
    text = """
        noise = "gaussian-0.1"
        start = "wide"
        condition = "delay-1"
        steps = 6_000
        trials = 50
        [parameters]
        half_length = 0.3
        force = 12
        [plant]
        name = "mujoco"
        integrator = "euler"
    """
    task = read(text, monkeypatch, tmp_path)
    assert set(task) == set(PARTS)
    case = make_case("random-search", **task)
    parameters = Parameters(half_length=0.3, force=12.0)
    assert case.spec == TaskSpec("gaussian-0.1", "wide", "delay-1", 6000, 50, parameters)
    assert case.plant == Mujoco(integrator="euler")


def test_the_file_of_the_documents_is_one(monkeypatch, tmp_path):
    (text,) = re.findall("```toml\n(.*?)```", (ROOT / "docs/protocol.md").read_text(), re.DOTALL)
    task = read(text, monkeypatch, tmp_path)
    assert task["parameters"] == {"half_length": 0.3}
    assert task["plant"] == Mujoco(integrator="implicit")


@pytest.mark.parametrize(
    ("text", "task"),
    [
        ("", {}),
        ("steps = 7", {"steps": 7}),
        ("[parameters]", {"parameters": {}}),
        ("parameters.force = 9.5", {"parameters": {"force": 9.5}}),
        ("[plant]\nintegrator = 'rk4'", {"plant": PLANTS.default("equations").__class__("rk4")}),
        ("plant = {name = 'gazebo'}", {"plant": PLANTS.default("gazebo")}),
    ],
)
def test_what_a_file_leaves_out_is_left_out(text, task, monkeypatch, tmp_path):
    assert read(text, monkeypatch, tmp_path) == task


@pytest.mark.parametrize(
    ("table", "text"),
    [
        ("a = 0.1\nb-c = 2", "a=0.1,b-c=2"),
        ("flag = true\nother = false\nrange = '1:2'", "flag,range=1:2"),
        ("at-100.force = -10", "at-100.force=-10"),
        ("", ""),
    ],
)
@pytest.mark.parametrize("part", ["noise", "condition"])
def test_a_table_of_terms_is_a_text(part, table, text, monkeypatch, tmp_path):
    seen = []
    monkeypatch.setattr(TaskSpec, "from_data", seen.append)
    assert read(f"[{part}]\n{table}", monkeypatch, tmp_path) == {part: text}
    assert seen == [{part: text}]


def test_tables_of_terms_are_what_the_texts_are(monkeypatch, tmp_path):
    text = "[noise]\ngaussian = 0.5\nactuator = '10%'\n"
    text += "[condition]\nno-velocities = true\nencoder = 1024\nat-100.force = -10\n"
    task = read(text, monkeypatch, tmp_path)
    spec = make_case("random-search", **task).spec
    assert spec.noise == "actuator=0.1,gaussian=0.5"
    assert (
        spec.condition
        == TaskSpec(condition="encoder=1024,no-velocities,at-100.force=-10").condition
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("steps = 0", "line 1, steps: steps is 0; it must be a whole number"),
        ("\nsteps = '5'", "line 2, steps: steps is '5'; it must be a whole number"),
        ("steps = 1\ntrials = 1.5", "line 2, trials: trials is 1.5"),
        ("trials = true", "line 1, trials: trials is True"),
        ("steps = 1979-05-27", "line 1, steps: steps is datetime.date"),
        ("noise = 'gausian-0.1'", "line 1, noise: noise is 'gausian-0.1'"),
        ("[noise]\nactuator = 2", "line 1, noise: noise actuator is '2'; it must be from 0 to 1"),
        ("noise = 3", "line 1, noise: noise is 3; it must be a text, or a table of terms"),
        ("[noise]\nx = []", r"line 2, noise.x: x is \[\]; it must be a number, a text, or true"),
        ("condition = ['delay-1']", "line 1, condition: condition is"),
        ("start = 'rondom'", "line 1, start: start is 'rondom'.*did you mean 'random'"),
        ("step = 1", "line 1, step: key is 'step'.*one of noise, .*plant; did you mean 'steps'"),
        ("parameters = 3", "line 1, parameters: parameters is 3"),
        ("[parameters]\n\nhalf_length = -1", "line 3, parameters.half_length: half_length is -1"),
        ("[parameters]\nforce = nan", "line 2, parameters.force: force is nan"),
        ("[parameters]\nforce = 'x'", "line 2, parameters.force: force is 'x'"),
        ("[parameters]\nforc = 1", "line 2, parameters.forc: parameter is 'forc'.*mean 'force'"),
        ("plant = 'mujoco'", r"line 1, plant: plant is 'mujoco'; it must be a table, \[plant\]"),
        ("[plant]\nname = 'mujco'", "line 2, plant.name: plant is 'mujco'.*did you mean 'mujoco'"),
        ("[plant]\nname = 1", "line 2, plant.name: plant is 1; it must be the name of a plant"),
        (
            "[plant]\nintegrator = 'x'",
            "line 2, plant.integrator: integrator is 'x'; it must be one of euler, semi",
        ),
        ("[plant]\nintegrator = 1", "line 2, plant.integrator: integrator is 1; it must be like"),
        ("[plant]\nspeed = 1", "line 2, plant.speed: setting is 'speed'; it must be one of integ"),
        (
            "[plant]\nname='gazebo'\nengine='ode'\nphysics_step=0.02",
            "line 1, plant: physics_step is 0.02; with ODE it must be at most",
        ),
        (
            "[plant]\nname='a:B'\nplant_name='c:D'",
            "line 3, plant.plant_name: plant is 'a:B'; it has",
        ),
        ("steps = \ntrials = 1", r"it is not TOML: Invalid value \(at line 1"),
        ("#" * 10**6 + "#", "it is larger than 1,000,000 bytes"),
    ],
    ids=lambda value: value[:30],
)
def test_a_wrong_file_is_refused_with_the_line_and_the_key(text, said, monkeypatch, tmp_path):
    with pytest.raises(UprightError, match=f"^task file is 'my-cart.toml'; {said}") as error:
        read(text, monkeypatch, tmp_path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "half_length = 0.3",
            "half_length is a parameter of the plant; it belongs in [parameters]",
        ),
        (
            "[plant]\nhalf_length = 0.3",
            "half_length is a parameter of the plant; it belongs in [parameters]",
        ),
        (
            "[parameters]\nengine = 'ode'",
            'engine is a setting of the plant gazebo; it belongs in [plant], with name = "gazebo"',
        ),
        (
            "[plant]\nname = 'ros2'\nintegrator = 'euler'",
            "integrator is a setting of the plant equations; it belongs in [plant], with name =",
        ),
        ("[plant]\nsteps = 3", "steps is a part of the task; it belongs above all tables"),
    ],
)
def test_a_name_in_the_wrong_table_is_answered_with_the_right_one(
    text, said, monkeypatch, tmp_path
):
    with pytest.raises(UprightError, match=re.escape(said)):
        read(text, monkeypatch, tmp_path)


PARAMETERS = st.fixed_dictionaries(
    {},
    optional={
        "gravity": st.floats(0, 1e8),
        "half_length": st.floats(1e-9, 1e8),  # a condition may double it
        "pole_friction": st.floats(0, 1e6),
        "angle_limit": st.floats(0.11, 3),
    },
)
SPECS = st.builds(
    TaskSpec,
    st.sampled_from([*NOISES, "actuator=0.1,gaussian=0.5"]),
    st.sampled_from(list(STARTS)),
    st.sampled_from([*CONDITIONS, "delay=1,encoder=1024"]),
    st.integers(1, 10**9),
    st.integers(1, 10**6),
    PARAMETERS,
)
SETTINGS = st.sampled_from([PLANTS.default(name) for name in PLANTS.built_in]) | st.builds(
    Mujoco, st.floats(1e-6, 1)
)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("task") / "my-cart.toml"


@settings(max_examples=25)
@given(spec=SPECS, plant=SETTINGS)
def test_a_task_is_read_back_as_it_was_written(spec, plant, path):
    case = replace(CASE, spec=spec, plant=plant)
    save_task(path, case)
    assert make_case(case.agent, **read_task(path)) == case


def test_a_custom_plant_is_named_once(path):
    case = replace(CASE, plant=PLANTS.default("examples.own_plant:SlowMotor"))
    save_task(path, case)
    assert tomllib.loads(path.read_text())["plant"] == {"name": "examples.own_plant:SlowMotor"}
    assert read_task(path)["plant"] == case.plant


def test_a_written_file_says_everything_with_its_meaning():
    spec = TaskSpec(noise="sensor-5", parameters={"half_length": 0.3})
    text = task_text(spec, PLANTS.default("gazebo"))
    content = tomllib.loads(text)
    assert set(content) == set(PARTS)
    assert content["parameters"] == spec.parameters._asdict()
    lines = text.splitlines()
    for name, meaning in describe_settings(Parameters).items():
        (line,) = [line for line in lines if line.startswith(f"{name} = ")]
        assert "  # " + meaning.replace("`", "") in line
        assert (" Published: 0.5." in line) == (name == "half_length")
    assert re.search('^engine = "dart" +# The physics engine: dart or ode.$', text, re.MULTILINE)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("mine.txt", "'.txt'; it must be one of .toml"),
        ("missing/mine.toml", "its folder does not exist"),
    ],
)
def test_a_task_is_not_written_where_it_cannot_be(name, said, tmp_path):
    with pytest.raises(UprightError, match=re.escape(said)):
        save_task(tmp_path / name, CASE)
    assert not list(tmp_path.iterdir())


def test_only_cases_have_tasks_to_write(tmp_path):
    with pytest.raises(
        UprightError, match=r"case is TaskSpec.*; it must be what make_case returns"
    ):
        save_task(tmp_path / "mine.toml", TaskSpec())
