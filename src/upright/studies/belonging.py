"""Whose a name is that stands in the wrong place, for the advice where it belongs."""

from collections.abc import Iterable, Iterator
from dataclasses import fields
from typing import NamedTuple

from upright.agents import AGENTS
from upright.core.parameters import Parameters
from upright.core.task import TaskSpec
from upright.plants import PLANTS
from upright.support.settings import values_of

KINDS = {
    "parameter": "a parameter of the plant",
    "plant": "a setting of the plant",
    "agent": "a setting of the agent",
    "task": "a part of the task",
}
"""What a name may stand for."""
PARTS = tuple(field.name for field in fields(TaskSpec) if field.name != "parameters")
"""The parts of a task, without the parameters of the plant."""


class Belonging(NamedTuple):
    """What a name stands for."""

    kind: str
    """One of KINDS."""
    owner: str = ""
    """Name of the plant or the agent, if it is a setting."""
    is_chosen: bool = True
    """Whether the owner is what was asked for."""

    def __str__(self) -> str:
        return f"{KINDS[self.kind]} {self.owner}".rstrip()


def belongings(name: str, plant: str, agents: Iterable[str] = ()) -> Iterator[Belonging]:
    """Yield everything that a name stands for.

    Parameters
    ----------
    name
        The name.
    plant
        Name of the plant that is asked for; settings of other plants come last.
    agents
        Names of the agents that are asked for.
    """
    if name in Parameters._fields:
        yield Belonging("parameter")
    if name in values_of(PLANTS.default(plant)):
        yield Belonging("plant", plant)
    for agent in agents:
        if not AGENTS.is_path(agent) and name in values_of(AGENTS.default(agent)):
            yield Belonging("agent", agent)
    if name in PARTS:
        yield Belonging("task")
    for other in PLANTS.built_in:
        if other != plant and name in values_of(PLANTS.default(other)):
            yield Belonging("plant", other, is_chosen=False)
