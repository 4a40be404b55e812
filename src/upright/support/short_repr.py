"""Short texts for objects that hold many numbers."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

FEW = 8
"""The most numbers that are shown in full."""


def short_list(numbers: "np.ndarray") -> str:
    """Return the numbers of an array with one dimension; the middle is left out if they are many.

    Examples
    --------
    >>> import numpy as np
    >>> short_list(np.arange(1000))
    '[0, 1, 2, 3, ..., 997, 998, 999]'
    """
    if len(numbers) <= FEW:
        return str(numbers.tolist())
    ends = [*map(str, numbers[:4].tolist()), "...", *map(str, numbers[-3:].tolist())]
    return f"[{', '.join(ends)}]"


def short_repr(record: Any) -> str:
    """Return the representation of a NamedTuple in which arrays are shown by type and shape alone.

    Examples
    --------
    >>> from typing import NamedTuple
    >>> import numpy as np
    >>> class Memory(NamedTuple):
    ...     values: np.ndarray
    ...     rate: float
    >>> short_repr(Memory(np.zeros((162, 2)), 0.1))
    'Memory(values=float64[162, 2], rate=0.1)'
    """
    return call(type(record).__name__, record._asdict())


def call(name: str, values: Mapping[str, Any], first: Iterable[Any] = ()) -> str:
    """Return the text of a call with named values, some of them first and without a name.

    Examples
    --------
    >>> call("Case", {"noise": "none"}, ["reinforce"])
    "Case('reinforce', noise='none')"
    """
    named = (f"{name}={_short(value)}" for name, value in values.items())
    return f"{name}({', '.join([*map(_short, first), *named])})"


def _short(value: Any) -> str:
    import numpy as np  # imported late: the help of commands needs none of this

    if isinstance(value, np.ndarray):
        return f"{value.dtype}{list(value.shape)}" if value.size > 1 else str(value.tolist())
    if isinstance(value, np.generic):
        return repr(value.item())
    return short_repr(value) if hasattr(value, "_asdict") else repr(value)
