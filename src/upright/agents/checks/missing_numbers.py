"""Find NaN (not a number) in what an agent has learned."""

from collections.abc import Iterable
from types import BuiltinFunctionType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from upright.errors import AgentError

DEPTH = 3
"""How many containers or objects within each other are looked into."""
ITEM, ARRAY, NUMBER = 300, 2500, 1
"""What it costs to look at an item of a container, an array, and a number in an array [ns]."""
PER_STEP = 100
"""What looking may cost for each step of a trial [ns]: a step of Python takes fifty times that."""
FLOATS = (float, np.floating)
OPAQUE = frozenset(
    {str, bytes, int, bool, type(None), type, np.random.Generator, ModuleType}
    | {FunctionType, MethodType, BuiltinFunctionType}
)
"""Types of what holds no numbers that an agent learns, and is not looked into."""


class NumberWatch:
    """Watches the numbers of an agent for NaN.

    Parameters
    ----------
    name
        Name of the agent.
    agent
        The agent, just created. Numbers that are NaN now are meant to be, and may always be.
    """

    def __init__(self, name: str, agent: object) -> None:
        self._name, self._agent = name, agent
        self._meant: set[str] = set()
        self._cost = _look(agent, (), self._meant)
        self._steps = 0

    def is_due(self, steps: int) -> bool:
        """Whether so many steps have been made since the last look that another costs little."""
        self._steps += steps
        return self._steps * PER_STEP >= self._cost

    def look(self, where: str) -> None:
        """Raise AgentError if a number has become NaN; `where` says in which trial of which run."""
        found: set[str] = set()
        self._cost = _look(self._agent, (), found)
        self._steps = 0
        if wrong := sorted(found - self._meant):
            raise AgentError(
                f"agent is {self._name!r}; its {wrong[0]} is NaN (not a number) after {where}; "
                "what is meant to be NaN at times must be so when the agent is created"
            )


def _look(thing: object, path: tuple[tuple[str, object], ...], found: set[str]) -> int:
    """Add the names of all numbers that are NaN in an object or a container; return the cost."""
    form, items = _items(thing)
    cost = 0
    for key, value in items:
        cost += ITEM
        if isinstance(value, FLOATS):
            if value != value:
                found.add(_name((*path, (form, key))))
        elif isinstance(value, np.ndarray):
            cost += ARRAY + NUMBER * value.size
            if value.dtype.kind in "fc" and value.size and np.isnan(value.min()):
                found.add(_name((*path, (form, key))))
        elif type(value) not in OPAQUE and len(path) < DEPTH:
            cost += _look(value, (*path, (form, key)), found)
    return cost


def _items(thing: Any) -> tuple[str, Iterable[tuple[object, Any]]]:
    """Return how the parts of an object or a container are written, and their keys and values."""
    if isinstance(thing, dict):
        return "[{!r}]", thing.items()
    if isinstance(thing, tuple) and hasattr(thing, "_asdict"):
        return ".{}", thing._asdict().items()
    if isinstance(thing, (list, tuple)):
        return "[{!r}]", enumerate(thing)
    slots = (name for kind in type(thing).__mro__ for name in getattr(kind, "__slots__", ()))
    held = {name: getattr(thing, name) for name in slots if hasattr(thing, name)}
    return ".{}", (held | getattr(thing, "__dict__", {})).items()


def _name(path: Iterable[tuple[str, object]]) -> str:
    return "".join(form.format(key) for form, key in path).removeprefix(".")
