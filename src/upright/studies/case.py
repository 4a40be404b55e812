"""Cases: an agent with its settings on a task, and what identifies its runs."""

import json
import reprlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from upright.agents import AGENTS, LABELS, Settings, is_custom
from upright.agents.custom import name_of
from upright.core.conditions import NOISES, condition_of
from upright.core.contracts import AnyAgent
from upright.core.task import TaskSpec
from upright.errors import UprightError, require_kind, require_one_of
from upright.plants import PLANTS, describe_plant, plant_settings, restore_plant
from upright.plants.equations import EQUATIONS
from upright.plants.settings import AnyPlant, PlantSettings
from upright.studies import matlab_twin
from upright.studies.fingerprint import fingerprint
from upright.support.settings import Fields, changed_values, values_of, with_values
from upright.support.short_repr import call

LANGUAGES = ("Python", "MATLAB")
"""Languages that a run can be made in: this package, or its MATLAB twin."""
TASK_PARTS = ("noise", "start", "steps", "trials", "condition")
"""What a key of version 0.1 holds of the task, among its other parts."""
PARTS = (
    "agent",
    "label",
    "settings",
    "task",
    "language",
    "plant",
    "rule",
    "integrator",
    *TASK_PARTS,
)
"""What data of a case may hold."""


@dataclass(frozen=True)
class Case:
    """An agent with its settings on a task: everything that determines a run except its seed.

    Raises
    ------
    UprightError
        If the case cannot be run.

    Examples
    --------
    `make_case` makes a case from names. `dataclasses.replace` changes it:

    >>> from dataclasses import replace
    >>> case = upright.make_case("q-learning", noise="actuator-5")
    >>> slower = replace(case, settings=replace(case.settings, learning_rate=0.1))
    >>> slower.settings_name
    'default, learning_rate=0.1'
    """

    agent: str
    """Name of the agent."""
    label: str
    """Name of the settings that its own are, or were before they were changed."""
    settings: Settings
    """Settings of the agent."""
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
            require_one_of("noise of the MATLAB twin", self.spec.noise, NOISES)
            require_one_of("condition of the MATLAB twin", self.spec.condition, ["nominal"])
            if self.plant != EQUATIONS or self.spec.parameters != TaskSpec().parameters:
                raise UprightError(
                    "the MATLAB twin has only the published parameters and integrator"
                )
        condition = condition_of(self.spec.condition)
        if condition.changes_plant and not getattr(self.plant, "can_change", False):
            raise UprightError(
                f"condition is {self.spec.condition!r}; within a run, plant {self.plant.name!r} "
                "cannot change, except for the force of a push"
            )

    def __repr__(self) -> str:
        """Return it as `make_case` takes it, with all that differs from the usual values."""
        usual = AGENTS.settings(self.agent)
        settings = changed_values(usual.get(self.label, usual["default"]), self.settings)
        plant = changed_values(PLANTS.default(self.plant.name), self.plant)
        parts: dict[str, Any] = {
            **({"language": self.language} if self.language != "Python" else {}),
            **({"settings": settings} if settings else {}),
            **({"plant": {"name": self.plant.name, **plant}} if self.plant != EQUATIONS else {}),
            **self.spec.changes(),
        }
        label = [self.label] if self.label != "default" else []
        return call("Case", parts, [self.agent, *label])

    @property
    def name(self) -> str:
        """Name of the agent, for display."""
        return named(self.agent, self.language, self.plant.name)

    @property
    def settings_name(self) -> str:
        """Name of its settings, and those that differ from the settings of this name."""
        named = {} if AGENTS.is_path(self.agent) else AGENTS.settings(self.agent)
        return name_settings(self.label, named.get(self.label, self.settings), self.settings)

    def twin_job(self, seed: int, runs: Iterable[int]) -> matlab_twin.TwinJob:
        """Return the job that makes the MATLAB twin run this case.

        Raises
        ------
        UprightError
            If the settings are not named ones.
        """
        if self.settings != AGENTS.settings(self.agent).get(self.label):
            raise UprightError(
                "settings are changed; for the MATLAB twin they must be default or as-published"
            )
        spec = self.spec
        task = (spec.noise, spec.start, spec.steps, spec.trials)
        return matlab_twin.TwinJob(self.agent, self.label, *task, seed, tuple(runs))

    def as_data(self) -> dict[str, Any]:
        """Return the case as data for JSON, which `from_data` reads."""
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
        """Everything that determines a run except its seed, including a digest of code, as JSON."""
        return json.dumps(self.as_data() | {"rule": self.rule}, sort_keys=True)

    @property
    def rule(self) -> str:
        """A digest of the code that determines a run, with the plant's version if it has one."""
        ours = self.language == "Python"
        rule = fingerprint(self.agent, self.plant.name) if ours else matlab_twin.twin_version()
        version = self.plant.version()
        return f"{rule}-{version}" if version else rule

    @classmethod
    def from_data(cls, values: Mapping[str, Any]) -> "Case":
        """Return the case that is described by the result of `as_data`, or by a key.

        Raises
        ------
        UprightError
            If there is no such agent or plant, or a name or value is not allowed.
        """
        for name in values:
            require_one_of("part of a case", name, PARTS)
        try:
            for name in ("agent", "label"):
                require_kind(name, values[name], str, "a name")
            case = cls._from_parts(values)
            hash(case)  # raises if a value is of a wrong type
            return case
        except UprightError:
            raise
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
            raise UprightError(f"case is {reprlib.repr(values)}; it is not one of a run") from None

    @classmethod
    def _from_parts(cls, values: Mapping[str, Any]) -> "Case":
        plant = dict(values.get("plant", {"name": "equations"}))
        if "task" in values:
            task = dict(values["task"])
        else:  # from a store of version 0.1
            task = {name: values[name] for name in TASK_PARTS if name in values}
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


def name_settings(label: str, usual: Fields, settings: Fields) -> str:
    """Return the label of the usual settings, and those of the settings that differ from them."""
    changed = changed_values(usual, settings)
    return ", ".join([label, *(f"{name}={value}" for name, value in changed.items())])


def named(agent: str, language: str, plant: str) -> str:
    """Return an agent's name, with language and plant in brackets if they are not the usual."""
    agent = agent.removeprefix("__main__:")  # of this very script or notebook
    unusual = [name for name in (language, plant) if name not in ("Python", "equations")]
    return f"{agent} ({', '.join(unusual)})" if unusual else agent


def make_case(
    agent: AnyAgent,
    label: str = "default",
    *,
    settings: Mapping[str, Any] = {},
    language: str = "Python",
    plant: AnyPlant = EQUATIONS,
    **task: Any,
) -> Case:
    """Return the case of an agent with named settings, some of which may be changed.

    Parameters
    ----------
    agent
        Name of an agent, or `module:name` of a custom one; or a class or function which returns an
        agent when it is called with the run's random numbers.
    label
        Name of its settings: "default" or "as-published". An agent without settings as published
        uses its default ones.
    settings
        Those of its settings that are to be changed, by name.
    language
        "Python", or "MATLAB" for the twin.
    plant
        Name of a plant in `PLANTS`, or its settings; or a custom one: `module:name`, or a class or
        function which returns a plant when it is called with the parameters.
    **task
        Fields of `TaskSpec` by name; `parameters` may be a dictionary of those that differ from the
        published ones.

    Raises
    ------
    UprightError
        If the agent or any name is unknown, or a value is impossible.

    Examples
    --------
    >>> case = upright.make_case("reinforce", "as-published", noise="gaussian-0.2", steps=600_000)
    >>> case.settings.learning_rate
    0.1
    >>> upright.make_case("q-learning", settings={"learning_rate": 0.3}).settings_name
    'default, learning_rate=0.3'
    """
    agent = name_of(agent)
    require_one_of("settings", label, LABELS)
    body, spec = plant_settings(plant), TaskSpec.from_data(task)
    named = AGENTS.settings(agent)
    if is_custom(agent):
        named["default"].agent(np.random.default_rng(0))  # raises if it is not an agent
    if check := getattr(body, "check", None):  # of a body of the user's own
        check(spec.task().parameters)
    if is_custom(agent) or body.name not in PLANTS.built_in:
        fingerprint(agent, body.name)  # now, because the files may change once they are imported
    label = label if label in named else "default"
    if settings:
        refuse_settings_of_custom(agent)
    changed = with_values(named[label], settings)
    return Case(agent, label, changed, spec, language, body)


def refuse_settings_of_custom(agent: str) -> None:
    """Raise UprightError if an agent has no settings: one that is named `module:name`."""
    if AGENTS.is_path(agent):
        raise UprightError(f"agent is {agent!r}; it has no settings that could be changed here")
