"""Measures how well a policy that was learned on one plant balances another.

Each agent is trained from scratch on the equations, in MuJoCo and in Gazebo until a trial lasts for
N steps. Its policy then plays one trial on every plant, without learning.
"""

import sys
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from os import cpu_count
from typing import NamedTuple

from speed import make_parser, put

from upright.plants import PLANTS as REGISTERED
from upright.studies.case import make_case
from upright.studies.intervals import wilson_interval
from upright.studies.learned import learned_policy
from upright.studies.playing import case_for, play_trials
from upright.studies.run import make_run

AGENTS = ("reinforce", "q-learning", "adaptive-lqr")
PLANTS = {"equations": "equations", "mujoco": "MuJoCo", "gazebo": "Gazebo"}


class Learner(NamedTuple):
    """An agent and the plant that it learns on."""

    agent: str
    plant: str


def transfer(learner: Learner, run: int, steps: int) -> list[int] | None:
    """Return the length of the trial on each plant after a run; None if the run failed."""
    case = make_case(learner.agent, steps=steps, plant=REGISTERED.default(learner.plant))
    memory, result = make_run(case, 0, run)
    assert result
    if not result.success:
        return None
    policy = learned_policy(case, 0, run, memory)
    cases = [case_for(policy, steps=steps, plant=REGISTERED.default(plant)) for plant in PLANTS]
    return [next(play_trials(policy, case, 1, run)).steps for case in cases]


def transfer_all(
    learners: list[Learner], runs: int, steps: int, workers: Executor
) -> Iterator[tuple[Learner, list[int] | None]]:
    """Yield the learner of each run, and the lengths of the trials after it, as runs end."""
    jobs: dict[Future[list[int] | None], Learner] = {}
    for run in range(runs):
        for learner in learners:
            jobs[workers.submit(transfer, learner, run, steps)] = learner
    for number, job in enumerate(as_completed(jobs), 1):
        learner, lengths = jobs[job], job.result()
        print(f"{number} of {len(jobs)}: {' on '.join(learner)}: {lengths}", file=sys.stderr)
        yield learner, lengths


def row(learner: Learner, trials: list[list[int]], steps: int) -> str:
    """Return a row of the table: for every plant, how many trials were balanced.

    Parameters
    ----------
    trials
        For each successful run, the lengths of the trials on each plant.
    """
    cells = [learner.agent, PLANTS[learner.plant]]
    for lengths in zip(*trials, strict=True):
        balanced = sum(length >= steps for length in lengths)
        low, high = (100 * end for end in wilson_interval(balanced, len(lengths)))
        cells.append(f"{balanced} of {len(lengths)} [{low:.0f}, {high:.0f}] %")
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Measure, and write the table."""
    parser = make_parser(__doc__, "docs/transfer.md")
    parser.add_argument("--steps", type=int, default=60_000, help="N (default 60,000)")
    parser.add_argument("--runs", type=int, default=20, help="runs each (default 20)")
    parser.add_argument(
        "--agent", action="append", choices=AGENTS, help="only this agent; may be repeated"
    )
    arguments = parser.parse_args()
    # In the order of the table.
    learners = [Learner(agent, plant) for agent in arguments.agent or AGENTS for plant in PLANTS]
    trials: dict[Learner, list[list[int]]] = {learner: [] for learner in learners}
    failed = 0
    with ProcessPoolExecutor(cpu_count(), get_context("spawn")) as workers:
        for learner, lengths in transfer_all(learners, arguments.runs, arguments.steps, workers):
            failed += lengths is None
            if lengths:
                trials[learner].append(lengths)
    heads = ["agent", "learned on", *(f"balances {name}" for name in PLANTS.values())]
    lines = [f"| {' | '.join(heads)} |", "|" + "---|" * len(heads)]
    lines += [row(learner, played, arguments.steps) for learner, played in trials.items() if played]
    text = (
        "\n".join(lines) + f"\n\nA trial is balanced if it lasts {arguments.steps:,} steps, "
        "noise-free, from a random start. Agents have their default settings. Each agent made "
        f"{arguments.runs} runs on each plant; {failed} runs failed in total. 95 % intervals are "
        "in brackets.\n"
    )
    put(text, arguments.output)


if __name__ == "__main__":
    main()
