"""The agents that `upright new` writes: one rule, plain and compiled, which learns."""

import sys
from itertools import pairwise

import numpy as np
import pytest
from helpers import ROOT

from upright.agents.starters import PLAIN, starter
from upright.agents.starters import my_agent as plain
from upright.agents.starters import my_compiled_agent as compiled
from upright.core.parameters import State
from upright.errors import UprightError
from upright.studies.case import make_case
from upright.studies.run import make_run
from upright.studies.study import study
from upright.support.files import PACKAGE

STARTERS = {
    "plain": "upright.agents.starters.my_agent:MyAgent",
    "compiled": "upright.agents.starters.my_compiled_agent:my_agent",
}
LINES = 60
"""How long the plain one may be, to be read in five minutes."""
TARGET_SEED = 1_000_000
"""Beyond the seeds of tables: the constants were chosen here, too."""


def fall(agent, measurements):
    """Let an agent live through a trial that ends with a fall."""
    rng = np.random.default_rng(0)
    agent.begin_trial(rng)
    for before, after in pairwise(measurements):
        agent.learn(before, True, after, after is measurements[-1])
    agent.end_trial(True)


def test_a_fall_corrects_the_weights_by_the_rule():
    agent = plain.MyAgent(np.random.default_rng(0))
    fall(agent, [State(0, 0, 0, 0), State(0, 0, 0.105, 1), State(0.24, -1, 0.21, 2)])
    first = 0.05 * np.array([0.1, -1.0, 1.0, 2.0])
    z = np.array([0.0, 0.0, 0.5, 1.0])
    expected = first + 0.05 * (0.98 - first @ z) * z
    np.testing.assert_allclose(agent.weights, expected, rtol=1e-12)


@pytest.mark.parametrize("side", [-1, 1])
def test_it_pushes_to_the_side_that_it_fell_to(side):
    agent, rng = plain.MyAgent(np.random.default_rng(0)), np.random.default_rng(0)
    leaning = State(0, 0, side * 0.1, side * 0.5)
    fall(agent, [State(0, 0, 0, 0), leaning, State(0, 0, side * 0.22, side * 1.0)])
    assert agent.act(leaning, rng) is (side == 1)


def test_a_success_changes_nothing():
    agent = plain.MyAgent(np.random.default_rng(0))
    agent.learn(State(0, 0, 0, 0), True, State(0, 0, 0.1, 0), False)
    agent.end_trial(False)
    assert agent.weights == [0.0] * 4


def test_the_plain_one_is_short():
    assert len((PACKAGE / "agents/starters" / PLAIN).read_text().splitlines()) <= LINES


@pytest.mark.parametrize("noise", ["none", "actuator-10", "gaussian-0.2"])
def test_both_give_the_same_trials(noise):
    """Trials of more steps than the agent remembers are among them."""
    told = []
    for name in STARTERS.values():
        case = make_case(name, noise=noise, condition="delay-2", steps=3000, trials=25)
        told.append([make_run(case, 0, run)[1].lengths.tolist() for run in range(4)])
    assert told[0] == told[1]
    assert any(plain.LAST < length < 3000 for lengths in told[0] for length in lengths)


def test_the_probability_of_a_push_is_what_the_compiled_one_does():
    agent, rng = compiled.my_agent(np.random.default_rng(0)), np.random.default_rng(0)
    assert agent.push_probability(State(0, 0, 0.1, 0)) == 0.5
    agent.weights[:] = 0.1, 0.2, 1.0, 0.5
    for observation in (State(0, 0, 0.1, 0), State(0, 0, -0.1, 0)):
        assert agent.push_probability(observation) == agent.act(observation, rng)


@pytest.mark.slow
@pytest.mark.parametrize("noise", ["none", "actuator-5", "sensor-10", "gaussian-0.2"])
def test_it_learns_in_half_the_trials_of_guessing(noise):
    """It takes a third to an eighth of them; a broken rule takes as many and more."""
    names = (STARTERS["compiled"], "random-search")
    cases = [make_case(name, noise=noise, steps=5000, trials=300) for name in names]
    results = study(cases, runs=60, seed=TARGET_SEED)
    own, guess = (np.mean([run.trials for run in results[case]]) for case in cases)
    assert all(run.success for run in results[cases[0]])
    assert own < 0.5 * guess
    assert own < 6


def test_names_are_made_from_that_of_the_module():
    for module, compiled_too, expected in (
        ("my_agent", False, "MyAgent"),
        ("pole_keeper", False, "PoleKeeper"),
        ("poleKeeper2", False, "PoleKeeper2"),
        ("pole_keeper", True, "pole_keeper"),
        ("poleKeeper2", True, "pole_keeper2"),
    ):
        name, text = starter(module, compiled=compiled_too)
        assert name == expected
        assert "MyAgent" not in text or module == "my_agent"
        known = {"__name__": module}
        sys.modules[module] = type(sys)(module)  # NamedTuple looks for its module
        try:
            exec(compile(text, module, "exec"), known)
        finally:
            del sys.modules[module]
        assert callable(known[name])


@pytest.mark.parametrize(("module", "compiled_too"), [("state", False), ("scaled", True)])
def test_a_name_that_would_hide_another_is_refused(module, compiled_too):
    with pytest.raises(UprightError, match=rf"would hide '.*try '{module}_agent\.py'"):
        starter(module, compiled=compiled_too)


def test_the_example_is_the_starter():
    assert (ROOT / "examples/plain_agent.py").read_text() == starter("plain_agent")[1]
