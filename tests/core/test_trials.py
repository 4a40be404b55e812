import sys
import threading
from itertools import pairwise

import numpy as np
import pytest
from helpers import (
    GOOD_WEIGHTS,
    HARD_START,
    POOR_WEIGHTS,
    LinearAgent,
    RecordingPlant,
    ScriptedPlant,
    arrays,
    make_task,
)

from upright.agents import AGENTS
from upright.core.cartpole import has_fallen, step
from upright.core.compiled import is_compiled
from upright.core.loops import compiled_run
from upright.core.parameters import Parameters, State
from upright.core.task import Task
from upright.core.trials import FAILED, SUCCEEDED, advance, new_progress, run, trial
from upright.plants.equations import equations


def go(run, agent, plant, task, seed=1, stop=False):
    """Return the lengths of a run's trials, checking the figure that the run returns."""
    lengths = np.zeros(task.trials, np.int64)
    figure = run(agent, plant, task, np.random.default_rng(seed), lengths, np.array([stop]))
    made = np.trim_zeros(lengths, "b").tolist()
    assert figure in (0, len(made))
    if figure:
        assert made[-1] == task.steps
    return made


# ------------------------------------------------------------------------------ the two loops


@pytest.mark.parametrize("noise", ["none", "actuator-10", "gaussian-0.2", "all-10"])
@pytest.mark.parametrize(
    ("name", "settings"), [(name, label) for name in AGENTS for label in AGENTS.settings(name)]
)
def test_the_compiled_loop_is_the_python_loop(name, settings, noise):
    """The same trial lengths, and the same memory to the last bit."""
    task = make_task(noise=noise, steps=300, trials=8)._replace(start=HARD_START)
    outcomes = []
    for either in (run, compiled_run):
        agent = AGENTS.settings(name)[settings].agent(np.random.default_rng(4))
        assert is_compiled(agent)
        lengths = go(either, agent, equations(), task)
        outcomes.append((lengths, [array.tolist() for array in arrays(agent)]))
    assert outcomes[0] == outcomes[1]
    if name != "adaptive-lqr":  # which may balance at once, but then has learned at every step
        assert len(set(outcomes[0][0])) > 1, "trials differ, so the comparison means something"


@pytest.mark.parametrize("pieces", [1, 7, 10**9])
@pytest.mark.parametrize("noise", ["none", "all-10"])
def test_a_run_in_pieces_is_the_run(pieces, noise):
    task = make_task(noise=noise, steps=200, trials=60)._replace(start=HARD_START)
    settings, outcomes = AGENTS.settings("q-learning")["default"], []
    for seed in (1, 2):
        agents = [settings.agent(np.random.default_rng(0)) for _ in range(2)]
        lengths, rng, progress = np.zeros(60, np.int64), np.random.default_rng(seed), new_progress()
        plant = equations()
        while progress.stage[0] < SUCCEEDED:
            assert 0 < advance(agents[0], plant, task, rng, progress, lengths, pieces) <= pieces
        assert advance(agents[0], plant, task, rng, progress, lengths, pieces) == 0
        made = np.trim_zeros(lengths, "b").tolist()
        assert made == go(run, agents[1], equations(), task, seed)
        assert all(map(np.array_equal, arrays(agents[0]), arrays(agents[1])))
        assert (progress.trials[0], progress.steps[0]) == (len(made), made[-1])
        outcomes.append(int(progress.stage[0]))
    assert SUCCEEDED in outcomes


def test_a_run_in_pieces_ends_after_the_last_trial():
    task = make_task(steps=200, trials=2)._replace(start=HARD_START)
    agent, progress = LinearAgent(*POOR_WEIGHTS), new_progress()
    lengths = np.zeros(2, np.int64)
    advance(agent, equations(), task, np.random.default_rng(1), progress, lengths, 10**9)
    assert progress.stage[0] == FAILED
    assert progress.trials[0] == 2
    assert lengths.all()


# ------------------------------------------------------------------------------ an agent in Python


def recount(weights, task, seed):
    """Return trial lengths of a linear policy without noise, by an independent loop."""
    rng = np.random.default_rng(seed)
    lengths = []
    while len(lengths) < task.trials and task.steps not in lengths:
        state = State(*(0.05 * (2 * rng.random(4) - 1)).tolist())
        lengths.append(0)
        while lengths[-1] < task.steps and not has_fallen(task.parameters, state):
            push = 10.0 if np.dot(weights, state) > 0 else -10.0
            state = step(task.parameters, state, push)
            lengths[-1] += 1
    return lengths


@pytest.mark.parametrize(("weights", "balances"), [(GOOD_WEIGHTS, True), (POOR_WEIGHTS, False)])
def test_an_agent_in_plain_python_balances_the_equations(weights, balances):
    task = make_task(steps=2000, trials=5)
    agent = LinearAgent(*weights)
    assert not is_compiled(agent)
    lengths = go(run, agent, equations(), task)
    assert lengths == recount(weights, task, 1)
    assert lengths == [2000] if balances else len(lengths) == 5


def test_the_agent_learns_from_every_step():
    task = make_task(steps=500, trials=3)
    agent, plant = LinearAgent(*POOR_WEIGHTS), RecordingPlant()
    lengths = go(run, agent, plant, task)
    assert agent.begun == 3
    assert agent.ends == [True] * 3
    for length, start, states, moves in zip(
        lengths, plant.starts, plant.states, agent.moves, strict=True
    ):
        assert [after for _, _, after, _ in moves] == states
        assert [before for before, _, _, _ in moves] == [start, *states[:-1]]
        assert [fallen for _, _, _, fallen in moves] == [False] * (length - 1) + [True]


# ------------------------------------------------------------------------------ ends


@pytest.mark.parametrize("fall", [1, 2, 7])
def test_a_trial_ends_at_the_step_of_the_fall(fall):
    agent = LinearAgent(*POOR_WEIGHTS)
    rng = np.random.default_rng(1)
    assert trial(agent, ScriptedPlant(fall), make_task(steps=10), rng) == (fall, True)
    assert len(agent.moves[0]) == fall
    assert agent.ends == [True]


def test_a_trial_without_a_fall_ends_as_a_success():
    agent, plant = LinearAgent(*POOR_WEIGHTS), ScriptedPlant(0)
    assert trial(agent, plant, make_task(steps=10), np.random.default_rng(1)) == (10, False)
    assert plant.steps == 10
    assert agent.ends == [False]


def test_a_run_counts_every_trial_and_the_successful_one():
    task = make_task(steps=10, trials=8)
    plant = ScriptedPlant(3, 5, 2, 11, 4)
    assert go(run, LinearAgent(*POOR_WEIGHTS), plant, task) == [3, 5, 2, 10]


def test_a_fall_at_the_last_step_is_no_success():
    """Success is N steps without a fall; the agent is told of the fall, too."""
    task = make_task(steps=10, trials=3)
    agent = LinearAgent(*POOR_WEIGHTS)
    assert go(run, agent, ScriptedPlant(10, 4, 10), task) == [10, 4, 10]
    assert agent.ends == [True, True, True]
    agent = LinearAgent(*POOR_WEIGHTS)
    lengths, stop = np.zeros(3, np.int64), np.zeros(1, np.bool_)
    plant = ScriptedPlant(10, 4, 10)
    assert run(agent, plant, task, np.random.default_rng(1), lengths, stop) == 0


def test_a_failed_run_makes_all_its_trials():
    task = make_task(steps=10, trials=3)
    plant = ScriptedPlant(3, 5, 2, 11)
    assert go(run, LinearAgent(*POOR_WEIGHTS), plant, task) == [3, 5, 2]


def test_a_compiled_run_ends_with_its_first_success():
    task = make_task(steps=200, trials=300)
    lengths = go(
        compiled_run, AGENTS.settings("random-search")["default"].agent(None), equations(), task
    )
    assert lengths[-1] == 200
    assert max(lengths[:-1]) < 200


def test_a_failed_compiled_run_makes_all_its_trials():
    task = make_task(steps=10**9, trials=3)
    task = task._replace(parameters=HOPELESS)
    agent = AGENTS.settings("random-search")["default"].agent(None)
    assert len(go(compiled_run, agent, equations(HOPELESS), task)) == 3


# ------------------------------------------------------------------------------ stopping

HOPELESS = Parameters(force=1e-6, time_step=1e-5)
"""A plant that falls whatever the policy, after many steps."""


def test_a_stopped_run_makes_no_further_trial():
    task = make_task(steps=10, trials=5)
    stop = np.zeros(1, np.bool_)

    class Stopper(LinearAgent):
        def end_trial(self, fallen):
            super().end_trial(fallen)
            stop[0] = len(self.ends) == 2

    agent, lengths = Stopper(*POOR_WEIGHTS), np.zeros(5, np.int64)
    plant = ScriptedPlant(3, 4, 5, 6, 7)
    assert run(agent, plant, task, np.random.default_rng(1), lengths, stop) == 0
    assert lengths.tolist() == [3, 4, 0, 0, 0]


@pytest.mark.parametrize("either", [run, compiled_run])
def test_a_run_stopped_before_it_begins_does_nothing(either):
    agent = AGENTS.settings("random-search")["default"].agent(None)
    assert go(either, agent, equations(), make_task(steps=10, trials=5), stop=True) == []
    assert not agent.weights.any()


def test_another_thread_watches_and_stops_a_compiled_run():
    task = Task(parameters=HOPELESS, steps=10**9, trials=20_000)
    lengths, stop = np.zeros(task.trials, np.int64), np.zeros(1, np.bool_)
    agent = AGENTS.settings("random-search")["default"].agent(None)
    rng = np.random.default_rng(1)
    figures = []

    def work():
        figures.append(compiled_run(agent, equations(HOPELESS), task, rng, lengths, stop))

    thread = threading.Thread(target=work)
    thread.start()
    try:
        while not lengths[1] and thread.is_alive():
            pass
    finally:  # a thread left running would keep the process alive
        stop[0] = True
        thread.join()
    assert figures == [0]
    made = np.count_nonzero(lengths)
    assert 2 <= made < task.trials
    assert lengths[:made].all()


# ------------------------------------------------------------------------------ start and memory


@pytest.mark.parametrize(("start", "half_width"), [("zero", 0.0), ("random", 0.05)])
def test_every_trial_begins_at_a_start_of_its_own(start, half_width):
    plant = RecordingPlant()
    go(run, LinearAgent(*POOR_WEIGHTS), plant, make_task(start=start, steps=300, trials=20))
    starts = np.array(plant.starts)
    assert starts.shape == (20, 4)
    assert np.abs(starts).max() <= half_width
    assert all((a != b).all() == (start == "random") for a, b in pairwise(starts))


def test_a_compiled_run_leaks_no_references():
    agent = AGENTS.settings("random-search")["default"].agent(None)
    plant, task = equations(), make_task(steps=50, trials=2)
    rng, lengths, stop = np.random.default_rng(1), np.zeros(2, np.int64), np.zeros(1, np.bool_)
    watched = [rng, rng.bit_generator, lengths, stop, plant.memory, *arrays(agent)]
    watched += [agent, plant, task, task.parameters, task.noise]
    compiled_run(agent, plant, task, rng, lengths, stop)
    before = [sys.getrefcount(thing) for thing in watched]
    for _ in range(200):
        compiled_run(agent, plant, task, rng, lengths, stop)
    assert [sys.getrefcount(thing) for thing in watched] == before


@pytest.mark.parametrize("name", AGENTS)
def test_calls_of_compiled_methods_leak_no_references(name):
    agent, rng = AGENTS.settings(name)["default"].agent(np.random.default_rng(1)), None
    rng, state = np.random.default_rng(2), State(0.01, 0.02, 0.03, 0.04)
    watched = [agent, rng, rng.bit_generator, state, *arrays(agent)]
    counts = []
    for _ in range(3):
        for _ in range(50):
            agent.begin_trial(rng)
            agent.learn(state, agent.act(state, rng), state, True)
            agent.end_trial(True)
        counts.append([sys.getrefcount(thing) for thing in watched])
    assert counts[1] == counts[2]
