"""What building relies on of Numba's inside: the text of its code, and the order of arguments.

Nothing else does. Numba compiles a function to one of LLVM, whose first two parameters are places
for the result and for an exception. The others are the numbers that the arguments consist of:

- a NamedTuple is its fields, one after the other, and so is a tuple;
- an array is two pointers that only Python uses, the number of its elements, the size of one, a
  pointer to the first, the shape and the strides;
- None is a pointer.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple, cast

import llvmlite.binding as llvm
import numba
import numpy as np
from numba.core import types
from numba.core.typing.typeof import typeof_impl

from upright.core.compiled import Compiled
from upright.errors import UprightError

RESULTS = {
    "int64": "i64",
    "float64": "double",
    "float32": "float",
    "bool": "i8",
    "none": "ptr",
}
"""LLVM's types for those of results."""


class Leaf(NamedTuple):
    """A number that arguments consist of."""

    name: str
    """Its place in the arguments, such as "agent.weights" or "task.noise.angle"."""
    kind: str
    """LLVM's name of its type: i8, i64, double, float or ptr."""
    value: Any
    """The number, or for the data of an array the array; None for a pointer to nothing."""
    fixed: bool = False
    """Whether it describes an array, so that it cannot change."""


class Lowered(NamedTuple):
    """A function as LLVM's code."""

    result: str
    """LLVM's name of the type of its result; ptr for none."""
    text: str
    """The code of the function, and of all that it calls."""
    symbol: str
    """What the function is called there."""
    leaves: list[Leaf]
    """What the arguments consist of, in the order of the function's parameters."""


def lower(function: Any, arguments: dict[str, Any], *, single: bool = False) -> Lowered:
    """Compile a function for arguments of these types, and return its code.

    Parameters
    ----------
    function
        A compiled function.
    arguments
        The arguments by name, in order.
    single
        Whether Python's numbers, those in the code among them, have 32 bits there, not 64.

    Raises
    ------
    UprightError
        If this version of Numba does any of that in another way.
    """
    inner: Any = cast(Compiled, function)._inner
    with _unoptimised(), _precision(types.float32 if single else types.float64):
        kinds = tuple(map(numba.typeof, arguments.values()))
        inner.compile(kinds)
    overload = inner.overloads[kinds]
    text, symbol = overload.library.get_llvm_str(), overload.fndesc.llvm_func_name
    leaves = [leaf for name, value in arguments.items() for leaf in leaves_of(name, value)]
    if single:
        leaves = [leaf._replace(kind="float") if leaf.kind == "double" else leaf for leaf in leaves]
    expected = ["ptr", "ptr", *(leaf.kind for leaf in leaves)]
    found = [str(each.type) for each in llvm.parse_assembly(text).get_function(symbol).arguments]
    if found != expected:
        raise UprightError(
            f"Numba {numba.__version__} passes arguments in a way that is not known here: "
            f"{', '.join(found)}, where {', '.join(expected)} was expected"
        )
    result = RESULTS.get(str(overload.signature.return_type), "")
    if not result:
        raise UprightError(f"{overload.signature} returns none of {', '.join(RESULTS)}")
    return Lowered(result, text, symbol, leaves)


@contextmanager
def _unoptimised() -> Iterator[None]:
    """Have Numba leave its code as it is; it would unroll loops, for this machine."""
    config: Any = numba.config
    previous = config.OPT, config.LOOP_VECTORIZE
    config.OPT, config.LOOP_VECTORIZE = type(config.OPT)(0), 0
    try:
        yield
    finally:
        config.OPT, config.LOOP_VECTORIZE = previous


@contextmanager
def _precision(kind: Any) -> Iterator[None]:
    """Have Numba take Python's numbers for this type."""
    previous = typeof_impl.dispatch(float)
    typeof_impl.register(float, lambda _value, _context: kind)
    try:
        yield
    finally:
        typeof_impl.register(float, previous)


def leaves_of(name: str, value: Any) -> Iterator[Leaf]:
    """Yield the numbers that an argument consists of, in order."""
    if value is None:
        yield Leaf(name, "ptr", None)
    elif isinstance(value, np.ndarray):
        for part in ("meminfo", "parent"):
            yield Leaf(f"{name}.{part}", "ptr", None)
        yield Leaf(f"{name}.size", "i64", value.size, fixed=True)
        yield Leaf(f"{name}.itemsize", "i64", value.itemsize, fixed=True)
        yield Leaf(name, "ptr", value)
        for number in (*value.shape, *value.strides):
            yield Leaf(f"{name}.shape or strides", "i64", number, fixed=True)
    elif isinstance(value, tuple):
        fields = getattr(value, "_fields", range(len(value)))
        for field, part in zip(fields, value, strict=True):
            yield from leaves_of(f"{name}.{field}", part)
    elif isinstance(value, bool | np.bool_):
        yield Leaf(name, "i8", bool(value))
    elif isinstance(value, int | np.integer):
        yield Leaf(name, "i64", int(value))
    else:
        yield Leaf(name, "double", float(value))
