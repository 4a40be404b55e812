"""The agents, by name: one learning rule a file, with its named settings beside it."""

import ast
import inspect
from dataclasses import fields, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

from upright.errors import UprightError, require_one_of

if TYPE_CHECKING:
    import numpy as np

    from upright.agents.outside import Outside

AGENTS = {
    "adaptive-lqr": "upright.agents.adaptive_lqr",
    "reinforce": "upright.agents.reinforce",
    "ndp": "upright.agents.ndp",
    "q-learning": "upright.agents.q_learning",
    "ase-ace": "upright.agents.ase_ace",
    "random-search": "upright.agents.random_search",
}
"""Where each agent is found. Modules are imported when used: compiled code is slow to load."""

MATLAB_AGENTS = ("q-learning", "reinforce", "random-search")
"""The agents that the MATLAB twin has, too."""


class Settings(Protocol):
    """The settings of an agent: a frozen dataclass that checks its values and makes the agent."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def agent(self, rng: "np.random.Generator") -> Any:
        """Return a new agent, its memory blank or random."""


def is_outside(agent: str) -> bool:
    """Whether this names an agent from outside the package."""
    return ":" in agent


def named_settings(agent: str) -> dict[str, Settings]:
    """Return an agent's settings by name: "default", and "as-published" where there is a source.

    Parameters
    ----------
    agent
        One of AGENTS, or `module:name` of an agent from outside.

    Raises
    ------
    UprightError
        If there is no such agent, or it is none.
    """
    if is_outside(agent):
        from numpy.random import default_rng

        outside = _outside(agent)
        outside.agent(default_rng(0))
        return {"default": outside}
    require_one_of("agent", agent, [*AGENTS, "module:name"])
    settings: dict[str, Settings] = import_module(AGENTS[agent]).SETTINGS
    return settings


def _outside(agent: str) -> "Outside":
    from upright.agents.outside import Outside

    return Outside(agent)


def summarise_agent(agent: str) -> str:
    """Return what an agent is, in one line.

    Raises
    ------
    UprightError
        If there is no such agent.
    """
    if is_outside(agent):
        return _outside(agent).summary()
    require_one_of("agent", agent, [*AGENTS, "module:name"])
    return (import_module(AGENTS[agent]).__doc__ or "").partition("\n")[0]


def restore_settings(agent: str, values: dict[str, Any]) -> Settings:
    """Return the settings that were written to a file as JSON.

    An agent from outside need not be there any more, and is not looked for.

    Raises
    ------
    UprightError
        If they are not this agent's, or not allowed.
    """
    if is_outside(agent):
        if values != {"agent_name": agent}:  # another name would be other code
            raise UprightError(f"the settings are {values!r}; they are not those of {agent!r}")
        return _outside(agent)
    default = named_settings(agent)["default"]
    if values.keys() != {field.name for field in fields(default)}:
        raise UprightError(f"the settings {', '.join(map(repr, values))} are not those of {agent}")
    values = {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()}
    for name, value in values.items():
        present = getattr(default, name)
        if not _is_like(present, value):
            raise UprightError(f"{name} is {value!r}; it must be like {present!r}")
    return replace(default, **values)


def change_settings(settings: Settings, changes: dict[str, str]) -> Settings:
    """Return settings with some values changed, given as text.

    Raises
    ------
    UprightError
        If there is no such setting, or its value is not allowed.
    """
    present = {field.name: getattr(settings, field.name) for field in fields(settings)}
    values = {}
    for name, text in changes.items():
        require_one_of("setting", name, present)
        values[name] = _parse(name, text, present[name])
    return replace(settings, **values)


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


def describe_settings(settings: Settings) -> dict[str, str]:
    """Return the line of text that stands under each field of a settings class."""
    (definition,) = ast.parse(inspect.getsource(type(settings))).body
    assert isinstance(definition, ast.ClassDef)
    lines = {}
    for field, text in zip(definition.body, definition.body[1:], strict=False):
        if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr):
            assert isinstance(field.target, ast.Name)
            assert isinstance(text.value, ast.Constant)
            lines[field.target.id] = " ".join(str(text.value.value).split())
    return lines
