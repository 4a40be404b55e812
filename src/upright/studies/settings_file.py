"""Files of an agent's settings, in TOML: `upright tune` writes them, and people may.

    agent = "q-learning"

    [settings]
    learning_rate = 0.1

    [found]                      # how they were found; nothing reads it

A file may leave out settings. It may come from anyone, so every name and value is checked, and its
size is bounded.
"""

import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from upright.agents import AGENTS, Settings
from upright.errors import UprightError, require_one_of
from upright.studies.case import refuse_settings_of_custom
from upright.support.files import check_output
from upright.support.settings import values_of, with_values

SUFFIX = ".toml"
"""How the name of a file of settings ends."""
LARGEST = 10**6
"""Most bytes that a file of settings may have."""
PARTS = ("agent", "settings", "found")
"""What a file of settings has."""


class SettingsFile(NamedTuple):
    """What a file of settings holds."""

    name: str
    """Name of the file, without its folder."""
    agent: str
    """Name of the agent."""
    values: dict[str, Any]
    """Values of its settings by name."""


def read_settings(path: Path | str) -> SettingsFile:
    """Read a file of settings.

    Raises
    ------
    UprightError
        If there is no such file, it is not a file of settings, or a name or value is not allowed.
    """
    path = Path(path)
    try:
        content = _content(path)
        for part in content:
            require_one_of("key", part, PARTS)
        agent, values = content.get("agent"), content.get("settings")
        if not isinstance(agent, str) or not isinstance(values, dict):
            raise UprightError("it must have the key agent and the table [settings]")
        AGENTS.check(agent)
        refuse_settings_of_custom(agent)
        with_values(AGENTS.default(agent), values)
    except UprightError as error:
        raise UprightError(f"settings file is {str(path)!r}; {error}") from None
    return SettingsFile(path.name, agent, values)


def _content(path: Path) -> dict[str, Any]:
    require_one_of("its ending", path.suffix, (SUFFIX,))
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST + 1)
        if len(data) > LARGEST:
            raise UprightError(f"it is larger than {LARGEST:,} bytes")
        return tomllib.loads(data.decode())
    except FileNotFoundError:
        raise UprightError("no such file") from None
    except OSError as error:
        raise UprightError(f"it cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:  # not TOML, or not UTF-8
        if isinstance(error, UprightError):
            raise
        raise UprightError(f"it is not TOML: {error}") from None


def check_settings_output(path: Path | str) -> None:
    """Check that a file of settings can later be written to this path.

    Raises
    ------
    UprightError
        If it cannot, or its name does not end in `SUFFIX`.
    """
    require_one_of(f"the ending of {str(path)!r}", Path(path).suffix, (SUFFIX,))
    check_output(path)


def settings_text(agent: str, settings: Settings, found: Mapping[str, Any]) -> str:
    """Return the content of a file of settings.

    Parameters
    ----------
    agent
        Name of the agent.
    settings
        Its settings.
    found
        How they were found: names with texts, numbers, or sequences of these.
    """
    lines = [
        "# Settings for the option --settings-file of upright learn, table and tune.",
        f"agent = {_toml(agent)}",
        "",
        "[settings]",
        *(f"{name} = {_toml(value)}" for name, value in values_of(settings).items()),
        "",
        "[found]",
        *(f"{name} = {_toml(value)}" for name, value in found.items()),
    ]
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (tuple, list)):
        return f"[{', '.join(map(_toml, value))}]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
