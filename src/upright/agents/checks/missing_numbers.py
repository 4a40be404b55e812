"""Find NaN (not a number) in what an agent has learned."""

import math
from collections.abc import Iterator, Mapping
from types import BuiltinFunctionType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from upright.errors import AgentError

DEPTH = 3
"""How many containers or objects within each other are looked into."""
NUMBERS_PER_STEP = 50
"""How many numbers may be looked at for each step of the agent, so that looking costs little."""
EACH = 50
"""How many numbers in an array take as long to look at as one attribute."""
OPAQUE = (
    *(str, bytes, int, type, ModuleType, np.random.Generator),
    *(FunctionType, MethodType, BuiltinFunctionType),
)
"""What holds no numbers that an agent learns, and is not looked into."""


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
        self._meant, self._cost = _look(agent)
        self._steps = 0

    def is_due(self, steps: int) -> bool:
        """Whether so many steps have been made since the last look that it costs little by now."""
        self._steps += steps
        return self._steps * NUMBERS_PER_STEP >= self._cost

    def look(self, place: str) -> None:
        """Raise AgentError if a number has become NaN; `place` says in which trial of which run."""
        found, self._cost = _look(self._agent)
        self._steps = 0
        if wrong := sorted(found - self._meant):
            raise AgentError(
                f"agent is {self._name!r}; {wrong[0]} is NaN (not a number) after {place}; numbers "
                "that are meant to be NaN at times must be so when the agent is created"
            )


def _look(agent: object) -> tuple[set[str], int]:
    """Return the names of an agent's numbers that are NaN, and what it cost to look at all."""
    found, cost = set(), 0
    for name, value in _numbers(agent, "", DEPTH):
        if isinstance(value, np.ndarray):
            cost += EACH + value.size
            is_nan = bool(np.isnan(value).any())
        else:
            cost += EACH
            is_nan = math.isnan(value)
        if is_nan:
            found.add(name.removeprefix("."))
    return found, cost


def _numbers(thing: object, name: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Yield the names and values of the floats and arrays of floats that an object holds."""
    if isinstance(thing, float | np.floating):
        yield name, thing
    elif isinstance(thing, np.ndarray):
        if thing.dtype.kind in "fc":
            yield name, thing
    elif depth > 0 and not isinstance(thing, OPAQUE):
        for part, value in _parts(thing):
            yield from _numbers(value, name + part, depth - 1)


def _parts(thing: object) -> Iterator[tuple[str, Any]]:
    """Yield what an object or a container holds, each part with the end of its name."""
    if isinstance(thing, Mapping):
        yield from ((f"[{key!r}]", value) for key, value in thing.items())
    elif isinstance(thing, list | tuple) and not hasattr(thing, "_asdict"):
        yield from ((f"[{index}]", value) for index, value in enumerate(thing))
    else:
        yield from ((f".{name}", value) for name, value in _attributes(thing).items())


def _attributes(thing: Any) -> dict[str, Any]:
    if hasattr(thing, "_asdict"):
        return thing._asdict()  # type: ignore[no-any-return]
    slots = (name for kind in type(thing).__mro__ for name in getattr(kind, "__slots__", ()))
    held = {name: getattr(thing, name) for name in slots if hasattr(thing, name)}
    return held | getattr(thing, "__dict__", {})
