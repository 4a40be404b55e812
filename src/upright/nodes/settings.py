"""What can be set of the nodes: their ROS parameters, and the options of `upright ros2`."""

import math
from dataclasses import dataclass

from upright.core.conditions import STEPS, TRIALS
from upright.core.parameters import make_parameters, parse_parameters
from upright.core.task import TaskSpec
from upright.errors import UprightError, require, require_one_of
from upright.plants import PLANTS
from upright.plants.settings import PlantSettings
from upright.support.settings import change_settings, pairs

BODIES = [name for name in PLANTS if name != "ros2"]
"""Plants that a simulator can have."""
DRAWN = (math.nan,) * 4
"""In place of a state: each trial starts in one that is drawn."""


@dataclass(frozen=True)
class SimulatorSettings:
    """What can be set of the simulator."""

    plant: str = "equations"
    """The plant: equations, mujoco or gazebo."""
    plant_set: str = ""
    """Settings of the plant, NAME=VALUE with commas between (see upright plants)."""
    parameters: str = ""
    """Parameters of the plant, NAME=VALUE with commas between, such as half_length=1.0."""
    gui: bool = False
    """Whether the plant's own window is opened; gazebo has one."""
    noise: str = "none"
    """Noise case: what disturbs forces and measurements."""
    start: str = "random"
    """Where trials start: random, zero or wide."""
    start_state: tuple[float, ...] = DRAWN
    """Where the next trial alone starts [m, m/s, rad, rad/s]; nan: where one is drawn."""
    seed: int = 0
    """Of noise and starts; to set it or the noise begins the random numbers anew."""
    rate: float = 50.0
    """Control periods a second of simulated time [1/s]."""
    lock_step: bool = True
    """Whether each command moves the cart by one period, as fast as commands come; else it moves by
    the wall clock, with the last command, as a real cart does."""
    real_time_factor: float = 1.0
    """How many times as fast as real time the cart moves by the wall clock."""
    command_timeout: float = 0.1
    """How long the last command stands when no other comes, by the wall clock; then the force is
    0 [s]."""

    def __post_init__(self) -> None:
        """Refuse impossible values."""
        require_one_of("plant of a simulator", self.plant, BODIES)
        self.body()
        if len(self.start_state) != 4 or any(map(math.isinf, self.start_state)):
            raise UprightError(f"start_state is {self.start_state}; it must be four numbers")
        require("seed", self.seed, 0, 2**63 - 1, whole=True)
        require("rate", self.rate, 1, 10_000)
        require("real_time_factor", self.real_time_factor, 0, 1_000, above=True)
        self.spec()
        require("command_timeout", self.command_timeout, 0, 3600, above=True)

    def body(self) -> PlantSettings:
        """Return the settings of the plant."""
        changes = [part for part in self.plant_set.split(",") if part.strip()]
        changes += ["gui=True"] * self.gui
        return change_settings(PLANTS.default(self.plant), dict(pairs("plant_set", changes)))

    def spec(self) -> TaskSpec:
        """Return plant parameters, noise and start."""
        changes = parse_parameters(part for part in self.parameters.split(",") if part.strip())
        if "time_step" in changes:
            raise UprightError("parameters has a time_step; rate sets it here")
        parameters = make_parameters(changes | {"time_step": 1 / self.rate})
        return TaskSpec(self.noise, self.start, parameters=parameters)


@dataclass(frozen=True)
class LearnerSettings:
    """What can be set of the learner."""

    agent: str = "reinforce"
    """Who learns: one of `upright agents`, or module:name."""
    settings: str = "default"
    """Its settings: default (tuned) or as-published."""
    policy: str = ""
    """A saved policy that balances in place of an agent that learns; FILE.npz or FILE.json."""
    seed: int = 0
    """Of the agent's random numbers."""
    steps: int = STEPS
    """A trial of this many steps succeeds."""
    trials: int = TRIALS
    """The run is at most this many trials."""
    save: str = ""
    """Where what was learned is saved: FILE.npz or FILE.json."""
    watchdog: float = 0.5
    """How long measurements may cease before the cart is stopped and the run given up [s]."""
    patience: float = 10.0
    """How long to wait until the cart is found, and until it is reset [s]."""
