"""Cases: an agent with its settings on a task, and what identifies its runs."""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

from upright.agents import (
    AGENTS,
    MATLAB_AGENTS,
    Settings,
    is_custom,
    named_settings,
)
from upright.core.conditions import STEPS, TRIALS
from upright.core.task import Task, make_task
from upright.errors import UprightError, require_one_of
from upright.plants import default_plant, describe_plant
from upright.plants.equations import SETTINGS as EQUATIONS
from upright.plants.settings import PlantSettings
from upright.studies import matlab_twin
from upright.studies.fingerprint import fingerprint

LANGUAGES = ("Python", "MATLAB")
"""In which a run can be made: this package, or its MATLAB twin."""


@dataclass(frozen=True)
class Case:
    """An agent with its settings on a task: everything that determines a run, save its seed.

    Examples
    --------
    `make_case` makes one by names. A setting is changed so:

    >>> from dataclasses import replace
    >>> case = upright.make_case("q-learning", noise="actuator-5")
    >>> slower = replace(case, settings=replace(case.settings, learning_rate=0.1))
    >>> slower.settings.learning_rate
    0.1
    """

    agent: str
    """Name of the agent."""
    label: str
    """Name of its settings, for people."""
    settings: Settings
    """Its settings."""
    noise: str = "none"
    """Name of the noise case."""
    start: str = "random"
    """Name of the start."""
    steps: int = STEPS
    """N: a trial of this many steps is a success."""
    trials: int = TRIALS
    """A run is at most this many trials."""
    integrator: str = "euler"
    """Name of the integrator."""
    condition: str = "nominal"
    """Name of the condition."""
    language: str = "Python"
    """One of LANGUAGES."""
    plant: PlantSettings = EQUATIONS
    """The body, and how it is made."""

    def __post_init__(self) -> None:
        """Refuse a case that cannot be run."""
        require_one_of("language", self.language, LANGUAGES)
        outside = getattr(self.settings, "agent_name", "module:name")
        require_one_of("agent", self.agent, [*AGENTS, outside])
        self.task()
        if self.plant.name != "equations":
            require_one_of("integrator of other plants", self.integrator, ["euler"])
            require_one_of("language of other plants", self.language, ["Python"])
        if self.language == "MATLAB":
            require_one_of("agent of the MATLAB twin", self.agent, MATLAB_AGENTS)
            require_one_of("integrator of the MATLAB twin", self.integrator, ["euler"])
            require_one_of("condition of the MATLAB twin", self.condition, ["nominal"])

    @property
    def name(self) -> str:
        """Name of the agent, for people."""
        return named(self.agent, self.language, self.plant.name)

    def wanted(self, seed: int, runs: Iterable[int]) -> matlab_twin.TwinJob:
        """Return what the MATLAB twin must know to make runs of this case.

        Raises
        ------
        UprightError
            If its settings have no name.
        """
        if self.settings != named_settings(self.agent).get(self.label):
            raise UprightError(
                "settings are changed; the MATLAB twin takes default or as-published"
            )
        task = (self.noise, self.start, self.steps, self.trials)
        return matlab_twin.TwinJob(self.agent, self.label, *task, seed, tuple(runs))

    def task(self) -> Task:
        """Return the task in numbers; where every run has its own plant, with the nominal one."""
        return make_task(
            self.noise, self.start, self.steps, self.trials, self.integrator, self.condition
        )

    @cached_property
    def key(self) -> str:
        """Everything that determines a run save its seed, the rule's own code included, as JSON."""
        ours = self.language == "Python"
        rule = fingerprint(self.agent, self.plant.name) if ours else matlab_twin.twin_version()
        values = asdict(self) | {"rule": rule, "plant": describe_plant(self.plant)}
        if version := self.plant.version():
            values["rule"] += f"-{version}"
        return json.dumps(values, sort_keys=True)


def named(agent: str, language: str, plant: str) -> str:
    """Return an agent's name, with the language and the plant where they are not the usual ones."""
    odd = [name for name in (language, plant) if name not in ("Python", "equations")]
    return f"{agent} ({', '.join(odd)})" if odd else agent


def make_case(agent: str, label: str = "default", **task: Any) -> Case:
    """Return the case of an agent with its settings of this name.

    Parameters
    ----------
    agent
        One of `AGENTS`, or ``module:name`` of an agent of your own.
    label
        Name of its settings: "default" or "as-published". An agent that knows only its default
        settings takes them whatever the name.
    **task
        Fields of `Case` that are to differ from their defaults: `noise`, `start`, `steps`,
        `trials`, `condition`, `plant` and others. A plant is one of `PLANTS` or its settings.

    Raises
    ------
    UprightError
        If the agent or any name is unknown, or a number is not allowed.

    Examples
    --------
    >>> case = upright.make_case("reinforce", "as-published", noise="gaussian-0.2", steps=600_000)
    >>> case.settings.learning_rate
    0.1
    """
    require_one_of("settings", label, ("default", "as-published"))
    settings = named_settings(agent)
    if isinstance(task.get("plant"), str):
        task["plant"] = default_plant(task["plant"])
    if is_custom(agent):
        fingerprint(
            agent, task.get("plant", EQUATIONS).name
        )  # now: the file may change once it is imported
    label = label if label in settings else "default"
    return Case(agent, label, settings[label], **task)
