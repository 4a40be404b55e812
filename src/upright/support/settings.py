"""Settings: frozen dataclasses, defined beside the code they configure, with a text for each field.

The command line, stores, documentation and ROS 2 read fields, values and texts from them.
"""

import ast
import inspect
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, ClassVar, Protocol, TypeVar

from upright.errors import UprightError, require_one_of


class Fields(Protocol):
    """Any dataclass.

    Its class attribute `RENAMED`, if any, maps former names of settings to present ones.
    """

    __dataclass_fields__: ClassVar[dict[str, Any]]


S = TypeVar("S", bound=Fields)


def values_of(settings: Fields) -> dict[str, Any]:
    """Return the values of settings as a dictionary."""
    return {field.name: getattr(settings, field.name) for field in fields(settings)}


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

    Former names of settings are accepted.

    Raises
    ------
    UprightError
        If the values are not the owner's settings, or are not allowed.
    """
    for old, new in renamed(default).items():
        if old in values and new not in values:
            values = {new if name == old else name: value for name, value in values.items()}
    if values.keys() != values_of(default).keys():
        raise UprightError(f"the settings {', '.join(map(repr, values))} are not those of {owner}")
    values = {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()}
    for name, value in values.items():
        present = getattr(default, name)
        if not _is_like(present, value):
            raise UprightError(f"{name} is {value!r}; it must be like {present!r}")
    return replace(default, **values)


def change_settings(settings: S, changes: Mapping[str, str]) -> S:
    """Return settings with some of the values changed, which are given as text.

    Raises
    ------
    UprightError
        If there is no such setting, it has been renamed, or its value is not allowed.
    """
    present = values_of(settings)
    values = {}
    for name, text in changes.items():
        refuse_former_name(settings, name)
        require_one_of("setting", name, present)
        values[name] = _parse(name, text, present[name])
    return replace(settings, **values)


def pairs(option: str, changes: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield the name and value of each text of the form NAME=VALUE.

    Parameters
    ----------
    option
        Name of the option that takes these texts, for errors.

    Raises
    ------
    UprightError
        If a text has no =.
    """
    for change in changes:
        name, sign, value = change.partition("=")
        if not sign:
            raise UprightError(f"{option} is {change!r}; it must be NAME=VALUE")
        yield name.strip().replace("-", "_"), value.strip()


def _parse(name: str, text: str, present: object) -> object:
    """Return the value that a text stands for, of the same kind as the present one."""
    if isinstance(present, str):
        return text
    try:
        value = float(text) if isinstance(present, float) else ast.literal_eval(text)
    except (ValueError, SyntaxError):
        raise UprightError(f"{name} is {text!r}; it must be like {present!r}") from None
    if isinstance(present, tuple) and isinstance(value, (int, float)):
        value = (value,)
    if not _is_like(present, value):
        raise UprightError(f"{name} is {text!r}; it must be like {present!r}")
    return value


def _is_like(present: object, value: object) -> bool:
    """Whether a value is of the present one's kind; an int is accepted as a float."""
    return type(value) is type(present) or (type(value) is int and isinstance(present, float))


def describe_settings(settings: Any) -> dict[str, str]:
    """Return the text that documents each field of a dataclass or NamedTuple, or of its class."""
    kind = settings if isinstance(settings, type) else type(settings)
    (definition,) = ast.parse(inspect.getsource(kind)).body
    assert isinstance(definition, ast.ClassDef)
    names: Any = kind
    own = {field.name for field in fields(kind)} if is_dataclass(kind) else set(names._fields)
    lines = {}
    for field, text in zip(definition.body, definition.body[1:], strict=False):
        if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr):
            assert isinstance(field.target, ast.Name)
            assert isinstance(text.value, ast.Constant)
            if field.target.id in own:
                lines[field.target.id] = " ".join(str(text.value.value).split())
    return lines
