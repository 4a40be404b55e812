"""Saving, loading and exporting policies.

Every format is a module with `encode(policy)`, which returns the contents of a file. Formats that
can be read again also have `begins(start)`, which recognises a file by its first bytes,
`read(path, agent)` and `read_header(path)`.
"""

import os
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

from upright.agents.custom import name_of
from upright.core.contracts import AnyAgent
from upright.errors import UprightError, require_kind, require_one_of
from upright.policies.checks import explained
from upright.policies.divergence import refuse_diverged
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
"""The formats of policies, by file ending."""


def save_policy(path: Path | str, policy: Policy) -> None:
    """Write a policy to a file that `load_policy` reads: JSON if it ends in ``.json``, else NumPy.

    A NumPy archive holds everything that the agent learned; JSON holds what the policy computes, in
    a form that other languages can read.

    Parameters
    ----------
    path
        The file to write.
    policy
        The policy to save.

    Raises
    ------
    UprightError
        If the file cannot be written, the agent diverged as it learned, or the file is to be an
        archive and the settings of the policy's agent are unknown.

    Examples
    --------
    >>> policy, _ = upright.learn("q-learning", steps=300)
    >>> upright.save_policy("policy.npz", policy)
    >>> upright.load_policy("policy.npz").agent
    'q-learning'
    """
    require_kind("path", path, (str, Path), "the path of a file")
    require_kind("policy", policy, Policy, "what learn or load_policy returns")
    refuse_diverged(policy)
    ending = ".json" if Path(path).suffix == ".json" else ".npz"
    write_file(path, FORMATS.module(ending).encode(policy))


def export_policy(path: Path | str, policy: Policy, *, greedy: bool = False) -> None:
    """Write a policy to a file that other languages can read; the ending selects the format.

    Parameters
    ----------
    path
        The file to write: ``.h`` for a C99 header, ``.onnx`` for ONNX, ``.json`` for JSON.
    policy
        The policy to export.
    greedy
        Whether to export the more probable push itself, 1 to the right or 0 to the left, in place
        of its probability, so that the user of the file needs no random numbers. Where both pushes
        are equally probable, it is 0.

    Raises
    ------
    UprightError
        As for `check_export`; if the policy's agent does not provide its form, or diverged as it
        learned; or if ONNX is needed and not installed.

    Examples
    --------
    >>> policy, _ = upright.learn("q-learning", steps=300)
    >>> upright.export_policy("policy.h", policy)
    >>> upright.export_policy("policy.json", policy)
    >>> upright.load_policy("policy.json").agent
    'q-learning'
    """
    require_kind("path", path, (str, Path), "the path of a file")
    require_kind("policy", policy, Policy, "what learn or load_policy returns")
    refuse_diverged(policy)
    policy = replace(policy, greedy=True) if greedy else policy
    write_file(path, FORMATS.module(check_export(path).suffix).encode(policy))


def check_export(path: Path | str) -> Path:
    """Return the path of an export to be written later, after checking that it can be written.

    Raises
    ------
    UprightError
        If its ending is not in FORMATS, or it cannot be written.
    """
    require_one_of(f"the ending of {str(path)!r}", Path(path).suffix, FORMATS)
    return check_output(path)


def load_policy(path: Path | str, agent: AnyAgent | None = None) -> Policy:
    """Read a policy from a file.

    Nothing in the file is executed, and no more is unpacked than its settings imply.

    Parameters
    ----------
    path
        A file written by `save_policy`, or a JSON file from another program. It may come from
        anyone.
    agent
        The agent that learned it. A custom agent is code that will be imported, so it must be named
        here, as it is in the file, or its class or function be given.

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
    require_kind("path", path, (str, Path), "the path of a file")
    policy: Policy = _reader(path).read(path, agent if agent is None else name_of(agent))
    return policy


def read_header(path: Path | str) -> dict[str, Any]:
    """Return the header of a policy's file: its contract, and the settings of its agent.

    For a JSON file, this is everything except the numbers of its form.

    Raises
    ------
    UprightError
        If the file is missing, damaged, or not a policy.
    """
    header: dict[str, Any] = _reader(path).read_header(path)
    return header


def is_policy(path: Path | str) -> bool:
    """Whether a file begins like a policy's, even if it is damaged further on."""
    return _format_of(path) is not None


def _reader(path: Path | str) -> ModuleType:
    """Return the module of the format of a file.

    Raises
    ------
    UprightError
        If the file is missing, or in none of the formats.
    """
    if not os.path.isfile(path):  # unlike Path's, it takes any name
        raise UprightError(f"policy is {str(path)!r}; there is no such file")
    module = _format_of(path)
    if module is None:
        raise UprightError(f"policy is {str(path)!r}; it is damaged, or not a policy's file")
    return module


def _format_of(path: Path | str) -> ModuleType | None:
    """Return the module that recognises the beginning of a file, or None."""
    if not os.path.isfile(path):
        return None
    with explained(path), Path(path).open("rb") as file:
        start = file.read(100)
    readable = (module for module in map(FORMATS.module, FORMATS) if hasattr(module, "begins"))
    return next((module for module in readable if module.begins(start)), None)
