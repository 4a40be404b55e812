"""Files of an agent's settings, in TOML: `upright tune` writes them, and people may.

    agent = "q-learning"

    [settings]
    learning_rate = 0.1

    [found]                      # how they were found; nothing reads it

A file may leave out settings. It may come from anyone, so every name and value is checked, and its
size is bounded.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from upright.agents import AGENTS, Settings
from upright.errors import require_one_of
from upright.studies.case import refuse_settings_of_custom
from upright.support.settings import values_of, with_values
from upright.support.toml_file import read_toml, toml_value

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
    file = read_toml(path, "settings file")
    file.checked(_check_parts, file.content)
    agent, values = file.content.get("agent"), file.content.get("settings")
    if not isinstance(agent, str) or not isinstance(values, dict):
        raise file.error("it must have the key agent and the table [settings]")
    file.checked(_check_agent, {"agent": agent})
    file.checked(lambda some: with_values(AGENTS.default(agent), some), values, "settings")
    return SettingsFile(file.path.name, agent, values)


def _check_parts(content: Mapping[str, Any]) -> None:
    for part in content:
        require_one_of("key", part, PARTS)


def _check_agent(content: Mapping[str, Any]) -> None:
    AGENTS.check(content["agent"])
    refuse_settings_of_custom(content["agent"])


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
        f"agent = {toml_value(agent)}",
        "",
        "[settings]",
        *(f"{name} = {toml_value(value)}" for name, value in values_of(settings).items()),
        "",
        "[found]",
        *(f"{name} = {toml_value(value)}" for name, value in found.items()),
    ]
    return "\n".join(lines) + "\n"
