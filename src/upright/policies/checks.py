"""Checks of the contents of policy files, which may come from anyone."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from upright.agents import AGENTS
from upright.core.cartpole import INTEGRATORS
from upright.core.task import TaskSpec
from upright.errors import AgentError, UprightError, require, require_one_of
from upright.plants import PLANTS, describe_plant, restore_plant
from upright.plants.equations import EQUATIONS
from upright.policies.greedy import GREEDY_ACTION
from upright.policies.policy import Policy

TOLD = ("noise", "start", "steps", "condition", "seed", "run")
"""What the task of a policy must state."""
JSON_LIMIT, JSON_MARKS = 2**25, 2 * 10**6
"""Maximum size of JSON [bytes], enough for the largest form; and maximum number of brackets, braces
and quotes, because lists, objects and texts take more memory than numbers.
"""
LONGEST_ERROR = 500
"""Maximum length of an error about a file; part of it is attacker-controlled."""


@contextmanager
def explained(path: Path | str) -> Iterator[None]:
    """Turn any error in reading a policy's file into one clear error; those of an agent pass."""
    try:
        yield
    except AgentError:  # it is about the agent's own code, and says so
        raise
    except Exception as error:  # a damaged file can make its reader fail in any way
        said = str(error)
        said = said if len(said) <= LONGEST_ERROR else said[:LONGEST_ERROR] + " …"
        raise UprightError(f"policy is {str(path)!r}; it cannot be read: {said}") from error


def parse_json(data: bytes) -> Any:
    """Return what JSON in UTF-8 holds, after checking that it is not too large.

    Raises
    ------
    ValueError
        If it is too large, or not JSON; NaN and Infinity are not.
    """
    check_json_size(data)
    return json.loads(data.decode("utf-8-sig"), parse_constant=_refuse_constant)


def check_json_size(data: bytes) -> None:
    """Raise ValueError if JSON is too large to be read."""
    if len(data) > JSON_LIMIT:
        raise ValueError(f"it is larger than {JSON_LIMIT:,} bytes")
    if sum(map(data.count, (b"[", b"{", b'"'))) > JSON_MARKS:
        raise ValueError(f"it has more than {JSON_MARKS:,} lists, objects and texts")


def _refuse_constant(name: str) -> None:
    raise ValueError(f"it holds {name}, which is not a number")


def check_header(header: Any, needed: Mapping[str, type], *forms: str) -> dict[str, Any]:
    """Return a header after checking that it is of one of these formats."""
    if not isinstance(header, dict) or header.get("format") not in forms:
        raise ValueError(f"it does not state that its format is {' or '.join(map(repr, forms))}")
    for name, kind in needed.items():
        if not isinstance(header.get(name), kind):
            raise ValueError(f"it does not state its {name}")
    return header


def check_agent(found: str, named: str | None) -> None:
    """Ensure that no code is imported merely because a file names it."""
    if named is not None and named != found:
        raise ValueError(f"it was learned by {found!r}, not by {named!r}")
    if named is None and AGENTS.is_path(found):
        raise ValueError(
            f"it was learned by {found!r}, a custom agent, whose code is run only if you name it: "
            "--agent MODULE:NAME (learn --from: MODULE:NAME), or agent= in Python"
        )


def read_task(task: dict[str, Any]) -> dict[str, Any]:
    """Return what a policy was trained on, checked, as arguments of `Policy`.

    Files of version 0.1 state neither `trials` nor `parameters`, but do state the integrator; of
    the plant they give the name alone.
    """
    task = dict(task)
    plant = task.pop("plant", describe_plant(EQUATIONS))
    integrator = task.pop("integrator", None)
    if isinstance(plant, str):
        plant = {"name": plant}
    elif not isinstance(plant, dict):
        raise ValueError(f"plant is {plant!r}; it must state its name and its settings")
    PLANTS.check(str(plant.get("name", "")))
    if integrator is not None:
        require_one_of("integrator", integrator, INTEGRATORS)
        if plant["name"] == EQUATIONS.name:
            plant = {**plant, "integrator": integrator}
    if plant["name"] == EQUATIONS.name:  # it is played on this one; any other is information only
        plant = describe_plant(restore_plant(plant))
    if lacking := [name for name in TOLD if name not in task]:
        raise ValueError(f"its task does not state {', '.join(lacking)}")
    seed, run = task.pop("seed"), task.pop("run")
    for name, value in (("seed", seed), ("run", run)):
        require(name, value, 0, whole=True)
    return {"learned_on": TaskSpec.from_data(task), "seed": seed, "run": run, "plant": plant}


def is_greedy(header: Mapping[str, Any]) -> bool:
    """Whether a file states that its policy is greedy."""
    return header.get("action") == GREEDY_ACTION


def check_contract(policy: Policy, header: dict[str, Any], for_people: set[str]) -> None:
    """Check that the file's contract is that of its policy; the task was checked by `read_task`."""
    for name, ours in policy.contract().items():
        if name not in {"task", *for_people} and header.get(name, ours) != ours:
            raise ValueError(f"its {name} is {header[name]!r}; it must be {ours!r}")
