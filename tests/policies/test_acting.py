"""Playing agents of which only `act` is known."""

import threading
from collections import defaultdict
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from helpers import GOOD_WEIGHTS, LinearAgent

from upright.core.compiled import compiled
from upright.core.parameters import State
from upright.core.task import TaskSpec
from upright.core.trials import trial
from upright.errors import UprightError
from upright.policies.acting import SAMPLES, Actor, generators_in
from upright.policies.policy import Policy
from upright.studies.case import make_case
from upright.studies.playing import TrialOutcome, play_trials, prepare, record

HERE = State(0.1, 0.2, 0.03, 0.4)


class Noisy:
    """An agent that changes as it acts, and draws from its own generator or from the run's."""

    def __init__(self, own):
        self.rng = np.random.default_rng(7)
        self.own, self.asked, self.seen = own, 0, []
        self.nested = {"inner": [self.rng]}

    def act(self, observation, rng):
        self.asked += 1
        self.seen.append(observation)
        rng = self.nested["inner"][0] if self.own else rng
        return self.asked < 100 and rng.random() < 0.3 + observation.x


class Biased:
    """An agent that mostly pushes to one side, by its own random numbers or the run's."""

    def __init__(self, own):
        self.rng, self.own, self.trials = np.random.default_rng(7), own, []

    def begin_trial(self, rng):
        self.trials.append(rng.random())

    def act(self, observation, rng):
        return (self.rng if self.own else rng).random() < 0.5 + 40 * observation.x

    def remember(self, observation, action): ...


class Climber(NamedTuple):
    weights: np.ndarray

    @compiled
    def act(self, observation, rng):
        return self.weights[2] * observation.theta > 0.0


class Lagging:
    """An agent that pushes as it was told in the previous step, which `remember` gives it."""

    def __init__(self):
        self.heard = []

    def begin_trial(self, rng):
        self.heard = ["begun"]

    def act(self, observation, rng):
        return observation.theta > 0

    def remember(self, observation, action):
        self.heard.append((observation, action))


def policy_of(agent):
    return Policy("mine:agent", agent, TaskSpec())


def moves(actor, seed, steps=20):
    rng = np.random.default_rng(seed)
    actor.begin_trial(rng)
    return [actor.act(HERE, rng) for _ in range(steps)]


@pytest.mark.parametrize("own", [False, True])
def test_every_trial_begins_from_the_same_state(own):
    agent = Noisy(own)
    actor = Actor("mine:agent", agent)
    first = moves(actor, 1)
    assert moves(actor, 2) != first
    assert moves(actor, 1) == first
    assert (agent.asked, agent.seen) == (0, [])
    assert agent.rng.random() == np.random.default_rng(7).random()


def test_the_generators_of_an_agent_are_found():
    agent = Noisy(own=True)
    agent.itself = agent
    other = np.random.default_rng(0)
    agent.more = (defaultdict(list, {1: [{other}]}), agent, np, generators_in, Noisy)
    assert {id(each) for each in generators_in(agent)} == {id(agent.rng), id(other)}
    assert generators_in(Climber(np.zeros(4))) == []


def test_the_probability_is_that_of_many_pushes_and_asking_changes_nothing():
    for own in (False, True):
        agent = Noisy(own)
        policy = policy_of(agent)
        probability = policy.push_probability(HERE)
        assert 0 < probability < 1
        assert (probability * SAMPLES).is_integer()
        assert [policy.push_probability(HERE) for _ in range(10)] == [probability] * 10
        assert (agent.asked, agent.seen) == (0, [])
        assert policy.push_probability(State(0.7, 0, 0, 0)) == 1.0
        assert policy.push_probability(State(-0.3, 0, 0, 0)) == 0.0


def test_an_agent_that_draws_nothing_is_asked_once():
    asked = []

    class Sure:
        def act(self, observation, rng):
            asked.append(observation)
            return observation.theta > 0

    policy = policy_of(Sure())
    assert policy.push_probability(np.array([0, 0, 0.1, 0])) == 1.0
    assert policy.push_probability((0, 0, -0.1, 0)) == 0.0
    assert asked == [State(0.0, 0.0, 0.1, 0.0), State(0.0, 0.0, -0.1, 0.0)]


def test_asking_between_steps_does_not_change_a_trial():
    actor, rng = Actor("mine:agent", Noisy(own=True)), np.random.default_rng(1)
    expected = moves(actor, 1)
    actor.begin_trial(rng)
    found = []
    for _ in expected:
        actor.push_probability(HERE)
        found.append(actor.act(HERE, rng))
    assert found == expected


def test_nothing_but_act_is_called():
    agent = LinearAgent(*GOOD_WEIGHTS)
    case = make_case("random-search", steps=300)
    assert list(play_trials(policy_of(agent), case, 2, seed=0)) == [TrialOutcome(300, True)] * 2
    assert (agent.begun, agent.moves, agent.ends) == (0, [], [])


def test_an_agent_that_remembers_is_told_each_step():
    policy = policy_of(Lagging())
    task = TaskSpec(steps=3).task()
    case = make_case("random-search", steps=3)
    for _ in range(2):
        plant, _, rng = prepare(case, 0, 0, np.zeros(1, np.bool_))
        scenes, _ = record(policy, plant, task, rng)
        heard = policy._actor._playing.heard
        assert heard[0] == "begun"
        assert [observation for observation, _ in heard[1:]] == [s.state for s in scenes[:-1]]
        assert [action for _, action in heard[1:]] == [s.force > 0 for s in scenes[1:]]
    assert policy.memory.heard == []


def test_an_agent_that_cannot_be_copied_is_refused_when_it_is_played():
    agent = Lagging()
    agent.lock = threading.Lock()
    policy = policy_of(agent)
    for play in (lambda: policy.push_probability(HERE), lambda: policy.begin_trial(None)):
        with pytest.raises(UprightError, match=r"'mine:agent'; without push_prob.*copied: .*lock"):
            play()


def test_compiled_agents_may_have_act_alone():
    policy = policy_of(Climber(np.array([0.0, 0.0, 1.0, 0.0])))
    assert policy.push_probability(HERE) == 1.0
    task = TaskSpec(steps=50).task()
    case = make_case("random-search", steps=50)
    played = list(play_trials(policy, case, 2, seed=4))
    for episode, each in enumerate(played):
        plant, _, rng = prepare(case, 4, episode, np.zeros(1, np.bool_))
        steps, fallen = trial(policy, plant, task, rng)
        assert each == TrialOutcome(steps, not fallen)


@pytest.mark.parametrize("own", [False, True])
def test_a_greedy_actor_makes_the_likelier_push_and_draws_nothing(own):
    policy = replace(policy_of(Biased(own)), greedy=True)
    rng = np.random.default_rng(1)
    unused = rng.bit_generator.state
    for _ in range(2):
        policy.begin_trial(rng)
        for x in (0.01, -0.01) * 10:
            here = HERE._replace(x=x)
            assert policy.act(here, rng) == (x > 0)
            assert policy.push_probability(here) == (x > 0)
            policy.learn(here, True, here, False)
    assert rng.bit_generator.state == unused
    drawn = policy_of(Biased(own))
    drawn.begin_trial(rng)
    assert {drawn.act(HERE._replace(x=0.001), rng) for _ in range(50)} == {True, False}
