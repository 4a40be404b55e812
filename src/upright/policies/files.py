"""Saving, loading and exporting policies; the ending of a file says its format."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from upright.agents import AGENTS, is_custom
from upright.errors import require_one_of
from upright.policies.c99 import c_header
from upright.policies.checks import check_agent, check_contract, explained, read_task
from upright.policies.form_json import NUMBERS
from upright.policies.json_file import first_bytes, is_json, json_form, load_json, read_json
from upright.policies.npz_file import fill, opened, read_npz_header
from upright.policies.onnx import onnx_model
from upright.policies.policy import Policy
from upright.support.files import check_output, write_file


def load_policy(path: Path | str, agent: str | None = None) -> Policy:
    """Read a policy from a file.

    Nothing in the file is executed, and no more is unpacked than the settings in it imply.

    Parameters
    ----------
    path
        What `save_policy` or `export_policy` wrote, the latter as JSON, or anything else.
    agent
        The agent that learned it. One from outside is code, which is imported; so it must be named
        here, as in the file.

    Raises
    ------
    UprightError
        If the file is missing, damaged, not a policy, or another agent's.
    """
    if is_json(path):
        return load_json(path, agent)
    with opened(path) as archive:
        header = read_npz_header(archive)
        check_agent(header["agent"], agent)
        settings = AGENTS.restore(header["agent"], header["settings"])
        memory = settings.agent(np.random.default_rng(0))
        former_names = getattr(settings, "RENAMED_ARRAYS", {})
        fill(memory, archive, finite=not is_custom(header["agent"]), renamed=former_names)
        policy = Policy(header["agent"], memory, **read_task(header["task"]))
        check_contract(policy, header, {"version"})
    return policy


def read_header(path: Path | str) -> dict[str, Any]:
    """Return what a policy's file says of itself: its contract, and the settings of its agent.

    Of a file in JSON: all but the numbers of its form.

    Raises
    ------
    UprightError
        If the file is missing, damaged, or not a policy.
    """
    if is_json(path):
        with explained(path):
            entries = read_json(path)
        return {name: value for name, value in entries.items() if name not in NUMBERS}
    with opened(path) as archive:
        return read_npz_header(archive)


def is_policy(path: Path | str) -> bool:
    """Whether a file begins as a policy does, be it damaged further on."""
    return first_bytes(path)[:2] == b"PK" or is_json(path)


def export_policy(path: Path | str, policy: Policy) -> None:
    """Write a policy to a file; its ending says the language.

    Raises
    ------
    UprightError
        As `check_export`; if the policy's agent does not tell its form; or if ONNX is asked for and
        not installed.
    """
    write_file(path, WRITERS[check_export(path).suffix](policy))


def check_export(path: Path | str) -> Path:
    """Return the path of an export to be written later, having made sure that it can be.

    Raises
    ------
    UprightError
        If its ending is not one of WRITERS, or it cannot be written.
    """
    require_one_of(f"the ending of {str(path)!r}", Path(path).suffix, WRITERS)
    return check_output(path)


WRITERS: dict[str, Callable[[Policy], str | bytes]] = {
    ".h": c_header,
    ".onnx": onnx_model,
    ".json": json_form,
}
"""What each ending stands for."""
