"""Run the package's agents on Gymnasium's own cart-pole.

    python examples/agents_on_gymnasium.py
    python examples/agents_on_gymnasium.py --agents adaptive-lqr,random-search --runs 20
    python examples/agents_on_gymnasium.py --env upright/CartPole-v0

An agent can balance any plant. This script wraps an environment which has the spaces of CartPole-v1
as a plant, and runs the agents on it with the package's own loop. The environment decides when the
pole has fallen.
"""

import argparse

import gymnasium

import upright
from upright import Case, Result, State, UprightError


class GymnasiumBody:
    """A Gymnasium environment as a plant.

    Parameters
    ----------
    name
        Name of the environment.
    steps
        Maximum number of steps in an episode.
    seed
        Seed of the environment's own random numbers.

    Raises
    ------
    UprightError
        If the environment's spaces are not those of CartPole-v1.
    """

    def __init__(self, name: str, steps: int, seed: int) -> None:
        self.env = gymnasium.make(name, max_episode_steps=steps)
        self.env.reset(seed=seed)
        self.ended = False
        spaces = self.env.observation_space.shape, self.env.action_space
        if spaces != ((4,), gymnasium.spaces.Discrete(2)):
            raise UprightError(f"env is {name!r}; it must have four observations and two actions")

    def reset(self, state: State) -> State:
        """Begin an episode in a state drawn by the environment; `state` is ignored."""
        observation, _ = self.env.reset()
        return State(*observation.tolist())

    def step(self, force: float) -> State:
        """Push in the direction of the force and return the observation, which is the state."""
        observation, _, self.ended, _, _ = self.env.step(int(force > 0))
        return State(*observation.tolist())

    def has_fallen(self, state: State) -> bool:
        """Return whether the environment has terminated the episode, by its own limits."""
        return self.ended

    def close(self) -> None:
        """Close the environment."""
        self.env.close()


def make_run(name: str, case: Case, seed: int, number: int) -> Result:
    """Run a new agent in an environment, as `upright.make_run` does on the plant of the case."""
    body = GymnasiumBody(name, case.spec.steps, seed + number)
    _, result = upright.make_run(case, seed, number, plant=body)
    assert result is not None  # nothing stops the run
    return result


def main() -> None:
    """Run the agents in an environment and print their trial table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--env", default="CartPole-v1", help="name of the environment")
    parser.add_argument("--agents", default="adaptive-lqr,reinforce,q-learning,random-search")
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--steps", type=int, default=60_000, help="steps of a successful trial")
    options = parser.parse_args()
    rows = []
    for agent in options.agents.split(","):
        case = upright.make_case(agent, steps=options.steps)
        results = [make_run(options.env, case, 0, number) for number in range(options.runs)]
        rows.append(upright.summarise(case, 0, results, environment=options.env))
    print(f"{options.env}\n\n{upright.render(rows, 'text')}", end="")


if __name__ == "__main__":
    main()
