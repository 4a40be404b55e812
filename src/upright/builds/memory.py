"""One block of memory that holds all numbers and arrays of a learner, wherever it lies.

The numbers come first, each in a place of eight bytes, then the arrays. Those that begin with
other values than zero are the first, so that little has to be copied when a learner begins.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from upright.builds.numba_inside import Leaf

ALIGNMENT = 8
"""Every array begins at a multiple of this, in bytes."""
NUMBERS: dict[str, np.dtype[Any]] = {
    "i8": np.dtype(np.bool_),
    "i64": np.dtype(np.int64),
    "double": np.dtype(np.float64),
    "float": np.dtype(np.float32),
}
"""Types of numbers by LLVM's names."""


class Place(NamedTuple):
    """Where a number or an array is."""

    name: str
    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    """Empty for a number."""
    offset: int
    """In bytes from the beginning of the block."""


class Memory:
    """How the block is laid out, and what it holds at first.

    Parameters
    ----------
    leaves
        What the arguments of all functions consist of. Those of one name are the same.
    """

    def __init__(self, leaves: Iterable[Leaf]) -> None:
        known = {leaf.name: leaf for leaf in leaves if not leaf.fixed and leaf.value is not None}
        self.places: dict[str, Place] = {}
        """Places by name."""
        numbers = {n: leaf for n, leaf in known.items() if leaf.kind in NUMBERS}
        arrays = {n: leaf.value for n, leaf in known.items() if leaf.kind not in NUMBERS}
        content = bytearray(ALIGNMENT * len(numbers))
        for i, (name, leaf) in enumerate(numbers.items()):
            kind, offset = NUMBERS[leaf.kind], ALIGNMENT * i
            self.places[name] = Place(name, kind, (), offset)
            number = np.array(leaf.value, kind).tobytes()
            content[offset : offset + len(number)] = number
        owners = {id(_owner(value)): _owner(value) for value in arrays.values()}
        offsets = {}
        for owner in sorted(owners.values(), key=lambda owner: not owner.view(np.uint8).any()):
            content.extend(bytes(-len(content) % ALIGNMENT))
            offsets[id(owner)] = len(content)
            content.extend(owner.tobytes())
        for name, value in arrays.items():
            owner = _owner(value)
            offset = offsets[id(owner)] + _address(value) - _address(owner)
            self.places[name] = Place(name, value.dtype, value.shape, offset)
        content.extend(bytes(-len(content) % ALIGNMENT))
        self.size = len(content)
        """Of the block, in bytes."""
        self.initial = bytes(content).rstrip(b"\0")
        """Its first bytes at the beginning; all others are zero."""

    def offset(self, name: str) -> int:
        """Return where something is, in bytes from the beginning of the block."""
        return self.places[name].offset

    def layout(self) -> dict[str, Any]:
        """Return type, shape and offset [bytes] of everything, by name."""
        return {
            place.name: {
                "type": place.dtype.name,
                "shape": list(place.shape),
                "offset": place.offset,
            }
            for place in self.places.values()
        }


def narrowed(value: Any, owners: dict[int, tuple[np.ndarray, np.ndarray]] | None = None) -> Any:
    """Return a tuple with its arrays of float64 as float32; views remain views of one array.

    Parameters
    ----------
    value
        The tuple, or what is in it.
    owners
        Arrays and what they have become, by identity; for calls within.
    """
    owners = {} if owners is None else owners
    if isinstance(value, tuple):
        parts = [narrowed(part, owners) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    if not isinstance(value, np.ndarray) or value.dtype != np.float64:
        return value
    owner = _owner(value)
    _, narrow = owners.setdefault(id(owner), (owner, owner.astype(np.float32)))
    offset = (_address(value) - _address(owner)) // 2
    strides = tuple(stride // 2 for stride in value.strides)
    return np.ndarray(value.shape, np.float32, narrow, offset, strides)


def _owner(value: np.ndarray) -> np.ndarray:
    """Return the array whose memory a view shows."""
    while isinstance(value.base, np.ndarray):
        value = value.base
    return value


def _address(value: np.ndarray) -> int:
    return int(value.__array_interface__["data"][0])
