"""The stages in which a policy was learned: its runs, each of which went on from the one before."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from upright.errors import UprightError, require, require_kind
from upright.support.words import count

MOST_STAGES = 500
"""Most stages of a policy, so that its file's header can hold them."""


class SavedAs(NamedTuple):
    """The file of a policy."""

    file: str
    """Its name, without the folder."""
    sha256: str
    """Digest of its contents."""


@dataclass(frozen=True)
class Stage:
    """A run that a policy learned in. What files of earlier versions do not state is None."""

    task: Mapping[str, Any]
    """The task, as `Policy.task` states it."""
    trials: int | None = None
    """Number of trials."""
    steps: int | None = None
    """Number of steps of all trials."""
    balanced: bool | None = None
    """Whether its last trial succeeded."""
    source: SavedAs | None = None
    """The file that it went on from; None for a new agent, or if the policy was not from a file."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """The agent's settings that differ from those of the stage before, by name."""

    def as_data(self) -> dict[str, Any]:
        """Return the stage as data for JSON, which `read_stages` reads."""
        source = {"from": self.source._asdict()} if self.source else {}
        settings = {"settings": dict(self.settings)} if self.settings else {}
        made = {"trials": self.trials, "steps": self.steps, "balanced": self.balanced}
        return {**source, **settings, **made, "task": dict(self.task)}


def read_stages(found: Any) -> tuple[Stage, ...]:
    """Return the stages that a policy's header states, checked.

    Tasks, settings and names of files are for people here, and only their kinds are checked.

    Raises
    ------
    UprightError
        If they are not what `Stage.as_data` returns.
    """
    require_kind("stages", found, list, "a list")
    require("the number of stages", len(found), 0, MOST_STAGES, whole=True)
    return tuple(map(_read_stage, found))


def _read_stage(found: Any) -> Stage:
    require_kind("a stage", found, dict, "an object")
    settings = found.get("settings", {})
    for name, value in (("task", found.get("task")), ("settings", settings)):
        require_kind(f"{name} of a stage", value, dict, "an object")
    trials, steps, balanced = (found.get(name) for name in ("trials", "steps", "balanced"))
    for name, value in (("trials of a stage", trials), ("steps of a stage", steps)):
        if value is not None:
            require(name, value, 0, 2**63 - 1, whole=True)
    require_kind("balanced of a stage", balanced, (bool, type(None)), "true, false or null")
    source = _read_source(found["from"]) if "from" in found else None
    return Stage(found["task"], trials, steps, balanced, source, settings)


def _read_source(found: Any) -> SavedAs:
    require_kind("from of a stage", found, dict, "an object")
    file, sha256 = str(found.get("file")), str(found.get("sha256"))
    if not re.fullmatch("[0-9a-f]{64}", sha256):
        raise UprightError(f"sha256 of a stage is {sha256!r}; it must be 64 hexadecimal digits")
    return SavedAs(file, sha256)


def describe_stages(stages: Sequence[Stage]) -> dict[str, Any]:
    """Return an entry for each stage, and one for all, for people."""
    numbered = {f"stage {i}": stage.as_data() for i, stage in enumerate(stages, 1)}
    return numbered | ({"learned in": learned_in(stages)} if stages else {})


def learned_in(stages: Sequence[Stage]) -> str:
    """Return in words how many trials and steps stages had."""
    known = [stage for stage in stages if stage.trials is not None]
    if not known:
        return "an unknown number of trials"
    trials = count(sum(stage.trials or 0 for stage in known), "trial")
    steps = count(sum(stage.steps or 0 for stage in known), "step")
    more = "" if len(known) == len(stages) else ", and an unknown number before"
    return f"{trials} ({steps}){more}"
