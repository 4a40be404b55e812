"""Names in words, for titles and legends: of agents, noise cases, tasks and cases."""

import math
from collections.abc import Collection, Iterable, Sequence

from upright.core.conditions import NOISES, TRIALS, noise_of
from upright.core.parameters import changed_parameters
from upright.core.task import TaskSpec
from upright.plants import PLANTS
from upright.studies.case import Case, named
from upright.support.settings import changed_values
from upright.support.words import count

AGENT_NAMES = {
    "adaptive-lqr": "Adaptive LQR",
    "reinforce": "REINFORCE",
    "ndp": "NDP",
    "q-learning": "Q-learning",
    "ase-ace": "ASE/ACE",
    "random-search": "Random search",
}
"""Names of the package's agents as the literature writes them."""
USUAL = TaskSpec()


def agent_name(agent: str) -> str:
    """Return the name of an agent in words; of a custom one, the name of its class or function.

    Examples
    --------
    >>> agent_name("ase-ace"), agent_name("lessons.mine:Pd")
    ('ASE/ACE', 'Pd')
    """
    return AGENT_NAMES.get(agent, agent.rpartition(":")[2])


def noise_name(noise: str) -> str:
    """Return the name of a noise in words.

    Examples
    --------
    >>> noise_name("none"), noise_name("sensor-5"), noise_name("gaussian-0.2")
    ('without noise', '5 % sensor noise', 'Gaussian sensor noise of 0.2 deg²')
    """
    size = noise_of(noise)
    parts = [f"{100 * size.actuator:g} % actuator noise"] if size.actuator else []
    if size.angle and size.angle == size.others:
        parts.append(f"{100 * size.angle:g} % noise on all measurements")
    else:
        parts += [f"{100 * size.angle:g} % sensor noise"] if size.angle else []
        parts += [f"{100 * size.others:g} % noise on other measurements"] if size.others else []
    if size.angle_offset:
        parts.append(f"Gaussian sensor noise of {math.degrees(size.angle_offset) ** 2:.3g} deg²")
    return " and ".join(parts) or "without noise"


def noise_rank(noise: str) -> tuple[int, str]:
    """Return where a noise stands in tables and pictures: named cases first, as they are listed."""
    names = list(NOISES)
    return (names.index(noise), "") if noise in names else (len(names), noise)


def task_name(task: TaskSpec, apart: Collection[str] = ()) -> str:
    """Return what a task has besides its noise that is not usual; empty if there is nothing.

    Parameters
    ----------
    apart
        Names of parameters of the plant that are not to be named.

    Examples
    --------
    >>> task_name(upright.TaskSpec(steps=600, condition="delay-2", parameters={"force": 5}))
    'success after 600 steps, condition delay-2, force=5'
    """
    parts = [f"success after {count(task.steps, 'step')}"] if task.steps != USUAL.steps else []
    parts += [f"start {task.start}"] if task.start != USUAL.start else []
    parts += [f"condition {task.condition}"] if task.condition != USUAL.condition else []
    parts += [f"at most {count(task.trials, 'trial')}"] if task.trials != TRIALS else []
    changed = changed_parameters(task.parameters)
    parts += [f"{name}={value:g}" for name, value in changed.items() if name not in apart]
    return ", ".join(parts)


def shared_task_name(tasks: Iterable[TaskSpec]) -> str:
    """Return the name of tasks that differ in nothing but their noise; empty if they differ."""
    names = {task_name(task) for task in tasks}
    return names.pop() if len(names) == 1 else ""


def case_name(case: Case) -> str:
    """Return the name of a case in words: its agent, and its settings unless they are the default.

    Examples
    --------
    >>> case_name(upright.make_case("q-learning", "as-published"))
    'Q-learning, as published'
    """
    return _case_name(case, agent_name(case.agent))


def case_names(cases: Sequence[Case]) -> list[str]:
    """Return the names of cases, with the modules of custom agents whose classes share a name."""
    agents: dict[str, set[str]] = {}
    for case in cases:
        agents.setdefault(agent_name(case.agent), set()).add(case.agent)
    names = [agent_name(case.agent) for case in cases]
    return [
        _case_name(case, name if len(agents[name]) == 1 else case.agent)
        for case, name in zip(cases, names, strict=True)
    ]


def _case_name(case: Case, agent: str) -> str:
    label = case.settings_name.replace("as-published", "as published")
    settings = [] if label == "default" else [label.removeprefix("default, ")]
    plant = changed_values(PLANTS.default(case.plant.name), case.plant)
    parts = [named(agent, case.language, case.plant.name), *settings]
    return ", ".join([*parts, *(f"{name}={value}" for name, value in plant.items())])
