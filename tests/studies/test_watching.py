import math
import os
import signal
import subprocess
import threading
import time

import imageio_ffmpeg
import numpy as np
import pygame
import pytest
from helpers import COMMAND, ROOT

from upright.core.parameters import State
from upright.errors import AgentError, Stopped, UprightError
from upright.pictures.size import SIZE, Size
from upright.plants.mujoco import Mujoco
from upright.plants.ros2.plant import Ros2
from upright.studies import filming, stage
from upright.studies.case import make_case
from upright.studies.filming import Film, film_run
from upright.studies.observing import Moment
from upright.studies.pace import SPEEDS, Pace
from upright.studies.run import make_run
from upright.studies.watching import GOES_ON, watch_run

AGENTS = {
    "built-in": "q-learning",
    "compiled": "examples.compiled_agent:hill_climber",
    "plain": "examples.plain_agent:PlainAgent",
    "learner": "helpers:GuessingLearner",
}
"""An agent of every kind."""


@pytest.fixture
def _display(monkeypatch):
    """The display that SDL has for tests, and a window that does not stay for long."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr(stage, "LINGER", 0.05)
    pygame.display.quit()
    yield
    pygame.quit()


def case_of(kind, **task):
    return make_case(AGENTS[kind], **{"steps": 200, "trials": 60, "noise": "sensor-10"} | task)


def press(*keys):
    for key in keys:
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key))


# ------------------------------------------------------------------------------------- observing


@pytest.mark.parametrize("kind", AGENTS)
def test_an_observed_run_has_the_same_trials_and_every_step_is_told(kind):
    case = case_of(kind)
    agent, alone = make_run(case, 3, 1)
    moments = []
    observed_agent, observed = make_run(case, 3, 1, observer=moments.append)
    np.testing.assert_array_equal(observed.lengths, alone.lengths)
    assert observed.success == alone.success
    assert type(observed_agent) is type(agent)
    steps = [
        (trial + 1, n) for trial, length in enumerate(alone.lengths) for n in range(length + 1)
    ]
    assert [(moment.trial, moment.step) for moment in moments] == steps
    endings = [moment.ending for moment in moments if moment.ending]
    last = "balanced" if alone.success else "fallen"
    assert endings == ["fallen"] * (alone.trials - 1) + [last]
    falls = [moment.state for moment in moments if moment.ending == "fallen"]
    starts = [moment for moment in moments if moment.step == 0]
    assert [start.last_fall for start in starts] == [None, *falls][: alone.trials]
    assert all(start.force == 0 for start in starts)
    assert {abs(moment.force) for moment in moments if moment.step} == {10.0}
    assert any(moment.measured != moment.state for moment in moments)


@pytest.mark.parametrize("kind", ["plain", "learner"])
def test_pictures_are_of_the_plant_as_it_is_at_each_moment(kind):
    condition = "each-episode.half_length=0.3:0.9,at-5.force=-8"
    moments, film = [], Film()
    case = case_of(kind, condition=condition, trials=3, steps=10_000)
    make_run(case, 3, 1, observer=lambda moment: (moments.append(moment), film(moment)))
    lengths = {m.trial: m.task.parameters.half_length for m in moments}
    assert len(set(lengths.values())) == 3
    assert {0.3 < length < 0.9 for length in lengths.values()} == {True}
    assert [m.task.parameters.force for m in moments[:7]] == [10.0] * 5 + [-8.0] * 2
    assert {shot.parameters.half_length for shot in film.shots("a")} == set(lengths.values())


def test_memory_is_the_same_to_the_last_bit_after_an_observed_run():
    case = make_case("reinforce", steps=500, trials=20)
    (alone, _), (observed, _) = make_run(case, 0, 0), make_run(case, 0, 0, observer=lambda _: None)
    for ours, theirs in zip(alone.network, observed.network, strict=True):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("kind", AGENTS)
def test_an_observed_run_stops_within_a_step(kind):
    stop, seen = np.zeros(1, np.bool_), []

    def observe(moment):
        seen.append(moment)
        stop[0] = len(seen) == 7

    _, result = make_run(case_of(kind), 0, 0, stop=stop, observer=observe)
    assert result is None
    assert len(seen) == 7


def test_other_plants_can_be_observed_unless_they_move_by_themselves(tmp_path):
    case = case_of("built-in", plant=Mujoco())
    moments = []
    _, observed = make_run(case, 0, 0, observer=moments.append)
    np.testing.assert_array_equal(observed.lengths, make_run(case, 0, 0)[1].lengths)
    assert len(moments) == observed.lengths.sum() + observed.trials
    alone = case_of("built-in", plant=Ros2())
    for pictures in ({"window": True}, {"video": str(tmp_path / "film.mp4")}):
        with pytest.raises(UprightError, match="'ros2'; it moves in real time"):
            watch_run(alone, 0, 0, **pictures)


# ------------------------------------------------------------------------------------------ pace


def test_keys_change_the_speed_step_by_step():
    pace = Pace(np.zeros(1, np.bool_))
    seen = [pace.speed]
    for _ in range(2 * len(SPEEDS)):
        pace.obey("faster")
        seen.append(pace.speed)
    assert seen[:4] == [1, 2, 5, 10]
    assert seen[-1] == math.inf
    assert str(pace) == "as fast as possible"
    for _ in range(2 * len(SPEEDS)):
        pace.obey("slower")
    assert (pace.speed, str(pace)) == (0.1, "0.1× real time")
    pace.obey("pause")
    assert str(pace) == "paused"
    pace.obey("pause")
    assert str(pace) == "0.1× real time"


def paced(speed, steps, seconds=0.02):
    """Return how long simulated steps take at a speed [s]."""
    pace = Pace(np.zeros(1, np.bool_))
    pace.speed = speed
    began = time.perf_counter()
    for _ in range(steps):
        pace.wait(seconds)
    return time.perf_counter() - began


def test_a_run_keeps_to_its_pace():
    assert 0.18 < paced(1.0, 10) < 5
    assert 0.09 < paced(100.0, 500) < 5
    assert paced(math.inf, 10_000) < 1


def test_a_run_that_was_held_up_does_not_catch_up():
    pace = Pace(np.zeros(1, np.bool_))
    pace.wait(0.0)
    time.sleep(0.6)
    began = time.perf_counter()
    for _ in range(20):
        pace.wait(0.02)
    assert time.perf_counter() - began > 0.1


def test_a_paused_run_waits_makes_single_steps_and_can_be_stopped():
    stop = np.zeros(1, np.bool_)
    pace, made, ended = Pace(stop), [], []

    def work():
        try:
            while True:
                pace.wait(0.0)
                made.append(1)
        except Stopped:
            ended.append(1)

    pace.obey("step")  # nothing, as it is not paused
    pace.obey("pause")
    thread = threading.Thread(target=work)
    thread.start()
    for expected in (0, 1, 2):
        time.sleep(0.1)
        assert len(made) == expected
        pace.obey("step")
    stop[0] = True
    thread.join(5)
    assert ended


# ---------------------------------------------------------------------------------------- window


@pytest.mark.usefixtures("_display")
@pytest.mark.parametrize("kind", AGENTS)
def test_a_run_in_a_window_has_the_same_trials(kind, capsys, monkeypatch):
    monkeypatch.setattr(stage.Pace, "__init__", fast(stage.Pace.__init__))
    scenes = []
    draw = stage.picture
    monkeypatch.setattr(stage, "picture", lambda *given: (scenes.append(given[1]), draw(*given))[1])
    case = case_of(kind)
    _, seen = watch_run(case, 3, 1, window=True)
    shown = capsys.readouterr().out
    _, alone = watch_run(case, 3, 1)
    np.testing.assert_array_equal(seen.lengths, alone.lengths)
    assert shown.splitlines()[:-1] == capsys.readouterr().out.splitlines()[:-1]
    last = scenes[-1]
    assert last.caption == f"{AGENTS[kind]} · trial {alone.trials}"
    assert last.ending == ("balanced" if alone.success else "fallen")
    np.testing.assert_array_equal(last.history.lengths, alone.lengths[:-1])
    assert last.note == "as fast as possible"
    assert "+ faster" in last.hint


def fast(make):
    def make_fast(pace, stop):
        make(pace, stop)
        pace.speed = math.inf

    return make_fast


@pytest.mark.usefixtures("_display")
def test_a_run_goes_on_when_its_window_is_closed(capsys, monkeypatch):
    draw = stage.picture

    def draw_and_close(parameters, scene, size):
        if scene.detail.startswith("step"):
            press(pygame.K_SPACE, pygame.K_q)
        return draw(parameters, scene, size)

    monkeypatch.setattr(stage, "picture", draw_and_close)
    case = case_of("plain", steps=2000)
    _, seen = watch_run(case, 0, 0, window=True)
    np.testing.assert_array_equal(seen.lengths, make_run(case, 0, 0)[1].lengths)
    assert capsys.readouterr().out.count(GOES_ON) == 1


@pytest.mark.usefixtures("_display")
def test_keys_in_the_window_set_the_pace(capsys, monkeypatch):
    notes, draw = [], stage.picture

    def draw_and_press(parameters, scene, size):
        notes.append(scene.note)
        if scene.note == "1× real time":
            press(pygame.K_UP)
        elif scene.note == "2× real time":
            press(pygame.K_SPACE)
        elif scene.note == "paused":
            press(pygame.K_SPACE, *[pygame.K_UP] * len(SPEEDS))
        return draw(parameters, scene, size)

    monkeypatch.setattr(stage, "picture", draw_and_press)
    watch_run(case_of("plain", trials=5), 0, 0, window=True)
    changes = [note for note, before in zip(notes, ["", *notes], strict=False) if note != before]
    assert changes == ["1× real time", "2× real time", "paused", "as fast as possible"]


@pytest.mark.usefixtures("_display")
def test_an_error_in_a_watched_agent_is_raised(monkeypatch):
    def fails(*_):
        raise ZeroDivisionError

    monkeypatch.setattr("examples.plain_agent.PlainAgent.learn", fails)
    with pytest.raises(AgentError, match="ZeroDivisionError"):
        watch_run(case_of("plain"), 0, 0, window=True)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["built-in", "plain"])
def test_an_interrupt_stops_a_watched_run_within_a_step(kind, tmp_path):
    paths = os.pathsep.join([str(ROOT), str(ROOT / "src")])
    process = subprocess.Popen(
        [*COMMAND, "learn", AGENTS[kind], "--steps", "60000", "--window", "--video", "film.mp4"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"SDL_VIDEODRIVER": "dummy", "PYTHONPATH": paths},
    )
    assert "logarithmic scale" in process.stdout.readline()
    assert process.stdout.readline().startswith("trial    1 ")
    process.send_signal(signal.SIGINT)
    began = time.monotonic()
    _, error = process.communicate(timeout=60)
    assert time.monotonic() - began < 20
    assert process.returncode == 130
    assert error == "upright: stopped\n"
    assert list(tmp_path.iterdir()) == []


# ----------------------------------------------------------------------------------------- video


def about(path):
    """Return the number of pictures in a video, and FFmpeg's words about it."""
    reader = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", path, "-f", "null", "-"]
    said = subprocess.run(reader, capture_output=True, text=True).stderr
    return int(said.rpartition("frame=")[2].split()[0]), said


@pytest.mark.parametrize("kind", AGENTS)
def test_a_filmed_run_has_the_same_trials(kind, tmp_path, capsys):
    case = case_of(kind, trials=4, steps=50)
    path = tmp_path / "film.mp4"
    _, filmed = watch_run(case, 3, 1, video=str(path), size=Size(320, 176))
    np.testing.assert_array_equal(filmed.lengths, make_run(case, 3, 1)[1].lengths)
    pictures, said = about(path)
    assert "320x176" in said
    shown = capsys.readouterr().out
    assert shown.endswith(f"video: {path}\n")
    assert shown.count("\ntrial ") == filmed.trials
    holds = 25 * filmed.trials + 50
    assert pictures == filmed.lengths.sum() + filmed.trials + holds


def filmed(lengths, steps=1000, time_step=0.02):
    """Return the scenes of a film of trials that last so long, without any physics."""
    task = make_case("q-learning", steps=steps, parameters={"time_step": time_step}).spec.task()
    lengths, film = np.array(lengths, np.int64), Film()
    place = State(0.0, 0.0, 0.0, 0.0)
    for number, length in enumerate(lengths.tolist(), 1):
        for step in range(length + 1):
            ending = "" if step < length else "balanced" if length == steps else "fallen"
            film(Moment(task, lengths, number, step, place, place, 0.0, ending, None))
    shots = [(shot.scene, shot.lasts) for shot in film.shots("somebody")]
    return shots, filming.picture_time(task)


@pytest.mark.parametrize(
    ("lengths", "steps", "time_step"),
    [
        ([10], 10, 0.02),
        ([5000] * 3, 60_000, 0.02),
        ([5000] * 8 + [30_000], 30_000, 0.02),
        ([20] * 3000, 60_000, 0.02),
        ([300] * 200 + [9000], 9000, 0.02),
        ([700] * 30, 60_000, 0.1),
        ([3000] * 30, 60_000, 0.003),
    ],
)
def test_a_film_is_bounded_and_shows_the_first_and_the_last(lengths, steps, time_step):
    scenes, picture_time = filmed(lengths, steps, time_step)
    assert sum(count for _, count in scenes) * picture_time < 60
    assert scenes[0][0].caption == "somebody · trial 1"
    assert scenes[0][0].detail.startswith("step 0 ")
    last = scenes[-1][0]
    assert last.caption == f"somebody · trial {len(lengths):,}"
    assert last.detail.startswith(f"step {lengths[-1]:,} ")
    assert last.ending == ("balanced" if lengths[-1] == steps else "fallen")
    numbers = [int(scene.caption.split()[-1].replace(",", "")) for scene, _ in scenes]
    assert numbers == sorted(numbers)
    shown = [(number, scene.detail) for number, (scene, _) in zip(numbers, scenes, strict=True)]
    assert len(set(shown)) >= len(shown) - min(len(lengths), 4) - 1  # only ends are repeated


def test_a_film_says_where_it_is_shortened():
    scenes, _ = filmed([20, 30, 40, *[25] * 600, 60_000], 60_000)
    notes = dict.fromkeys(scene.note for scene, _ in scenes)
    assert list(notes) == ["", "fast forward: trials 4 to 603", "fast forward: 20 minutes"]
    glimpses = [scene for scene, _ in scenes if "trials" in scene.note]
    assert all(scene.ending == "fallen" for scene in glimpses)
    assert 250 <= len(glimpses) <= 500


def test_film_run_makes_the_run_and_the_video(tmp_path):
    case = case_of("plain", trials=3)
    path = tmp_path / "film.gif"
    agent, result = film_run(path, case, 3, 1, size=Size(320, 176))
    assert type(agent).__name__ == "PlainAgent"
    np.testing.assert_array_equal(result.lengths, make_run(case, 3, 1)[1].lengths)
    assert path.read_bytes().startswith(b"GIF89a")
    with pytest.raises(UprightError, match=r"'\.avi'"):
        film_run(tmp_path / "film.avi", case)


def test_a_stopped_film_is_not_written(tmp_path):
    case, stop = case_of("plain", trials=3), np.ones(1, np.bool_)
    assert film_run(tmp_path / "film.mp4", case, stop=stop)[1] is None
    film = Film()
    make_run(case, 0, 0, observer=film)
    with pytest.raises(Stopped):
        film.write(tmp_path / "film.mp4", "somebody", SIZE, stop=stop)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("_display")
def test_a_window_and_a_video_at_once(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(stage.Pace, "__init__", fast(stage.Pace.__init__))
    case, path = case_of("built-in", trials=3, steps=30), tmp_path / "film.mp4"
    _, result = watch_run(case, 0, 0, window=True, video=str(path), quiet=True)
    assert about(path)[0] > result.lengths.sum()
    assert capsys.readouterr().out.count("\n") == 2
