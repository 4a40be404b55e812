"""The state of a plain Python agent as data: JSON, and NumPy arrays beside it.

The state consists of the agent's attributes. JSON stands for None, bools, whole and finite numbers,
text and lists itself; anything else is an object whose first name says what it is:

    {"tuple": [...]}, {"set": [...]}, {"frozenset": [...]}, {"range": [start, stop, step]}
    {"deque": [...], "maxlen": 100}
    {"dict": [[key, value], ...]}, and likewise "OrderedDict" and "Counter"
    {"defaultdict": [[key, value], ...], "factory": "float"}
    {"float": "nan"}, {"complex": [real, imaginary]}, {"bytes": "00ff"}, {"float64": 0.5}, ...
    {"array": 0}                            the first of the arrays
    {"object": "Network", "attributes": {...}}, {"NamedTuple": "Step", "fields": {...}}
    {"Enum": "Mode", "member": "GREEDY"}
    {"left out": "Generator"}               a new agent has its own

Reading this runs no code of the file, only the agent's own: a new agent is created, and then filled
in. An object is made again where the new agent has one of the same class, so that the file cannot
choose what is made; only classes that declare data may stand elsewhere.
"""

import math
import reprlib
from collections import Counter, OrderedDict, defaultdict, deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from enum import Enum
from typing import Any, NamedTuple, NoReturn

import numpy as np

from upright.errors import UprightError
from upright.policies.own_classes import (
    CODE,
    OwnClasses,
    attributes_of,
    has_compiled_methods,
    is_named_tuple,
    is_transparent,
    make_object,
)

DEPTH = 50
"""How deep data may be nested."""
BITS = 13_000
"""Size of the largest whole number; Python refuses to read numbers of more than 4,300 digits."""
SIZES = (8, 16, 32, 64)
"""Sizes of NumPy's whole numbers [bits]."""
ARRAYS = "biufcSU"
"""Kinds of NumPy's types that arrays may have: bools, numbers and text."""
SCALARS: dict[str, type[np.generic]] = {
    "bool": np.bool_,
    **{
        f"{sign}int{bits}": np.dtype(f"{sign}int{bits}").type
        for sign in ("", "u")
        for bits in SIZES
    },
    **{kind.__name__: kind for kind in (np.float16, np.float32, np.float64)},
    **{kind.__name__: kind for kind in (np.complex64, np.complex128, np.str_, np.bytes_)},
}
"""NumPy's scalars by name."""
SEQUENCES: dict[str, Callable[[Iterable[Any]], Any]] = {
    kind.__name__: kind for kind in (tuple, set, frozenset)
}
MAPPINGS: dict[str, Callable[[Iterable[Any]], Any]] = {
    kind.__name__: kind for kind in (dict, OrderedDict)
} | {"Counter": lambda pairs: Counter(dict(pairs))}
FACTORIES: dict[str, Callable[[], Any]] = {
    kind.__name__: kind for kind in (bool, int, float, str, list, dict, set)
}
"""Functions that may make the values of a dictionary which a new agent does not have."""
LEFT_OUT = np.random.Generator
"""What a policy does not need: when it is played, the random numbers are those of the trial."""
ALLOWED = (
    "a policy holds numbers, text, NumPy arrays, lists, tuples, dictionaries, sets and deques of "
    "these, and objects of the agent's own module"
)
LISTED = 100
"""Number of attributes that a description names."""


class PlainState(NamedTuple):
    """A state as data."""

    data: Any
    """What JSON can hold."""
    arrays: list[np.ndarray]
    """The arrays that it refers to by number."""


class _Place(NamedTuple):
    """Where in an agent something stands. It is spelled out only for errors."""

    parent: "_Place | None"
    step: Any
    """The name of an attribute, or the index or key of an element."""
    is_attribute: bool

    def __str__(self) -> str:
        before = "" if self.parent is None else str(self.parent)
        if self.is_attribute:
            return f"{before}.{self.step}".lstrip(".")
        return f"{before}[{reprlib.repr(self.step)}]"


def encode_state(name: str, agent: object, fresh: object) -> PlainState:
    """Return the state of an agent as data.

    Parameters
    ----------
    name
        Name of the agent, for errors.
    agent
        The agent.
    fresh
        A new agent, into which the state is to be filled when it is read.

    Raises
    ------
    UprightError
        If something is not data. The error names it.
    """
    encoder = _Encoder(name, fresh)
    state = PlainState(encoder.encode(agent, fresh, None), encoder.arrays)
    try:
        decode_state(state, fresh)
    except ValueError as error:
        raise UprightError(f"agent is {name!r}; its policy cannot be saved: {error}") from error
    return state


def decode_state(state: PlainState, fresh: object) -> Any:
    """Return an agent with this state.

    Parameters
    ----------
    state
        The state. It may come from anyone, so every part of it is checked.
    fresh
        A new agent, which is not changed; it gives classes, code and generators.

    Raises
    ------
    ValueError
        If it is not the state of such an agent.
    """
    if not isinstance(state.data, dict) or not state.data.keys() & {"object", "NamedTuple"}:
        raise ValueError("it holds no state of an agent")
    return _Decoder(state.arrays, fresh).decode(state.data, fresh, None)


def describe_state(agent: object) -> dict[str, str]:
    """Return what each attribute of an agent is, in a few words."""
    parts = _parts(agent)
    described = {name: _described(parts[name]) for name in list(parts)[:LISTED]}
    more = len(parts) - len(described)
    return described | ({"…": f"{more} more"} if more else {})


def _described(value: object) -> str:
    kind = type(value)
    if isinstance(value, np.ndarray):
        return f"array of {value.dtype}, shape {value.shape}"
    if isinstance(value, (list, tuple, set, frozenset, deque, dict)) and not is_named_tuple(kind):
        return f"{kind.__name__} of {len(value)}"
    if value is None or isinstance(value, (bool, int, float, complex, str, bytes, range)):
        return reprlib.repr(value)
    return kind.__name__


def _parts(value: Any) -> dict[str, Any]:
    """Return the fields of a NamedTuple, or the attributes of another object."""
    if is_named_tuple(type(value)):
        return dict(zip(value._fields, tuple(value), strict=True))
    return attributes_of(value)


def _element(template: object, index: int) -> Any:
    """Return what a new agent has in this place of a sequence, or None."""
    if isinstance(template, (list, tuple, deque)) and index < len(template):
        return template[index]
    return None


def _values(template: object) -> Callable[[Any], Any]:
    """Return a function that finds what a new agent has, or would make, under a key."""
    found = template if isinstance(template, dict) else {}
    made = None
    if isinstance(found, defaultdict) and found.default_factory:
        made = found.default_factory()
    return lambda key: found.get(key, made)


class _Encoder:
    """Turns values into data for JSON, and collects arrays."""

    def __init__(self, name: str, fresh: object) -> None:
        self.arrays: list[np.ndarray] = []
        self._name, self._own = name, OwnClasses(fresh)
        self._numbers: dict[int, int] = {}  # of arrays, by identity
        self._around: dict[int, _Place | None] = {}  # containers that are being encoded

    def encode(self, value: Any, template: Any, place: _Place | None) -> Any:
        """Return a value as data; the template is what a new agent has in its place."""
        kind = type(value)
        if value is None or kind in (bool, str):
            return value
        if kind is int:
            if value.bit_length() > BITS:
                self._refuse(place, f"is a number of more than {BITS:,} bits")
            return value
        if kind is float:
            return value if math.isfinite(value) else {"float": repr(value)}
        if kind is complex:
            return {
                "complex": [self.encode(part, None, place) for part in (value.real, value.imag)]
            }
        if kind is bytes:
            return {"bytes": value.hex()}
        if kind is range:
            return {"range": [value.start, value.stop, value.step]}
        if kind is np.ndarray:
            return {"array": self._number(value, place)}
        if isinstance(value, np.generic):
            return self._scalar(value, place)
        if isinstance(value, LEFT_OUT):
            return {"left out": LEFT_OUT.__name__}
        if isinstance(value, CODE) and value is template:
            return {"left out": "code"}
        if isinstance(value, Enum):
            return self._member(value, place)
        with self._inside(value, place):
            return self._container(value, template, place)

    def _container(self, value: Any, template: Any, place: _Place | None) -> Any:
        kind = type(value)
        if kind is list:
            return self._elements(value, template, place)
        if kind.__name__ in SEQUENCES and SEQUENCES[kind.__name__] is kind:
            return {kind.__name__: self._elements(value, template, place)}
        if kind is deque:
            return {"deque": self._elements(value, template, place), "maxlen": value.maxlen}
        if kind in (dict, OrderedDict, Counter):
            return {kind.__name__: self._pairs(value, template, place)}
        if kind is defaultdict:
            return self._defaultdict(value, template, place)
        return self._object(value, template, place)

    def _elements(self, values: Iterable[Any], template: Any, place: _Place | None) -> list[Any]:
        return [
            self.encode(value, _element(template, i), _Place(place, i, False))
            for i, value in enumerate(values)
        ]

    def _pairs(self, value: dict[Any, Any], template: Any, place: _Place | None) -> list[Any]:
        templates = _values(template)
        pairs = []
        for key, part in value.items():
            inner = _Place(place, key, False)
            pairs.append([self.encode(key, None, inner), self.encode(part, templates(key), inner)])
        return pairs

    def _defaultdict(self, value: Any, template: Any, place: _Place | None) -> dict[str, Any]:
        factory = getattr(value.default_factory, "__name__", "")
        if FACTORIES.get(factory) is not value.default_factory:
            factory = ""
            if not isinstance(template, defaultdict):
                self._refuse(
                    place,
                    "is a defaultdict, and a new agent has none in its place, which would give it "
                    "its function: create it in __init__",
                )
        return {"defaultdict": self._pairs(value, template, place), "factory": factory}

    def _number(self, array: np.ndarray, place: _Place | None) -> int:
        if array.dtype.kind not in ARRAYS or array.dtype.itemsize == 0:
            self._refuse(place, f"is an array of {array.dtype}, which is not plain data")
        if id(array) not in self._numbers:
            self._numbers[id(array)] = len(self.arrays)
            self.arrays.append(array)
        return self._numbers[id(array)]

    def _scalar(self, value: np.generic, place: _Place | None) -> dict[str, Any]:
        kind = type(value)
        name = kind.__name__ if value.dtype.kind in "SU" else value.dtype.name
        if name not in SCALARS:
            self._refuse_type(place, kind)
        return {name: self.encode(value.item(), None, place)}

    def _member(self, value: Enum, place: _Place | None) -> dict[str, Any]:
        kind = type(value)
        if self._own.find(kind.__name__) is not kind or value.name not in kind.__members__:
            self._refuse_type(place, kind)
        return {"Enum": kind.__name__, "member": value.name}

    def _object(self, value: Any, template: Any, place: _Place | None) -> dict[str, Any]:
        kind = type(value)
        is_tuple = is_named_tuple(kind)
        has_template = kind is type(template)
        if not (is_tuple and (has_template or self._own.find(kind.__name__) is kind)):
            if isinstance(value, CODE) or kind not in self._own or not is_transparent(kind):
                self._refuse_type(place, kind)
            if not has_template and self._own.find(kind.__name__) is not kind:
                self._refuse(
                    place,
                    f"is of type {kind.__name__!r}, and a new agent has none in its place: create "
                    "it in __init__, or make it a dataclass or NamedTuple of the agent's module",
                )
        templates = _parts(template) if has_template else {}
        parts = {
            name: self.encode(part, templates.get(name), _Place(place, name, True))
            for name, part in _parts(value).items()
        }
        if is_tuple:
            return {"NamedTuple": kind.__name__, "fields": parts}
        return {"object": kind.__name__, "attributes": parts}

    @contextmanager
    def _inside(self, value: object, place: _Place | None) -> Iterator[None]:
        """Refuse what contains itself, and what is nested too deep."""
        if id(value) in self._around:
            around = self._around[id(value)]
            which = "the agent itself" if around is None else repr(str(around))
            self._refuse(place, f"is {which} again, which contains it")
        if len(self._around) > DEPTH:
            self._refuse(place, f"is nested more than {DEPTH} deep")
        self._around[id(value)] = place
        try:
            yield
        finally:
            del self._around[id(value)]

    def _refuse_type(self, place: _Place | None, kind: type) -> NoReturn:
        self._refuse(place, f"is of type {kind.__name__!r}, which is not data; {ALLOWED}")

    def _refuse(self, place: _Place | None, reason: str) -> NoReturn:
        which = "it" if place is None else f"its attribute {str(place)!r}"
        raise UprightError(f"agent is {self._name!r}; its policy cannot be saved: {which} {reason}")


class _Decoder:
    """Turns data from JSON into values again."""

    def __init__(self, arrays: list[np.ndarray], fresh: object) -> None:
        self._arrays, self._own, self._depth = arrays, OwnClasses(fresh), 0
        self._readers: dict[str, tuple[set[str], Callable[..., Any]]] = {
            **dict.fromkeys(SEQUENCES, (set(), self._sequence)),
            **dict.fromkeys(MAPPINGS, (set(), self._mapping)),
            **dict.fromkeys(SCALARS, (set(), self._scalar)),
            "deque": ({"maxlen"}, self._deque),
            "defaultdict": ({"factory"}, self._defaultdict),
            "range": (set(), self._range),
            "float": (set(), self._float),
            "complex": (set(), self._complex),
            "bytes": (set(), self._bytes),
            "array": (set(), self._array),
            "left out": (set(), self._left_out),
            "Enum": ({"member"}, self._member),
            "NamedTuple": ({"fields"}, self._named_tuple),
            "object": ({"attributes"}, self._object),
        }

    def decode(self, data: Any, template: Any, place: _Place | None) -> Any:
        """Return the value that data stand for; the template is what a new agent has there."""
        if not isinstance(data, (list, dict)):
            return data
        if self._depth > DEPTH + 4:  # numbers that are not plain JSON are some deep themselves
            raise ValueError(f"it is nested more than {DEPTH} deep")
        self._depth += 1
        try:
            if isinstance(data, list):
                return self._elements(data, template, place)
            tag = next(iter(data), "")
            further, reader = self._readers.get(tag, ({"?"}, None))
            if reader is None or data.keys() != {tag, *further}:
                raise _unfit(place, f"stated as {reprlib.repr(data)}")
            return reader(data, template, place)
        finally:
            self._depth -= 1

    def _elements(self, data: Any, template: Any, place: _Place | None) -> list[Any]:
        return [
            self.decode(part, _element(template, i), _Place(place, i, False))
            for i, part in enumerate(_typed(data, list, place))
        ]

    def _sequence(self, data: dict[str, Any], template: Any, place: _Place | None) -> Any:
        ((tag, parts),) = data.items()
        return SEQUENCES[tag](self._elements(parts, template, place))

    def _deque(self, data: dict[str, Any], template: Any, place: _Place | None) -> Any:
        longest = data["maxlen"]
        return deque(self._elements(data["deque"], template, place), longest)

    def _mapping(self, data: dict[str, Any], template: Any, place: _Place | None) -> Any:
        ((tag, parts),) = data.items()
        return MAPPINGS[tag](self._pairs(parts, template, place))

    def _defaultdict(self, data: dict[str, Any], template: Any, place: _Place | None) -> Any:
        factory = FACTORIES.get(_typed(data["factory"], str, place))
        if isinstance(template, defaultdict):
            factory = template.default_factory
        if factory is None:
            raise _unfit(place, "a defaultdict, and the new agent has none in its place")
        return defaultdict(factory, self._pairs(data["defaultdict"], template, place))

    def _pairs(self, data: Any, template: Any, place: _Place | None) -> list[tuple[Any, Any]]:
        templates = _values(template)
        pairs = []
        for pair in _typed(data, list, place):
            if len(_typed(pair, list, place)) != 2:
                raise _unfit(place, "a dictionary whose entries are not pairs")
            key = self.decode(pair[0], None, place)
            pairs.append((key, self.decode(pair[1], templates(key), _Place(place, key, False))))
        return pairs

    def _range(self, data: dict[str, Any], template: Any, place: _Place | None) -> range:
        return range(*self._elements(data["range"], None, place))

    def _float(self, data: dict[str, Any], template: Any, place: _Place | None) -> float:
        return float(_typed(data["float"], str, place))

    def _complex(self, data: dict[str, Any], template: Any, place: _Place | None) -> complex:
        return complex(*self._elements(data["complex"], None, place))

    def _bytes(self, data: dict[str, Any], template: Any, place: _Place | None) -> bytes:
        return bytes.fromhex(_typed(data["bytes"], str, place))

    def _scalar(self, data: dict[str, Any], template: Any, place: _Place | None) -> np.generic:
        ((tag, part),) = data.items()
        value = self.decode(part, None, place)
        scalar = SCALARS[tag](_typed(value, (bool, int, float, complex, str, bytes), place))
        return _typed(scalar, SCALARS[tag], place)  # type: ignore[no-any-return]

    def _array(self, data: dict[str, Any], template: Any, place: _Place | None) -> np.ndarray:
        number = _typed(data["array"], int, place)
        if not 0 <= number < len(self._arrays):
            raise _unfit(place, f"array {number}, which is not in the file")
        array: np.ndarray = self._arrays[number]
        return array

    def _left_out(self, data: dict[str, Any], template: Any, place: _Place | None) -> Any:
        if data["left out"] == LEFT_OUT.__name__:
            return template if isinstance(template, LEFT_OUT) else np.random.default_rng(0)
        if not isinstance(template, CODE):
            raise _unfit(place, "code, and the new agent has none in its place")
        return template

    def _member(self, data: dict[str, Any], template: Any, place: _Place | None) -> Any:
        name = _typed(data["Enum"], str, place)
        kind = self._own.find(name)
        members = kind.__members__ if kind is not None and issubclass(kind, Enum) else {}
        if data["member"] not in members:
            raise _unfit(place, f"{data['member']!r} of {name!r}, which the agent's code lacks")
        return members[data["member"]]

    def _named_tuple(self, data: dict[str, Any], template: Any, place: _Place | None) -> Any:
        kind = self._kind(data["NamedTuple"], template, place)
        if not is_named_tuple(kind):
            raise _unfit(place, f"a NamedTuple {kind.__name__!r}, which is none")
        parts = self._attributes(kind, data["fields"], template, place)
        if tuple(parts) != kind._fields:  # type: ignore[attr-defined]
            raise _unfit(place, f"a {kind.__name__!r} with other fields")
        made: Any = tuple.__new__(kind, parts.values())
        if has_compiled_methods(kind):
            _require_alike(made, template, place)
        return made

    def _object(self, data: dict[str, Any], template: Any, place: _Place | None) -> Any:
        kind = self._kind(data["object"], template, place)
        if is_named_tuple(kind) or issubclass(kind, Enum) or not is_transparent(kind):
            raise _unfit(place, f"an object of type {kind.__name__!r}, which has other contents")
        parts = self._attributes(kind, data["attributes"], template, place)
        return make_object(kind, parts)

    def _attributes(
        self, kind: type, data: Any, template: Any, place: _Place | None
    ) -> dict[str, Any]:
        templates = _parts(template) if kind is type(template) else {}
        data = _typed(data, dict, place)
        needed = templates or getattr(kind, "__dataclass_fields__", {})
        if lacking := [name for name in needed if name not in data]:
            which = str(_Place(place, lacking[0], True))
            raise ValueError(
                f"its state lacks the attribute {which!r}, which the agent has when it is created; "
                "has the agent's code changed since?"
            )
        return {
            name: self.decode(part, templates.get(name), _Place(place, name, True))
            for name, part in data.items()
        }

    def _kind(self, name: Any, template: Any, place: _Place | None) -> type:
        """Return the class of the new agent's object in this place, or one that declares data."""
        kind = type(template)
        if kind.__name__ == name and (is_named_tuple(kind) or kind in self._own):
            return kind
        found = self._own.find(_typed(name, str, place))
        if found is None or place is None:
            raise _unfit(place, f"of type {name!r}, and the new agent has none in its place")
        return found


def _typed(value: Any, kind: type | tuple[type, ...], place: _Place | None) -> Any:
    """Return a value after checking its type."""
    if not isinstance(value, kind):
        raise _unfit(place, f"stated with {reprlib.repr(value)}")
    return value


def _require_alike(value: Any, template: Any, place: _Place | None) -> None:
    """Ensure that a value is of the same form as another one; compiled code relies on it."""
    alike = type(value) is type(template)
    if alike and isinstance(value, np.ndarray):
        alike = (value.shape, value.dtype) == (template.shape, template.dtype)
    elif alike and isinstance(value, tuple):
        alike = len(value) == len(template)
        for part, other in zip(value, template, strict=False):
            _require_alike(part, other, place)
    if not alike:
        raise _unfit(place, "of another form than in a new agent, for which code is compiled")


def _unfit(place: _Place | None, how: str) -> ValueError:
    which = "it" if place is None else f"its attribute {str(place)!r}"
    return ValueError(f"in its state, {which} is {how}")
