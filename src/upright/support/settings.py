"""Settings: frozen dataclasses, defined beside the code they configure, with a text for each field.

The command line, stores, documentation and ROS 2 read fields, values and texts from them.
"""

import ast
import inspect
import math
import re
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from itertools import pairwise, product
from typing import Any, ClassVar, Protocol, TypeVar

from upright.errors import UprightError, require, require_one_of, said
from upright.support.numbers import whole_number


class Fields(Protocol):
    """Any dataclass.

    Its class attribute `RENAMED`, if any, maps former names of settings to present ones; `ADDED`
    has the names of those that files of earlier versions lack, and that have their default there;
    `RANGES` the smallest and the largest value of numbers, by name.
    """

    __dataclass_fields__: ClassVar[dict[str, Any]]


S = TypeVar("S", bound=Fields)
T = TypeVar("T")


def values_of(settings: Fields) -> dict[str, Any]:
    """Return the values of settings as a dictionary."""
    return {field.name: getattr(settings, field.name) for field in fields(settings)}


def require_ranges(settings: Fields) -> None:
    """Raise UprightError unless each number is within the settings' `RANGES`."""
    ranges = ranges_of(settings)
    for field in fields(settings):
        if field.name in ranges:
            low, high = ranges[field.name]
            whole = isinstance(field.default, int)
            require(field.name, getattr(settings, field.name), low, high, whole=whole)


def ranges_of(settings: Fields) -> Mapping[str, tuple[float, float]]:
    """Return the smallest and the largest value of numbers, by name; of all classes inherited."""
    found: dict[str, tuple[float, float]] = {}
    for kind in reversed(type(settings).__mro__):
        found |= vars(kind).get("RANGES", {})
    return found


def renamed(settings: Fields) -> dict[str, str]:
    """Return the present names of renamed settings by their former names."""
    names: dict[str, str] = getattr(settings, "RENAMED", {})
    return names


def refuse_former_name(settings: Fields, name: str) -> None:
    """Raise UprightError if this is the former name of a setting."""
    if name in renamed(settings):
        raise UprightError(f"{name} is now called {renamed(settings)[name]}")


def changed_values(usual: Fields, settings: Fields) -> dict[str, Any]:
    """Return the values of settings that differ from the usual ones, by name."""
    values = values_of(usual)
    return {name: value for name, value in values_of(settings).items() if value != values[name]}


def restored(default: S, values: Mapping[str, Any], owner: str) -> S:
    """Return settings of the same class as the default ones, with values read from JSON.

    Former names of settings are accepted, and settings that were added since may be missing.

    Raises
    ------
    UprightError
        If the values are not the owner's settings, or are not allowed.
    """
    values = _by_present_name(default, values)
    own, added = values_of(default), set(getattr(default, "ADDED", ()))
    if values.keys() | added != own.keys():
        raise UprightError(f"the settings {', '.join(map(repr, values))} are not those of {owner}")
    return with_values(default, values)


def with_values(settings: S, values: Mapping[str, Any]) -> S:
    """Return settings with some of the values changed.

    Former names of settings are accepted, and lists as tuples.

    Raises
    ------
    UprightError
        If there is no such setting, or its value is not allowed.
    """
    changes = {}
    for name, value in _by_present_name(settings, values).items():
        require_one_of("setting", name, values_of(settings))
        changes[name] = _converted(name, value, getattr(settings, name))
    return replace(settings, **changes)


def _converted(name: str, value: object, present: object) -> object:
    """Return a value in the type of the present one: a list as a tuple, an int as a float."""
    if isinstance(value, int) and abs(value) > LARGEST_INT:
        raise UprightError(f"{name} is a number of more than 63 bits")
    if isinstance(value, list):
        value = tuple(value)
    elif isinstance(present, float) and isinstance(value, (int, float)):
        value = value if isinstance(value, bool) else float(value)
    if not _is_like(present, value):
        raise UprightError(f"{name} is {value!r}; it must be like {present!r}")
    return value


def _by_present_name(settings: Fields, values: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the values of settings, with former names replaced by the present ones."""
    for old, new in renamed(settings).items():
        if old in values and new not in values:
            values = {new if name == old else name: value for name, value in values.items()}
    return values


def change_settings(settings: S, changes: Mapping[str, str]) -> S:
    """Return settings with some of the values changed, which are given as text.

    Raises
    ------
    UprightError
        If there is no such setting, it has been renamed, or its value is not allowed.
    """
    return replace(settings, **{n: _parse(n, t, p) for n, t, p in _named(settings, changes)})


def sweep_settings(settings: S, changes: Mapping[str, str]) -> list[S]:
    """Return settings with every combination of the values, which have commas between.

    Numbers may also be given as ranges, as `numbers_in` reads them. A tuple has commas of its own:
    several are given in brackets, as (-1, 1),(-2, 2).

    Raises
    ------
    UprightError
        As for `change_settings`, or if there are more than `MOST_CASES`.
    """
    values: dict[str, list[object]] = {}
    for name, text, present in _named(settings, changes):
        values[name] = [_parse(name, part, present) for part in _parts(name, text, present)]
    return [replace(settings, **chosen) for chosen in combinations(values)]


def _parts(name: str, text: str, present: object) -> list[str]:
    """Return the texts of the values that a setting is to have."""
    if isinstance(present, (int, float)) and not isinstance(present, bool):
        return numbers_in(name, text)
    several = not isinstance(present, tuple) or text.startswith("(")
    return split_values(text) if several else [text]


def _named(settings: Fields, changes: Mapping[str, str]) -> Iterator[tuple[str, str, object]]:
    """Yield the name, new value as text and present value of each setting to be changed."""
    present = values_of(settings)
    for name, text in changes.items():
        refuse_former_name(settings, name)
        require_one_of("setting", name, present)
        yield name, text, present[name]


LONGEST = 10_000
"""Most characters of a text NAME=VALUE."""
LARGEST_INT = 2**63 - 1
"""Largest whole number that a setting may have."""
MOST_CASES = 1_000
"""Most combinations of values in a sweep, and most cases of a study."""


def combinations(values: Mapping[str, Sequence[T]]) -> list[dict[str, T]]:
    """Return every combination of one value for each name.

    Raises
    ------
    UprightError
        If there are more than `MOST_CASES`.

    Examples
    --------
    >>> from upright.support.settings import combinations
    >>> combinations({"a": [1, 2], "b": [3]})
    [{'a': 1, 'b': 3}, {'a': 2, 'b': 3}]
    """
    require_few_cases(math.prod(map(len, values.values())))
    return [dict(zip(values, chosen, strict=True)) for chosen in product(*values.values())]


def require_few_cases(number: int) -> None:
    """Raise UprightError if a sweep has more than `MOST_CASES` cases."""
    if number > MOST_CASES:
        raise UprightError(
            f"the sweep has {number:,} cases; at most {MOST_CASES:,} are allowed in one study"
        )


def split_values(text: str) -> list[str]:
    """Return the values in a text, which have commas between outside of brackets.

    Examples
    --------
    >>> from upright.support.settings import split_values
    >>> split_values("0.1, 0.3"), split_values("(-1, 1),(-2, 2)")
    (['0.1', '0.3'], ['(-1, 1)', '(-2, 2)'])
    """
    return [part.strip() for part in re.split(r",(?![^(\[]*[)\]])", text)]


RANGE = "LOW:HIGH:COUNT or, with equal ratios, LOW:HIGH:COUNT:log"
"""How a range of numbers is written."""


def numbers_in(name: str, text: str) -> list[str]:
    """Return the numbers in a text, which has numbers and ranges with commas between, as texts.

    A range has COUNT numbers, its ends among them, with equal differences or, with `log`, equal
    ratios. Those between its ends are rounded to six significant digits.

    Parameters
    ----------
    name
        What has these values, for errors.
    text
        The text; what is no range stands as it is.

    Raises
    ------
    UprightError
        If a range is not of this form, its ends are not in order, or its numbers are too many.

    Examples
    --------
    >>> from upright.support.settings import numbers_in
    >>> numbers_in("half_length", "0.1,0.25:1:4")
    ['0.1', '0.25', '0.5', '0.75', '1']
    >>> numbers_in("half_length", "0.25:2:4:log")
    ['0.25', '0.5', '1', '2']
    """
    return [
        number
        for part in split_values(text)
        for number in (_numbers_of_range(name, part) if ":" in part else [part])
    ]


def _numbers_of_range(name: str, text: str) -> list[str]:
    def wrong(why: str) -> UprightError:
        return UprightError(f"{name} is {said(text)}; {why}")

    fields = [field.strip() for field in text.split(":")]
    is_log = fields[3:] == ["log"]
    if len(fields) != 3 + is_log:
        raise wrong(f"a range is {RANGE}")
    first, last, count = fields[:3]
    try:
        low, high = float(first), float(last)
    except ValueError:
        raise wrong("LOW and HIGH must be numbers") from None
    if not -math.inf < low < high < math.inf:
        raise wrong("LOW must be below HIGH")
    if is_log and low <= 0:
        raise wrong("equal ratios need LOW above 0")
    if not re.fullmatch("[0-9]{1,4}", count) or not 2 <= int(count) <= MOST_CASES:
        raise wrong(f"COUNT must be a whole number from 2 to {MOST_CASES:,}")
    between = _between(low, high, int(count), is_log=is_log)
    if any(one >= next_ for one, next_ in pairwise([low, *between, high])):
        raise wrong("LOW and HIGH are too close for so many numbers of six digits")
    return [first, *(f"{value:g}" for value in between), last]


def _between(low: float, high: float, count: int, *, is_log: bool) -> list[float]:
    """Return what lies between the ends of a range, rounded to six significant digits."""
    ends = (math.log(low), math.log(high)) if is_log else (low, high)
    parts = (step / (count - 1) for step in range(1, count - 1))
    values = [(1 - part) * ends[0] + part * ends[1] for part in parts]
    # What is 0 between -1 and 1 is not quite 0 as it is computed.
    digits = 12 - math.floor(math.log10(max(abs(low), abs(high))))
    return [float(f"{math.exp(v) if is_log else round(v, digits) + 0.0:.6g}") for v in values]


def as_options(option: str, values: Mapping[str, Any]) -> list[str]:
    """Return command-line options that set these values, quoted for the shell.

    Examples
    --------
    >>> from upright.support.settings import as_options
    >>> as_options("--set", {"learning_rate": 0.3, "x_edges": (-1.5, 1.5)})
    ['--set learning_rate=0.3', "--set 'x_edges=(-1.5, 1.5)'"]
    """
    return [f"{option} {shlex.quote(f'{name}={value}')}" for name, value in values.items()]


def pairs(option: str, changes: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield the name and value of each text of the form NAME=VALUE.

    Parameters
    ----------
    option
        Name of the option that takes these texts, for errors.

    Raises
    ------
    UprightError
        If a text has no =, a name is given twice, or a text is longer than `LONGEST`.
    """
    given = set()
    for change in changes:
        if len(change) > LONGEST:
            why = f"it has {len(change):,} characters; at most {LONGEST:,} are allowed"
            raise UprightError(f"{option} is {said(change)}; {why}")
        name, sign, value = change.partition("=")
        if not sign:
            raise UprightError(f"{option} is {said(change)}; it must be NAME=VALUE")
        name = name.strip().replace("-", "_")
        if name in given:
            raise UprightError(f"{option} is {said(change)}; {name} is given twice")
        given.add(name)
        yield name, value.strip()


def _parse(name: str, text: str, present: object) -> object:
    """Return the value that a text stands for, of the same kind as the present one."""
    if isinstance(present, str):
        return text
    if type(present) is int:
        try:
            return whole_number(text, commas=False)  # a comma is between several values
        except UprightError as error:
            raise UprightError(f"{name} is {error}") from None
    try:
        value = float(text) if isinstance(present, float) else _literal(text)
    except (ValueError, SyntaxError):
        raise UprightError(f"{name} is {said(text)}; it must be like {present!r}") from None
    if isinstance(present, tuple) and isinstance(value, (int, float)):
        value = (value,)
    if not _is_like(present, value):
        raise UprightError(f"{name} is {said(text)}; it must be like {present!r}")
    return value


def _literal(text: str) -> Any:
    """Return the value of a Python literal.

    Raises
    ------
    ValueError, SyntaxError
        If it is not one, or too deep.
    """
    try:
        return ast.literal_eval(text)
    except (MemoryError, RecursionError, TypeError):  # too deep, or a list among keys
        raise ValueError from None


def _is_like(present: object, value: object) -> bool:
    """Whether a value is of the present one's kind; an int is accepted as a float."""
    return type(value) is type(present) or (type(value) is int and isinstance(present, float))


def describe_settings(settings: Any) -> dict[str, str]:
    """Return the text that documents each field of a dataclass or NamedTuple, or of its class."""
    kind = settings if isinstance(settings, type) else type(settings)
    names: Any = kind
    own = {field.name for field in fields(kind)} if is_dataclass(kind) else set(names._fields)
    lines: dict[str, str] = {}
    for each in reversed(kind.__mro__):
        if is_dataclass(each) or each is kind:
            lines |= {name: text for name, text in _documented(each) if name in own}
    return lines


def _documented(kind: type) -> Iterator[tuple[str, str]]:
    """Yield the fields that a class itself defines, each with the text below it."""
    (definition,) = ast.parse(inspect.getsource(kind)).body
    assert isinstance(definition, ast.ClassDef)
    for field, text in zip(definition.body, definition.body[1:], strict=False):
        if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr):
            assert isinstance(field.target, ast.Name)
            assert isinstance(text.value, ast.Constant)
            yield field.target.id, " ".join(str(text.value.value).split())
