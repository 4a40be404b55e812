"""Going on learning from a policy: what is carried over, what is counted, what is refused."""

import hashlib
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import ROOT

from upright.agents import AGENTS
from upright.commands import run
from upright.errors import UprightError
from upright.plants.equations import equations
from upright.policies.files import export_policy, load_policy, read_header, save_policy
from upright.policies.going_on import carry_over
from upright.policies.npz_file import arrays_of
from upright.policies.stages import MOST_STAGES, SavedAs, Stage
from upright.reports.learning import learn
from upright.studies.case import make_case
from upright.studies.learned import case_from, learned_policy
from upright.studies.run import choose_loop, make_run
from upright.support.exit_status import BAD_USE, FAILED

HARD = {"noise": "all-10", "start": "wide", "condition": "delay-2", "steps": 2000}
"""A task on which every agent falls."""
PLAIN = """
    import numpy as np


    class Climber:
        '''Draws a line, from its own generator; keeps the best.'''

        def __init__(self, rng):
            self.rng, self.weights, self.best = rng, np.zeros(4), []
            self.trials = self.steps = 0

        def begin_trial(self, rng):
            self.steps, self.trials = 0, self.trials + 1
            self.weights[:] = self.rng.normal(size=4) * (1, 1, 9, 3)

        def act(self, observation, rng):
            return self.weights @ np.array(observation) > 0

        def learn(self, before, action, after, fallen):
            self.steps += 1

        def end_trial(self, fallen):
            self.best.append((self.steps, self.weights.copy()))
"""


def contents(memory):
    return {name: array.tobytes() for name, array in arrays_of(memory)}


@pytest.fixture(scope="module", params=AGENTS)
def learned(request, tmp_path_factory):
    """What an agent learned in three trials, and the same from its file."""
    case = make_case(request.param, trials=3, **HARD)
    memory, result = make_run(case, 5, 0)
    policy = learned_policy(case, 5, 0, memory, result)
    path = tmp_path_factory.mktemp("going_on") / "policy.npz"
    save_policy(path, policy)
    return policy, load_policy(path)


# --------------------------------------------------------------------------- what is carried over


def test_a_file_gives_back_all_that_an_agent_learned(learned):
    policy, loaded = learned
    settings = policy.settings
    fresh = settings.agent(np.random.default_rng(9))
    agent = carry_over(loaded, fresh)
    assert agent is fresh
    assert contents(agent) == contents(policy.memory) == contents(loaded.memory)
    assert contents(agent) != contents(settings.agent(np.random.default_rng(9)))


def test_it_goes_on_as_if_it_had_not_been_interrupted(learned):
    """With the random numbers that it would have drawn."""
    _, loaded = learned
    task = loaded.learned_on.task()._replace(trials=1)
    new = loaded.settings.agent
    loop = choose_loop(case_from(loaded), loaded.memory, equations())

    def trials(agent, rng, count):
        lengths, stop = np.zeros(count, np.int64), np.zeros(1, np.bool_)
        for number in range(count):
            loop(agent, equations(), task, rng, lengths[number:], stop)
        return lengths.tolist()

    rng, again = (np.random.default_rng(3) for _ in range(2))
    uninterrupted = carry_over(loaded, new(np.random.default_rng(1)))
    expected = trials(uninterrupted, rng, 6)
    first = carry_over(loaded, new(np.random.default_rng(2)))
    lengths = trials(first, again, 3)
    second = carry_over(replace(loaded, memory=first), new(np.random.default_rng(4)))
    assert lengths + trials(second, again, 3) == expected
    assert contents(second) == contents(uninterrupted)


def test_learning_from_a_file_or_from_memory_is_the_same_and_changes_neither(learned):
    policy, loaded = learned
    before = contents(policy.memory)
    (once, first), (again, second) = (
        learn(each, seed=8, steps=2000, trials=4) for each in (policy, loaded)
    )
    assert first.lengths.tolist() == second.lengths.tolist()
    assert contents(once.memory) == contents(again.memory)
    assert contents(policy.memory) == contents(loaded.memory) == before
    assert once.learned_on == replace(policy.learned_on, trials=4)


def test_what_was_learned_counts():
    """Q-learning that has learned to balance does so in its first trial."""
    policy, result = learn("q-learning", steps=3000)
    assert result.trials > 3
    on, more = learn(policy, seed=1, steps=3000)
    assert more.trials == 1
    assert [stage.trials for stage in on.stages] == [result.trials, 1]


def test_a_plain_agent_goes_on_with_the_random_numbers_of_the_run(write):
    agent = f"{write(PLAIN)}:Climber"
    policy, result = learn(agent, steps=3000, trials=3)
    save_policy("plain.npz", policy)
    loaded = load_policy("plain.npz", agent)
    ons = [learn(each, seed=2, steps=3000, trials=4) for each in (policy, loaded)]
    assert ons[0].result.lengths.tolist() == ons[1].result.lengths.tolist()
    new = learn(agent, seed=2, steps=3000, trials=4)
    assert ons[0].result.lengths.tolist() == new.result.lengths.tolist()  # it keeps, but not uses
    for on, trials in ons:
        steps = [steps for steps, _ in on.memory.best]
        assert steps == [*result.lengths.tolist(), *trials.lengths.tolist()]
        assert on.memory.trials == result.trials + trials.trials
    for kept in (policy, loaded):
        assert kept.memory.trials == len(kept.memory.best) == result.trials
        np.testing.assert_array_equal(kept.memory.weights, kept.memory.best[-1][1])


# -------------------------------------------------------------------------- the task and settings


def test_the_task_is_the_policys_except_for_changes():
    parameters = {"half_length": 0.7}
    names = {"noise": "sensor-5", "start": "zero", "parameters": parameters}
    policy, _ = learn("random-search", steps=20, trials=7, **names)
    spec = case_from(policy, condition="delay-1").spec
    assert spec == replace(policy.learned_on, condition="delay-1", steps=60_000, trials=1_000)


def test_settings_that_nothing_learned_depends_on_can_be_changed():
    policy, _ = learn("reinforce", "as-published", steps=50, trials=2)
    assert case_from(policy).settings_name == "as-published"
    on, _ = learn(policy, {"learning_rate": 0.003}, steps=50, trials=2)
    assert on.settings == replace(policy.settings, learning_rate=0.003)
    assert on.memory.adam.learning_rate == 0.003
    assert on.stages[-1].settings == {"learning_rate": 0.003}


@pytest.mark.parametrize(
    ("agent", "changes", "said"),
    [
        ("reinforce", {"kept_steps": 10, "discount": 0.9}, "kept_steps .* 'episodes.inputs'"),
        ("reinforce", {"theta_scale": 1.0}, "theta_scale cannot be changed .* 'scales'"),
        ("adaptive-lqr", {"history": 3}, "history .* 'model'.*; the policy has history 6"),
        ("adaptive-lqr", {"theta_cost": 1.0}, "theta_cost .* 'design.state_costs'"),
        (
            "q-learning",
            {"mirrored": False, "x_edges": (0.0, 1.0, 2.0)},
            "mirrored and x_edges cannot .* 'table'",
        ),
        ("q-learning", {"tempo": 1}, "setting is 'tempo'; it must be one of"),
        ("q-learning", "as-published", "settings is 'as-published'; an agent that goes on"),
    ],
)
def test_settings_that_shape_what_is_carried_over_are_refused(agent, changes, said):
    case = make_case(agent)
    policy = learned_policy(case, 0, 0, case.settings.agent(np.random.default_rng(0)))
    with pytest.raises(UprightError, match=said):
        learn(policy, changes)


# ------------------------------------------------------------------------------ what is recorded


def test_the_file_tells_all_its_stages(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    line = "learn q-learning --steps 3000 --trials 3 --save a.npz --quiet"
    assert run(line.split()) == FAILED
    line = "learn --from a.npz --noise sensor-5 --steps 3000 --trials 2 --seed 4 --save b.npz"
    capsys.readouterr()
    assert run(line.split()) in (0, FAILED)
    shown = capsys.readouterr().out
    first, second = load_policy("a.npz").stages[0], load_policy("b.npz").stages[1]
    assert f"goes on from a.npz: q-learning, learned in 3 trials ({first.steps:,} steps)" in shown
    assert "carried over: table, move_entries, move_boxes, moves (4,481 numbers)" in shown
    total = f"{3 + second.trials} trials ({first.steps + second.steps:,} steps)"
    assert f"learned in 2 stages, in all: {total}" in shown

    loaded = load_policy("b.npz")
    assert loaded.stages == (first, second)
    digest = hashlib.sha256(Path("a.npz").read_bytes()).hexdigest()
    assert second.source == ("a.npz", digest)
    assert (first.source, first.balanced) == (None, False)
    assert second.task == loaded.task
    assert (second.task["noise"], second.task["seed"]) == ("sensor-5", 4)
    assert run(["show", "b.npz"]) == 0
    lines = capsys.readouterr().out.splitlines()
    for number, stage in ((1, first), (2, second)):
        assert f"stage {number}: {json.dumps(stage.as_data())}" in lines
    assert f'learned in: "{total}"' in lines


def test_a_file_of_an_earlier_version_goes_on_with_an_unknown_count(tmp_path):
    old = load_policy(ROOT / "tests/data/0.1.0/q-learning.npz")
    assert old.stages == ()
    policy, result = learn(old, steps=300, trials=2)
    assert policy.stages[0] == Stage(old.task)
    assert policy.stages[1].source.file == "q-learning.npz"
    save_policy(tmp_path / "on.npz", policy)
    header = read_header(tmp_path / "on.npz")
    steps = sum(result.lengths)
    counted = f"{result.trials} trial{'s' * (result.trials > 1)} ({steps:,} steps)"
    assert header["learned in"] == f"{counted}, and an unknown number before"


def test_as_many_stages_as_there_may_be_fit_a_file(tmp_path):
    policy, _ = learn("random-search", steps=20, trials=2)
    stage = replace(policy.stages[0], source=SavedAs("ö" * 120 + ".npz", "0" * 64))
    full = replace(policy, stages=(stage,) * MOST_STAGES)
    save_policy(tmp_path / "full.npz", full)
    loaded = load_policy(tmp_path / "full.npz")
    assert len(loaded.stages) == MOST_STAGES
    with pytest.raises(UprightError, match=f"with {MOST_STAGES} stages, the most"):
        learn(loaded)


# ------------------------------------------------------------------------------ what is refused


@pytest.fixture
def files(write):
    """Policies as files in the current folder, and the name of the plain agent of one of them."""
    policy, _ = learn("q-learning", steps=20, trials=2)
    save_policy("q.npz", policy)
    export_policy("q.json", policy)
    agent = f"{write(PLAIN)}:Climber"
    save_policy("plain.npz", learn(agent, steps=20, trials=2).policy)
    return agent


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("--from gone.npz", "'gone.npz'; there is no such file"),
        ("--from q.json", "holds only what it computes, as JSON does; .* ending in .npz"),
        ("reinforce --from q.npz", "learned by 'q-learning', not by 'reinforce'"),
        ("nobody --from q.npz", "agent is 'nobody'; it must be one of"),
        ("--from plain.npz", "whose code is run only if you name it: .*--from: MODULE:NAME"),
        ("--from q.npz --settings as-published", "--settings cannot be given with --from"),
        ("--from q.npz --settings-file x.toml", "--settings-file cannot be given with --from"),
        ("--from q.npz --set replay_size=5", "replay_size cannot be changed .* 'move_entries'"),
        ("--from q.npz --set reinforce.discount=1", "'reinforce' is not among the agents"),
        ("--from q.npz --twister", "--twister cannot be given with --from"),
        ("AGENT --from plain.npz --set best=1", "has no settings that could be changed"),
    ],
)
def test_what_cannot_go_on_is_refused_in_one_line(line, said, files, capsys):
    assert run(["learn", *line.replace("AGENT", files).split()]) == BAD_USE
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert re.search(said, error), error


def test_a_plain_agent_that_is_named_goes_on(files, capsys):
    line = f"learn {files} --from plain.npz --steps 20 --trials 3 --save on.npz"
    assert run(line.split()) in (0, FAILED)
    assert "carried over: rng, weights, best, trials, steps" in capsys.readouterr().out
    assert len(load_policy("on.npz", files).stages) == 2


def test_a_policy_of_another_agent_or_of_changed_code_is_refused(write):
    policy, _ = learn("q-learning", steps=20, trials=2)
    with pytest.raises(UprightError, match="agent of the policy is 'q-learning'; it must be one"):
        make_run(make_case("reinforce"), 0, 0, policy=policy)
    other = make_case("q-learning", "as-published")
    with pytest.raises(UprightError, match="its array 'table' is float64 of shape"):
        make_run(other, 0, 0, policy=policy)


def test_it_goes_on_on_a_simulator():
    policy, _ = learn("random-search", steps=20, trials=2)
    on, result = learn(policy, plant="mujoco", steps=30, trials=3)
    assert on.plant["name"] == on.stages[1].task["plant"]["name"] == "mujoco"
    assert [stage.trials for stage in on.stages] == [policy.stages[0].trials, result.trials]
    back, _ = learn(on, steps=20, trials=2)
    assert back.plant["name"] == "equations"
