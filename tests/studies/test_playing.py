from dataclasses import replace
from functools import partial

import numpy as np
import pygame
import pytest
from helpers import GOOD_WEIGHTS, LinearAgent, RecordingPlant, ScriptedPlant, arrays, make_task
from PIL import Image

from upright.agents import AGENTS
from upright.core.parameters import State
from upright.core.task import TaskSpec
from upright.core.trials import trial
from upright.errors import UprightError
from upright.pictures.picture import HEIGHT, WIDTH
from upright.plants.equations import EquationsSettings
from upright.plants.mujoco import Mujoco
from upright.policies.files import export_policy, save_policy
from upright.policies.policy import Policy
from upright.studies.case import make_case
from upright.studies.learned import learned_policy
from upright.studies.playing import (
    PAUSE,
    TrialOutcome,
    case_for,
    pictures,
    play,
    play_trials,
    prepare,
    record,
)
from upright.studies.run import make_run
from upright.studies.watching import watch_play

HARD = {"noise": "all-10", "start": "wide", "condition": "delay-2", "steps": 3000}
"""A task on which trials vary much in length."""
GO_ON = np.zeros(1, np.bool_)


@pytest.fixture(scope="module")
def learned():
    """Return what every agent learned in too few trials."""

    def learn(agent):
        steps = 20 if agent == "adaptive-lqr" else 2000  # it would learn enough
        case = make_case(agent, trials=5, steps=steps, start="zero")
        memory, _ = make_run(case, 0, 0)
        return learned_policy(case, 0, 0, memory)

    return {agent: learn(agent) for agent in AGENTS}


@pytest.mark.parametrize("agent", AGENTS)
@pytest.mark.parametrize("changes", [HARD, HARD | {"condition": "varied-plant"}])
def test_compiled_play_is_the_same_as_the_loop_in_python(agent, changes, learned):
    policy = learned[agent]
    case = case_for(policy, **changes)
    compiled = list(play_trials(policy, case, 8, seed=3))
    for episode, played in enumerate(compiled):
        steps, fallen = trial(policy, *prepare(case, 3, episode, GO_ON))
        assert played == TrialOutcome(steps, not fallen)
    assert len({played.steps for played in compiled}) > 1


@pytest.mark.parametrize("agent", ["reinforce", "adaptive-lqr"])
def test_greedy_play_is_the_same_compiled_and_in_python(agent, learned):
    policy = replace(learned[agent], greedy=True)
    case = case_for(policy, **HARD)
    compiled = list(play_trials(policy, case, 5, seed=3))
    for episode, played in enumerate(compiled):
        steps, fallen = trial(policy, *prepare(case, 3, episode, GO_ON))
        assert played == TrialOutcome(steps, not fallen)
    assert play(learned[agent], 5, seed=3, greedy=True, **HARD) == compiled
    if agent == "reinforce":  # the other one's pushes are sure, but use up random numbers
        assert play(learned[agent], 5, seed=3, **HARD) != compiled


def test_a_policy_of_a_custom_agent_plays_in_python():
    class Memory(LinearAgent):
        def push_probability(self, observation):
            return float(super().act(observation, None))

    policy = Policy("helpers:LinearAgent", Memory(*GOOD_WEIGHTS), TaskSpec())
    case = make_case("random-search", steps=500)
    assert list(play_trials(policy, case, 2, seed=0)) == [TrialOutcome(500, True)] * 2


@pytest.mark.parametrize(
    ("agent", "parts"),
    [
        ("random-search", ["weights"]),
        ("reinforce", ["network"]),
        ("adaptive-lqr", ["model", "moments", "gains", "samples"]),
    ],
)
def test_playing_teaches_nothing(agent, parts, learned):
    policy = learned[agent]
    kept = [array for part in parts for array in arrays((getattr(policy.memory, part),))]
    before = [array.copy() for array in kept]
    list(play_trials(policy, case_for(policy, **HARD), 5, seed=0))
    for array, old in zip(kept, before, strict=True):
        np.testing.assert_array_equal(array, old)
        assert array.any()


def test_a_policy_with_a_history_remembers_and_forgets(learned):
    policy = learned["adaptive-lqr"]
    case = case_for(policy, steps=5)
    for _ in range(2):
        assert list(play_trials(policy, case, 1, seed=0)) == [TrialOutcome(5, True)]
        assert policy.memory.steps[0] == 5


def test_a_trial_depends_on_its_number_and_the_seed_alone(learned):
    policy = learned["q-learning"]
    case = case_for(policy, **HARD)
    few, many = (list(play_trials(policy, case, count, seed=1)) for count in (3, 6))
    assert many[:3] == few
    assert list(play_trials(policy, case, 3, seed=2)) != few
    starts = [record(policy, *prepare(case, 1, i, GO_ON))[0][0].state for i in range(3)]
    assert len(set(starts)) == 3


def test_every_trial_has_its_own_plant_where_plants_vary(learned):
    case = case_for(learned["reinforce"], condition="varied-plant")
    prepared = [prepare(case, 0, episode, GO_ON) for episode in range(3)]
    assert all(plant.parameters == task.parameters for plant, task, _ in prepared)
    assert len({task.parameters for _, task, _ in prepared}) == 3


def test_what_is_no_policy_is_refused(tmp_path):
    for act in (
        play,
        partial(save_policy, tmp_path / "a"),
        partial(export_policy, tmp_path / "a.h"),
    ):
        with pytest.raises(
            UprightError, match=r"policy is 'policy\.npz'; it must be what learn or"
        ):
            act("policy.npz")
    assert not list(tmp_path.iterdir())


def test_a_policy_plays_its_own_task_except_for_changes():
    names = {"noise": "sensor-5", "start": "zero", "condition": "delay-1"}
    plant, parameters = EquationsSettings("rk4"), {"half_length": 0.7}
    case = make_case("random-search", plant=plant, parameters=parameters, **names)
    policy = learned_policy(case, 0, 0, case.settings.agent(None))
    assert case_for(policy) == case
    changed = case_for(policy, noise="none", steps=7)
    assert changed.spec == replace(case.spec, noise="none", steps=7)
    assert changed.plant == plant
    assert case_for(policy, plant=Mujoco()).plant == Mujoco()
    with pytest.raises(UprightError, match="'loud'"):
        case_for(policy, noise="loud")


# ------------------------------------------------------------------------------ what is recorded


def test_a_recording_has_what_happened_and_what_the_agent_saw():
    agent, plant = LinearAgent(*GOOD_WEIGHTS), RecordingPlant()
    task = make_task(noise="all-10", steps=50, condition="delay-1")._replace(trials=1)
    task = task._replace(noise=task.noise._replace(actuator=0.1))
    moments, played = record(agent, plant, task, np.random.default_rng(0))
    assert played == TrialOutcome(50, True)
    assert [moment.state for moment in moments] == [*plant.starts, *plant.states[0]]
    assert [moment.force for moment in moments] == [0.0, *plant.forces[0]]
    (moves,) = agent.moves
    assert [moment.measured for moment in moments] == [moves[0][0], *[move[2] for move in moves]]
    assert all(moment.measured != moment.state for moment in moments)
    assert agent.ends == [False]


def test_a_fall_at_the_last_step_is_no_success():
    task = make_task(steps=3)
    for fall, played in (
        (3, TrialOutcome(3, False)),
        (4, TrialOutcome(3, True)),
        (1, TrialOutcome(1, False)),
    ):
        agent, rng = LinearAgent(*GOOD_WEIGHTS), np.random.default_rng(0)
        assert record(agent, ScriptedPlant(fall), task, rng)[1] == played


def test_pictures_show_every_step_of_the_trials_that_play_plays(learned, monkeypatch):
    scenes, told = [], []

    def draw(parameters, scene, size):
        scenes.append(scene)
        assert scene.measured.theta != scene.state.theta or scene.state.theta == 0
        return len(scenes)

    monkeypatch.setattr("upright.studies.playing.picture", draw)
    policy = learned["random-search"]
    case = case_for(policy, noise="gaussian-0.2", start="wide", steps=100)
    shown = list(pictures(policy, case, 4, 5, told.append))
    assert told == list(play_trials(policy, case, 4, 5))
    assert not all(played.balanced for played in told)
    assert len(shown) == sum(played.steps + 1 + PAUSE for played in told)
    assert len(scenes) == sum(played.steps + 1 for played in told)
    assert (scenes[0].caption, scenes[0].detail) == ("random-search · trial 1", "step 0 · 0.0 s")
    falls = [scene for scene in scenes if scene.ending == "fallen"]
    assert len(falls) == sum(not played.balanced for played in told)
    assert scenes[-1].last_fall == falls[2].state
    assert scenes[0].last_fall is None
    assert shown[: told[0].steps + 1] == list(range(1, told[0].steps + 2))
    assert set(shown[-PAUSE - 1 :]) == {len(scenes)}


# ---------------------------------------------------------------------------------------- watch


def guess():
    case = make_case("random-search", noise="gaussian-0.2", steps=200)
    return learned_policy(case, 0, 0, case.settings.agent(None)), case


def test_watching_prints_every_trial_and_a_summary(learned, capsys):
    policy, case = guess()
    played = watch_play(policy, case, 3, 0)
    lines = capsys.readouterr().out.splitlines()
    assert [int(line.split()[2]) for line in lines[1:4]] == [trial.steps for trial in played]
    steps = sorted(trial.steps for trial in played)
    assert lines[4] == (
        f"balanced in 0 of 3 trials; steps: mean {sum(steps) / 3:.1f}, median {steps[1]}, "
        f"shortest {steps[0]}"
    )


def test_a_video_has_a_picture_of_every_step(tmp_path, capsys):
    policy, case = guess()
    played = watch_play(policy, case, 2, 0, str(tmp_path / "film.gif"))
    with Image.open(tmp_path / "film.gif") as film:
        assert film.size == (WIDTH, HEIGHT)
        shown = 0
        for i in range(film.n_frames):  # equal pictures are one that lasts longer
            film.seek(i)
            shown += film.info["duration"] / 20
    assert shown == sum(trial.steps + 1 + PAUSE for trial in played)
    assert "balanced in 0 of 2 trials" in capsys.readouterr().out


@pytest.fixture
def _display(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame.display.quit()
    yield
    pygame.quit()


@pytest.mark.usefixtures("_display")
def test_a_window_shows_the_trials_and_may_be_closed(capsys, monkeypatch):
    policy, case = guess()
    played = watch_play(policy, case, 1, 0, window=True)
    assert len(played) == 1
    assert "balanced in 0 of 1 trial;" in capsys.readouterr().out

    pygame.event.clear()
    monkeypatch.setattr("upright.studies.stage.picture", press_q)
    assert watch_play(policy, case, 1, 0, window=True) == []
    assert capsys.readouterr().out == "no trial was played to its end\n"
    assert State(*policy.memory.weights) == State(0, 0, 0, 0)


def press_q(parameters, scene, size):
    if scene.detail.startswith("step"):
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_q))
    return np.zeros((size.height, size.width, 3), np.uint8)


@pytest.mark.usefixtures("_display")
def test_a_window_and_a_video_show_the_same_trials(tmp_path, capsys):
    policy, case = guess()
    played = watch_play(policy, case, 1, 0, str(tmp_path / "film.mp4"), window=True)
    assert len(played) == 1
    assert (tmp_path / "film.mp4").stat().st_size > 1000
    assert capsys.readouterr().out.count("trial ") == 1
