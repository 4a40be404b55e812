"""What a study must know of the custom code of its cases."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from upright.agents import is_custom
from upright.core.compiled import is_compiled
from upright.plants.custom import CustomPlant
from upright.plants.equations import EQUATIONS
from upright.studies.case import Case
from upright.studies.definitions import pack


def changeable(case: Case) -> str:
    """Return what of a case may change while a study goes on, in words; empty if nothing."""
    agent, plant = f"agent is {case.agent!r}", f"plant is {case.plant.name!r}"
    parts = [agent] * is_custom(case.agent) + [plant] * (case.plant != EQUATIONS)
    return " and ".join(parts)


def has_changed(case: Case) -> bool:
    """Whether the code that determines the runs of a case is no longer that of its key."""
    return changeable(case) != "" and replace(case).key != case.key


def is_plain_python(cases: Iterable[Case]) -> bool:
    """Whether a custom agent or plant of any case is plain Python: such use one core at a time."""
    agents = {case.settings for case in cases if is_custom(case.agent)}
    plants = {case.plant for case in cases if isinstance(case.plant, CustomPlant)}
    rng = np.random.default_rng(0)
    return not all(is_compiled(settings.agent(rng)) for settings in agents) or not all(
        plant.is_compiled() for plant in plants
    )


def definitions_of(cases: Iterable[Case]) -> bytes:
    """Return what this script or notebook defines of cases, for other processes."""
    names = {(case.agent, case.plant.name) for case in cases}
    return pack(sorted({agent for agent, _ in names}), sorted({plant for _, plant in names}))
