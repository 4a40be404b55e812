"""Saving, loading and exporting policies.

Every format has a module with `encode(policy)`, which returns what a file of this format holds. A
format that can be read again also has `begins(start)`, which tells by the first bytes of a file
whether it is of this format, `read(path, agent)` and `read_header(path)`.
"""

from pathlib import Path
from types import ModuleType
from typing import Any

from upright.errors import UprightError, require_one_of
from upright.policies.checks import explained
from upright.policies.policy import Policy
from upright.support.files import check_output, write_file
from upright.support.registry import Registry
from upright.support.settings import Fields

FORMATS: Registry[Fields] = Registry(
    "format of a policy",
    {
        ".h": "upright.policies.c99",
        ".onnx": "upright.policies.onnx",
        ".json": "upright.policies.json_file",
        ".npz": "upright.policies.npz_file",
    },
)
"""The formats of policies by the ending of their files."""


def save_policy(path: Path | str, policy: Policy) -> None:
    """Write a policy to a file that `load_policy` reads: as JSON if it ends so, else as `.npz`.

    A NumPy archive holds all that the agent learned; JSON holds what the policy computes, in terms
    that other languages read.

    Parameters
    ----------
    path
        The file to write.
    policy
        The policy to save.

    Raises
    ------
    UprightError
        If the file cannot be written, or the policy does not know the settings of its agent, which
        an archive holds.

    Examples
    --------
    >>> policy, _ = upright.learn("q-learning", steps=300)
    >>> upright.save_policy("policy.npz", policy)
    >>> upright.load_policy("policy.npz").agent
    'q-learning'
    """
    ending = ".json" if Path(path).suffix == ".json" else ".npz"
    write_file(path, FORMATS.module(ending).encode(policy))


def export_policy(path: Path | str, policy: Policy) -> None:
    """Write a policy to a file in a form that other languages read; its ending says which.

    Parameters
    ----------
    path
        Where to: ``.h`` is a header in C99, ``.onnx`` is ONNX, ``.json`` is JSON.
    policy
        What is written.

    Raises
    ------
    UprightError
        As `check_export`; if the policy's agent does not tell its form; or if ONNX is asked for and
        not installed.

    Examples
    --------
    >>> policy, _ = upright.learn("q-learning", steps=300)
    >>> upright.export_policy("policy.h", policy)
    >>> upright.export_policy("policy.json", policy)
    >>> upright.load_policy("policy.json").agent
    'q-learning'
    """
    write_file(path, FORMATS.module(check_export(path).suffix).encode(policy))


def check_export(path: Path | str) -> Path:
    """Return the path of an export to be written later, having made sure that it can be.

    Raises
    ------
    UprightError
        If its ending is not one of FORMATS, or it cannot be written.
    """
    require_one_of(f"the ending of {str(path)!r}", Path(path).suffix, FORMATS)
    return check_output(path)


def load_policy(path: Path | str, agent: str | None = None) -> Policy:
    """Read a policy from a file.

    Nothing in the file is executed, and no more is unpacked than the settings in it imply.

    Parameters
    ----------
    path
        A file that `save_policy` wrote, or another program in JSON; or anything else.
    agent
        The agent that learned it. A custom agent is code, which is imported, so it must be named
        here, as in the file.

    Raises
    ------
    UprightError
        If the file is missing, damaged, not a policy, or another agent's.

    Examples
    --------
    >>> learned, _ = upright.learn("q-learning", steps=300)
    >>> upright.save_policy("policy.npz", learned)
    >>> policy = upright.load_policy("policy.npz")
    >>> policy.task["noise"], policy.task["steps"]
    ('none', 300)
    """
    policy: Policy = _reader(path).read(path, agent)
    return policy


def read_header(path: Path | str) -> dict[str, Any]:
    """Return what a policy's file says of itself: its contract, and the settings of its agent.

    Of a file in JSON: all but the numbers of its form.

    Raises
    ------
    UprightError
        If the file is missing, damaged, or not a policy.
    """
    header: dict[str, Any] = _reader(path).read_header(path)
    return header


def is_policy(path: Path | str) -> bool:
    """Whether a file begins as a policy does, be it damaged further on."""
    return _format_of(path) is not None


def _reader(path: Path | str) -> ModuleType:
    """Return the module that reads a file.

    Raises
    ------
    UprightError
        If the file is missing, or none does.
    """
    if not Path(path).is_file():
        raise UprightError(f"policy is {str(path)!r}; there is no such file")
    module = _format_of(path)
    if module is None:
        raise UprightError(f"policy is {str(path)!r}; it is damaged, or not a file of a policy")
    return module


def _format_of(path: Path | str) -> ModuleType | None:
    """Return the module whose format a file begins with, if there is one."""
    if not Path(path).is_file():
        return None
    with explained(path), Path(path).open("rb") as file:
        start = file.read(100)
    readable = (module for module in map(FORMATS.module, FORMATS) if hasattr(module, "begins"))
    return next((module for module in readable if module.begins(start)), None)
