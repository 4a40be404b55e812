"""The cart-pole as a URDF, which MuJoCo, DART, Gazebo and the tools of ROS 2 read.

``cartpole.urdf`` has the default parameters and is self-contained; `text` returns the same for
other parameters.
"""

from pathlib import Path
from xml.etree import ElementTree

from upright.core.parameters import Parameters, check_parameters

ASSET = Path(__file__).parent / "cartpole.urdf"
"""The URDF of the default parameters."""
SLIDER, HINGE = "slider", "hinge"
"""Names of the joints: between track and cart, and between cart and pole."""
ROOM = 2.0
"""Half of the track's length in position limits: far enough that no trial reaches its end."""
SLENDERNESS = 50.0
"""Half of the pole's length in radii of the pole; the radius affects only its appearance."""


def text(parameters: Parameters | None = None) -> str:
    """Return the URDF of a cart-pole.

    Gravity, the time step and the limits of a trial are not part of a URDF.

    Parameters
    ----------
    parameters
        Parameters of the plant; the published ones by default.

    Raises
    ------
    UprightError
        If a parameter is impossible.
    """
    comments = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    robot = ElementTree.parse(ASSET, comments).getroot()
    for path, values in _numbers(check_parameters(parameters or Parameters())).items():
        for element in robot.iterfind(path):
            element.attrib |= values
    return ElementTree.tostring(robot, encoding="unicode")


def _numbers(p: Parameters) -> dict[str, dict[str, str]]:
    """Return the attributes that follow from the parameters, by the path of their element."""
    end = ROOM * p.position_limit
    radius = p.half_length / SLENDERNESS
    across = str(p.pole_mass * p.half_length**2 / 3.0)  # a thin rod about its middle
    along = str(p.pole_mass * radius**2 / 2.0)
    middle = {"xyz": f"0 0 {p.half_length}"}
    slider, hinge = (f"joint[@name='{name}']" for name in (SLIDER, HINGE))
    track, cart, pole = (f"link[@name='{name}']" for name in ("track", "cart", "pole"))
    return {
        f"{track}/visual/geometry/box": {"size": f"{2.0 * end} 0.06 0.03"},
        f"{slider}/limit": {"lower": f"{-end}", "upper": f"{end}", "effort": f"{p.force}"},
        f"{slider}/dynamics": {"friction": f"{p.cart_friction}"},
        f"{cart}/inertial/mass": {"value": f"{p.cart_mass}"},
        f"{hinge}/dynamics": {"damping": f"{p.pole_friction}"},
        f"{pole}/inertial/mass": {"value": f"{p.pole_mass}"},
        f"{pole}/inertial/inertia": {"ixx": across, "iyy": across, "izz": along},
        f"{pole}/inertial/origin": middle,
        f"{pole}/visual/origin": middle,
        f"{pole}/visual/geometry/cylinder": {
            "radius": f"{radius}",
            "length": f"{2.0 * p.half_length}",
        },
    }
