"""Settings of any cart on ROS 2 topics: what its numbers mean, and how its trials begin."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from upright.errors import UprightError, require_one_of
from upright.plants.urdf import HINGE, SLIDER
from upright.support.settings import require_ranges

MEASURED, DIFFERENCED, HIDDEN = VELOCITIES = "measured", "differenced", "hidden"
"""Where velocities come from: the message, its positions, or nowhere."""
RESET, PERSON = STARTERS = "reset", "person"
"""What starts a trial: the cart's service, or a person who holds the pole still near upright."""
LARGEST = 1e9
"""The largest reading or factor."""


@dataclass(frozen=True)
class CartSettings:
    """Settings of a cart. A reading r is the quantity gain × (r - zero)."""

    slider: str = SLIDER
    """Name of the joint between the track and the cart."""
    hinge: str = HINGE
    """Name of the joint between the cart and the pole."""
    position_zero: float = 0.0
    """Reading of the slider with the cart in the middle of the track."""
    position_gain: float = 1.0
    """Metres for each unit of that reading; negative if it grows to the left."""
    angle_zero: float = 0.0
    """Reading of the hinge with the pole upright."""
    angle_gain: float = 1.0
    """Radians for each unit of that reading; negative if it grows as the pole leans to the left."""
    whole_turns: bool = True
    """Whether whole turns are taken off the angle, as encoders count on."""
    velocities: str = MEASURED
    """Where velocities come from: measured (the message), differenced (its positions) or hidden
    (nowhere)."""
    smoothing: float = 0.0
    """Time constant of the filter of differenced velocities [s]; 0: none."""
    command_gain: float = 1.0
    """Command for a force of 1 N, in the units of the cart: 1 if it takes newtons, volts or percent
    otherwise; negative if a positive command pushes to the left."""
    start_by: str = RESET
    """What starts a trial: reset (the cart's service) or person (who holds the pole still near
    upright)."""
    still: float = 1.0
    """How long the pole must be held still, if a person starts a trial [s]."""
    homing_force: float = 0.0
    """Greatest force that moves the cart to the middle before a person raises the pole [N]; 0: the
    cart is not moved."""
    listeners: str = "rosbag2_recorder,recorder,foxglove_bridge"
    """Names of nodes, separated by commas, that may hear the commands without being a motor."""

    RANGES: ClassVar[Mapping[str, tuple[float, float]]] = {
        "position_zero": (-LARGEST, LARGEST),
        "position_gain": (-LARGEST, LARGEST),
        "angle_zero": (-LARGEST, LARGEST),
        "angle_gain": (-LARGEST, LARGEST),
        "smoothing": (0.0, 10.0),
        "command_gain": (-LARGEST, LARGEST),
        "still": (0.1, 60.0),
        "homing_force": (0.0, 1000.0),
    }
    """The smallest and the largest value of each number."""

    def __post_init__(self) -> None:
        """Refuse impossible values, and settings that do not go together."""
        require_ranges(self)
        for name in ("position_gain", "angle_gain", "command_gain"):
            if getattr(self, name) == 0:
                raise UprightError(f"{name} is 0; it must be a factor, such as 1 or -1")
        require_one_of("velocities", self.velocities, VELOCITIES)
        require_one_of("start_by", self.start_by, STARTERS)
        if not self.slider or not self.hinge or self.slider == self.hinge:
            raise UprightError(
                f"slider is {self.slider!r} and hinge is {self.hinge!r}; they must be the names of "
                "two joints"
            )
        if self.smoothing and self.velocities != DIFFERENCED:
            raise UprightError(
                f"smoothing is {self.smoothing}, but velocities is {self.velocities!r}; only "
                f"velocities that are {DIFFERENCED} are smoothed"
            )
        if self.homing_force and self.velocities == HIDDEN:
            raise UprightError(
                f"homing_force is {self.homing_force}, but velocities is {HIDDEN!r}; a cart is "
                "moved to the middle by its velocity"
            )
        for name in ("homing_force", "still"):
            value = getattr(self, name)
            if value != getattr(CartSettings, name) and self.start_by != PERSON:
                raise UprightError(
                    f"{name} is {value}, but start_by is {self.start_by!r}; it is for trials that "
                    f"a {PERSON} starts"
                )
