"""The equations of motion, compiled: the plant of the published tables."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from upright.cartpole import equations
from upright.task import Task
from upright.trials import Plant


@dataclass(frozen=True)
class EquationsSettings:
    """None: the integrator is part of the task."""

    name: ClassVar[str] = "equations"
    alone: ClassVar[bool] = False

    def make(self, task: Task, noise: str, seed: int, stop: np.ndarray) -> tuple[Plant, Task]:
        """Return the equations with the parameters of the task, and the task."""
        return equations(task.parameters), task

    def version(self) -> str:
        """Return nothing: the rule's own version covers the equations."""
        return ""


SETTINGS = EquationsSettings()
