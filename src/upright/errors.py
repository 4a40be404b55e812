"""Errors that name the bad value and what is allowed."""

import math
from collections.abc import Iterable
from importlib import import_module
from typing import Any


class UprightError(ValueError):
    """A request that cannot be met; its one line says why, and what is allowed."""


class Stopped(Exception):  # noqa: N818 - what happened, which is not an error
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
        Whether it must be a whole number.
    """
    kinds = int if whole else (int, float)
    if isinstance(value, kinds) and not isinstance(value, bool) and value < math.inf:
        above_low = low < value if above else low <= value
        if above_low and value <= high:
            return
    kind = "a whole number" if whole else "a number"
    lower = f"above {low:,}" if above else f"at least {low:,}"
    upper = f" and at most {high:,}" if math.isfinite(high) else ""
    raise UprightError(f"{name} is {value!r}; it must be {kind}, {lower}{upper}")


def require_one_of(name: str, value: str, allowed: Iterable[str]) -> None:
    """Raise UprightError unless `value` is one of the allowed names."""
    allowed = list(allowed)
    if value not in allowed:
        raise UprightError(f"{name} is {value!r}; it must be one of {', '.join(allowed)}")


def require_module(name: str, need: str, extra: str) -> Any:
    """Return a library that is not needed for everything.

    Parameters
    ----------
    need
        Who needs what, such as "tuning needs Optuna".
    extra
        With which of the package's extras it is installed.

    Raises
    ------
    UprightError
        If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        raise UprightError(f"{need}: pip install 'upright[{extra}]'") from None
