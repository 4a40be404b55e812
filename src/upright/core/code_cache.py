"""Machine code on disk: what Numba asks of a cache, with a file for each function and its types."""

import hashlib
import pickle
import sys
from collections.abc import Callable, Iterator
from typing import Any

import numba
from numba import types
from numba.core import compiler, serialize
from numba.core.caching import NullCache

from upright.support.machine_code import discard, keep, kept

_Code: Any = compiler.CompileResult
_dumps: Any = serialize.dumps
PREFIX = f"{__name__.split('.')[0]}."
"""How the names of this package's modules begin."""


class CodeCache(NullCache):
    """The machine code of a function of this package, for each combination of argument types.

    A function that depends on more than the sources is not kept: one of a custom agent or plant, or
    one made by another function.

    Parameters
    ----------
    function
        The function.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the code for these types, or None."""
        target_context.refresh()  # so that the code finds what it refers to
        name = self._name(sig, target_context.codegen())
        data = kept(name) if name else None
        if name is None or data is None:
            return None
        try:
            return _Code._rebuild(target_context, *pickle.loads(data))
        except Exception:  # written by another version of a library: it may fail in any way
            discard(name)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code for these types, unless it holds addresses of this process."""
        name = self._name(sig, data.codegen)
        if name and not data.library.has_dynamic_globals:
            keep(name, _dumps(data._reduce()))

    def _name(self, sig: Any, codegen: Any) -> str | None:
        """Return the name of the file for these types, on this processor; None if there is none."""
        function, classes = self._function, list(_classes(sig))
        names = [f"{each.__module__}.{each.__qualname__}" for each in classes]
        if function.__closure__ or not all(name.startswith(PREFIX) for name in names):
            return None
        code = function.__module__, function.__qualname__, function.__code__.co_firstlineno
        versions = numba.__version__, sys.implementation.cache_tag, codegen.magic_tuple()
        text = repr((code, versions, [*map(str, sig)], names))
        return f"{function.__name__}-{hashlib.sha256(text.encode()).hexdigest()[:32]}.code"


def _classes(kinds: Any) -> Iterator[type]:
    """Yield the classes of the NamedTuples among some types; types alone tell only their names."""
    for kind in kinds:
        if isinstance(kind, (types.NamedTuple, types.NamedUniTuple)):
            yield kind.instance_class
        if isinstance(kind, types.BaseTuple):
            yield from _classes(kind)
