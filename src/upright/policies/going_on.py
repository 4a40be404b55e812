"""Going on learning from a policy: a new agent is given all that the policy's agent learned.

What is carried over is what a file holds: the arrays of a memory, or the state of a plain Python
agent. The rest is the new agent's own: its settings, its code, and its random numbers, which are
those of the run.
"""

from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from upright.agents import Settings
from upright.errors import UprightError
from upright.policies.npz_file import arrays_of, is_memory
from upright.policies.plain_state import decode_state, describe_state, encode_state
from upright.policies.policy import Policy
from upright.policies.stages import MOST_STAGES, Stage, learned_in
from upright.support.settings import changed_values
from upright.support.words import count


def check_going_on(policy: Policy) -> Settings:
    """Return the settings of a policy's agent, after checking that the agent can go on learning.

    Raises
    ------
    UprightError
        If the policy holds only what it computes, or it has the most stages that a file can hold.
    """
    if policy.settings is None:
        raise UprightError(
            f"policy is one of {policy.agent!r} that holds only what it computes, as JSON does; "
            "learning goes on from a file ending in .npz, which learn --save writes"
        )
    if len(policy.stages) >= MOST_STAGES:
        raise UprightError(
            f"policy is one of {policy.agent!r} with {MOST_STAGES} stages, the most there can be"
        )
    return policy.settings


def check_changes(policy: Policy, settings: Settings) -> None:
    """Check that an agent with these settings can go on from a policy.

    A setting may change if a new agent's arrays do not depend on it.

    Raises
    ------
    UprightError
        If what is carried over depends on a setting that differs from the policy's.
    """
    former = check_going_on(policy)
    changes = changed_values(former, settings)
    if not changes:
        return
    if not is_memory(policy.agent, policy.memory):
        raise _fixed(policy, list(changes), "the agent's state")
    for names in [*([name] for name in changes), list(changes)]:
        with suppress(_Impossible):
            if array := _first_difference(former, _changed(former, settings, names)):
                raise _fixed(policy, names, f"the array {array!r}")


class _Impossible(Exception):  # noqa: N818 - one of several settings that change together
    """A setting is impossible without others."""


def _changed(former: Settings, settings: Settings, names: list[str]) -> Settings:
    """Return the former settings with those of these names changed."""
    try:
        return replace(former, **{name: getattr(settings, name) for name in names})
    except UprightError as error:
        raise _Impossible from error


def _first_difference(former: Settings, settings: Settings) -> str:
    """Return the name of the first array in which new agents differ, or an empty text."""
    blank, other = (arrays_of(each.agent(np.random.default_rng(0))) for each in (former, settings))
    if [name for name, _ in blank] != [name for name, _ in other]:
        return blank[0][0]
    pairs = zip(blank, other, strict=True)
    return next((name for (name, a), (_, b) in pairs if not np.array_equal(a, b)), "")


def _fixed(policy: Policy, names: list[str], what: str) -> UprightError:
    settings = policy.settings
    kept = ", ".join(f"{name} {getattr(settings, name)!r}" for name in names)
    return UprightError(
        f"{' and '.join(names)} cannot be changed when {policy.agent!r} goes on from a policy: "
        f"{what}, which is carried over, depends on it; the policy has {kept}"
    )


def carry_over(policy: Policy, fresh: Any) -> Any:
    """Give a new agent all that a policy's agent learned, and return it.

    Parameters
    ----------
    policy
        The policy, which is not changed when the agent learns.
    fresh
        The new agent. Arrays of a memory are filled; a plain Python agent is made again.

    Raises
    ------
    UprightError
        If the agent's code has changed since, or it keeps something that is not data.
    """
    if not is_memory(policy.agent, fresh):
        state = encode_state(policy.agent, policy.memory, fresh)
        copies = [array.copy(order="K") for array in state.arrays]
        return decode_state(state._replace(arrays=copies), fresh)
    learned = arrays_of(policy.memory)
    for (name, array), (former, values) in zip(arrays_of(fresh), learned, strict=True):
        if (name, array.shape, array.dtype) != (former, values.shape, values.dtype):
            raise UprightError(
                f"agent is {policy.agent!r}; its array {name!r} is {array.dtype} of shape "
                f"{array.shape}, the policy's {former!r} is {values.dtype} of shape {values.shape}"
            )
        array[...] = values
    return fresh


def earlier_stages(policy: Policy) -> tuple[Stage, ...]:
    """Return the stages of a policy; that of an old file is known by its task alone."""
    return policy.stages or (Stage(policy.task),)


def describe_going_on(policy: Policy) -> str:
    """Return in words what learning goes on from, and what is carried over."""
    where = policy.saved_as.file if policy.saved_as else "a policy"
    learned = learned_in(earlier_stages(policy))
    start = f"goes on from {where}: {policy.agent}, learned in {learned}"
    return f"{start}\ncarried over: {_parts(policy)}"


def describe_total(policy: Policy) -> str:
    """Return in words how long a policy was learned in all its stages."""
    return f"learned in {count(len(policy.stages), 'stage')}, in all: {learned_in(policy.stages)}"


def _parts(policy: Policy) -> str:
    """Return the names of what is carried over."""
    if not is_memory(policy.agent, policy.memory):
        return ", ".join(describe_state(policy.memory))
    arrays = arrays_of(policy.memory)
    names = dict.fromkeys(name.partition(".")[0] for name, _ in arrays)
    numbers = sum(array.size for _, array in arrays)
    return f"{', '.join(names)} ({numbers:,} numbers)"
