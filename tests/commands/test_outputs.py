"""What commands do with the files that they are given: none is lost, and none is half written."""

import argparse
import os
import shlex
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import upright
from upright.commands import make_parser, run
from upright.commands.completion import FILES
from upright.commands.parser import MODEL, WRITTEN
from upright.errors import UprightError
from upright.reports.leaderboards import LEADERBOARD, BoardPlan, make_board
from upright.reports.reproduction import reproduce
from upright.studies.learned import learned_policy
from upright.support.exit_status import BAD_USE, UNWRITTEN

UPRIGHT = [sys.executable, "-m", "upright"]


def leaves(parser, name=()):
    """Yield the name of every command below a parser, and its own parser."""
    below = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    for action in below:
        for word, command in action.choices.items():
            yield from leaves(command, (*name, word))
    if not below:
        yield " ".join(name), parser


LEAVES = dict(leaves(make_parser()))


def words_for(parser, chosen):
    """Return arguments that name these files, with some value for all others that are needed."""
    words = []
    for action in parser._actions:
        if action.option_strings:
            if action in chosen:
                words += [action.option_strings[-1], chosen[action]]
        elif action in chosen:
            words.append(chosen[action])
        elif action.nargs != "?" or action.metavar == "AGENT":
            words.append(next(iter(action.choices)) if action.choices else f"other-{action.dest}")
    return words


def pairs():
    """Yield each two arguments of a command of which one names a file that is written."""
    for name, parser in LEAVES.items():
        for (one, use), (other, another) in product(parser.files, repeat=2):
            if one is not other and use == WRITTEN and another != MODEL:
                yield pytest.param(name, one, other, id=f"{name} {one.dest} {other.dest}")


@pytest.mark.parametrize(("name", "one", "other"), [*pairs()])
def test_no_command_writes_a_file_that_it_reads_or_writes_otherwise(
    name, one, other, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("precious")
    os.link("file", "hard")
    Path("soft").symlink_to("file")
    for path in ("file", "./file", "hard", "soft"):
        words = words_for(LEAVES[name], {one: "file", other: path})
        with pytest.raises(UprightError, match="the same file"):
            make_parser([name.split()[0]]).parse([*name.split(), *words])
    assert Path("file").read_text() == "precious"


def test_every_argument_that_names_a_file_says_what_is_done_with_it():
    for name, parser in LEAVES.items():
        known = [action for action, _ in parser.files]
        named = [action for action in parser._actions if action.metavar in (*FILES, "FOLDER")]
        assert [action for action in named if action not in known] == (
            [named[0]] if name == "new" else []  # which overwrites nothing
        )


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working folder with a store and policies."""
    monkeypatch.chdir(tmp_path)
    case = upright.make_case("random-search", steps=9, trials=3)
    with upright.Store("runs.sqlite") as store:
        store.add(case.key, 0, upright.Result(0, True, np.array([2, 9]), 0.5))
    policy = learned_policy(case, 0, 0, case.settings.agent(np.random.default_rng(0)))
    upright.save_policy("policy.npz", policy)
    upright.save_policy("policy.json", policy)
    return tmp_path


@pytest.mark.parametrize(
    "line",
    [
        "show runs.sqlite --output runs.sqlite",
        "show runs.sqlite --output runs.sqlite-wal",
        "plot trials runs.sqlite --output runs.sqlite",
        "plot trials trials.png",
        "table --store runs.sqlite --output ./runs.sqlite",
        "leaderboard --agents random-search --store runs.sqlite --output runs.sqlite",
        "leaderboard --agents random-search --store board.json --output board.md",
        "tune q-learning --output tune-q-learning.sqlite",
        "learn --from policy.npz --save policy.npz",
        "learn random-search --plant mujoco --plant-set model=policy.json --save policy.json",
        "export policy.json policy.json",
    ],
)
def test_a_store_and_a_policy_survive(line, folder, capsys):
    (folder / "trials.png").write_bytes((folder / "runs.sqlite").read_bytes())
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert run(shlex.split(line)) == BAD_USE
    assert capsys.readouterr().err.count("\n") == 1
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_python_refuses_the_same(folder):
    plan = BoardPlan(("random-search",), 1, 0, 9, {}, "board.json", "board.md")
    with pytest.raises(UprightError, match=r"'board\.json'; it is the same file as store"):
        make_board(LEADERBOARD, plan)
    (folder / "report.md").symlink_to("runs.sqlite")
    with pytest.raises(UprightError, match=r"report\.md'; it is the same file as store"):
        reproduce(folder)


# ------------------------------------------------------------------------------ names


@pytest.mark.parametrize("name", ["", "a" * 256, "a\0b", "\ud800"])
@pytest.mark.parametrize(
    "line",
    [
        "show NAME",
        "play NAME",
        "show runs.sqlite --output NAME",
        "plot trials NAME",
        "table --store NAME",
        "table --task NAME",
        "learn random-search --save NAME",
        "learn random-search --settings-file NAME",
        "export policy.npz NAME",
        "check NAME",
        "cite --output NAME",
        "reproduce --output NAME",
        "new NAME",
    ],
)
def test_a_name_that_no_file_can_have_is_one_sentence(line, name, folder, capsys):
    assert run([name if word == "NAME" else word for word in line.split()]) == BAD_USE
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("name", ["a" * 248, "new/", "nowhere"])
@pytest.mark.parametrize(
    "line",
    [
        "table --agents random-search --noises none --store NAME",
        "study study.toml --status --store NAME",
        "leaderboard --agents random-search --store NAME",
        "tune q-learning --store NAME",
        "merge runs.sqlite --output NAME",
    ],
)
def test_a_name_that_no_store_can_have_is_refused_before_the_work(
    line, name, folder, capsys, monkeypatch
):
    if "tune" in line:
        pytest.importorskip("optuna")
    monkeypatch.setattr("upright.studies.run.make_run", None)
    (folder / "nowhere").symlink_to(folder / "missing" / "runs.sqlite")
    (folder / "study.toml").write_text('agents = ["random-search"]')
    before = sorted(os.listdir())
    assert run([name if word == "NAME" else word for word in line.split()]) == BAD_USE
    assert capsys.readouterr().err.count("\n") == 1
    assert sorted(os.listdir()) == before


@pytest.mark.parametrize("name", ["a" * 256, "a\0b", "\ud800"])
def test_such_a_name_is_refused_in_python(name, folder):
    policy = upright.load_policy("policy.npz")
    with pytest.raises(UprightError, match="no such file"):
        upright.load_policy(name)
    for write in (upright.save_policy, upright.export_policy):
        with pytest.raises(UprightError):
            write(f"{name}.json", policy)


# ------------------------------------------------------------------------------ closed streams


def ended(words, closing):
    """Return how a command ended whose shell closed some of its streams."""
    line = f"{shlex.join([*UPRIGHT, *words])} {closing}"
    return subprocess.run(["sh", "-c", line], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("words", "closing", "status", "errors"),
    [
        (["cite"], "<&-", 0, 0),
        (["cite"], "2>&-", 0, 0),
        (["cite"], ">&-", UNWRITTEN, 1),
        (["cite"], ">&- 2>&- <&-", UNWRITTEN, 0),
        (["--help"], ">&-", UNWRITTEN, 1),
        (["show", "missing"], ">&-", BAD_USE, 1),
        (["show", "missing"], "2>&-", BAD_USE, 0),
        (["cite", "--format", "x"], "2>&-", BAD_USE, 0),
        (["cite", "--output", "/dev/stdout"], ">&-", BAD_USE, 1),
    ],
)
def test_a_closed_stream_is_a_sentence_or_nothing(words, closing, status, errors):
    how = ended(words, closing)
    assert how.returncode == status
    assert how.stderr.count("\n") == errors
    assert "Traceback" not in how.stderr


@pytest.mark.slow
def test_no_file_gets_the_number_of_a_closed_stream(folder):
    before = Path("runs.sqlite").read_bytes()
    assert ended(["show", "runs.sqlite"], ">&- 2>&- <&-").returncode == UNWRITTEN
    assert Path("runs.sqlite").read_bytes() == before


# ------------------------------------------------------------------------------ special files


def test_outputs_go_to_devices_and_open_files(folder):
    line = ["show", "runs.sqlite", "--each", "run", "--output"]
    shown = subprocess.run([*UPRIGHT, *line, "/dev/stdout"], capture_output=True, check=True).stdout
    run([*line, "runs.csv"])
    assert shown == Path("runs.csv").read_bytes()
    assert run([*line, "/dev/null"]) == 0
    assert Path("/dev/null").is_char_device()


# ------------------------------------------------------------------------------ full disks


@pytest.fixture
def full(folder):
    """A folder on a disk that has no room left."""
    place = folder / "full"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=16k", "tmpfs", place]
    if sys.platform != "linux" or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("mounting is not allowed here")
    (place / "filler").write_bytes(b"x" * 4096 * 4)
    yield place
    subprocess.run(["umount", place], check=True)


@pytest.mark.parametrize(
    "line",
    [
        *(f"show runs.sqlite --format {name} --output full/x" for name in ("text", "csv", "json")),
        *(f"show runs.sqlite --each trial --format {n} --output full/x" for n in ("csv", "json")),
        "show runs.sqlite --format parquet --output full/x",
        "plot trials runs.sqlite --output full/x.png",
        "export policy.json full/x.h",
        "export policy.json full/x.onnx",
        "cite --output full/x",
        "new full/agent.py",
        "learn random-search --steps 300 --quiet --save full/x.npz",
        "learn random-search --steps 300 --quiet --save full/x.json",
        "learn random-search --steps 300 --quiet --plot full/x.svg",
        "learn random-search --steps 300 --quiet --save-task full/x.toml",
        "leaderboard --agents random-search --runs 1 --steps 30 --output full/x.md",
        pytest.param(
            "play policy.json --steps 5 --video full/x.gif", marks=pytest.mark.slow, id="video"
        ),
    ],
)
def test_a_full_disk_is_one_sentence_and_leaves_nothing(line, full, capsys):
    for module in ("onnx", "pyarrow", "imageio_ffmpeg"):
        if module[:3] in line:
            pytest.importorskip(module)
    (full / "x").touch()
    assert run(line.split()) == BAD_USE
    errors = capsys.readouterr().err
    assert errors.splitlines()[-1].endswith("cannot be written: No space left on device")
    assert errors.count("upright: error: output is 'full/") == 1
    assert sorted(os.listdir(full)) == ["filler", "x"]
