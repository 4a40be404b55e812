"""Cases: an agent with its settings on a task, and what identifies its runs."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from upright.agents import AGENTS, Settings, is_custom
from upright.core.task import TaskSpec
from upright.errors import UprightError, require_one_of
from upright.plants import PLANTS, describe_plant, restore_plant
from upright.plants.equations import EQUATIONS
from upright.plants.settings import PlantSettings
from upright.studies import matlab_twin
from upright.studies.fingerprint import fingerprint
from upright.support.settings import values_of

LANGUAGES = ("Python", "MATLAB")
"""The languages of a run: this package, or its MATLAB twin."""


@dataclass(frozen=True)
class Case:
    """An agent with its settings on a task: everything that determines a run, save its seed.

    Raises
    ------
    UprightError
        If the case cannot be run.

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
    spec: TaskSpec = TaskSpec()
    """The task."""
    language: str = "Python"
    """One of LANGUAGES."""
    plant: PlantSettings = EQUATIONS
    """Settings of the plant."""

    def __post_init__(self) -> None:
        """Refuse a case that cannot be run."""
        require_one_of("language", self.language, LANGUAGES)
        AGENTS.check(self.agent)
        if self.language == "MATLAB":
            require_one_of("agent of the MATLAB twin", self.agent, matlab_twin.AGENTS)
            require_one_of("plant of the MATLAB twin", self.plant.name, ["equations"])
            require_one_of("condition of the MATLAB twin", self.spec.condition, ["nominal"])
            if self.plant != EQUATIONS or self.spec.parameters != TaskSpec().parameters:
                raise UprightError(
                    "the MATLAB twin has the published parameters and integrator alone"
                )

    @property
    def name(self) -> str:
        """Name of the agent, for people."""
        return named(self.agent, self.language, self.plant.name)

    def twin_job(self, seed: int, runs: Iterable[int]) -> matlab_twin.TwinJob:
        """Return what the MATLAB twin must know to run this case.

        Raises
        ------
        UprightError
            If its settings have no name.
        """
        if self.settings != AGENTS.settings(self.agent).get(self.label):
            raise UprightError(
                "settings are changed; the MATLAB twin takes default or as-published"
            )
        spec = self.spec
        task = (spec.noise, spec.start, spec.steps, spec.trials)
        return matlab_twin.TwinJob(self.agent, self.label, *task, seed, tuple(runs))

    def as_data(self) -> dict[str, Any]:
        """Return the case as JSON takes it; `from_data` reads it."""
        return {
            "agent": self.agent,
            "label": self.label,
            "settings": values_of(self.settings),
            "task": self.spec.as_data(),
            "language": self.language,
            "plant": describe_plant(self.plant),
        }

    @cached_property
    def key(self) -> str:
        """Everything that determines a run save its seed, the rule's own code included, as JSON."""
        ours = self.language == "Python"
        rule = fingerprint(self.agent, self.plant.name) if ours else matlab_twin.twin_version()
        if version := self.plant.version():
            rule += f"-{version}"
        return json.dumps(self.as_data() | {"rule": rule}, sort_keys=True)

    @classmethod
    def from_data(cls, values: Mapping[str, Any]) -> "Case":
        """Return the case that `as_data` described, also that of a key.

        Raises
        ------
        UprightError
            If there is no such agent or plant, or a name or value is not allowed.
        """
        plant = dict(values.get("plant", {"name": "equations"}))
        if "task" in values:
            task = dict(values["task"])
        else:  # a store of version 0.1
            names = ("noise", "start", "steps", "trials", "condition")
            task = {name: values[name] for name in names if name in values}
        if plant["name"] == "equations":
            plant.setdefault("integrator", values.get("integrator", "euler"))
        return cls(
            values["agent"],
            values["label"],
            AGENTS.restore(values["agent"], values["settings"]),
            TaskSpec.from_data(task),
            values.get("language", "Python"),
            restore_plant(plant),
        )


def named(agent: str, language: str, plant: str) -> str:
    """Return an agent's name, with the language and the plant where they are not the usual ones."""
    odd = [name for name in (language, plant) if name not in ("Python", "equations")]
    return f"{agent} ({', '.join(odd)})" if odd else agent


def make_case(
    agent: str,
    label: str = "default",
    *,
    language: str = "Python",
    plant: PlantSettings | str = EQUATIONS,
    **task: Any,
) -> Case:
    """Return the case of an agent with its settings of this name.

    Parameters
    ----------
    agent
        Name of an agent, or `module:name` of a custom one.
    label
        Name of its settings: "default" or "as-published". An agent that has only its default
        settings takes them whatever the name.
    language
        "Python", or "MATLAB" for the twin.
    plant
        A plant: one of `PLANTS`, or its settings.
    **task
        Parts of the task by name, as `TaskSpec` has them; `parameters` may be a dictionary of those
        that differ from the published ones.

    Raises
    ------
    UprightError
        If the agent or any name is unknown, or a value is impossible.

    Examples
    --------
    >>> case = upright.make_case("reinforce", "as-published", noise="gaussian-0.2", steps=600_000)
    >>> case.settings.learning_rate
    0.1
    """
    require_one_of("settings", label, ("default", "as-published"))
    if isinstance(plant, str):
        plant = PLANTS.default(plant)
    settings = AGENTS.settings(agent)
    if is_custom(agent):
        settings["default"].agent(np.random.default_rng(0))  # refuses what is not an agent
        fingerprint(agent, plant.name)  # now: the file may change once it is imported
    label = label if label in settings else "default"
    return Case(agent, label, settings[label], TaskSpec.from_data(task), language, plant)
