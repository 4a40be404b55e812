"""Measure learners from Stable-Baselines3 by the trial protocol.

    pip install stable-baselines3
    upright learn examples.train_sb3:PPO
    upright table --agents examples.train_sb3:PPO,examples.train_sb3:DQN,random-search \
        --noises none,gaussian-0.2 --runs 10 --store results/sb3.sqlite

The `learn` command shows every trial of one run. The `table` command measures the learners over
many runs; after an interruption, it resumes where it stopped. A learner written for Gymnasium needs
only what the classes below have: its constructor takes the run's random number generator, and its
method `train` trains until the environment reports that the run is over.
"""

import gymnasium
import numpy as np
import stable_baselines3
import torch

ENDLESS = 10**9
"""More steps than a run can have: the environment ends the run."""

torch.set_num_threads(1)  # each core has its own run


class PPO:
    """Proximal policy optimisation from Stable-Baselines3."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Create a new learner for a run."""
        self.seed = int(rng.integers(2**31))

    def train(self, env: gymnasium.Env) -> None:
        """Train until the run is over, with the fastest of four settings that were tried once."""
        model = stable_baselines3.PPO(
            "MlpPolicy",
            env,
            learning_rate=1e-3,
            n_steps=512,
            batch_size=128,
            gamma=0.98,
            gae_lambda=0.8,
            seed=self.seed,
            device="cpu",
        )
        model.learn(ENDLESS)


class DQN:
    """Deep Q-learning from Stable-Baselines3."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Create a new learner for a run."""
        self.seed = int(rng.integers(2**31))

    def train(self, env: gymnasium.Env) -> None:
        """Train until the run is over, with RL Baselines3 Zoo's settings for CartPole-v1."""
        model = stable_baselines3.DQN(
            "MlpPolicy",
            env,
            learning_rate=2.3e-3,
            buffer_size=100_000,
            learning_starts=1000,
            batch_size=64,
            train_freq=256,
            gradient_steps=128,
            target_update_interval=10,
            exploration_fraction=8_000 / ENDLESS,
            exploration_final_eps=0.04,
            policy_kwargs={"net_arch": [256, 256]},
            seed=self.seed,
            device="cpu",
        )
        model.learn(ENDLESS)
