"""Policies as JSON: the form alone, which other languages can write and read."""

import codecs
import json
from pathlib import Path
from typing import Any

from upright.agents import AGENTS
from upright.errors import require_one_of
from upright.policies.checks import (
    JSON_LIMIT,
    check_agent,
    check_contract,
    check_header,
    explained,
    is_greedy,
    parse_json,
    read_task,
)
from upright.policies.form_json import NUMBERS, form_entries, restore_form
from upright.policies.form_player import make_memory
from upright.policies.policy import Policy, form_of

JSON_FORMAT = "upright policy form 1"
JSON_HEADER = {"agent": str, "task": dict, "form": str}
"""What reading needs of a file besides its format, and the types."""


def encode(policy: Policy) -> str:
    """Return a policy as JSON, one entry a line; `load_policy` and other languages can read it.

    Raises
    ------
    UprightError
        If the policy's agent does not provide its form, or a number in it is out of bounds.
    """
    entries = {"format": JSON_FORMAT, **policy.contract(), **form_entries(form_of(policy))}
    lines = (f"  {json.dumps(name)}: {json.dumps(value)}" for name, value in entries.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def read(path: Path | str, agent: str | None) -> Policy:
    """Read a policy, as `files.load_policy` does."""
    with explained(path):
        entries = _read_entries(path)
        check_agent(entries["agent"], agent)
        if agent is None:
            require_one_of("agent", entries["agent"], AGENTS)
        memory = make_memory(restore_form(entries))
        trained = read_task(entries["task"])
        policy = Policy(entries["agent"], memory, **trained, greedy=is_greedy(entries))
        # These three follow from the form; other languages may word them differently.
        check_contract(policy, entries, {"version", "normalisation", "history"})
    return policy


def read_header(path: Path | str) -> dict[str, Any]:
    """Return everything in a file except the numbers of its form."""
    with explained(path):
        entries = _read_entries(path)
        restore_form(entries)
        read_task(entries["task"])
    return {name: value for name, value in entries.items() if name not in NUMBERS}


def begins(start: bytes) -> bool:
    """Whether a file that starts with these bytes is a JSON object."""
    return start.removeprefix(codecs.BOM_UTF8).lstrip()[:1] == b"{"


def _read_entries(path: Path | str) -> dict[str, Any]:
    """Return the entries of a JSON file, its form not yet checked."""
    with Path(path).open("rb") as file:
        data = file.read(JSON_LIMIT + 1)
    return check_header(parse_json(data), JSON_HEADER, JSON_FORMAT)
