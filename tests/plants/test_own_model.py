"""Models of the user's own in MuJoCo: what is found, what is refused, and that agents learn."""

import math
import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from helpers import PUSHES, ROOT, make_context, trajectory

from upright.agents import AGENTS
from upright.commands import run
from upright.core.parameters import Parameters, State
from upright.core.task import TaskSpec
from upright.errors import UprightError
from upright.plants import describe_plant, own_model, restore_plant, urdf
from upright.plants.mujoco import Mujoco
from upright.studies.case import Case, make_case
from upright.studies.run import make_run
from upright.studies.store import Store
from upright.studies.study import stored, study
from upright.support.exit_status import BAD_USE

MODELS = ROOT / "tests" / "data" / "models"
FOUND = {  # file: names of the joints, angle of upright [°], sign, push [N], position limit [m]
    "slider.urdf": ("rail_to_cart", "cart_to_pole", 0.0, 1, 10.0, 2.4),
    "motor.xml": ("slider", "hinge", -0.0955, 1, 300.0, 1.0),
    "classes.xml": ("slider", "hinge_1", 180.0, -1, 10.0, 1.8),
    "sideways.urdf": ("slider_to_cart", "cart_to_pendulum", 162.811, -1, 10.0, 2.4),
}
"""What the four models have in them, as one reads in their files."""

CART = '<joint name="slide" type="slide" axis="1 0 0"/><geom size=".1"/>'
ROD = '<geom type="capsule" fromto="0 0 0 0 0 1" size=".05" mass=".1"/>'
POLE = f'<body><joint name="hinge" axis="0 1 0"/>{ROD}</body>'


def settings(name, **changes):
    return Mujoco(model=str(MODELS / name), **changes)


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    """Let MuJoCo write its log of warnings into a temporary folder."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def mjcf(tmp_path):
    """Return a function that writes an MJCF file around bodies, and returns settings with it."""

    def write(bodies, rest="", **changes):
        path = tmp_path / "own.xml"
        path.write_text(f"<mujoco><worldbody>{bodies}</worldbody>{rest}</mujoco>")
        return Mujoco(model=str(path), **changes)

    return write


def forward(name, plant):
    """Return a model and its data, read here, with the joints where the plant has them."""
    model = mujoco.MjModel.from_xml_path(str(MODELS / name))
    data = mujoco.MjData(model)
    data.qpos[:] = plant.position
    mujoco.mj_forward(model, data)
    return model, data


# ------------------------------------------------------------------------------ what is found


@pytest.mark.parametrize("name", FOUND)
def test_theta_and_x_are_what_the_geometry_says(name):
    slider, hinge, zero, sign, force, limit = FOUND[name]
    plant, task = settings(name).make(make_context())
    assert (task.parameters.force, task.parameters.position_limit) == (force, limit)
    assert plant.pole.sign == sign
    assert math.degrees(plant.pole.zero) == pytest.approx(zero, abs=1e-3)

    _, upright_data = forward(name, plant._replace(position=at(plant, 0.0, 0.0)))
    model, data = forward(name, plant._replace(position=at(plant, 0.3, 0.1)))
    slide, turn = model.joint(slider), model.joint(hinge)
    track = data.xaxis[slide.id]
    body = model.jnt_bodyid[turn.id]
    lever = data.subtree_com[body] - data.xanchor[turn.id]
    length = np.linalg.norm(np.cross(lever, data.xaxis[turn.id]))
    assert lever @ track == pytest.approx(length * math.sin(0.1), abs=1e-9)
    assert lever[2] == pytest.approx(length * math.cos(0.1), abs=1e-9)
    moved = data.xanchor[turn.id] - upright_data.xanchor[turn.id]
    assert moved == pytest.approx(0.3 * track)


def at(plant, x, theta):
    """Return the positions of a plant's joints in a state."""
    assert plant.reset(State(x, 0.0, theta, 0.0)) == State(x, 0.0, theta, 0.0)
    return plant.position.copy()


@pytest.mark.parametrize("name", FOUND)
def test_pushes_and_gravity_act_as_they_must(name):
    plant, task = settings(name).make(make_context())
    plant.reset(State(0.0, 0.0, 0.0, 0.0))
    pushed = plant.step(task.parameters.force)
    assert pushed.x_dot > 0.1
    assert pushed.theta_dot < -0.1
    plant.reset(State(0.0, 0.0, 0.0, 0.0))
    assert plant.step(-task.parameters.force) == pytest.approx([-part for part in pushed], rel=1e-3)
    plant.reset(State(0.0, 0.0, 0.1, 0.0))
    assert plant.step(0.0).theta > 0.1
    plant.reset(State(task.parameters.position_limit - 0.001, 1.0, 0.0, 0.0))
    assert plant.has_fallen(plant.step(0.0))


def test_the_urdf_of_this_package_moves_as_its_own_plant(tmp_path):
    """Except for gravity, which a URDF does not state: MuJoCo's is 9.81 m/s²."""
    path = tmp_path / "ours.urdf"
    path.write_text(urdf.text())
    ours = Mujoco(0.002, "rk4").plant(Parameters(gravity=9.81))
    own = Mujoco(0.002, "rk4", str(path)).plant()
    for pushes in PUSHES.values():
        assert np.array_equal(trajectory(own, pushes), trajectory(ours, pushes))


def test_the_physics_step_is_the_models_or_a_little_shorter():
    plant = settings("classes.xml").plant(Parameters(time_step=0.025))
    assert plant.substeps == 3
    assert settings("classes.xml", physics_step=0.005).plant().substeps == 4
    assert settings("motor.xml").plant().substeps == 1


def test_without_a_model_there_is_one_step_a_push():
    for time_step in (0.02, 0.013):
        plant = Mujoco().plant(Parameters(time_step=time_step))
        plant.reset(State(0.0, 1.0, 0.0, 0.0))
        assert plant.substeps == 1
        assert plant.step(0.0).x == pytest.approx(time_step, rel=1e-3)


def test_wheels_are_no_poles_and_servos_do_not_act(mjcf):
    wheel = '<body pos="0 0 -.1"><joint name="wheel" axis="0 1 0"/><geom size=".1"/></body>'
    servo = '<actuator><position joint="slide" kp="1000"/></actuator>'
    without = mjcf(f"<body>{CART}{POLE}</body>").plant()
    state = State(0.5, 0.0, 0.01, 0.0)
    assert without.reset(state) == state
    expected = [without.step(10.0) for _ in range(5)]
    plant = mjcf(f"<body>{CART}{POLE}</body>", servo).plant()
    plant.reset(state)
    assert [plant.step(10.0) for _ in range(5)] == expected
    assert mjcf(f"<body>{CART}{wheel}{POLE}</body>").found()["other joints"] == "wheel"


def test_a_slide_along_the_axis_of_the_hinge_is_no_track(mjcf):
    across = '<joint name="across" type="slide" axis="0 1 0"/>'
    assert mjcf(f"<body>{across}{CART}{POLE}</body>").found()["other joints"] == "across"


def test_a_track_that_ends_has_its_middle_at_0(mjcf):
    cart = CART.replace("/>", ' limited="true" range="0 3"/>', 1)
    plant, task = mjcf(f"<body>{cart}{POLE}</body>").make(make_context())
    assert task.parameters.position_limit == 1.5
    plant.reset(State(0.0, 0.0, 0.0, 0.0))
    assert plant.position[0] == 1.5


# ------------------------------------------------------------------------------ what is given


SLEDGE = '<joint name="sledge" type="slide" axis="1 0 0"/><geom size=".2"/>'
TWO_SLIDES = f"<body>{SLEDGE}<body>{CART}{POLE}</body></body>"
TWO_HINGES = f"<body>{CART}{POLE}{POLE.replace('hinge', 'other')}</body>"
LOW_POLE = POLE.replace("/>", ' limited="true" range="90 270"/>', 1)
ONE_WAY = '<actuator><motor joint="slide" ctrllimited="true" ctrlrange="0 1"/></actuator>'


def test_names_decide_what_is_ambiguous(mjcf):
    assert mjcf(TWO_SLIDES, cart_joint="slide").plant().cart.position == 1
    found = mjcf(TWO_HINGES, pole_joint="other").found()
    assert found["pole"].startswith("joint other, ")
    assert found["other joints"] == "hinge"


def test_zero_sign_and_force_limit_can_be_given():
    plant = settings("motor.xml", zero=2, sign=-1, force_limit=20.0).plant()
    assert plant.parameters.force == 20.0
    assert (plant.pole.zero, plant.pole.sign) == (math.radians(2), -1.0)
    plant.reset(State(0.0, 0.0, 0.1, 0.2))
    assert (plant.position[1], plant.velocity[1]) == (math.radians(2) - 0.1, -0.2)


def test_what_the_task_states_takes_the_place_of_the_models():
    changed = Parameters(force=200.0, position_limit=0.5, angle_limit=0.1)
    assert settings("motor.xml").plant(changed).parameters == changed


@pytest.mark.parametrize(
    ("bodies", "rest", "message"),
    [
        (f"<body>{POLE}</body>", "", "it has no slide joint, along which a cart could move: hinge"),
        ("<body/>", "", "it has no slide joint, along which a cart could move: no joint"),
        (TWO_SLIDES.replace(POLE, ""), "", "it has the slide joints sledge, slide; name one: "),
        (TWO_SLIDES, "", "name one: --plant-set cart_joint=sledge"),
        (
            TWO_HINGES,
            "",
            "it has the hinge joints on the cart hinge, other; name one: ",
        ),
        (f"<body>{CART}</body><body>{POLE}</body>", "", "slide, carries no pole, .* on it: none"),
        (
            f"<body>{CART}{POLE.replace('0 1 0', '1 0 0')}</body>",
            "",
            "a hinge with a level axis across the track .*; hinges on it: hinge",
        ),
        (
            f'<body><freejoint name="float"/><geom size=".1"/><body>{CART}{POLE}</body></body>',
            "",
            "its cart moves freely with the joint float",
        ),
        (f"<body>{CART}{LOW_POLE}</body>", "", "its pole is upright at 0° .* allows 90° to 270°"),
        (f"<body>{CART}{POLE}</body>", '<option gravity="0 0 0"/>', "it has no gravity"),
        (f"<body>{CART}{POLE}</body>", ONE_WAY, "its cart has 1 motor, and how hard one can push"),
    ],
)
def test_what_is_ambiguous_is_refused_with_what_was_found(bodies, rest, message, mjcf):
    with pytest.raises(UprightError, match=message) as caught:
        mjcf(bodies, rest).plant()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"cart_joint": "hinge"}, "cart_joint is 'hinge'; it must be one of slider"),
        ({"pole_joint": "hing"}, "pole_joint is 'hing'; it must be one of hinge; did you mean"),
        ({"zero": "north"}, "zero is 'north'; it must be an angle in degrees"),
        ({"zero": "180"}, "its pole is upright at 180° of the joint hinge, which allows -90° to"),
        ({"sign": 2}, "sign is 2; it must be 1, -1 or 0"),
        ({"force_limit": -1.0}, "force_limit is -1.0; it must be a number, at least 0"),
    ],
)
def test_impossible_settings_are_refused(changes, message):
    with pytest.raises(UprightError, match=message):
        settings("motor.xml", **changes).plant()


def test_settings_of_a_model_need_one():
    with pytest.raises(UprightError, match="pole_joint is 'hinge'; it is about a model of"):
        Mujoco(pole_joint="hinge")


@pytest.mark.parametrize(
    ("task", "message"),
    [
        ({"parameters": {"half_length": 1.0}}, "^half_length cannot be changed on a model of your"),
        ({"condition": "friction-100"}, "^cart_friction, pole_friction cannot be changed on a mod"),
        ({"condition": "varied-plant"}, "^cart_mass, pole_mass, half_length cannot be changed"),
        ({"parameters": {"position_limit": 2.0}}, "^position_limit is 2; it must be at most 1 on"),
        ({"parameters": {"force": 301}}, "^force is 301; it must be at most 300 on"),
        ({"condition": "at-5.force=-301"}, "^force is 301; it must be at most 300 on"),
        ({"condition": "left-force=302"}, "^force is 302; it must be at most 300 on"),
        ({"condition": "each-episode.force=9:400,saturation=350"}, "^force is 350; it must be at"),
    ],
)
def test_parameters_that_are_the_models_are_refused(task, message):
    with pytest.raises(UprightError, match=message):
        make_run(make_case("random-search", plant=settings("motor.xml"), steps=9, **task), 0, 0)


# ------------------------------------------------------------------------------ files


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("gone.xml", None, "'.*gone.xml'; it cannot be read: No such file"),
        ("text.xml", "a cart", "MuJoCo cannot read it: XML parse error"),
        ("other.xml", "<world/>", "MuJoCo cannot read it: .*'world'"),
        (
            "a.urdf",
            '<robot name="a" xmlns:xacro="x"><xacro:property name="m" value="1"/></robot>',
            "expand its macros: xacro .*a.urdf > model.urdf",
        ),
        (
            "mesh.urdf",
            (MODELS / "slider.urdf").read_text().replace("visual>", "collision>"),
            "MuJoCo cannot read it: .*rail.stl",
        ),
    ],
)
def test_files_that_cannot_be_read_are_explained(name, content, message, tmp_path):
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(UprightError, match=message) as caught:
        make_case("random-search", plant=Mujoco(model=tmp_path / name))
    assert "\n" not in str(caught.value)


def test_comments_above_a_model_do_not_matter():
    comments = b"<?xml version='1.0'?>" + b"<!-- a licence -->\n" * 60
    assert own_model.URDF.match(comments + b"<robot name='a'/>")
    assert not own_model.URDF.match(comments + b"<mujoco/>" + comments)


def test_the_content_of_a_model_and_its_parts_is_in_the_key(mjcf, tmp_path):
    part = tmp_path / "part.xml"
    part.write_text(f"<mujoco>{POLE}</mujoco>")
    plant = mjcf(f'<body>{CART}<include file="part.xml"/></body>')
    case = make_case("random-search", plant=plant)
    assert replace(case).key == case.key
    part.write_text(f"<mujoco><!-- the same -->{POLE}</mujoco>")
    assert replace(case).key == case.key
    part.write_text(f"<mujoco>{POLE.replace('.1', '.2')}</mujoco>")
    assert replace(case).key != case.key
    with pytest.raises(UprightError, match="plant is 'mujoco'; it changed after its case was made"):
        study([case], 1)


def test_stored_runs_are_shown_when_the_file_is_gone(mjcf, tmp_path, capsys):
    plant = mjcf(f"<body>{CART}{POLE}</body>")
    case = make_case("random-search", steps=100, plant=plant)
    with Store(tmp_path / "runs.sqlite") as store:
        study([case], 2, 0, store)
    (tmp_path / "own.xml").unlink()
    ((found, _, results),) = stored(tmp_path / "runs.sqlite")
    assert found == case
    assert len(results) == 2
    assert run(["show", str(tmp_path / "runs.sqlite")]) == 0
    assert "own.xml" in capsys.readouterr().out


def test_settings_of_earlier_versions_are_restored():
    old = {"name": "mujoco", "physics_step": 0.02, "integrator": "rk4"}
    assert restore_plant(old) == Mujoco(0.02, "rk4")
    own = settings("motor.xml", zero=1.5)
    assert restore_plant(describe_plant(own)) == own


# ------------------------------------------------------------------------------ commands


def test_the_plants_command_shows_what_was_found(capsys):
    line = ["plants", "mujoco", "--plant-set", f"model={MODELS / 'classes.xml'}"]
    assert run(line) == 0
    shown = capsys.readouterr().out
    for found in (
        "cart: joint slider, 1 kg",
        "pole: joint hinge_1, 0.1 kg, centre of mass 0.5 m away",
        "upright: joint hinge_1 at 180°; the pole leans to +x as the joint's angle falls",
        "push: ±10 N, by the model's motor",
        "limits: ±1.8 m from slider = 0 m, ±12°",
        "physics step: 0.01 s, 2 a push",
    ):
        assert f"  found {found}\n" in shown
    assert run(["plants", "mujoco", "--plant-set", "model=gone.urdf"]) == BAD_USE
    assert run(["plants", "--plant-set", "sign=1"]) == BAD_USE
    assert "--plant-set needs the name of a plant" in capsys.readouterr().err


def test_an_agent_learns_on_a_model_by_command(capsys):
    line = ["learn", "adaptive-lqr", "--steps", "300", "--plant", "mujoco", "--plant-set"]
    assert run([*line, f"model={MODELS / 'sideways.urdf'}"]) == 0
    assert "found in the model: cart: joint slider_to_cart, 1 kg; pole" in capsys.readouterr().err


# ------------------------------------------------------------------------------ learning


@pytest.mark.parametrize("name", FOUND)
@pytest.mark.parametrize("agent", ["adaptive-lqr", "random-search"])
def test_quick_agents_learn_on_every_model(agent, name):
    case = make_case(agent, steps=300, trials=100, plant=settings(name))
    assert make_run(case, 0, 0)[1].success


@pytest.mark.slow
@pytest.mark.parametrize("name", FOUND)
def test_all_agents_learn_on_every_model(name):
    cases = [
        make_case(agent, steps=2000, trials=400, plant=settings(name)) for agent in AGENTS.built_in
    ]
    results = study(cases, 4)
    assert {case.agent: [result.success for result in results[case]] for case in cases} == {
        case.agent: [True] * 4 for case in cases
    }


def test_a_wrong_zero_is_not_learned():
    """A pole that leans by 20° in truth where the agent measures 0 falls at once."""
    case = make_case("adaptive-lqr", steps=300, trials=10, plant=settings("slider.urdf", zero=20))
    assert not make_run(case, 0, 0)[1].success


def test_a_case_on_a_model_is_shown_with_it():
    case = Case.from_data(make_case("reinforce", plant=settings("motor.xml")).as_data())
    assert case.spec == TaskSpec()
    assert "motor.xml" in repr(case)


def test_a_joint_whose_name_is_not_text_has_a_number(tmp_path):
    text = (ROOT / "tests/data/models/slider.urdf").read_bytes()
    names = re.findall(rb'<joint name="(\w+)"', text)
    for name in names:
        text = text.replace(b'"' + name + b'"', b'"\xec' + name + b'"')
    path = tmp_path / "odd.urdf"
    path.write_bytes(text)
    found = Mujoco(model=str(path)).found()
    assert found["cart"].startswith("joint #")
    assert found["pole"].startswith("joint #")


@pytest.mark.parametrize("path", ["/dev/zero", ".", "\0", "a" * 300])
def test_a_model_that_is_no_file_is_refused_at_once(path):
    with pytest.raises(UprightError, match=r"it is not a file|it cannot be read"):
        Mujoco(model=path).found()
