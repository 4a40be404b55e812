"""Published figures, as data, and beside which tasks they may stand.

A figure stands beside a task that differs from its own in nothing but N, and N must be one of the
two published lengths. The longer one is the harder task, so each note on a source names its N.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from upright.core.conditions import PUBLISHED_NOISES, STEPS, STRICT_STEPS
from upright.core.task import TaskSpec

REPORT, SI_AND_WANG = "Report", "Si & Wang 2001"
"""Names of the sources that tables and plots refer to individually."""


class Source(NamedTuple):
    """One published table."""

    name: str
    """Short name, used as the head of a column."""
    citation: str
    """Where it was published."""
    what: str
    """What learned, in short."""
    agent: str | None
    """The agent of this package that follows the same rule; None: shown beside every agent."""
    runs: int
    """Number of runs behind each figure."""
    steps: int
    """N: steps of a successful trial."""
    start: str
    """Name of the start."""
    mean_trials: dict[str, float]
    """Mean number of trials by noise case."""
    has_own_noise: bool = False
    """Whether its noise acts in another way than here; its task is then ours only without noise."""

    @property
    def protocol(self) -> str:
        """How the figures were measured, for notes."""
        return f"{self.runs} runs, N = {self.steps:,}, start {self.start}"

    def figure(self, task: TaskSpec) -> float | None:
        """Return the published mean trials on a task of the equations; None if it has no such."""
        if task.steps not in (STEPS, STRICT_STEPS) or (self.has_own_noise and task.noise != "none"):
            return None
        same = task == TaskSpec(noise=task.noise, start=self.start, steps=task.steps)
        return self.mean_trials.get(task.noise) if same else None


SOURCES = (
    Source(
        REPORT,
        "Balancing an Inverted Pendulum using Reinforcement Learning (course report), Table I: "
        "REINFORCE, learning rate 0.1, discount 0.97",
        "REINFORCE",
        "reinforce",
        20,
        60_000,
        "random",
        dict(zip(PUBLISHED_NOISES, (35.65, 34.6, 49.6, 32.5, 44.1, 40.6, 106.9), strict=True)),
    ),
    Source(
        REPORT,
        "Balancing an Inverted Pendulum using Reinforcement Learning (course report), Table II: "
        "tabular Q-learning, learning rate 0.3, discount 0.9; another session, in its figure 5, "
        "averaged 209",
        "Q-learning",
        "q-learning",
        20,
        60_000,
        "random",
        {"none": 42.0},
    ),
    Source(
        SI_AND_WANG,
        "J. Si, Y.-T. Wang, On-line learning control by association and reinforcement, IEEE Trans. "
        "Neural Networks 12(2), 2001: direct neural dynamic programming; as quoted by He et al. "
        "2012, Table 2",
        "direct NDP",
        None,
        100,
        600_000,
        "zero",
        dict(zip(PUBLISHED_NOISES, (6.0, 8.0, 14.0, 32.0, 54.0, 164.0, 193.0), strict=True)),
    ),
    Source(
        "He 2012",
        "H. He, Z. Ni, J. Fu, A three-network architecture for on-line learning and optimization "
        "based on adaptive dynamic programming, Neurocomputing 78, 2012, Table 2",
        "three networks",
        None,
        100,
        600_000,
        "zero",
        dict(zip(PUBLISHED_NOISES, (13.7, 16.1, 20.6, 12.6, 14.4, 15.0, 21.3), strict=True)),
    ),
    Source(
        "gym-cartpolemod",
        "README of the program gym-cartpolemod: DQN; its actuator noise is drawn once per "
        "environment and its sensor noise enters the dynamics, so the task differs; 98 % of the "
        "runs succeeded under gaussian-0.2, all elsewhere",
        "DQN",
        None,
        100,
        60_000,
        "random",
        dict(
            zip(
                PUBLISHED_NOISES,
                (119.68, 118.88, 130.47, 123.93, 133.67, 179.36, 209.59),
                strict=True,
            )
        ),
        has_own_noise=True,
    ),
)


def figures(
    agent: str,
    task: TaskSpec,
    plant: str = "equations",
    plant_settings: Mapping[str, Any] = {},
) -> dict[str, float]:
    """Return the published mean trials that may stand beside an agent's, by name of the source.

    Parameters
    ----------
    agent
        Name of the agent.
    task
        Its task.
    plant
        Name of the plant, or of an environment.
    plant_settings
        Settings of the plant that differ from the default ones.
    """
    if plant != "equations" or plant_settings:
        return {}
    return {
        source.name: figure
        for source in SOURCES
        if source.agent in (None, agent) and (figure := source.figure(task)) is not None
    }
