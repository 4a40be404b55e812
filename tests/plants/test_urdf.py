from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from helpers import PUSHES, FinePlant, trajectory

from upright.core.compiled import PACKAGE
from upright.core.parameters import Parameters, State
from upright.errors import UprightError
from upright.pictures import picture
from upright.plants import urdf

OTHER = Parameters(
    cart_mass=2.5,
    pole_mass=0.3,
    half_length=0.8,
    cart_friction=0.02,
    pole_friction=0.003,
    force=7.0,
    position_limit=1.5,
)
BOTH = pytest.mark.parametrize("parameters", [Parameters(), OTHER], ids=["default", "other"])


def robot(parameters):
    return ElementTree.fromstring(urdf.text(parameters))


def numbers(element, path, *names):
    """Return the numbers in attributes of the one element at a path."""
    (found,) = element.findall(path)
    return [float(number) for name in names for number in found.attrib[name].split()]


def content(element):
    """Return all that is in an element, its numbers as such."""

    def value(words):
        try:
            return [float(word) for word in words.split()]
        except ValueError:
            return words

    attributes = {name: value(words) for name, words in element.attrib.items()}
    return [element.tag, attributes, [content(child) for child in element]]


# ------------------------------------------------------------------------------ the numbers


def test_the_asset_is_the_text_of_the_default_parameters():
    asset = content(ElementTree.parse(urdf.ASSET).getroot())
    assert content(robot(None)) == content(robot(Parameters())) == asset
    assert content(robot(OTHER)) != asset


def test_the_asset_lies_within_the_package():
    assert PACKAGE in urdf.ASSET.parents


def test_the_text_is_ascii_without_a_declared_encoding():
    """Tools of ROS pass it on as a string, which may not name an encoding, in any locale."""
    assert urdf.text().isascii()
    assert urdf.ASSET.read_bytes().isascii()
    assert "encoding" not in urdf.text()


@BOTH
def test_every_number_is_that_of_the_parameters(parameters):
    p, body = parameters, robot(parameters)
    rod = p.pole_mass * p.half_length**2 / 3
    end, length = 2 * p.position_limit, 2 * p.half_length
    expected = {
        ("joint[@name='slider']/axis", "xyz"): [1, 0, 0],
        ("joint[@name='slider']/limit", "lower", "upper", "effort"): [-end, end, p.force],
        ("joint[@name='slider']/dynamics", "friction", "damping"): [p.cart_friction, 0],
        ("joint[@name='hinge']/axis", "xyz"): [0, 1, 0],
        ("joint[@name='hinge']/dynamics", "friction", "damping"): [0, p.pole_friction],
        ("link[@name='cart']/inertial/mass", "value"): [p.cart_mass],
        ("link[@name='pole']/inertial/mass", "value"): [p.pole_mass],
        ("link[@name='pole']/inertial/origin", "xyz"): [0, 0, p.half_length],
        ("link[@name='pole']/inertial/inertia", "ixx", "iyy"): [rod, rod],
        ("link[@name='pole']/inertial/inertia", "ixy", "ixz", "iyz"): [0, 0, 0],
        ("link[@name='pole']/visual/origin", "xyz"): [0, 0, p.half_length],
        ("link[@name='pole']/visual/geometry/cylinder", "length"): [length],
        ("link[@name='track']/visual/geometry/box", "size"): [2 * end, 0.06, 0.03],
    }
    for (path, *names), values in expected.items():
        assert numbers(body, path, *names) == pytest.approx(values, rel=1e-15, abs=0), path


@BOTH
def test_the_inertia_along_the_pole_is_that_of_its_picture(parameters):
    body = robot(parameters)
    (radius,) = numbers(body, "link[@name='pole']/visual/geometry/cylinder", "radius")
    (along,) = numbers(body, "link[@name='pole']/inertial/inertia", "izz")
    assert 0 < along == pytest.approx(parameters.pole_mass * radius**2 / 2, rel=1e-15)


def test_names_that_others_rely_on():
    body = robot(None)
    joints = {
        joint.get("name"): (joint.get("type"), joint.find("parent").get("link"))
        for joint in body.iter("joint")
    }
    assert joints == {
        "base": ("fixed", "world"),
        "slider": ("prismatic", "track"),
        "hinge": ("continuous", "cart"),
    }
    assert not body.findall(".//collision")
    assert [link.get("name") for link in body.iter("link") if not link.findall("inertial")] == [
        "world"
    ]
    assert not body.findall("joint[@name='hinge']/origin"), "the hinge is in the cart's middle"


def test_the_colours_are_those_of_the_pictures():
    for name, colour in [("blue", picture.CART), ("orange", picture.POLE), ("steel", picture.INK)]:
        rgba = numbers(robot(None), f"material[@name='{name}']/color", "rgba")
        drawn = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        assert rgba == pytest.approx([*drawn, 1], abs=6e-4)


def test_impossible_parameters_are_refused():
    with pytest.raises(UprightError, match="pole_mass is -1"):
        urdf.text(Parameters(pole_mass=-1.0))


# ------------------------------------------------------------------------------ in MuJoCo


@BOTH
def test_mujoco_reads_the_same_numbers(parameters):
    p = parameters
    model = mujoco.MjModel.from_xml_string(urdf.text(p))
    cart, pole = model.body("cart"), model.body("pole")
    assert (model.nq, model.nv, model.ngeom, model.neq, model.nu) == (2, 2, 0, 0, 0)
    assert (model.joint("slider").id, model.joint("hinge").id) == (0, 1)
    assert model.jnt_type.tolist() == [mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE]
    assert model.jnt_axis.tolist() == [[1, 0, 0], [0, 1, 0]]
    assert model.jnt_limited.tolist() == [1, 0]
    assert model.jnt_range[0].tolist() == [-2 * p.position_limit, 2 * p.position_limit]
    assert model.dof_frictionloss.tolist() == [p.cart_friction, 0]
    assert model.dof_damping.ravel()[:2].tolist() == [0, p.pole_friction]
    assert model.dof_armature.tolist() == [0, 0]
    assert (cart.mass[0], pole.mass[0]) == (p.cart_mass, p.pole_mass)
    assert pole.ipos.tolist() == [0, 0, p.half_length]
    assert pole.iquat.tolist() == [1, 0, 0, 0]
    assert pole.inertia[:2].tolist() == [p.pole_mass * p.half_length**2 / 3] * 2
    assert pole.pos.tolist() == cart.pos.tolist() == [0, 0, 0]


# ------------------------------------------------------------------------------ in DART


class Dart:
    """The URDF in DART, which takes so many steps of semi-implicit Euler in a time step."""

    def __init__(self, path, parameters, substeps):
        dart = pytest.importorskip("dartpy")
        self.body = dart.utils.DartLoader().parseSkeleton(str(path))
        self.world = dart.simulation.World()
        self.world.addSkeleton(self.body)
        self.world.setGravity([0, 0, -parameters.gravity])
        self.world.setTimeStep(parameters.time_step / substeps)
        self.substeps = substeps

    def reset(self, state):
        self.body.setPositions([state.x, state.theta])
        self.body.setVelocities([state.x_dot, state.theta_dot])
        return state

    def step(self, force):
        for _ in range(self.substeps):
            self.body.setForce(0, force)
            self.world.step()
        (x, theta), (x_dot, theta_dot) = self.body.getPositions(), self.body.getVelocities()
        return State(x, x_dot, theta, theta_dot)


@pytest.fixture
def in_dart(tmp_path):
    """Return a function that loads the URDF of parameters in DART: the asset of the default."""

    def load(parameters, substeps=200):
        path = urdf.ASSET
        if parameters != Parameters():
            path = tmp_path / "other.urdf"
            path.write_text(urdf.text(parameters))
        return Dart(path, parameters, substeps)

    return load


@BOTH
def test_dart_reads_the_same_numbers(parameters, in_dart):
    p, body = parameters, in_dart(parameters).body
    joints = [body.getJoint(name) for name in ("base", "slider", "hinge")]
    kinds = [joint.getType() for joint in joints]
    assert kinds == ["WeldJoint", "PrismaticJoint", "RevoluteJoint"]
    _, slider, hinge = joints
    assert slider.getAxis().tolist() == [1, 0, 0]
    assert hinge.getAxis().tolist() == [0, 1, 0]
    assert (slider.getPositionLowerLimit(0), slider.getPositionUpperLimit(0)) == (
        -2 * p.position_limit,
        2 * p.position_limit,
    )
    assert slider.getForceUpperLimit(0) == p.force
    assert (slider.getCoulombFriction(0), slider.getDampingCoefficient(0)) == (p.cart_friction, 0)
    assert (hinge.getCoulombFriction(0), hinge.getDampingCoefficient(0)) == (0, p.pole_friction)
    assert hinge.isCyclic(0)
    cart, pole = body.getBodyNode("cart"), body.getBodyNode("pole")
    assert (cart.getMass(), pole.getMass()) == (p.cart_mass, p.pole_mass)
    assert pole.getLocalCOM().tolist() == [0, 0, p.half_length]
    rod = p.pole_mass * p.half_length**2 / 3
    assert np.diag(pole.getInertia().getMoment())[:2].tolist() == [rod, rod]


@pytest.mark.parametrize("pushes", PUSHES)
def test_dart_moves_it_like_the_equations(pushes, in_dart):
    """To 6e-4 m, m/s, rad and rad/s with steps of 0.1 ms, of order 1: of 1 ms, ten times as far."""
    forces = PUSHES[pushes]
    exact = trajectory(FinePlant(Parameters()), forces)
    errors = [
        np.abs(trajectory(in_dart(Parameters(), substeps), forces) - exact).max()
        for substeps in (20, 200)
    ]
    assert errors[1] < 6e-4
    assert errors[0] / errors[1] == pytest.approx(10, rel=0.05)


@pytest.mark.parametrize("pushes", ["free", "constant"])
def test_dart_moves_other_parameters_like_the_equations(pushes, in_dart):
    """The hinge's and the cart's friction among the rest: 1000 times the usual, 40 times."""
    forces = PUSHES[pushes]
    exact = trajectory(FinePlant(OTHER), forces)
    assert trajectory(in_dart(OTHER), forces) == pytest.approx(exact, abs=6e-4)
    smooth = OTHER._replace(cart_friction=0.0, pole_friction=0.0)
    assert np.abs(trajectory(FinePlant(smooth), forces) - exact).max() > 6e-3
