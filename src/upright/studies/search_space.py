"""Derives from an agent's settings class which values of its settings a search tries."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

from upright.agents import Settings
from upright.errors import UprightError, said
from upright.support.settings import refuse_former_name

if TYPE_CHECKING:
    import optuna

SPREAD, WHOLE_SPREAD = 10.0, 4.0
"""Factors by which a setting may become smaller or larger than at the start: floats and integers.
Integers vary less, because they multiply computing time.
"""


class Range(NamedTuple):
    """The values of a setting that a search tries."""

    setting: str
    """Name of the setting."""
    choices: tuple[Any, ...] = ()
    """Possible values of a setting of kind "choice"."""
    low: float = 0.0
    high: float = 0.0
    """Ends of the range of a number, or of its gap."""
    kind: Literal["float", "int", "gap", "choice"] = "float"
    """A gap is a number's distance from 1: 0.9 and 0.99 differ as 0.1 and 0.01 do."""

    @property
    def label(self) -> str:
        """The name of the number that Optuna varies."""
        return f"1 - {self.setting}" if self.kind == "gap" else self.setting

    def distribution(self) -> "optuna.distributions.BaseDistribution":
        """Return the range as a distribution of Optuna: logarithmic, unless it begins at zero."""
        from optuna.distributions import (
            CategoricalDistribution,
            FloatDistribution,
            IntDistribution,
        )

        if self.kind == "choice":
            return CategoricalDistribution(self.choices)
        if self.kind == "int":
            return IntDistribution(int(self.low), int(self.high), log=self.low > 0)
        return FloatDistribution(self.low, self.high, log=self.low > 0)

    def value(self, drawn: Any) -> Any:
        """Return the setting's value for what Optuna drew, rounded to three significant digits."""
        if self.kind in ("choice", "int"):
            return drawn
        rounded = min(max(float(f"{drawn:.3g}"), self.low), self.high)
        return round(1.0 - rounded, 12) if self.kind == "gap" else rounded

    def drawn(self, value: Any) -> Any:
        """Return what Optuna would have drawn for a value; None if that is outside the range."""
        drawn = 1.0 - value if self.kind == "gap" else value
        inside = drawn in self.choices if self.choices else self.low <= drawn <= self.high
        return drawn if inside else None


def search_space(
    settings: Settings, names: Sequence[str] = (), fixed: Sequence[str] = ()
) -> list[Range]:
    """Return ranges around the present values of an agent's settings.

    A float is searched on a logarithmic scale, up to ten times smaller and larger; an integer, up
    to four times. A fraction above one half is searched by its distance from 1, and a fraction that
    is 0 on a linear scale. Both values of a bool are tried, and all values of a ``Literal``. Values
    that the settings refuse are left out. Tuples and other strings are not searched.

    Parameters
    ----------
    settings
        The settings that the search starts from.
    names
        Settings to search, as "name" or "name=low:high"; by default all that can be searched.
    fixed
        Settings not to search.

    Raises
    ------
    UprightError
        If a setting is unknown or cannot be searched, or a range is not allowed.
    """
    kinds = get_type_hints(type(settings))
    if not names:
        free = [field.name for field in fields(settings) if field.name not in fixed]
        ranges = (_range(settings, name, kinds[name]) for name in free)
        return [limits for limits in ranges if limits]
    space: dict[str, Range] = {}
    for text in names:
        name, _, limits = text.partition("=")
        name = name.strip().replace("-", "_")
        refuse_former_name(settings, name)
        if name not in kinds:
            known = ", ".join(field.name for field in fields(settings))
            raise UprightError(f"search is {said(text)}; the setting must be one of {known}")
        if name in fixed:
            raise UprightError(f"search is {said(text)}; the same setting is fixed")
        range_ = _range(settings, name, kinds[name])
        if limits:
            range_ = _parsed_range(settings, name, limits)
        if range_ is None:
            why = "it has no default range; give one as NAME=LOW:HIGH, or leave it out"
            raise UprightError(f"search is {said(text)}; {why}")
        space[name] = range_
    return list(space.values())


def _range(settings: Settings, name: str, kind: Any) -> Range | None:
    """Return the range of a setting around its present value, or None if it has none."""
    value = getattr(settings, name)
    if isinstance(value, bool) or get_origin(kind) is Literal:
        options = (False, True) if isinstance(value, bool) else get_args(kind)
        choices = tuple(option for option in options if _allows(settings, name, option))
        return Range(name, choices, kind="choice") if len(choices) > 1 else None
    if isinstance(value, int):
        low = _allowed_end(settings, name, value, max(1, round(value / WHOLE_SPREAD)))
        high = _allowed_end(settings, name, value, round(value * WHOLE_SPREAD))
        return Range(name, (), low, high, "int") if 0 < low < high else None
    if not isinstance(value, float) or value < 0.0:
        return None
    fraction = value <= 1.0 and not _allows(settings, name, 1.000001)
    if fraction and value > 0.5:
        gap = max(1.0 - value, 0.001)
        least = 1.0 - _allowed_end(settings, name, value, 1.0)
        return Range(name, (), max(gap / SPREAD, least), min(gap * SPREAD, 1.0), "gap")
    if value == 0.0:
        return Range(name, (), 0.0, _allowed_end(settings, name, 0.0, 1.0)) if fraction else None
    low, high = (
        _allowed_end(settings, name, value, end) for end in (value / SPREAD, value * SPREAD)
    )
    return Range(name, (), low, high)


def _parsed_range(settings: Settings, name: str, limits: str) -> Range:
    """Return the range of a number that is given as "low:high"."""
    value = getattr(settings, name)
    whole, given = isinstance(value, int), said(f"{name}={limits}")
    try:
        low, high = (int(end) if whole else float(end) for end in limits.split(":"))
    except ValueError:
        raise UprightError(f"search is {given}; it must be NAME=LOW:HIGH") from None
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low < high:
        raise UprightError(f"search is {given}; it must be a number from LOW up to HIGH")
    replace(settings, **{name: low})
    replace(settings, **{name: high})
    if not whole and low > 0.5 and high < 1.0:
        return Range(name, (), 1.0 - high, 1.0 - low, "gap")
    return Range(name, (), low, high, "int" if whole else "float")


def _allows(settings: Settings, name: str, value: Any) -> bool:
    """Return whether a setting may have a value."""
    try:
        replace(settings, **{name: value})
    except ValueError:
        return False
    return True


def _allowed_end(settings: Settings, name: str, allowed: Any, end: Any) -> Any:
    """Return `end` if a setting may have it, or else the allowed number closest to it.

    Parameters
    ----------
    allowed
        A number that the setting may have, from which to search towards `end`.
    """
    whole = isinstance(end, int)
    while not _allows(settings, name, end):
        if abs(end - allowed) <= (1 if whole else 1e-9 * abs(end)):
            return allowed
        middle = (allowed + end) // 2 if whole else (allowed + end) / 2
        if _allows(settings, name, middle):
            allowed = middle
        else:
            end = middle
    return end
