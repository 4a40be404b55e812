import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from helpers import HARD_START, make_task, python

import upright  # noqa: F401 - makes the environments known
from upright.agents import AGENTS
from upright.agents.custom import CustomAgent
from upright.core import trials
from upright.core.parameters import State
from upright.core.task import TaskSpec
from upright.environments.cartpole_env import CartPoleEnv
from upright.environments.trial_protocol import RunOver, TrialProtocol, run_learner
from upright.errors import UprightError
from upright.plants.equations import equations
from upright.reports.statistics import summarise
from upright.reports.tables import render
from upright.studies.case import Case


class ScriptedEnv(gymnasium.Env):
    """An environment whose episodes end at given steps; 0 never, below 0 by truncation."""

    observation_space = gymnasium.spaces.Box(-1.0, 1.0, (4,))
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, *ends):
        self.ends = iter(ends)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.asked = seed, options
        self.end, self.made = next(self.ends), 0
        return np.zeros(4, np.float32), {}

    def step(self, action):
        self.made += 1
        fallen, truncated = self.made == self.end, self.made == -self.end
        return np.zeros(4, np.float32), 1.0, fallen, truncated, {"made": self.made}


def go_on(env):
    """Make steps and trials until the run is over."""
    while not env.over:
        env.reset()
        over = False
        while not over:
            *_, fallen, truncated, _ = env.step(0)
            over = fallen or truncated


# ------------------------------------------------------------------------------ what counts


def test_a_run_ends_with_its_first_success():
    env = TrialProtocol(ScriptedEnv(3, 5, 0, 2), steps=7)
    go_on(env)
    assert env.lengths.tolist() == [3, 5, 7]
    assert env.over
    result = env.result(run=4)
    assert (result.run, result.success, result.trials) == (4, True, 3)
    assert result.lengths.tolist() == [3, 5, 7]
    assert 0 < result.seconds < 60


def test_a_run_ends_with_its_last_trial():
    env = TrialProtocol(ScriptedEnv(3, 5, 0), steps=7, trials=2)
    go_on(env)
    assert not env.result().success
    assert env.result().lengths.tolist() == [3, 5]


def test_a_fall_at_the_last_step_is_no_success():
    env = TrialProtocol(ScriptedEnv(7, 8), steps=7)
    go_on(env)
    assert env.lengths.tolist() == [7, 7]
    assert env.succeeded


def test_the_last_step_of_a_success_is_truncated_and_else_as_the_environment_says():
    env = TrialProtocol(ScriptedEnv(0), steps=3)
    env.reset(seed=5, options={"a": 1})
    assert env.env.asked == (5, {"a": 1})
    ends = [env.step(1)[1:] for _ in range(3)]
    assert ends == [(1.0, False, made == 3, {"made": made}) for made in (1, 2, 3)]


def test_a_trial_that_is_given_up_counts_and_one_without_a_step_does_not():
    env = TrialProtocol(ScriptedEnv(0, 0, 0, 4), steps=7, trials=2)
    env.reset()
    env.reset()
    env.step(0)
    env.step(0)
    assert env.lengths.tolist() == []
    env.reset()
    assert env.lengths.tolist() == [2]
    for _ in range(3):
        env.step(0)
    with pytest.raises(RunOver, match="over after 2 trials: no trial succeeded"):
        env.reset()
    assert env.result().lengths.tolist() == [2, 3]
    assert not env.succeeded


def test_a_trial_that_the_environment_truncates_counts_and_failed():
    env = TrialProtocol(ScriptedEnv(-4, -7), steps=7)
    go_on(env)
    assert env.lengths.tolist() == [4, 7]
    assert env.succeeded, "truncation at N is a success"


def test_no_step_is_made_after_the_end_of_a_run():
    env = TrialProtocol(ScriptedEnv(0), steps=1)
    env.reset()
    env.step(0)
    for call in (env.reset, lambda: env.step(0)):
        with pytest.raises(RunOver, match="over after 1 trial: a trial succeeded"):
            call()
    assert env.env.made == 1


def test_a_run_can_be_watched_and_stopped():
    lengths, stop = np.zeros(9, np.int64), np.zeros(1, np.bool_)
    env = TrialProtocol(ScriptedEnv(2, 0), steps=7, trials=9, lengths=lengths, stop=stop)
    env.reset()
    env.step(0)
    assert lengths.sum() == 0
    env.step(0)
    assert lengths.tolist() == [2] + [0] * 8
    env.reset()
    env.step(0)
    assert not env.over
    stop[0] = True
    with pytest.raises(RunOver):
        env.step(0)
    assert env.over
    assert not env.succeeded


# ------------------------------------------------------------------------------ limits of Gymnasium


def test_n_may_be_the_limit_of_the_environment_or_below():
    for limit in (20, 1000, -1):
        env = gymnasium.make(
            "upright/CartPole-v0", start=State(0, 0, 0, 0), max_episode_steps=limit
        )
        env = TrialProtocol(env, steps=20)
        observation, _ = env.reset()
        over = False
        while not over:
            observation, _, fallen, over, _ = env.step(int(observation @ [1, 1.5, 20, 3] > 0))
            assert not fallen
        assert env.result().lengths.tolist() == [20]
        assert env.succeeded


def test_a_limit_below_n_is_refused():
    env = gymnasium.make("CartPole-v1")
    with pytest.raises(
        UprightError, match=r"max_episode_steps is 500; it must be .*, at least 501"
    ):
        TrialProtocol(env, steps=501)
    TrialProtocol(env, steps=500)


# ------------------------------------------------------------------------------ misuse


def test_a_step_outside_a_trial_is_refused():
    env = TrialProtocol(ScriptedEnv(1), steps=7)
    with pytest.raises(ResetNeeded):
        env.step(0)
    env.reset()
    env.step(0)
    with pytest.raises(ResetNeeded):
        env.step(0)
    assert env.lengths.tolist() == [1]


def test_there_is_no_result_before_the_end():
    env = TrialProtocol(ScriptedEnv(1, 0), steps=7, trials=9)
    env.reset()
    env.step(0)
    with pytest.raises(UprightError, match=r"at trial 2; .* after 9 trials"):
        env.result()


@pytest.mark.parametrize("numbers", [{"steps": 0}, {"steps": 1.5}, {"trials": 0}])
def test_impossible_numbers_are_refused(numbers):
    with pytest.raises(UprightError, match=f"{next(iter(numbers))} is "):
        TrialProtocol(ScriptedEnv(), **numbers)


def test_several_environments_at_once_are_refused():
    with pytest.raises(TypeError):
        TrialProtocol(gymnasium.make_vec("upright/CartPole-v0", num_envs=2))


# ------------------------------------------------------------------------------ the loop's twin


class Driver:
    """One of the package's agents as a learner that only knows Gymnasium."""

    def __init__(self, agent, rng):
        self.agent, self.rng = agent, rng

    def train(self, env):
        while True:
            observation = State(*env.reset()[0].tolist())
            self.agent.begin_trial(self.rng)
            over = False
            while not over:
                action = self.agent.act(observation, self.rng)
                after, _, fallen, truncated, _ = env.step(int(action))
                before, observation = observation, State(*after.tolist())
                self.agent.learn(before, action, observation, fallen)
                over = fallen or truncated
            self.agent.end_trial(fallen)


@pytest.mark.parametrize("noise", ["none", "actuator-10", "gaussian-0.2", "all-10"])
@pytest.mark.parametrize("name", AGENTS)
def test_an_agent_has_the_same_trials_through_gymnasium_as_in_the_loop(name, noise):
    """The same random numbers, drawn in the same order, give the same trials."""
    task = make_task(noise=noise, steps=300, trials=8)._replace(start=HARD_START)
    rng, settings = np.random.default_rng(4), AGENTS.settings(name)["default"]
    agent = settings.agent(rng)
    env = CartPoleEnv(task.noise, task.start, task.parameters, dtype="float64")
    env.np_random = rng
    counted = TrialProtocol(env, task.steps, task.trials)
    with pytest.raises(RunOver):
        Driver(agent, rng).train(counted)

    rng, lengths = np.random.default_rng(4), np.zeros(task.trials, np.int64)
    agent, plant = settings.agent(rng), equations(task.parameters)
    success = trials.run(agent, plant, task, rng, lengths, np.zeros(1, np.bool_))
    assert counted.lengths.tolist() == lengths[lengths > 0].tolist()
    assert counted.succeeded == (success > 0)


def test_a_run_of_a_learner_is_reported_like_one_of_the_loop():
    """Its environment has the task's noise and plant, and draws the run's own numbers."""

    class Looker:
        def train(self, env):
            self.env = env
            while True:
                env.reset()
                env.step(1)

    task = make_task(noise="gaussian-0.2", condition="friction-100", steps=2, trials=3)
    rng, learner, lengths = np.random.default_rng(1), Looker(), np.zeros(3, np.int64)
    assert run_learner(learner, equations(), task, rng, lengths, np.zeros(1, np.bool_)) == 0
    assert lengths.tolist() == [1, 1, 1]
    rules = learner.env.unwrapped.rules
    assert (rules.noise, rules.parameters, rules.start) == (task.noise, task.parameters, task.start)
    assert learner.env.unwrapped.np_random is rng


def test_gymnasium_is_imported_only_where_it_is_needed():
    ended = python(
        "import sys, upright.commands, upright.studies.study, upright.agents.custom\n"
        "print({'upright.environments.cartpole_env', 'gymnasium'} & set(sys.modules))"
    )
    assert ended.stdout == "set()\n", ended.stderr


def test_results_counted_by_hand_make_a_table():
    results = []
    for run, ends in enumerate([(3, 0), (4, 5, 0)]):
        env = TrialProtocol(ScriptedEnv(*ends), steps=7)
        go_on(env)
        results.append(env.result(run))
    case = Case("elsewhere:mine", "default", CustomAgent("elsewhere:mine"), TaskSpec(steps=7))
    row = summarise(case, 0, results)
    assert (row.runs, row.successes, row.mean_trials) == (2, 2, 2.5)
    assert "elsewhere:mine" in render([row], "text")
