"""What a custom agent's own classes are, and which attributes its objects have.

Used when the state of a plain Python agent is written or read: only what is known to consist of
its attributes, and nothing else, can be made again from them.
"""

import inspect
import sys
from collections import Counter, OrderedDict, defaultdict, deque
from dataclasses import is_dataclass
from enum import Enum
from pathlib import Path
from types import BuiltinFunctionType, FunctionType, MemberDescriptorType, ModuleType
from typing import Any

import numpy as np

from upright.core.compiled import Compiled
from upright.core.parameters import State

CODE = (type, ModuleType, FunctionType, BuiltinFunctionType, np.ufunc, Compiled)
"""Types of code. It is never saved; a new agent has it already."""
CONTAINERS = (list, dict, set, deque, defaultdict, Counter, OrderedDict, np.ndarray)
"""Types of what can change while it stays the same object."""


def attributes_of(value: object) -> dict[str, Any]:
    """Return the attributes of an object, those in slots included.

    Containers that are attributes of its class are included too: they can change like the object's
    own, so that they are part of its state.
    """
    state: Any = object.__getstate__(value)
    own, slots = state if isinstance(state, tuple) else (state, None)
    shared = {}
    if hasattr(value, "__dict__"):
        for base in reversed(type(value).__mro__):
            for name, part in vars(base).items():
                if type(part) in CONTAINERS and not name.startswith("__"):
                    shared[name] = part
    return shared | (own or {}) | (slots or {})


def make_object(kind: type, attributes: dict[str, Any]) -> Any:
    """Return an object with these attributes; no code of its class is run.

    Raises
    ------
    ValueError
        If an attribute would hide a method or what Python looks for, or there is no place for it.
    """
    made: Any = object.__new__(kind)
    for name, value in attributes.items():
        place = inspect.getattr_static(kind, name, None)
        hides = callable(place) or (name.startswith("__") and name.endswith("__"))
        if isinstance(place, MemberDescriptorType):  # a slot
            place.__set__(made, value)
        elif hides or not hasattr(made, "__dict__"):
            raise ValueError(f"{kind.__name__} can have no attribute {name!r} that is data")
        else:
            vars(made)[name] = value
    return made


def is_named_tuple(kind: type) -> bool:
    """Whether this is the class of a NamedTuple."""
    return issubclass(kind, tuple) and hasattr(kind, "_fields")


def is_transparent(kind: type) -> bool:
    """Whether objects of a class consist of their attributes alone, and have no hidden contents."""
    try:
        object.__new__(kind)
    except TypeError:  # it inherits from a class that is not written in Python, such as dict
        return False
    return True


def has_compiled_methods(kind: type) -> bool:
    """Whether compiled code may be given objects of this class."""
    members = (member for base in kind.__mro__ for member in vars(base).values())
    return any(isinstance(member, Compiled) for member in members)


class OwnClasses:
    """The classes of an agent's own code: those of its package, or of modules in its folder.

    Parameters
    ----------
    agent
        A new agent.
    """

    def __init__(self, agent: object) -> None:
        self._home = sys.modules[type(agent).__module__]

    def __contains__(self, kind: type) -> bool:
        """Whether a class is the agent's own."""
        if kind.__module__.partition(".")[0] == self._home.__name__.partition(".")[0]:
            return True
        folder = _folder(sys.modules.get(kind.__module__))
        return folder is not None and folder == _folder(self._home)

    def find(self, name: str) -> type | None:
        """Return the class that a file may ask for by this name, or None.

        These are the classes in the agent's module that declare data: NamedTuples, dataclasses and
        enumerations, and the package's `State`. Compiled code takes the fields of a NamedTuple as
        they are, so one with compiled methods cannot be had by its name.
        """
        kind = vars(self._home).get(name, State)
        if not isinstance(kind, type) or kind.__name__ != name:
            return None
        if kind is State:
            return kind
        declares = is_dataclass(kind) or is_named_tuple(kind) or issubclass(kind, Enum)
        return kind if declares and kind in self and not has_compiled_methods(kind) else None


def _folder(module: ModuleType | None) -> Path | None:
    file = getattr(module, "__file__", None)
    return Path(file).parent if file else None
