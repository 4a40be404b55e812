"""Settings of the nodes: their ROS parameters, and the options of `upright ros2`."""

import math
from dataclasses import dataclass

from upright.core.conditions import STEPS, TRIALS
from upright.core.parameters import make_parameters, parse_parameters
from upright.core.task import TaskSpec
from upright.errors import UprightError, require, require_one_of
from upright.plants import PLANTS
from upright.plants.settings import PlantSettings
from upright.support.settings import change_settings, pairs

SIMULATED = [name for name in PLANTS if name != "ros2"]
"""Names of the plants that a simulator can have."""
DRAWN = (math.nan,) * 4
"""Stands for a start state that is drawn at random."""


@dataclass(frozen=True)
class SimulatorSettings:
    """Settings of the simulator."""

    plant: str = "equations"
    """The plant: equations, mujoco or gazebo."""
    plant_set: str = ""
    """Settings of the plant: NAME=VALUE, separated by commas (see upright plants)."""
    parameters: str = ""
    """Parameters of the plant: NAME=VALUE, separated by commas, such as half_length=1.0."""
    gui: bool = False
    """Whether to open the plant's own window (gazebo only)."""
    noise: str = "none"
    """Noise case or terms (see upright terms), which disturb forces and measurements."""
    start: str = "random"
    """Where trials start: random, zero or wide."""
    start_state: tuple[float, ...] = DRAWN
    """Start state of the next trial only [m, m/s, rad, rad/s]; nan: drawn at random."""
    seed: int = 0
    """Seed of noise and starts; setting it or the noise restarts the random numbers."""
    rate: float = 50.0
    """Control periods per second of simulated time [1/s]."""
    lock_step: bool = True
    """Whether each command moves the cart by one period, as fast as commands arrive; otherwise the
    cart moves in real time under the last command, as a real one does."""
    real_time_factor: float = 1.0
    """Speed relative to real time, if not in lock-step."""
    command_timeout: float = 0.1
    """How long the last command is applied, if not in lock-step and no other arrives; then the
    force is 0 [s]."""

    def __post_init__(self) -> None:
        """Refuse impossible values."""
        require_one_of("plant of a simulator", self.plant, SIMULATED)
        self.plant_settings()
        if len(self.start_state) != 4 or any(map(math.isinf, self.start_state)):
            raise UprightError(f"start_state is {self.start_state}; it must be four numbers")
        require("seed", self.seed, 0, 2**63 - 1, whole=True)
        require("rate", self.rate, 1, 10_000)
        require("real_time_factor", self.real_time_factor, 0.001, 1_000)
        self.spec()
        require("command_timeout", self.command_timeout, 0.001, 3600)

    def plant_settings(self) -> PlantSettings:
        """Return the settings of the plant."""
        changes = [part for part in self.plant_set.split(",") if part.strip()]
        changes += ["gui=True"] * self.gui
        return change_settings(PLANTS.default(self.plant), dict(pairs("plant_set", changes)))

    def spec(self) -> TaskSpec:
        """Return the task: the plant's parameters, noise and start."""
        changes = parse_parameters(part for part in self.parameters.split(",") if part.strip())
        if "time_step" in changes:
            raise UprightError(
                f"parameters is {self.parameters!r}; it must not set time_step, which rate sets"
            )
        parameters = make_parameters(changes | {"time_step": 1 / self.rate})
        return TaskSpec(self.noise, self.start, parameters=parameters)


@dataclass(frozen=True)
class LearnerSettings:
    """Settings of the learner."""

    agent: str = ""
    """Agent that learns: one of `upright agents`, or module:name; if empty, that of from_policy, or
    reinforce."""
    settings: str = "default"
    """Settings of the agent: default (tuned) or as-published."""
    policy: str = ""
    """Saved policy to play in place of an agent; FILE.npz or FILE.json."""
    greedy: bool = False
    """Whether the policy that is played makes the more probable push, without drawing."""
    from_policy: str = ""
    """Saved policy that the agent goes on learning from; FILE.npz."""
    seed: int = 0
    """Seed of the agent's random numbers."""
    steps: int = STEPS
    """A trial of this many steps succeeds."""
    trials: int = TRIALS
    """Maximum number of trials in the run."""
    save: str = ""
    """Where to save the learned policy; FILE.npz or FILE.json."""
    watchdog: float = 0.5
    """Longest time without a measurement before the cart is stopped and the run aborted [s]."""
    patience: float = 10.0
    """Longest time to wait for the cart to appear, and for a reset [s]."""

    def __post_init__(self) -> None:
        """Refuse settings that contradict each other."""
        if self.policy and self.save:
            raise UprightError(
                f"save is {self.save!r}, but a policy that is played learns nothing to save"
            )
        if self.policy and self.from_policy:
            raise UprightError("a policy is either played (policy) or learned from (from_policy)")
        if self.greedy and not self.policy:
            raise UprightError("greedy is for a policy that is played; it needs policy")
