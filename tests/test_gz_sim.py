"""What of modern Gazebo's plant needs no Gazebo: it cannot be had here."""

from xml.etree import ElementTree

import pytest

from upright.cartpole import Parameters
from upright.cli import run
from upright.exits import BAD_USE
from upright.gazebo.world import write_world
from upright.plants import urdf
from upright.plants.gz_sim import PHYSICS


def test_its_world_has_its_own_physics(tmp_path):
    parameters = Parameters(gravity=3.7, pole_mass=0.2)
    world = ElementTree.parse(write_world(tmp_path, parameters, "dart", 0.002, PHYSICS))
    assert world.findtext("world/gravity") == "0 0 -3.7"
    assert world.findtext("world/physics/max_step_size") == "0.002"
    assert [plugin.get("filename") for plugin in world.iter("plugin")] == ["gz-sim-physics-system"]
    model = ElementTree.parse(tmp_path / "models/cartpole/cartpole.urdf").getroot()
    assert (tmp_path / "models/cartpole/model.config").is_file()
    colours = {element.get("reference") for element in model.iterfind("gazebo")}
    assert colours == {"track", "cart", "pole"}
    for element in model.findall("gazebo"):
        model.remove(element)
    assert ElementTree.tostring(model) == ElementTree.tostring(
        ElementTree.fromstring(urdf.text(parameters))
    )


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("", "modern Gazebo's Python module is missing; one of gz.sim10, gz.sim9, gz.sim8"),
        ("--plant-set physics_step=0", "physics_step is 0"),
    ],
)
def test_impossible_requests_are_refused(line, message, capsys):
    assert run(f"learn random-search --plant gz-sim {line}".split()) == BAD_USE
    assert message in capsys.readouterr().err
