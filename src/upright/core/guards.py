"""What compiled functions are given from Python is checked first: they read arrays unchecked."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from upright.errors import UprightError, require_kind

T = TypeVar("T")
REMEMBERED = 16
"""Number of objects that are remembered as checked."""


def require_array(
    name: str, value: Any, kind: Any, *shape: int | None, written: bool = True
) -> None:
    """Raise UprightError unless a value is an array of this type and shape.

    Parameters
    ----------
    name
        What the array is called.
    value
        The array.
    kind
        Its type, such as ``np.float64``; None for any.
    *shape
        Its size along each axis; None for any.
    written
        Whether it is written to.
    """
    if (
        isinstance(value, np.ndarray)
        and (value.shape == shape or _fits(value.shape, shape))
        and (kind is None or value.dtype == kind)
        and (not written or value.flags.writeable)
    ):
        return
    access = "a writable" if written else "an"
    of_kind = "" if kind is None else f" of {np.dtype(kind)}"
    sizes = ", ".join("any" if size is None else str(size) for size in shape)
    wanted = f"{access} array{of_kind} with the shape ({sizes}{',' if len(shape) == 1 else ''})"
    require_kind(name, value, np.ndarray, wanted)
    access = "an" if value.flags.writeable else "a read-only"
    raise UprightError(
        f"{name} is {access} array of {value.dtype} with the shape {value.shape}; it must be "
        f"{wanted}"
    )


def _fits(sizes: tuple[int, ...], wanted: tuple[int | None, ...]) -> bool:
    return len(sizes) == len(wanted) and all(
        want in (None, size) for size, want in zip(sizes, wanted, strict=True)
    )


def require_lane(i: Any, lanes: int) -> None:
    """Raise UprightError unless `i` is the number of one of this many lanes."""
    if not (isinstance(i, (int, np.integer)) and 0 <= i < lanes):
        raise UprightError(f"lane is {i!r}; it must be a whole number from 0 to {lanes - 1}")


def require_rows(name: str, numbers: np.ndarray, count: int) -> None:
    """Raise UprightError unless all numbers are numbers of rows, of which there are this many."""
    wrong = [number for number in numbers.tolist() if number not in range(count)]
    if wrong:
        raise UprightError(f"{name} has row {wrong[0]}; it must be from 0 to {count - 1}")


def once(check: Callable[[T], None]) -> Callable[[T], None]:
    """Return the check, made only the first time that it is asked of each of the latest objects."""
    checked: dict[int, T] = {}

    def check_once(thing: T) -> None:
        if checked.get(id(thing)) is not thing:
            check(thing)
            if len(checked) >= REMEMBERED:
                checked.clear()
            checked[id(thing)] = thing

    return check_once
