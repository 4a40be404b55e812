"""Policies that agents learned in runs, and saving them."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from upright.agents import is_custom
from upright.core.trials import Result
from upright.plants import describe_plant
from upright.policies.files import save_policy
from upright.policies.npz_file import check_saving
from upright.policies.policy import Policy, form_of
from upright.studies.case import Case
from upright.studies.repeatability import doubt_about, warn_if_doubtful
from upright.studies.run import make_run
from upright.support.files import check_output


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


def learned_policy(case: Case, seed: int, run: int, memory: Any) -> Policy:
    """Return the policy that an agent learned in a run."""
    return Policy(
        case.agent, memory, case.spec, seed, run, describe_plant(case.plant), case.settings
    )


def make_learned(case: Case, seed: int, run: int) -> tuple[Policy, Result]:
    """Make one run, and return the policy that its agent learned and the result.

    Raises
    ------
    KeyboardInterrupt
        If interrupted; the run ends before its next trial.
    """
    stop = np.zeros(1, np.bool_)

    def work() -> tuple[Any, Result | None]:
        warn_if_doubtful(doubt_about(case))
        return make_run(case, seed, run, stop=stop)

    with ThreadPoolExecutor(1) as thread:  # the main thread stays free for Ctrl-C
        try:
            memory, result = thread.submit(work).result()
        finally:
            stop[0] = True
    assert result is not None, "only an interrupt stops a run"
    return learned_policy(case, seed, run, memory), result


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


def save_learned(path: str, case: Case, seed: int, run: int, memory: Any) -> None:
    """Save what an agent learned in a run: as JSON if the path ends in .json, otherwise as .npz.

    Raises
    ------
    UprightError
        If the file cannot be written, or the agent keeps something that is not data.
    """
    save_policy(path, learned_policy(case, seed, run, memory))
