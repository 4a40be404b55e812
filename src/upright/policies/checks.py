"""Checks of what the file of a policy says, whoever wrote it."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from upright.agents import is_custom
from upright.core.task import make_task
from upright.errors import UprightError, require, require_one_of
from upright.plants import PLANTS
from upright.plants.equations import SETTINGS as EQUATIONS
from upright.policies.policy import TASK, Policy

LONGEST_ERROR = 500
"""Characters of what is said of a file; its author chose some of them."""


@contextmanager
def explained(path: Path | str) -> Iterator[None]:
    """Make whatever is wrong with a policy's file one clear error."""
    try:
        yield
    except Exception as error:  # nobody can list how a foreign file makes its readers fail
        said = str(error)
        said = said if len(said) <= LONGEST_ERROR else said[:LONGEST_ERROR] + " …"
        raise UprightError(f"policy is {str(path)!r}; it cannot be read: {said}") from error


def check_header(header: Any, form: str, needed: Mapping[str, type]) -> dict[str, Any]:
    """Return a header, having made sure that it is one of this format."""
    if not isinstance(header, dict) or header.get("format") != form:
        raise ValueError(f"it does not say that its format is {form!r}")
    for name, kind in needed.items():
        if not isinstance(header.get(name), kind):
            raise ValueError(f"it does not tell its {name}")
    return header


def check_agent(found: str, named: str | None) -> None:
    """Make sure that no code is imported because a file says so."""
    if named is not None and named != found:
        raise ValueError(f"it was learned by {found!r}, not by {named!r}")
    if named is None and is_custom(found):
        raise ValueError(
            f"it was learned by {found!r}, code from outside the package, which is run only if "
            "you name it: --agent MODULE:NAME, or agent= in Python"
        )


def check_task(task: dict[str, Any]) -> None:
    """Make sure that the task a policy was trained on is one that can be named."""
    if task.keys() - {"plant"} != {*TASK, "seed", "run"}:
        raise ValueError(f"its task must tell {', '.join(TASK)}, seed and run")
    make_task(**{name: task[name] for name in TASK})
    for name in ("seed", "run"):
        require(name, task[name], 0, whole=True)
    require_one_of("plant", task.get("plant", EQUATIONS.name), PLANTS)


def check_contract(policy: Policy, header: dict[str, Any], for_people: set[str]) -> None:
    """Make sure that what the file promises is what its policy does."""
    for name, ours in policy.contract().items():
        if name not in for_people and header.get(name, ours) != ours:
            raise ValueError(f"it says of {name}: {header[name]!r}; it must be {ours!r}")
