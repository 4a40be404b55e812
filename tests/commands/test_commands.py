import json
import os
import re
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import pytest
from helpers import COMMAND, GOOD_WEIGHTS, POOR_WEIGHTS

from upright.commands import run
from upright.policies.files import save_policy
from upright.studies.case import make_case
from upright.studies.learned import learned_policy
from upright.support.exit_status import BAD_USE, FAILED, INTERRUPTED

QUICK = ["--steps", "300", "--agents", "random-search"]


def files_below(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def keep_policy(path: Path, weights: Sequence[float]) -> None:
    """Write a linear policy to a file."""
    case = make_case("random-search", start="wide")
    memory = case.settings.agent(None)
    memory.weights[:] = weights
    save_policy(path, learned_policy(case, 0, 0, memory))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working folder with a policy that falls and files that are not stores. No display."""
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    keep_policy(tmp_path / "poor.npz", POOR_WEIGHTS)
    (tmp_path / "text").write_text("not a database")
    with sqlite3.connect(tmp_path / "foreign") as database:
        database.execute("CREATE TABLE recipes (name)")
    database.close()
    return tmp_path


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("learn nobody", ["'nobody'", "reinforce", "q-learning", "random-search"]),
        ("learn", ["AGENT is missing", "--from POLICY"]),
        ("learn reinforce --noise loud", ["'loud'", "none", "gaussian-0.2", "all-10"]),
        ("learn reinforce --steps 0", ["steps is 0", "at least 1"]),
        ("learn reinforce --trials -1", ["trials is -1", "at least 1"]),
        ("learn reinforce --start up", ["'up'", "random", "zero"]),
        ("learn reinforce --plant-set integrator=magic", ["'magic'", "euler", "rk4"]),
        ("learn reinforce --settings mine", ["'mine'", "default", "as-published"]),
        ("learn reinforce --seed -1", ["seed is -1", "at least 0"]),
        ("learn reinforce --run -1", ["run is -1", "at least 0"]),
        ("learn reinforce --set learning_rate=nan", ["learning_rate is nan"]),
        ("learn reinforce --set learning_rate=inf", ["learning_rate is inf"]),
        ("learn reinforce --set learning_rate=fast", ["learning_rate is 'fast'"]),
        ("learn reinforce --set episodes=1.5", ["episodes is '1.5'"]),
        ("learn reinforce --set tempo=3", ["'tempo'", "learning_rate", "discount"]),
        ("learn reinforce --set discount", ["'discount'", "NAME=VALUE"]),
        ("learn q-learning --set learning_rate=2", ["learning_rate is 2", "at most 1"]),
        ("learn q-learning --set theta_edges=(3,1)", ["theta_edges", "ascend"]),
        ("learn q-learning --set x_edges=(1,2)", ["x_edges", "alike in ±"]),
        ("learn random-search --save missing/policy.npz", ["missing/policy.npz", "folder"]),
        ("learn random-search --plot curve.doc", [".doc", ".png"]),
        ("play absent.npz", ["'absent.npz'", "no such file"]),
        ("play text", ["'text'", "not a policy's file"]),
        ("play poor.npz --noise loud", ["'loud'", "none", "gaussian-0.2", "all-10"]),
        ("play poor.npz --start up", ["'up'", "random", "zero", "wide"]),
        ("play poor.npz --plant-set integrator=magic", ["'magic'", "euler", "rk4"]),
        ("play poor.npz --condition odd", ["'odd'", "nominal", "delay-2"]),
        ("play poor.npz --episodes 0", ["episodes is 0", "at least 1"]),
        ("play poor.npz --steps 0", ["steps is 0", "at least 1"]),
        ("play poor.npz --seed -1", ["seed is -1", "at least 0"]),
        ("play poor.npz --video film.avi", ["'.avi'", ".mp4", ".gif"]),
        ("play poor.npz --video missing/film.mp4", ["missing/film.mp4", "folder"]),
        ("play poor.npz --video .mp4", ["''", ".mp4", ".gif"]),
        ("play poor.npz --window", ["no display", "video"]),
        ("play poor.npz --video film.mp4 --size 641", ["'641'", "even", "1280x720"]),
        ("play poor.npz --size 1280", ["'1280'", "--window", "--video"]),
        ("learn q-learning --window", ["no display", "video"]),
        ("learn q-learning --video film.avi", ["'.avi'", ".mp4", ".gif"]),
        ("learn q-learning --video film.mp4 --size big", ["'big'", "WIDTHxHEIGHT"]),
        ("learn q-learning --size 1280", ["'1280'", "--window", "--video"]),
        ("learn q-learning --plant ros2 --video film.mp4", ["'ros2'", "real time"]),
        ("table --runs -3", ["runs is -3", "at least 1"]),
        ("table --runs many", ["'many'"]),
        ("table --agents reinforce,nobody", ["'nobody'", "reinforce"]),
        ("table --noises none,loud", ["'loud'", "none"]),
        ("table --format xml", ["'xml'", "text", "latex"]),
        ("table --output missing/table.txt", ["missing/table.txt", "folder"]),
        ("table --output .", ["'.'", "folder"]),
        ("table --store missing/runs.sqlite", ["missing/runs.sqlite", "folder"]),
        ("table --store text", ["'text'", "not a database"]),
        ("table --store foreign", ["'foreign'", "another program"]),
        ("table --store .", ["'.'"]),
        ("show absent", ["'absent'", "no such file"]),
        ("show text", ["'text'", "not a database"]),
        ("reproduce --output text", ["'text'", "folder"]),
        ("reproduce --output new --runs 0", ["runs is 0"]),
        ("reproduce --output new --steps 0", ["steps is 0"]),
        ("plot policy absent.npz", ["'absent.npz'", "no such file"]),
        ("plot policy text", ["'text'", "not a policy's file"]),
        ("plot curves foreign", ["'foreign'", "another program"]),
        ("plot trials text --output trials.doc", [".doc", ".svg"]),
        ("export absent.npz policy.h", ["'absent.npz'", "no such file"]),
        ("export text policy.doc", [".doc", ".h", ".onnx"]),
        ("export text policy.h", ["'text'", "not a policy's file"]),
        ("plot shapes text", ["'shapes'", "curves"]),
        ("dance", ["'dance'", "learn"]),
        ("ros2", ["COMMAND", "see upright ros2 --help"]),
    ],
)
def test_bad_usage_prints_one_clear_line_and_changes_nothing(line, said, folder, capsys):
    before = files_below(folder)
    try:
        status = run(line.split())
    except SystemExit as refusal:  # raised by argparse
        status = refusal.code
    error = capsys.readouterr().err
    assert status == BAD_USE
    assert error.count("\n") == 1
    for words in said:
        assert words in error
    assert files_below(folder) == before


def test_learn_shows_every_trial_and_how_it_ended(capsys):
    line = "learn random-search --steps 300 --seed 1"
    assert run(line.split()) == 0
    shown = capsys.readouterr().out.splitlines()
    lengths = [int(text.split()[2].replace(",", "")) for text in shown if text.startswith("trial")]
    assert lengths[-1] == 300
    assert max(lengths[:-1]) < 300
    assert shown[-1].startswith(f"balanced at trial {len(lengths)}")


def test_the_exit_status_of_learn_says_whether_it_failed(capsys):
    line = "learn random-search --steps 100000 --trials 2 --seed 0 --quiet"
    assert run(line.split()) == FAILED
    assert "not balanced within 2 trials" in capsys.readouterr().out


def test_learn_saves_curve_and_policy_that_plot_draws(folder, capsys):
    line = "learn random-search --steps 300 --quiet --plot curve.svg --save policy.npz"
    assert run(line.split()) == 0
    assert (folder / "curve.svg").read_text().startswith("<?xml")
    for what in ("policy", "phases"):
        assert run(["plot", what, "policy.npz", "--output", f"{what}.png"]) == 0
        assert (folder / f"{what}.png").read_bytes().startswith(b"\x89PNG")
    capsys.readouterr()


def test_learn_saves_json_where_the_name_says_so(folder, capsys):
    assert run(["learn", "q-learning", "--steps", "300", "--quiet", "--save", "policy.json"]) == 0
    assert json.loads((folder / "policy.json").read_text())["form"] == "table"
    assert run(["play", "policy.json", "--steps", "5"]) == 0
    capsys.readouterr()


def test_the_exit_status_of_play_says_whether_the_pole_fell(folder, capsys):
    assert run(["play", "poor.npz", "--episodes", "3"]) == FAILED
    shown = capsys.readouterr().out.splitlines()
    assert "logarithmic scale" in shown[0]
    assert [line.split()[:2] for line in shown[1:4]] == [["trial", number] for number in "123"]
    assert shown[4].startswith("balanced in 0 of 3 trials")
    assert run(["play", "poor.npz", "--steps", "5"]) == 0
    assert "balanced in 10 of 10 trials" in capsys.readouterr().out


def test_play_uses_the_task_of_the_policy_by_default(folder, capsys):
    shown = []
    for options in ("", "--noise none --start wide", "--noise gaussian-0.2", "--start zero"):
        run(["play", "poor.npz", *options.split()])
        shown.append(capsys.readouterr().out)
    assert shown[0] == shown[1]
    assert len(set(shown)) == 4 - 1


def test_play_writes_a_video(folder, capsys):
    for name in ("film.mp4", "film.gif"):
        assert run(["play", "poor.npz", "--video", name]) == FAILED
        assert capsys.readouterr().out.count("trial ") == 1
    assert (folder / "film.mp4").read_bytes()[4:8] == b"ftyp"
    assert (folder / "film.gif").read_bytes().startswith(b"GIF89a")


def test_tables_are_written_in_every_format_to_a_file_or_the_screen(folder, capsys):
    store = ["--store", "runs.sqlite"]
    assert run(["table", *QUICK, "--runs", "3", *store, "--format", "json", "--output", "t"]) == 0
    rows = json.loads((folder / "t").read_text())
    wanted = "agent settings noise runs successes mean_trials median_trials p95_trials ci95 steps "
    wanted += "steps_simulated seconds published"
    assert set(wanted.split()) <= set(rows[0])
    assert [row["noise"] for row in rows][:2] == ["none", "actuator-5"]
    assert {row["runs"] for row in rows} == {3}
    for name, sign in (("text", "random-search"), ("markdown", "| --- |"), ("latex", r"\midrule")):
        capsys.readouterr()
        assert run(["show", "runs.sqlite", "--format", name]) == 0
        assert sign in capsys.readouterr().out


def entries(shown: str) -> list[str]:
    """Return the arguments, commands and options that a help lists, a line each."""
    listed = re.findall(r"^(?:positional arguments|options):\n(.*?)\n\n", shown, re.M | re.S)
    return re.sub(r"\n {5,}", "  ", "\n".join(listed)).splitlines()


def commands_in(shown: str) -> list[str]:
    return [entry.split()[0] for entry in entries(shown) if re.match(r" {4}\w", entry)]


@pytest.fixture(scope="module")
def helps() -> dict[str, str]:
    """What ``--help`` prints of every command and subcommand."""
    found, waiting = {}, [""]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "1000")  # no text is broken into lines
        while waiting:
            command = waiting.pop()
            with redirect_stdout(StringIO()) as out, pytest.raises(SystemExit) as ended:
                run([*command.split(), "--help"])
            assert ended.value.code == 0
            found[command] = out.getvalue()
            waiting += [f"{command} {name}".strip() for name in commands_in(found[command])]
    return found


def test_commands_are_found_in_the_help(helps):
    """Otherwise the tests below would pass without checking anything."""
    assert {"", "learn", "leaderboard", "tune", "matlab", "matlab table", "gazebo view"} <= {*helps}


def test_help_of_every_command_has_examples(helps):
    for command, shown in helps.items():
        assert re.search(rf"^examples:\n(  .*\n)*  upright {command}\b", shown, re.M), command


def test_every_argument_and_option_has_a_help_text(helps):
    for command, shown in helps.items():
        for entry in entries(shown):
            assert re.match(r" +\S.*?  +\w", entry) or entry == "  COMMAND", (command, entry)


def test_help_needs_no_heavy_library():
    heavy = {"numba", "scipy", "matplotlib", "rich", "numpy", "pygame", "imageio_ffmpeg"}
    program = (
        "import sys; from upright.commands import run\n"
        "try: run(['--help'])\n"
        f"except SystemExit: print({heavy!r} & set(sys.modules))"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert result.stdout.endswith("set()\n")


def test_the_agents_command_explains_every_setting(capsys):
    assert run(["agents"]) == 0
    assert "random-search: Random search" in capsys.readouterr().out
    assert run(["agents", "q-learning"]) == 0
    shown = capsys.readouterr().out
    assert "learning_rate: α" in shown
    assert "default 0.08, as-published 0.3" in shown


def start(folder, *arguments, **environment):
    return subprocess.Popen(
        [*COMMAND, *arguments],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"COLUMNS": "80"} | environment,
    )


LONG = ["table", "--agents", "random-search,q-learning", "--noises", "none,gaussian-0.2"]
LONG += ["--runs", "40", "--seed", "5", "--store", "runs.sqlite", "--format", "json"]


def runs_kept(path: Path) -> int:
    if not path.exists():
        return 0
    database = sqlite3.connect(path, timeout=60)
    try:
        ((count,),) = database.execute("SELECT count(*) FROM runs")
    except sqlite3.OperationalError:  # the table does not exist yet
        count = 0
    database.close()
    return count


def wait_for_runs(path: Path, count: int, process) -> None:
    until = time.monotonic() + 120
    while runs_kept(path) < count:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        time.sleep(0.01)


def without_times(rows):
    return [{name: row[name] for name in row if name != "seconds"} for row in rows]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """What the study shows that nobody stops."""
    process = start(tmp_path_factory.mktemp("whole"), *LONG)
    shown, _ = process.communicate(timeout=300)
    assert process.returncode == 0
    return shown


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_stopped_study_keeps_its_runs_and_can_be_resumed(how, tmp_path, whole):
    process = start(tmp_path, *LONG)
    wait_for_runs(tmp_path / "runs.sqlite", 5, process)
    process.send_signal(how)
    _, error = process.communicate(timeout=60)
    if how != signal.SIGKILL:
        assert process.returncode == INTERRUPTED
        assert "the same command goes on" in error
        assert "Traceback" not in error
    kept = runs_kept(tmp_path / "runs.sqlite")
    assert 5 <= kept < 160

    again = start(tmp_path, *LONG)
    shown, _ = again.communicate(timeout=300)
    assert again.returncode == 0
    assert without_times(json.loads(shown)) == without_times(json.loads(whole))


@pytest.mark.parametrize(
    "words",
    [
        [word for word in LONG if word not in ("--store", "runs.sqlite")],
        ["leaderboard", "--agents", "random-search"],
        ["robust", "--agents", "random-search"],
    ],
    ids=lambda words: words[0],
)
def test_an_interrupted_study_without_a_store_says_that_nothing_was_kept(words, tmp_path):
    process = start(tmp_path, *words, "--steps", "10000000", FORCE_COLOR="1")
    first = process.stderr.read(1)  # of the progress bar: the study has begun
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=60)
    assert process.returncode == INTERRUPTED
    assert "nothing was kept" in first + error
    assert "Traceback" not in error
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("weights", "options", "played"),
    [
        (GOOD_WEIGHTS, ["--steps", "20000000"], "balanced in 1 of 1 trial;"),
        (POOR_WEIGHTS, ["--episodes", "1000000"], "balanced in 0 of "),
        (POOR_WEIGHTS, ["--episodes", "1000000", "--video", "film.mp4"], "balanced in 0 of "),
    ],
)
def test_interrupted_play_reports_what_was_played(weights, options, played, tmp_path):
    keep_policy(tmp_path / "policy.npz", weights)
    process = start(tmp_path, "play", "policy.npz", *options)
    assert "logarithmic scale" in process.stdout.readline()
    assert process.stdout.readline().startswith("trial    1 ")
    process.send_signal(signal.SIGINT)
    shown, error = process.communicate(timeout=60)
    assert process.returncode == INTERRUPTED
    assert error == "upright: stopped\n"
    assert shown.splitlines()[-1].startswith(played)
    assert [path.name for path in tmp_path.iterdir()] == ["policy.npz"]


@pytest.mark.slow
def test_two_processes_share_one_store(tmp_path):
    processes = [start(tmp_path, *LONG) for _ in range(2)]
    shown = [process.communicate(timeout=300)[0] for process in processes]
    assert [process.returncode for process in processes] == [0, 0]
    first, second = (without_times(json.loads(text)) for text in shown)
    assert first == second
    assert runs_kept(tmp_path / "runs.sqlite") == 160
