"""Classes and functions that are defined in a script or a notebook, and not in a module.

Their code has no file that a digest could read or another process could import. So the digest is of
what Python has compiled, and processes receive the definitions themselves.
"""

import dis
import hashlib
import linecache
import pickle
import sys
from collections.abc import Iterable, Iterator
from functools import partial
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any, NamedTuple

import numpy as np

from upright.errors import UprightError

MAIN = "__main__"
"""The module of what a script or a notebook defines."""
NOT_CODE = {
    "__annotate__",
    "__annotate_func__",
    "__annotations__",
    "__annotations_cache__",
    "__dict__",
    "__doc__",
    "__firstlineno__",
    "__slotnames__",
    "__static_attributes__",
    "__weakref__",
}
"""Attributes of a class that no result depends on."""
PLAIN = (type(None), type(...), bool, int, float, complex, str, bytes)
"""Types of values which their text describes in full."""


def is_in_main(name: str) -> bool:
    """Whether the path `module:name` of custom code leads into a script or a notebook."""
    return name.partition(":")[0] == MAIN


def digest_of(thing: object) -> tuple[str, set[str]]:
    """Return a short digest of a class or function, and the names of the modules that it uses.

    The digest covers the code of the class or function and of all that it uses of the same script
    or notebook: base classes, other functions, and the values of global names, as far as they are
    numbers, texts, arrays, or tuples, lists, sets, dictionaries and instances of those. Comments,
    and where the code stands, do not count.
    """
    walk = _Walk()
    sha = hashlib.sha256()
    for fact in walk.facts(thing):
        sha.update(f"{len(fact)} {fact}".encode())
    return sha.hexdigest()[:12], walk.modules


class _Walk:
    """Walks through what a definition consists of, each part once."""

    def __init__(self) -> None:
        self.modules: set[str] = set()
        """Names of the modules that things met belong to."""
        self._met: dict[int, tuple[int, object]] = {}  # keeps the objects, so that no id recurs

    def facts(self, thing: Any) -> Iterator[str]:
        """Yield texts that together describe a thing."""
        yield type(thing).__name__
        if isinstance(thing, PLAIN):
            yield repr(thing)
        elif id(thing) in self._met:
            yield str(self._met[id(thing)][0])
        else:
            self._met[id(thing)] = len(self._met), thing
            yield from self._facts(thing)

    def _facts(self, thing: Any) -> Iterator[str]:
        if isinstance(thing, CodeType):
            yield from self._of_code(thing)
        elif isinstance(thing, ModuleType):
            self.modules.add(thing.__name__)
            yield thing.__name__
        elif isinstance(thing, (type, FunctionType)):
            if thing.__module__ != MAIN:
                self.modules.add(thing.__module__)
                yield f"{thing.__module__}:{thing.__qualname__}"
            elif isinstance(thing, type):
                yield from self._of_class(thing)
            else:
                yield from self._of_function(thing)
        elif isinstance(thing, (np.ndarray, np.generic)) and not thing.dtype.hasobject:
            yield from (str(thing.dtype), str(thing.shape), thing.tobytes().hex())
        elif isinstance(thing, (set, frozenset)):
            yield from sorted("\0".join(self.facts(item)) for item in thing)
        else:
            for part in self._parts(thing):
                yield from self.facts(part)

    def _parts(self, thing: Any) -> Iterable[Any]:
        """Return what a thing consists of."""
        if isinstance(thing, dict):
            return [part for item in thing.items() for part in item]
        if isinstance(thing, (list, tuple)):
            return [type(thing), *thing]
        if isinstance(thing, (staticmethod, classmethod, MethodType)):
            return [thing.__func__]
        if isinstance(thing, property):
            return [thing.fget, thing.fset, thing.fdel]
        if isinstance(thing, partial):
            return [thing.func, thing.args, thing.keywords]
        if hasattr(thing, "py_func"):  # a compiled function
            return [thing.py_func]
        is_ours = type(thing).__module__ == MAIN
        return [type(thing), getattr(thing, "__dict__", None) if is_ours else None]

    def _of_class(self, kind: type) -> Iterator[str]:
        yield kind.__qualname__
        yield from self.facts([type(kind), *kind.__bases__])
        yield from self.facts({n: part for n, part in vars(kind).items() if n not in NOT_CODE})

    def _of_function(self, function: FunctionType) -> Iterator[str]:
        yield from self.facts([function.__code__, function.__defaults__, function.__kwdefaults__])
        for cell in function.__closure__ or ():
            yield from self.facts(_content(cell))
        for name in sorted(_globals_of(function.__code__) & function.__globals__.keys()):
            yield name
            yield from self.facts(function.__globals__[name])

    def _of_code(self, code: CodeType) -> Iterator[str]:
        yield from (code.co_code.hex(), code.co_exceptiontable.hex(), str(code.co_flags))
        counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount
        names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
        yield from (str(counts), str(names))
        self.modules |= _used(code, "IMPORT_NAME")
        for constant in code.co_consts:
            yield from self.facts(constant)


def _content(cell: Any) -> Any:
    """Return what a variable of an enclosing function holds; None if it has no value yet."""
    try:
        return cell.cell_contents
    except ValueError:
        return None


def _used(code: CodeType, instruction: str) -> set[str]:
    """Return the names that instructions of a kind have in code."""
    found = {each.argval for each in dis.get_instructions(code) if each.opname == instruction}
    return {name for name in found if isinstance(name, str)}


def _globals_of(code: CodeType) -> set[str]:
    """Return the global names that code reads, including the functions inside it."""
    inner = [part for part in code.co_consts if isinstance(part, CodeType)]
    return _used(code, "LOAD_GLOBAL").union(*map(_globals_of, inner))


# ------------------------------------------------------------------------- to other processes


def pack(agents: Iterable[str], plants: Iterable[str] = ()) -> bytes:
    """Return the definitions of agents and plants of this script or notebook, for other processes.

    Parameters
    ----------
    agents, plants
        Names of agents and of plants. Other processes can import those that modules define.

    Raises
    ------
    UprightError
        If an agent or a plant uses something that cannot leave this process, such as an open file.
    """
    from upright.studies.code_pickle import dumps  # imported late: it is rarely needed

    definitions = {}
    named = [("agent", agent) for agent in agents] + [("plant", plant) for plant in plants]
    for kind, path in named:
        if not is_in_main(path):
            continue
        name = path.partition(":")[2].partition(".")[0]
        definitions[name] = getattr(sys.modules[MAIN], name)
        try:
            dumps(definitions[name])
        except Exception as error:  # what pickling calls may raise anything
            raise UprightError(
                f"{kind} is {path!r}; what it uses cannot be copied to other processes: {error}"
            ) from error
    cells = {name: entry for name, entry in linecache.cache.items() if entry[1:2] == (None,)}
    return dumps((definitions, cells))


_received: list[bytes] = []


def receive(packed: bytes) -> None:
    """Keep what `pack` returned in another process, until `unpack` is called."""
    _received.append(packed)


def unpack() -> None:
    """Define what was received, if anything, as if this process's own script had.

    Raises
    ------
    UprightError
        If that needs something that this process does not find.
    """
    while _received:
        define(load(_received.pop()))


class Definitions(NamedTuple):
    """What `pack` packed."""

    things: dict[str, Any]
    """Classes and functions by name."""
    cells: dict[str, Any]
    """The texts of cells of a notebook, for tracebacks."""


def load(packed: bytes) -> Definitions:
    """Return what `pack` packed, as new classes and functions.

    Raises
    ------
    UprightError
        If that needs something that this process does not find.
    """
    try:
        return Definitions(*pickle.loads(packed))
    except Exception as error:
        raise UprightError(
            f"what the script or notebook defines cannot be copied to another process: {error}"
        ) from error


def define(definitions: Definitions) -> None:
    """Define what `load` returned, as if this process's own script had."""
    vars(sys.modules[MAIN]).update(definitions.things)
    linecache.cache.update(definitions.cells)
