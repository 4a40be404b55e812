"""TOML files that people write: read within bounds, with errors that name the line and the key."""

import json
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from upright.errors import CodeError, UprightError, require_one_of
from upright.support.files import check_output

T = TypeVar("T")

SUFFIX = ".toml"
"""How the name of a TOML file ends."""
Key = str | int
"""A key of a table, or a place in an array of tables, from 0."""
LARGEST = 10**6
"""Most bytes that such a file may have."""
MOST_WORK = 4 * 10**6
"""Most characters to be parsed again in search of a line, some seconds of work."""


class TomlFile(NamedTuple):
    """What a TOML file holds, with what it takes to say where an error is."""

    kind: str
    """What such a file is called in errors, such as "settings file"."""
    path: Path
    """Path of the file."""
    text: str
    """All of its text."""
    content: dict[str, Any]
    """What the text means."""

    def error(self, why: object, *keys: Key) -> UprightError:
        """Return an error that names the file, and the line and the name of a key.

        Parameters
        ----------
        why
            What is wrong, in a line.
        keys
            The key after those of the tables that it stands in; none if it is not about a key. A
            number is the place of a table in an array of them, from 0.
        """
        line = self.line_of(*keys)
        places = [f"line {line}"] if line else []
        places += [_path(keys)] if keys else []
        place = f"{', '.join(places)}: " if places else ""
        return UprightError(f"{self.kind} is {str(self.path)!r}; {place}{why}")

    def checked(
        self, check: Callable[[Mapping[str, Any]], T], values: Mapping[str, Any], *keys: Key
    ) -> T:
        """Return what a function makes of values by name.

        Parameters
        ----------
        check
            Takes the values, and raises UprightError if it refuses any.
        values
            Those of a table of the file.
        keys
            The names of the tables that lead to them.

        Raises
        ------
        UprightError
            If it refuses them: the error names the value that is refused by itself, if any is, or
            else the table.
        """
        try:
            return check(values)
        except CodeError:
            raise
        except UprightError as error:
            why = str(error)
            refused = (name for name in values if refusal(check, {name: values[name]}) == why)
            raise self.error(why, *keys, *list(refused)[:1]) from None

    @contextmanager
    def at(self, *keys: Key) -> Iterator[None]:
        """Let an error name the place that it is about, unless it is one of custom code."""
        try:
            yield
        except CodeError:
            raise
        except UprightError as error:
            raise self.error(error, *keys) from None

    def line_of(self, *keys: Key) -> int | None:
        """Return the number of the line on which a key is first given a value, or a table begins.

        The parser itself tells, whatever the form of the key and of its value: the lines above are
        TOML without the key, and with this line, and those that its value goes on for, they are
        TOML that has it.

        Parameters
        ----------
        keys
            The key after those of the tables that it stands in, as for `error`.

        Returns
        -------
        int or None
            None if there is no such key, or to find it would take long.
        """
        lines = self.text.split("\n")
        if not keys or len(lines) * len(self.text) > MOST_WORK:
            return None
        begins = 1
        for number in range(1, len(lines) + 1):
            content = _parsed("\n".join(lines[:number]) + "\n")
            if content is None:  # within a value of several lines
                continue
            if _has(content, keys):
                return begins
            begins = number + 1
        return None


def read_toml(path: Path | str, kind: str) -> TomlFile:
    """Read a TOML file.

    Parameters
    ----------
    path
        Path of the file, which may come from anyone.
    kind
        What such a file is called in errors, such as "settings file".

    Raises
    ------
    UprightError
        If there is no such file, it is too large, or it is not TOML.
    """
    path = Path(path)
    try:
        require_one_of("its ending", path.suffix, (SUFFIX,))
        text = _text(path)
        content = tomllib.loads(text)
        repr(content)  # raises for a hexadecimal number of more digits than Python writes
        return TomlFile(kind, path, text, content)
    except UprightError as error:
        why = str(error)
    except (ValueError, RecursionError) as error:  # not TOML, or not UTF-8
        why = f"it is not TOML: {error}"
    raise UprightError(f"{kind} is {str(path)!r}; {why}")


def _text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST + 1)
    except FileNotFoundError:
        raise UprightError("no such file") from None
    except OSError as error:
        raise UprightError(f"it cannot be read: {error.strerror}") from None
    if len(data) > LARGEST:
        raise UprightError(f"it is larger than {LARGEST:,} bytes")
    return data.decode("utf-8-sig")  # some editors begin a file with a mark


def refusal(check: Callable[[Mapping[str, Any]], object], values: Mapping[str, Any]) -> str:
    """Return the words in which a function refuses values, or an empty string."""
    try:
        check(values)
    except UprightError as error:
        return str(error)
    return ""


def _parsed(text: str) -> dict[str, Any] | None:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError):
        return None


def _has(content: Any, keys: Sequence[Key]) -> bool:
    """Whether a table has a key, given after those that lead there."""
    for key in keys:
        if isinstance(content, list) and isinstance(key, int):
            if key >= len(content):
                return False
        elif not isinstance(content, dict) or key not in content:
            return False
        content = content[key]
    return True


def _path(keys: Sequence[Key]) -> str:
    """Return keys as they are written, such as tasks[1].parameters."""
    parts = (f"[{key}]" if isinstance(key, int) else f".{_key(key)}" for key in keys)
    return "".join(parts).removeprefix(".")


def _key(name: str) -> str:
    """Return a key as it is written: quoted unless it is of letters, digits, _ and -."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else toml_value(name)


def toml_value(value: Any) -> str:
    """Return a value as TOML: a text, a number, a truth value, or a sequence of these.

    Examples
    --------
    >>> from upright.support.toml_file import toml_value
    >>> toml_value((1, 0.5, True, "a"))
    '[1, 0.5, true, "a"]'
    """
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (tuple, list)):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(float(value) if isinstance(value, float) else value)  # NumPy's name their type


def toml_text(content: Mapping[str, Any]) -> str:
    """Return tables as TOML; what they hold is what `toml_value` takes, and tables.

    Examples
    --------
    >>> from upright.support.toml_file import toml_text
    >>> print(toml_text({"runs": 5, "parameters": {"force": [9.0, 10.0]}}), end="")
    runs = 5
    <BLANKLINE>
    [parameters]
    force = [9.0, 10.0]
    """
    return "\n\n".join(_tables(content)) + "\n"


def _tables(content: Mapping[str, Any], *keys: str) -> Iterator[str]:
    """Yield a table, without what stands in tables of its own, and then these."""
    lines = [f"[{_path(keys)}]"] if keys else []
    within = {name: value for name, value in content.items() if isinstance(value, Mapping)}
    lines += [
        f"{_key(name)} = {toml_value(value)}"
        for name, value in content.items()
        if name not in within
    ]
    if len(lines) > bool(keys) or not within:
        yield "\n".join(lines)
    for name, value in within.items():
        yield from _tables(value, *keys, name)


def check_toml_output(path: Path | str) -> None:
    """Check that a TOML file can later be written to this path.

    Raises
    ------
    UprightError
        If it cannot, or its name does not end in `SUFFIX`.
    """
    require_one_of(f"the ending of {str(path)!r}", Path(path).suffix, (SUFFIX,))
    check_output(path)
