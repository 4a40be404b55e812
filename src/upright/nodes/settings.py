"""Settings of the nodes: their ROS parameters, and the options of `upright ros2`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from upright.agents import LABELS
from upright.core.conditions import STEPS, TRIALS
from upright.core.parameters import LARGEST, make_parameters, parse_parameters
from upright.core.task import TaskSpec
from upright.errors import UprightError, require_one_of, said
from upright.plants import PLANTS
from upright.plants.ros2.settings import CartSettings
from upright.plants.settings import PlantSettings
from upright.studies.learned import KEEPS_SETTINGS
from upright.support.settings import change_settings, pairs, require_ranges

SIMULATED = [name for name in PLANTS if name != "ros2"]
"""Names of the plants that a simulator can have."""
SEEDS = (0, 2**63 - 1)
"""The smallest and the largest seed: ROS 2 has no larger numbers."""
TASK_PARAMETERS = ("force", "time_step", "position_limit", "angle_limit")
"""Parameters of a task that a learner is told; a cart has the others itself."""
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

    RANGES: ClassVar[Mapping[str, tuple[float, float]]] = {
        "seed": SEEDS,
        "rate": (1.0, 10_000.0),
        "real_time_factor": (0.001, 1_000.0),
        "command_timeout": (0.001, 3_600.0),
    }
    """The smallest and the largest value of numbers."""

    def __post_init__(self) -> None:
        """Refuse impossible values, and settings that do not go together."""
        require_one_of("plant of a simulator", self.plant, SIMULATED)
        self.plant_settings()
        if len(self.start_state) != 4 or any(abs(number) > LARGEST for number in self.start_state):
            raise UprightError(
                f"start_state is {said(self.start_state)}; it must be four numbers, each "
                f"within ±{LARGEST:,} or nan"
            )
        require_ranges(self)
        self.spec()
        for name in ("real_time_factor", "command_timeout"):
            value, usual = getattr(self, name), self.__dataclass_fields__[name].default
            if self.lock_step and value != usual:
                raise UprightError(
                    f"{name} is {value}, but a simulator in lock-step has no time of its own; "
                    "lock_step must be false"
                )

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
class LearnerSettings(CartSettings):
    """Settings of the learner, and of the cart that it balances."""

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
    task_parameters: str = ""
    """Parameters of the task: NAME=VALUE, separated by commas, such as force=6; of force [N],
    time_step [s], position_limit [m] and angle_limit [rad]."""
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
    """Longest time to wait for the cart to appear [s]."""
    reset_patience: float = 600.0
    """Longest time to wait for the answer to a reset, which a person may carry out [s]."""

    RANGES: ClassVar[Mapping[str, tuple[float, float]]] = {
        "seed": SEEDS,
        "steps": (1, 10**9),
        "trials": (1, 10**6),
        "watchdog": (0.001, 3_600.0),
        "patience": (0.001, 3_600.0),
        "reset_patience": (0.001, 86_400.0),
    }
    """The smallest and the largest value of numbers."""

    def __post_init__(self) -> None:
        """Refuse impossible values, and settings that contradict each other."""
        super().__post_init__()
        require_ranges(self)
        if self.policy and self.save:
            raise UprightError(
                f"save is {self.save!r}, but a policy that is played learns nothing to save"
            )
        if self.policy and self.from_policy:
            raise UprightError("a policy is either played (policy) or learned from (from_policy)")
        if self.greedy and not self.policy:
            raise UprightError("greedy is for a policy that is played; it needs policy")
        require_one_of("settings", self.settings, LABELS)
        if self.settings != "default" and self.policy:
            raise UprightError(
                f"settings is {self.settings!r}, but a policy that is played does not learn"
            )
        if self.settings != "default" and self.from_policy:
            raise UprightError(f"settings is {self.settings!r}; {KEEPS_SETTINGS}")
        self.parameters()

    def parameters(self) -> dict[str, float]:
        """Return the parameters of the task that differ from those of the agent's own."""
        texts = (part for part in self.task_parameters.split(",") if part.strip())
        changes = parse_parameters(texts, "task_parameters")
        for name in changes:
            require_one_of("parameter of a cart's task", name, TASK_PARAMETERS)
        make_parameters(changes)
        return changes
