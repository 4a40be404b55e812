"""Policies that agents learned in runs, and saving them."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from upright.agents import AGENTS, Settings, is_custom
from upright.core.trials import Result
from upright.plants import describe_plant
from upright.policies.going_on import check_changes, check_going_on, earlier_stages
from upright.policies.npz_file import check_saving
from upright.policies.policy import Policy, form_of, task_as_data
from upright.policies.stages import Stage
from upright.studies.case import Case
from upright.studies.playing import case_for
from upright.studies.repeatability import doubt_about, warn_if_doubtful
from upright.studies.run import make_run
from upright.support.files import check_output
from upright.support.settings import changed_values

KEEPS_SETTINGS = (
    "an agent that goes on from a policy has that policy's settings, of which some can be changed "
    "by name"
)
"""Why named settings are refused where learning goes on."""


def check_policy(case: Case) -> None:
    """Check that what the case's agent learns can be saved, as far as a new agent tells.

    Raises
    ------
    UprightError
        If the agent cannot be played, or keeps something that is not data.
    """
    if is_custom(case.agent):
        check_saving(_blank_policy(case))


def _blank_policy(case: Case) -> Policy:
    """Return the policy of a new agent."""
    return learned_policy(case, 0, 0, case.settings.agent(np.random.default_rng(0)))


def case_from(policy: Policy, settings: Settings | None = None, **changes: Any) -> Case:
    """Return the case in which a policy's agent goes on learning.

    Its task is the one that the policy was trained on, with changes, as in `case_for`.

    Parameters
    ----------
    policy
        The policy.
    settings
        Settings of the agent; by default the policy's.
    **changes
        Parts of the task by name; and `plant`, by default the equations.

    Raises
    ------
    UprightError
        If the policy holds only what it computes, a setting cannot be changed, a name is unknown,
        or a number is not allowed.
    """
    settings = check_going_on(policy) if settings is None else settings
    check_changes(policy, settings)
    case = case_for(policy, **changes)
    named = AGENTS.settings(policy.agent)
    label = next((label for label in named if named[label] == policy.settings), "default")
    return replace(case, label=label, settings=settings)


def learned_policy(
    case: Case,
    seed: int,
    run: int,
    memory: Any,
    result: Result | None = None,
    start: Policy | None = None,
) -> Policy:
    """Return the policy that an agent learned in a run.

    Parameters
    ----------
    case, seed, run
        The run.
    memory
        The agent.
    result
        The result of the run; without it, the policy does not state how long it was learned.
    start
        The policy that learning went on from, if any.
    """
    plant = describe_plant(case.plant)
    stages = earlier_stages(start) if start else ()
    if result:
        task = task_as_data(case.spec, seed, run, plant)
        steps = int(result.lengths.sum())
        before = (start.saved_as, _changed_settings(start, case)) if start else ()
        stages = (*stages, Stage(task, result.trials, steps, result.success, *before))
    return Policy(case.agent, memory, case.spec, seed, run, plant, case.settings, stages)


def _changed_settings(start: Policy, case: Case) -> dict[str, Any]:
    """Return the settings of a case that differ from those of the policy that it goes on from."""
    return changed_values(check_going_on(start), case.settings)


def make_learned(
    case: Case, seed: int, run: int, start: Policy | None = None
) -> tuple[Policy, Result]:
    """Make one run, and return the policy that its agent learned and the result.

    The agent is a new one, or goes on from the policy `start`.

    Raises
    ------
    KeyboardInterrupt
        If interrupted; the run ends before its next trial.
    """
    stop = np.zeros(1, np.bool_)

    def work() -> tuple[Any, Result | None]:
        warn_if_doubtful(doubt_about(case))
        return make_run(case, seed, run, stop=stop, policy=start)

    with ThreadPoolExecutor(1) as thread:  # the main thread stays free for Ctrl-C
        try:
            memory, result = thread.submit(work).result()
        finally:
            stop[0] = True
    assert result is not None, "only an interrupt stops a run"
    return learned_policy(case, seed, run, memory, result, start), result


def check_learned(path: str, case: Case) -> None:
    """Check that what the case's agent learns can later be saved to this path.

    Raises
    ------
    UprightError
        If it cannot.
    """
    check_output(path)
    if Path(path).suffix == ".json":
        form_of(_blank_policy(case))
    else:
        check_policy(case)
