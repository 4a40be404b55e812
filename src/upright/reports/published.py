"""Published figures, as data."""

from typing import NamedTuple

from upright.core.conditions import PUBLISHED_NOISES

REPORT, SI_AND_WANG = "Report", "Si & Wang 2001"
"""Names of the sources that tables and plots refer to individually."""


class Source(NamedTuple):
    """One published table."""

    name: str
    """Short name, used as the head of a column."""
    citation: str
    """Where it was published."""
    agent: str | None
    """The agent of this package that follows the same rule; None: shown beside every agent."""
    runs: int
    """Number of runs behind each figure."""
    steps: int
    """N: steps of a successful trial."""
    mean_trials: dict[str, float]
    """Mean number of trials by noise case."""


SOURCES = (
    Source(
        REPORT,
        "Balancing an Inverted Pendulum using Reinforcement Learning (course report), Table I: "
        "REINFORCE, learning rate 0.1, discount 0.97",
        "reinforce",
        20,
        60_000,
        dict(zip(PUBLISHED_NOISES, (35.65, 34.6, 49.6, 32.5, 44.1, 40.6, 106.9), strict=True)),
    ),
    Source(
        REPORT,
        "Balancing an Inverted Pendulum using Reinforcement Learning (course report), Table II: "
        "tabular Q-learning, learning rate 0.3, discount 0.9; another session, in its figure 5, "
        "averaged 209",
        "q-learning",
        20,
        60_000,
        {"none": 42.0},
    ),
    Source(
        SI_AND_WANG,
        "J. Si, Y.-T. Wang, On-line learning control by association and reinforcement, IEEE Trans. "
        "Neural Networks 12(2), 2001: direct neural dynamic programming; as quoted by He et al. "
        "2012, Table 2",
        None,
        100,
        600_000,
        dict(zip(PUBLISHED_NOISES, (6.0, 8.0, 14.0, 32.0, 54.0, 164.0, 193.0), strict=True)),
    ),
    Source(
        "He 2012",
        "H. He, Z. Ni, J. Fu, A three-network architecture for on-line learning and optimization "
        "based on adaptive dynamic programming, Neurocomputing 78, 2012, Table 2",
        None,
        100,
        600_000,
        dict(zip(PUBLISHED_NOISES, (13.7, 16.1, 20.6, 12.6, 14.4, 15.0, 21.3), strict=True)),
    ),
    Source(
        "gym-cartpolemod",
        "README of the program gym-cartpolemod: DQN; its actuator noise is drawn once per "
        "environment and its sensor noise enters the dynamics, so the task differs; 98 % of the "
        "runs succeeded under gaussian-0.2, all elsewhere",
        None,
        100,
        60_000,
        dict(
            zip(
                PUBLISHED_NOISES,
                (119.68, 118.88, 130.47, 123.93, 133.67, 179.36, 209.59),
                strict=True,
            )
        ),
    ),
)


def figures(agent: str, noise: str) -> dict[str, float]:
    """Return the published mean trials to compare an agent's with, by short name of the source."""
    return {
        source.name: source.mean_trials[noise]
        for source in SOURCES
        if source.agent in (None, agent) and noise in source.mean_trials
    }
