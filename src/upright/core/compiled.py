"""Compile functions with Numba, so that the loop and every rule run near the speed of C.

`compiled` is ``numba.njit`` with the choices this package makes once:

- strict arithmetic (no ``fastmath``), so that a seed gives the same result on every processor;
- the global interpreter lock released, so that threads run in parallel on all cores;
- no reference counting and no allocation within compiled code;
- machine code cached on disk, in a folder named after a digest of the package's sources: Numba
  alone would not notice a change of a function in *another* file. Its own cache also believes
  whatever it finds, and loses entries when several processes compile at once.
"""

import functools
import inspect
import re
from collections.abc import Callable
from pathlib import Path
from types import MethodType
from typing import Any, TypeVar, cast

import numba
from numba import types
from numba.core.errors import NumbaError
from numba.extending import overload_method

from upright.core.code_cache import CodeCache
from upright.core.parameters import State
from upright.errors import UprightError, require_kind
from upright.support.files import PACKAGE

F = TypeVar("F", bound=Callable[..., Any])
MEASURED = ("observation", "before", "after")
"""Names of parameters that are a `State`, whose numbers agents may read by index."""
Check = TypeVar("Check", bound=Callable[..., None])
COMPILES = not cast(Any, numba.config).DISABLE_JIT
"""Whether Numba compiles at all: the variable NUMBA_DISABLE_JIT turns that off."""


class Compiled:
    """A function compiled in two forms, each when it is first needed.

    The form for other compiled code is inlined and does not count references to its arguments,
    which would cost more in the loop than a step of the plant; so the function must not allocate
    memory. The form for Python has the wrapper that Python calls need.

    Parameters
    ----------
    function
        The function to compile.
    kept
        Whether the machine code for Python is cached on disk. That of a function outside the
        package never is, because the cache folder is named after the package's sources alone.
    small
        Whether Python runs the uncompiled function instead.
    """

    def __init__(
        self, function: Callable[..., Any], *, kept: bool = True, small: bool = False
    ) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        self._inner = _jit(
            function, _nrt=False, forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True
        )
        self._numba_type_ = types.Dispatcher(self._inner)
        # Only this form is cached on disk, together with everything it calls. Numba looks cached
        # code up by name and types alone, and would confuse the two forms.
        self._outer = function if small else _jit(function, kept=kept, no_cfunc_wrapper=True)
        self._explains = kept and not small and _is_ours(function)
        self._guard: Callable[..., None] | None = None
        names = function.__code__.co_varnames[: function.__code__.co_argcount]
        if self._explains and not set(names).isdisjoint(MEASURED):
            self._guard = self._require_states

    def __call__(self, *arguments: Any) -> Any:
        """Call the function from Python."""
        if self._guard is not None:
            self._guard(*arguments)
        try:
            return self._outer(*arguments)
        except NumbaError as error:
            if not self._explains:
                raise
            kinds = ", ".join(type(argument).__name__ for argument in arguments)
            raise UprightError(
                f"{self.py_func.__qualname__} is called with ({kinds}); it takes "
                f"{inspect.signature(self.py_func)}: {explain(error)}"
            ) from error

    def _require_states(self, *arguments: Any) -> None:
        for name, argument in zip(self.py_func.__code__.co_varnames, arguments, strict=False):
            if name in MEASURED:
                require_kind(name, argument, State, "a State")

    @property
    def signatures(self) -> list[Any]:
        """For which types compiled code calls it so far; none with Numba's compiler off."""
        return getattr(self._inner, "nopython_signatures", [])

    def __get__(self, instance: object, owner: type | None = None) -> Any:
        return self if instance is None else MethodType(self, instance)


def _is_ours(function: Callable[..., Any]) -> bool:
    return PACKAGE in Path(function.__code__.co_filename).parents


def _jit(function: Callable[..., Any], *, kept: bool = False, **options: bool) -> Any:
    njit: Any = numba.njit
    dispatcher = njit(nogil=True, error_model="numpy", **options)(function)
    if kept and COMPILES and _is_ours(function):
        dispatcher._cache = CodeCache(function)  # what its enable_caching() does with Numba's own
    return dispatcher


def compiled(function: F) -> F:
    """Compile a function, or a method of a NamedTuple.

    A compiled function does strict arithmetic and must not allocate memory. An agent whose methods
    are compiled runs as fast as the package's own. Numbers that change are kept in arrays, which
    are allocated when the agent is created.

    Parameters
    ----------
    function
        The function to compile; this happens on its first call.

    Returns
    -------
    callable
        The same function, compiled.

    Examples
    --------
    >>> from typing import NamedTuple
    >>> import numpy as np
    >>> class Counter(NamedTuple):
    ...     total: np.ndarray
    ...
    ...     @upright.compiled
    ...     def add(self, value):
    ...         self.total[0] += value
    >>> counter = Counter(np.zeros(1))
    >>> counter.add(2.5)
    >>> counter.total
    array([2.5])
    """
    return cast(F, Compiled(function))


def inlined(function: F) -> F:
    """Compile a function for other compiled code only; Python runs it uncompiled.

    For functions so small that calling compiled code from Python would take longer, and for those
    that Python need not call: uncompiled, NumPy checks every index.
    """
    return cast(F, Compiled(function, small=True))


def guard(function: Callable[..., Any]) -> Callable[[Check], Check]:
    """Return a decorator: what it decorates is called before Python calls a compiled function.

    Given the same arguments, it raises UprightError unless all arrays have the sizes that the
    function relies on: compiled code reads and writes arrays without looking at their sizes.
    Compiled code that calls the function does not call it.
    """

    def decorate(check: Check) -> Check:
        cast(Compiled, function)._guard = check
        return check

    return decorate


def machine_code(function: F, *arguments: Any) -> F:
    """Return the machine code of a compiled function for arguments of these types.

    Calling it takes a quarter of the time, because argument types are not checked: they must be
    the same as those given here. (With Numba's compiler off, it is the function itself.)
    """
    outer: Any = cast(Compiled, function)._outer
    kinds = tuple(map(numba.typeof, arguments))
    return cast(F, outer.compile(kinds) if COMPILES else outer)


def is_compiled(thing: object) -> bool:
    """Whether `thing` is a NamedTuple with compiled methods, which compiled code can call."""
    return any(isinstance(member, Compiled) for member in vars(type(thing)).values())


HINTS = {
    "NRT required": "it allocates memory; allocate arrays when the agent is created",
    "Only accept returning of array": "it allocates an array; do so when the agent is created",
    "Untyped global name 'method'": "a method that the loop calls lacks @compiled",
    "no attribute '_outer'": "a method that the loop calls lacks @compiled",
    "No definition for lowering": "fields cannot change; keep numbers that do in an array",
}
"""What Numba's most common errors mean here."""


def explain(error: Exception) -> str:
    """Return in one line why something did not compile: Numba's last error and its location."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    failures = [i for i, line in enumerate(lines) if "Failed in nopython mode" in line]
    words = lines[failures[-1] + 1 if failures else 0 :][:2] or [repr(error)]
    reason = words[0]
    if words[-1].startswith(">>>"):
        reason = f"{reason} {words[1].removeprefix('>>>').strip()}"
    reason += "".join(f" ({hint})" for sign, hint in HINTS.items() if sign in reason)
    places = re.findall(r'(?: at |File ")(\S[^"\n]*?\.py)"?(?:, line | \()(\d+)', str(error))
    for file, line in places:
        parents = Path(file).resolve().parents
        if PACKAGE not in parents and Path(numba.__file__).parent not in parents:
            return f"{reason}, {Path(file).name} line {line}"
    return reason


CALLED_BY_THE_LOOP = (
    "reset",
    "step",
    "has_fallen",
    "begin_run",
    "begin_trial",
    "act",
    "learn",
    "end_trial",
    "push_probability",
    "remember",
    "random",
    "seed",
)


def _callable_in_compiled_code(name: str) -> None:
    """Let compiled code call the compiled method `name` of any NamedTuple.

    Numba knows the fields of a NamedTuple but not its methods. The method is chosen by type at
    compile time, which costs nothing at run time, and (unlike a function passed as an argument) the
    result can be loaded from the cache by the next process.
    """

    def find(instance, *arguments):  # type: ignore[no-untyped-def]  # noqa: ARG001
        method = getattr(instance.instance_class, name, None)
        return (lambda instance, *arguments: method(instance, *arguments)) if method else None

    overload_method(types.NamedTuple, name)(find)
    overload_method(types.NamedUniTuple, name)(find)


for _name in CALLED_BY_THE_LOOP:
    _callable_in_compiled_code(_name)
