"""Writes the files that describe the cart-pole and its surroundings to Gazebo."""

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

from upright.core.parameters import Parameters
from upright.plants import urdf
from upright.plants.gazebo.installation import sources

CONFIG = """\
<model>
  <name>cartpole</name>
  <version>1.0</version>
  <sdf>cartpole.urdf</sdf>
</model>
"""
"""The file that turns a folder with a URDF into a model for Gazebo."""

STEPPER = {"name": "stepper", "filename": "libupright_stepper.so"}
"""The plugin for Gazebo 11, `plugin/stepper.cc`."""


def write_world(
    folder: Path,
    parameters: Parameters,
    engine: str,
    physics_step: float,
    system: Mapping[str, str] = STEPPER,
) -> Path:
    """Write a world and its model into a folder, and return the world's file.

    Parameters
    ----------
    folder
        The folder; its subfolder `models` must be on the path on which Gazebo looks for models.
    parameters
        Parameters of the plant.
    engine
        Name of the physics engine.
    physics_step
        Its time step [s].
    system
        Attributes of the plugin that steps the world.
    """
    _write_model(folder / "models" / "cartpole", parameters)
    tree = ElementTree.parse(sources() / "cartpole.world")
    _find(tree, "world/gravity").text = f"{0.0 - parameters.gravity_along} 0 {-parameters.gravity}"
    _find(tree, "world/physics").set("type", engine)
    _find(tree, "world/physics/max_step_size").text = f"{physics_step}"
    _find(tree, "world/plugin").attrib |= system
    _find(tree, "world/plugin/socket").text = str(folder / "socket")
    path = folder / "cartpole.world"
    tree.write(path, encoding="utf-8", xml_declaration=True)
    return path


def _write_model(folder: Path, parameters: Parameters) -> None:
    """Write the URDF as a model, with its colours in Gazebo's own format: it ignores the URDF's."""
    folder.mkdir(parents=True)
    (folder / "model.config").write_text(CONFIG, encoding="utf-8")
    robot = ElementTree.fromstring(urdf.text(parameters))
    colours = {
        material.get("name"): color.get("rgba", "")
        for material in robot.iterfind("material")
        for color in material.iterfind("color")
    }
    for link in robot.findall("link"):
        for material in link.iterfind("visual/material"):
            gazebo = ElementTree.SubElement(robot, "gazebo", reference=link.get("name", ""))
            look = ElementTree.SubElement(ElementTree.SubElement(gazebo, "visual"), "material")
            for name in ("ambient", "diffuse"):
                ElementTree.SubElement(look, name).text = colours[material.get("name")]
    ElementTree.ElementTree(robot).write(folder / "cartpole.urdf", encoding="utf-8")


def _find(tree: "ElementTree.ElementTree[ElementTree.Element]", path: str) -> ElementTree.Element:
    element = tree.find(path)
    assert element is not None, path
    return element
