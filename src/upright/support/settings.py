"""Settings: frozen dataclasses that stand beside what they set, a line of text under each field.

The command line, stores, documents and ROS 2 read fields, values and texts from there.
"""

import ast
import inspect
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, ClassVar, Protocol, TypeVar

from upright.errors import UprightError, require_one_of


class Fields(Protocol):
    """Any dataclass.

    If settings once had other names, its class attribute `RENAMED` holds the new one of each.
    """

    __dataclass_fields__: ClassVar[dict[str, Any]]


S = TypeVar("S", bound=Fields)


def values_of(settings: Fields) -> dict[str, Any]:
    """Return the values of settings by name."""
    return {field.name: getattr(settings, field.name) for field in fields(settings)}


def renamed(settings: Fields) -> dict[str, str]:
    """Return the present names of settings that once had other names, by those."""
    names: dict[str, str] = getattr(settings, "RENAMED", {})
    return names


def refuse_former_name(settings: Fields, name: str) -> None:
    """Raise UprightError if a person names a setting as it was once called."""
    if name in renamed(settings):
        raise UprightError(f"{name} is now called {renamed(settings)[name]}")


def changed_values(usual: Fields, settings: Fields) -> dict[str, Any]:
    """Return by name the values of settings that differ from the usual ones."""
    values = values_of(usual)
    return {name: value for name, value in values_of(settings).items() if value != values[name]}


def restored(default: S, values: Mapping[str, Any], owner: str) -> S:
    """Return settings like the default ones with the values that were written to a file as JSON.

    A file may hold former names of settings.

    Raises
    ------
    UprightError
        If they are not the owner's settings, or not allowed.
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
    """Return settings with some values changed, given as text.

    Raises
    ------
    UprightError
        If there is no such setting, it now has another name, or its value is not allowed.
    """
    present = values_of(settings)
    values = {}
    for name, text in changes.items():
        refuse_former_name(settings, name)
        require_one_of("setting", name, present)
        values[name] = _parse(name, text, present[name])
    return replace(settings, **values)


def pairs(option: str, changes: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Return names and values of texts like NAME=VALUE.

    Raises
    ------
    UprightError
        If there is no =; `option` is what gave the texts.
    """
    for change in changes:
        name, sign, value = change.partition("=")
        if not sign:
            raise UprightError(f"{option} is {change!r}; it must be NAME=VALUE")
        yield name.strip().replace("-", "_"), value.strip()


def _parse(name: str, text: str, present: object) -> object:
    """Return the value that a text means, of the same kind as the present one."""
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
    """Whether a value is of the present one's kind; a whole number will do for any other."""
    return type(value) is type(present) or (type(value) is int and isinstance(present, float))


def describe_settings(settings: Any) -> dict[str, str]:
    """Return the sentence under each field of a dataclass or a NamedTuple, or of its class."""
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
