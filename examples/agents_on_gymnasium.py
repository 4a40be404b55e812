"""The package's agents on an environment that is not the package's: Gymnasium's own cart-pole.

    python examples/agents_on_gymnasium.py
    python examples/agents_on_gymnasium.py --agents adaptive-lqr,random-search --runs 20
    python examples/agents_on_gymnasium.py --env upright/CartPole-v0

An agent balances any body. This file makes one of an environment with the spaces of CartPole-v1,
which tells when it has fallen, and lets the package's own loop move it.
"""

import argparse
import time

import gymnasium
import numpy as np

from upright.core.conditions import RUNS, STEPS
from upright.core.parameters import State
from upright.core.trials import Result, run
from upright.errors import UprightError
from upright.reports.statistics import summarise
from upright.reports.tables import render
from upright.studies.case import Case, make_case
from upright.studies.random_streams import random_numbers


class GymnasiumBody:
    """An environment of Gymnasium as a body that agents balance.

    Parameters
    ----------
    name
        Of the environment.
    steps
        How many steps an episode may last.
    seed
        Of the environment's own random numbers.

    Raises
    ------
    UprightError
        If its spaces are not those of CartPole-v1.
    """

    def __init__(self, name: str, steps: int, seed: int) -> None:
        self.env = gymnasium.make(name, max_episode_steps=steps)
        self.env.reset(seed=seed)
        self.ended = False
        spaces = self.env.observation_space.shape, self.env.action_space
        if spaces != ((4,), gymnasium.spaces.Discrete(2)):
            raise UprightError(f"env is {name!r}; it must have four observations and two actions")

    def reset(self, state: State) -> State:
        """Begin an episode, in a state that the environment draws."""
        observation, _ = self.env.reset()
        return State(*observation.tolist())

    def step(self, force: float) -> State:
        """Push to the side of the force, and return the observation, which is the state."""
        observation, _, self.ended, _, _ = self.env.step(int(force > 0))
        return State(*observation.tolist())

    def has_fallen(self, state: State) -> bool:
        """Whether the environment ended the episode, by whatever limits it has."""
        return self.ended

    def close(self) -> None:
        """Close the environment."""
        self.env.close()


def make_run(name: str, case: Case, seed: int, number: int) -> Result:
    """Let a new agent learn in an environment, as `study.make_run` does on the equations."""
    rng = random_numbers(seed, number)
    agent = case.settings.agent(rng)
    body = GymnasiumBody(name, case.spec.steps, int(rng.integers(2**31)))
    lengths = np.zeros(case.spec.trials, np.int64)
    began = time.perf_counter()
    success = run(agent, body, case.spec.task(), rng, lengths, np.zeros(1, np.bool_)) > 0
    body.close()
    return Result(number, success, lengths[lengths > 0], time.perf_counter() - began)


def main() -> None:
    """Print the trial table of some agents in an environment."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--env", default="CartPole-v1", help="name of the environment")
    parser.add_argument("--agents", default="adaptive-lqr,reinforce,q-learning,random-search")
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--steps", type=int, default=STEPS, help="steps of a success")
    options = parser.parse_args()
    rows = []
    for agent in options.agents.split(","):
        case = make_case(agent, steps=options.steps)
        results = [make_run(options.env, case, 0, number) for number in range(options.runs)]
        rows.append(summarise(case, 0, results))
    print(f"{options.env}\n\n{render(rows, 'text')}", end="")


if __name__ == "__main__":
    main()
