"""An agent that does not repeat itself is noticed, said once, and measured all the same."""

import sys

import pytest

from upright.commands import run
from upright.errors import AgentWarning
from upright.reports.learning import learn
from upright.studies.case import make_case
from upright.studies.repeatability import STEPS, TRIALS, doubt_about
from upright.studies.study import study

AGENT = """
    import random, time
    import numpy as np
    seen = []


    class A:
        def __init__(self, rng, kept=[]):
            self.kept, self.steps = kept, 0

        def begin_trial(self, rng): ...

        def act(self, observation, rng):
            self.steps += 1
            {act}

        def learn(self, before, action, after, fallen): ...

        def end_trial(self, fallen):
            print("trial ended")
            breakpoint()
"""
LEARNER = """
    import numpy as np


    class A:
        def __init__(self, rng):
            self.rng = {rng}

        def train(self, env):
            while True:
                env.reset()
                while not env.step(int(self.rng.random() < 0.5))[2]:
                    pass
"""
COMPILED = """
    from typing import NamedTuple
    import numpy as np
    from upright import compiled

    SHARED = np.zeros(1, np.int64)


    class Counter(NamedTuple):
        n: np.ndarray

        @compiled
        def begin_trial(self, rng): ...

        @compiled
        def act(self, observation, rng):
            return observation.theta > 0.0

        @compiled
        def learn(self, before, action, after, fallen):
            self.n[0] += 1

        @compiled
        def end_trial(self, fallen): ...

        @compiled
        def push_probability(self, observation):
            return 0.5


    def A(rng):
        return Counter({n})
"""
LOUD = """
    import warnings

    warnings.warn("very loud")
"""
UNREPEATABLE = {
    "random": "return random.random() < 0.5",
    "numpy.random": "return np.random.random() < 0.5",
    "default_rng": "return np.random.default_rng().random() < 0.5",
    "a global variable": "seen.append(1); return len(seen) % 5 < 2",
    "a default argument": "self.kept.append(1); return len(self.kept) % 5 < 2",
    "the clock": "return time.perf_counter_ns() % 2 == 0",
}


def doubt(text, write, **task):
    return doubt_about(make_case(f"{write(text)}:A", **task))


@pytest.mark.parametrize("act", UNREPEATABLE.values(), ids=UNREPEATABLE)
def test_what_does_not_come_from_rng_is_noticed(act, write):
    said = doubt(AGENT.format(act=act), write)
    assert "; two runs with the same seed differ, so its results cannot be repeated; all " in said
    assert "random numbers must come from rng, and no global variable" in said


@pytest.mark.parametrize("noise", ["none", "all-10"])
@pytest.mark.parametrize("act", ["return rng.random() < 0.5", "return self.steps % 3 == 0"])
def test_an_agent_that_repeats_itself_is_not_doubted(act, noise, write, capsys):
    assert doubt(AGENT.format(act=act), write, noise=noise) == ""
    assert capsys.readouterr().out == "", "what it prints is not shown"


def test_an_agent_that_fails_is_not_judged(write):
    assert doubt(AGENT.format(act="return 1 / 0"), write) == ""
    assert doubt(AGENT.format(act="return None"), write) == ""


@pytest.mark.parametrize(("rng", "doubted"), [("rng", False), ("np.random", True)])
def test_learners_are_judged_by_the_lengths_of_their_trials(rng, doubted, write):
    assert bool(doubt(LEARNER.format(rng=rng), write)) == doubted


@pytest.mark.slow
@pytest.mark.parametrize(("n", "doubted"), [("np.zeros(1, np.int64)", False), ("SHARED", True)])
def test_compiled_agents_are_judged_by_their_memory_too(n, doubted, write):
    assert bool(doubt(COMPILED.format(n=n), write)) == doubted


def test_the_package_s_own_agents_and_other_plants_are_not_run(write, monkeypatch):
    monkeypatch.setattr("upright.studies.repeatability.trace", None)
    assert doubt_about(make_case("reinforce")) == ""
    assert doubt(AGENT.format(act=UNREPEATABLE["random"]), write, plant="gazebo") == ""


def test_little_is_run_and_only_once(write):
    name = write(AGENT.format(act="seen.append(1); return observation.theta > 0.0"))
    case = make_case(f"{name}:A", steps=60_000)
    for _ in range(2):
        doubt_about(case)
        assert 0 < len(sys.modules[name].seen) <= 2 * TRIALS * STEPS


@pytest.mark.slow
def test_a_study_says_it_once_and_makes_its_runs(write):
    """In processes and in threads."""
    name = write(AGENT.format(act=UNREPEATABLE["numpy.random"]).replace("breakpoint()", "pass"))
    cases = [make_case(f"{name}:A", noise=n, steps=50, trials=2) for n in ("none", "sensor-5")]
    with pytest.warns(AgentWarning, match="two runs with the same seed differ") as said:
        results = study(cases, 2)
    assert len(said) == 1
    assert [len(results[case]) for case in cases] == [2, 2]


def test_a_command_says_it_in_one_line(write, capsys):
    agent = f"{write(AGENT.format(act=UNREPEATABLE['random']).replace('breakpoint()', 'pass'))}:A"
    run(["learn", agent, "--quiet", "--trials", "2"])
    shown = capsys.readouterr()
    assert shown.err.startswith(
        f"upright: warning: agent is {agent!r}; two runs with the same seed"
    )
    assert shown.err.count("\n") == 1
    assert shown.out.count("trial ended") == 2


@pytest.mark.slow
def test_learn_warns(write):
    with pytest.warns(AgentWarning, match="two runs with the same seed differ"):
        learn(f"{write(COMPILED.format(n='SHARED'))}:A", trials=2)


def test_other_warnings_are_shown_as_usual(write):
    text = AGENT.format(act="return True").replace("breakpoint()", "pass")
    with pytest.warns(UserWarning, match="very loud"):
        run(["learn", f"{write(text + LOUD)}:A", "--quiet", "--trials", "2"])
