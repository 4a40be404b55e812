"""Errors that name the wrong value and what is allowed. Imports nothing of the package."""

import math
import re
import reprlib
from collections.abc import Iterable
from importlib import import_module
from typing import Any, ClassVar, TypeVar

T = TypeVar("T")

LONGEST_SAID = 100
"""The most characters of a value in an error."""


class UprightError(ValueError):
    """A request that cannot be met; its one-line message states why, and what is allowed.

    Examples
    --------
    >>> try:
    ...     upright.make_case("reinforce", steps=0)
    ... except upright.UprightError as error:
    ...     print(error)
    steps is 0; it must be a whole number, at least 1 and at most 1,000,000,000
    """


class CodeError(UprightError):
    """Custom code failed: `AgentError` or `PlantError`."""

    owner: ClassVar[str]
    """What the code is: an agent or a plant."""


class AgentError(CodeError):
    """A custom agent failed: its code raised an exception, or breaks the rules for agents.

    The first line of the message says what happened and in which run, trial and step. If the
    agent's code raised, its own traceback follows, and the exception is the `__cause__`.

    Examples
    --------
    >>> try:
    ...     upright.make_case("numpy:dtype")
    ... except upright.AgentError as error:
    ...     print(str(error).splitlines()[0])  # doctest: +ELLIPSIS
    agent is 'numpy:dtype'; ...
    """

    owner = "agent"


class PlantError(CodeError):
    """A custom plant failed: its code raised an exception, or breaks the rules for plants.

    The first line of the message says what happened and in which run, trial and step. If the
    plant's code raised, its own traceback follows, and the exception is the `__cause__`.

    Examples
    --------
    >>> try:
    ...     upright.make_case("reinforce", plant="numpy:dtype")
    ... except upright.PlantError as error:
    ...     print(str(error).splitlines()[0])  # doctest: +ELLIPSIS
    plant is 'numpy:dtype'; ...
    """

    owner = "plant"


class AgentWarning(UserWarning):
    """An agent does something that makes its results doubtful.

    A custom agent does not repeat itself, or learning diverged.

    Examples
    --------
    To have such an agent refused:

    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", upright.AgentWarning)
    ...     results = upright.study([upright.make_case("random-search", steps=500)], runs=2)
    """


class Stopped(Exception):  # noqa: N818 - an event, not an error
    """A plant was asked to move after its run had been stopped."""


def require(
    name: str,
    value: float,
    low: float,
    high: float = math.inf,
    *,
    above: bool = False,
    whole: bool = False,
) -> None:
    """Raise UprightError unless `value` is a finite number from `low` to `high`.

    Parameters
    ----------
    above
        Whether `low` itself is refused.
    whole
        Whether `value` must be an integer.
    """
    kinds = int if whole else (int, float)
    if isinstance(value, kinds) and not isinstance(value, bool) and value < math.inf:
        above_low = low < value if above else low <= value
        if above_low and value <= high:
            return
    kind = "a whole number" if whole else "a number"
    lower = f"above {low:,}" if above else f"at least {low:,}"
    upper = f" and at most {high:,}" if math.isfinite(high) else ""
    raise UprightError(f"{name} is {said(value)}; it must be {kind}, {lower}{upper}")


def said(value: object) -> str:
    """Return a value as an error names it, without its middle if it is long.

    Examples
    --------
    >>> said("half_length")
    "'half_length'"
    >>> len(said("1" * 5_000))
    100
    """
    short = reprlib.Repr()
    short.maxstring = short.maxother = LONGEST_SAID
    try:
        return short.repr(value)
    except ValueError:  # Python writes no larger ones
        return "a number of thousands of digits"


def require_one_of(name: str, value: str, allowed: Iterable[str]) -> None:
    """Raise UprightError unless `value` is one of the allowed names; suggest the closest."""
    allowed = list(allowed)
    if not allowed:
        raise UprightError(f"{name} is {said(value)}; there is none that could be named here")
    if value not in allowed:
        hint = did_you_mean(value, allowed)
        raise UprightError(f"{name} is {said(value)}; it must be one of {', '.join(allowed)}{hint}")


def require_kind(name: str, value: object, kinds: type | tuple[type, ...], expected: str) -> None:
    """Raise UprightError unless `value` is of one of these classes; say what is expected instead.

    Examples
    --------
    >>> require_kind("store", 3, str, "a path")
    Traceback (most recent call last):
    upright.errors.UprightError: store is 3; it must be a path
    """
    if not isinstance(value, kinds):
        raise UprightError(f"{name} is {said(value)}; it must be {expected}")


def require_all(name: str, values: Iterable[T], kind: type[T], expected: str) -> list[T]:
    """Return a list of the values, or raise UprightError unless all of them are of this class."""
    listed = list(values) if isinstance(values, Iterable) else None
    if listed is None or not all(isinstance(value, kind) for value in listed):
        raise UprightError(f"{name} is {said(values)}; it must be {expected}")
    return listed


def did_you_mean(value: object, allowed: Iterable[str]) -> str:
    """Return the end of an error about an unknown name: the closest allowed one, if any is close.

    The comparison ignores case, takes hyphens and underscores for the same, and skips the leading
    hyphens of an option.

    Examples
    --------
    >>> did_you_mean("gausian-0.1", ["none", "gaussian-0.1"])
    "; did you mean 'gaussian-0.1'?"
    >>> did_you_mean("loud", ["none", "gaussian-0.1"])
    ''
    """
    from difflib import get_close_matches

    def plain(name: object) -> str:
        return str(name).lower().replace("_", "-").lstrip("-")

    names = {plain(name): name for name in allowed}
    found = get_close_matches(plain(value), names, 1)
    return f"; did you mean {names[found[0]]!r}?" if found else ""


def require_module(name: str, need: str, extra: str) -> Any:
    """Import and return an optional library.

    Parameters
    ----------
    name
        Name of the module to import.
    need
        What needs which library, for the error: for example, "tuning needs Optuna".
    extra
        The extra of this package that installs it.

    Raises
    ------
    UprightError
        If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        raise missing(need, extra) from None


def missing(need: str, extra: str) -> UprightError:
    """Return the error that explains how to install the libraries of an extra of this package.

    The command names the libraries themselves, which works however this package was installed.
    """
    libraries = " ".join(f"'{library}'" for library in _libraries(extra))
    command = f": pip install {libraries}" if libraries else ""
    return UprightError(f"{need}{command} (the extra {extra!r} of upright)")


def _libraries(extra: str) -> list[str]:
    """Return the requirements of an extra, from the metadata of the installed package."""
    from importlib.metadata import PackageNotFoundError, requires  # imported late: it is slow

    try:
        lines = requires("upright") or []
    except PackageNotFoundError:  # the sources are on the path, but the package is not installed
        return []
    halves = (line.partition(";") for line in lines)
    mark = re.compile(rf"""extra == ['"]{re.escape(extra)}['"]""")
    return [library.strip() for library, _, condition in halves if mark.search(condition)]
