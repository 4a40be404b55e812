"""The options --task and --save-task, and names that are given to the wrong option."""

import json
import re
from pathlib import Path

import pytest

from upright.commands import make_parser, parse, run
from upright.commands.options import case_of, noises_of, plant_of, task_of, tasks_of
from upright.core.conditions import PUBLISHED_NOISES, STEPS
from upright.core.task import TaskSpec
from upright.errors import UprightError
from upright.plants.equations import EquationsSettings
from upright.plants.mujoco import Mujoco
from upright.studies.task_file import read_task
from upright.support.exit_status import BAD_USE, FAILED

TEXT = """\
noise = "gaussian-0.1"
condition = "delay-1"
steps = 300
[parameters]
half_length = 0.3
force = 12.0
[plant]
name = "mujoco"
integrator = "euler"
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder with a file of a task."""
    monkeypatch.chdir(tmp_path)
    Path("my-cart.toml").write_text(TEXT)
    return tmp_path


def parsed(line):
    return parse(make_parser([line.split()[0]]), line.split())


def test_a_file_gives_the_task_and_the_plant():
    options = parsed("learn random-search --task my-cart.toml")
    case = case_of(options, plant=plant_of(options))
    parameters = {"half_length": 0.3, "force": 12.0}
    assert case.spec == TaskSpec("gaussian-0.1", "random", "delay-1", 300, parameters=parameters)
    assert case.plant == Mujoco(integrator="euler")


@pytest.mark.parametrize("order", ["{file} {more}", "{more} {file}"])
def test_options_override_a_file_in_any_order_even_with_their_usual_values(order):
    more = "--noise none --condition nominal --trials 7 --steps 60000 --parameter force=9"
    line = order.format(file="--task my-cart.toml", more=f"{more} --plant-set integrator=rk4")
    options = parsed(f"learn random-search {line}")
    wanted = TaskSpec(trials=7, parameters={"half_length": 0.3, "force": 9.0})
    assert TaskSpec.from_data(task_of(options)) == wanted
    assert plant_of(options) == Mujoco(integrator="rk4")


def test_another_plant_has_its_own_settings():
    options = parsed("learn random-search --task my-cart.toml --plant equations")
    assert plant_of(options) == EquationsSettings()
    options = parsed("learn random-search --task my-cart.toml --plant mujoco")
    assert plant_of(options) == Mujoco(integrator="euler")


def test_without_a_file_nothing_changes():
    options = parsed("learn random-search")
    assert TaskSpec.from_data(task_of(options)) == TaskSpec()
    assert plant_of(options) == EquationsSettings()
    assert noises_of(parsed("table")) == list(PUBLISHED_NOISES)


@pytest.mark.parametrize("command", ["table", "tune random-search", "matlab table"])
def test_the_noise_of_a_file_is_alone_unless_noises_are_given(command):
    line = f"{command} --task my-cart.toml"
    assert noises_of(parsed(line)) == ["gaussian-0.1"]
    assert noises_of(parsed(f"{line} --noises none,sensor-5")) == ["none", "sensor-5"]
    assert noises_of(parsed(f"{line} --noises all")) == list(PUBLISHED_NOISES)
    Path("my-cart.toml").write_text("steps = 300")
    assert noises_of(parsed(line)) == noises_of(parsed(command))


def test_a_sweep_of_parameters_keeps_the_others_of_the_file():
    tasks = tasks_of(parsed("table --task my-cart.toml --parameter force=9,10"))
    assert [task["parameters"] for task in tasks] == [
        {"half_length": 0.3, "force": 9.0},
        {"half_length": 0.3, "force": 10.0},
    ]
    assert {task["steps"] for task in tasks} == {300}
    (alone,) = tasks_of(parsed("table --task my-cart.toml"))
    assert alone["parameters"] == {"half_length": 0.3, "force": 12.0}


def test_a_policy_is_played_as_it_was_trained_except_for_what_the_file_says():
    Path("my-cart.toml").write_text("start = 'wide'")
    assert task_of(parsed("play policy.npz --task my-cart.toml")) == {"start": "wide"}
    options = parsed("play policy.npz --task my-cart.toml --start zero --steps 5")
    assert task_of(options) == {"start": "zero", "steps": 5}


@pytest.mark.parametrize("command", ["learn random-search", "table", "tune random-search"])
def test_a_wrong_file_is_refused_in_one_line(command, capsys):
    Path("my-cart.toml").write_text("[parameters]\nhalf_length = -1\n")
    assert run([*command.split(), "--task", "my-cart.toml"]) == BAD_USE
    where = "task file is 'my-cart.toml'; line 2, parameters.half_length: half_length is -1; it"
    assert capsys.readouterr().err.startswith(
        f"upright: error: {where} must be a number, at least 1e-12"
    )


def test_commands_go_on_with_a_task_that_is_saved_and_played(capsys):
    Path("equations.toml").write_text(TEXT.partition("[plant]")[0])
    learn = "learn random-search --quiet --task equations.toml --start zero --noise none"
    learn += " --save policy.npz --save-task saved.toml"
    assert run(learn.split()) == 0
    shown = capsys.readouterr()
    assert shown.err == "task: saved.toml\n"
    assert "balanced at trial" in shown.out
    saved = read_task("saved.toml")
    assert (saved["start"], saved["noise"], saved["steps"]) == ("zero", "none", 300)
    play = "play policy.npz --episodes 1 --save-task b.toml"
    assert run([*play.split(), "--task", "equations.toml"]) in (0, FAILED)
    played = read_task("b.toml")
    assert (played["start"], played["noise"], played["steps"]) == ("zero", "gaussian-0.1", 300)
    assert played["parameters"]["half_length"] == 0.3
    assert run([*play.split(), "--parameter", "force=9"]) in (0, FAILED)
    assert read_task("b.toml")["steps"] == STEPS
    assert read_task("b.toml")["parameters"]["force"] == 9.0


def test_what_goes_on_learning_has_the_plant_of_the_file():
    Path("rk4.toml").write_text("steps = 50\n[plant]\nintegrator = 'rk4'")
    learn = "learn {} --quiet --trials 2 --steps 50 --save-task b.toml"
    assert run([*learn.format("random-search").split(), "--save", "a.npz"]) in (0, FAILED)
    line = learn.format("--from a.npz --task rk4.toml").split()
    assert run(line) in (0, FAILED)
    assert read_task("b.toml")["plant"] == EquationsSettings("rk4")
    assert run([*line, "--plant-set", "integrator=euler"]) in (0, FAILED)
    assert read_task("b.toml")["plant"] == EquationsSettings()


def test_a_table_of_a_saved_task_is_the_same(capsys):
    line = "table --agents random-search --runs 2 --format json --steps 50 --trials 3"
    options = "--noises sensor-5 --parameter half_length=0.3 --plant-set integrator=rk4"
    assert run([*line.split(), *options.split(), "--save-task", "saved.toml"]) == 0
    first = json.loads(capsys.readouterr().out)
    line = "table --agents random-search --runs 2 --format json --task saved.toml"
    assert run(line.split()) == 0
    second = json.loads(capsys.readouterr().out)
    assert [row["noise"] for row in second] == ["sensor-5"]
    timed = ("seconds", "mean_seconds")
    assert [{k: v for k, v in row.items() if k not in timed} for row in first] == [
        {k: v for k, v in row.items() if k not in timed} for row in second
    ]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("table --runs 1 --save-task a.toml", "a file holds one task, and these options ask for 7"),
        ("table --noises none --parameter force=9,10 --save-task a.toml", "ask for 2"),
        ("learn random-search --save-task a.txt", "the ending of 'a.txt' is '.txt'; it must be"),
        ("learn random-search --save-task x/a.toml", "its folder does not exist"),
        ("learn random-search --task a.toml", "task file is 'a.toml'; no such file"),
        ("learn random-search --task .toml", "its ending is ''; it must be one of .toml"),
    ],
)
def test_what_cannot_be_saved_or_read_is_refused_before_anything_runs(line, said, capsys):
    assert run(line.split()) == BAD_USE
    shown = capsys.readouterr()
    assert said in shown.err
    assert shown.err.count("\n") == 1
    assert shown.out == ""
    assert [path.name for path in Path().iterdir()] == ["my-cart.toml"]


def test_a_matlab_table_takes_a_file_that_the_twin_can_run(capsys):
    assert run(["matlab", "table", "--task", "my-cart.toml"]) == BAD_USE
    assert "plant of the MATLAB twin is 'mujoco'" in capsys.readouterr().err


@pytest.mark.slow
def test_settings_are_tuned_for_the_task_and_plant_of_a_file(capsys):
    Path("my-cart.toml").write_text(TEXT.replace("mujoco", "equations").replace("euler", "rk4"))
    line = "tune random-search --task my-cart.toml --runs 1 --candidates 1 --validation-runs 1"
    assert run([*line.split(), "--output", "tuned.toml"]) == 0
    shown = capsys.readouterr().out
    assert "--parameter force=12.0 --plant-set integrator=rk4\n" in shown
    assert 'plant_settings = ["integrator=rk4"]' in Path("tuned.toml").read_text()


# ------------------------------------------------------------------------------ the wrong option


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            "learn q-learning --plant-set half-length=0.3",
            "--plant-set is 'half-length=0.3'; half_length is a parameter of the plant: "
            "--parameter half_length=0.3",
        ),
        (
            "learn q-learning --parameter integrator=rk4",
            "integrator is a setting of the plant equations: --plant-set integrator=rk4",
        ),
        (
            "learn q-learning --plant-set engine=ode",
            "engine is a setting of the plant gazebo: --plant gazebo --plant-set engine=ode",
        ),
        (
            "learn q-learning --plant-set discount=0.9",
            "discount is a setting of the agent q-learning: --set discount=0.9",
        ),
        ("learn q-learning --set half_length=0.3", "plant: --parameter half_length=0.3"),
        ("learn q-learning --set steps=100", "steps is a part of the task: --steps 100"),
        ("table --set noise=none", "--set is 'noise=none'; it must name one of the agents"),
        ("table --set half_length=0.3", "plant: --parameter half_length=0.3"),
        ("table --set q-learning.force=3", "plant: --parameter force=3"),
        (
            "table --agents random-search,ndp --plant-set discount=0.9,1",
            "a setting of the agent ndp: --set ndp.discount=0.9,1",
        ),
        ("play policy.npz --plant-set half_length=1", "plant: --parameter half_length=1"),
        ("robust --parameter integrator=rk4", "parameter is 'integrator'; it must be one of"),
        ("leaderboard --parameter steps=3", "steps is a part of the task: --steps 3"),
        ("learn q-learning --plant-set speed=1", "setting is 'speed'; it must be one of integr"),
    ],
)
def test_a_name_that_belongs_to_another_option_is_answered_with_it(line, said, capsys):
    if line.startswith("play"):
        with pytest.raises(UprightError, match=re.escape(said)):
            plant_of(parsed(line))
        return
    assert run(line.split()) == BAD_USE
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
