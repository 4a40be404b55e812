"""What commands print, in terminals of every kind, to pipes and to full disks."""

import argparse
import io
import os
import pty
import signal
import subprocess
import sys

import pytest

from upright.commands import GREETING, make_parser, run
from upright.studies.case import make_case
from upright.studies.store import Store
from upright.studies.study import study
from upright.studies.watching import print_trial
from upright.support.exit_status import UNWRITTEN

UPRIGHT = [sys.executable, "-m", "upright"]
LEARN = ["learn", "random-search", "--steps", "300", "--seed", "1"]


@pytest.fixture(scope="module")
def every_command():
    """The words of every command and of those below them."""

    def found(parser, words):
        for action in parser._actions:
            if isinstance(action, argparse._SubParsersAction):
                for name, below in action.choices.items():
                    yield [*words, name]
                    yield from found(below, [*words, name])

    return [[], *found(make_parser(), [])]


@pytest.fixture
def stream(monkeypatch):
    """Return a function that makes the output one of an encoding; it gives the stream."""

    def make(encoding):
        for name in ("LC_ALL", "PYTHONIOENCODING", "PYTHONUTF8"):
            monkeypatch.delenv(name, raising=False)
        made = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
        monkeypatch.setattr(sys, "stdout", made)
        return made

    return make


def output_of(*words, **environment):
    """Return what a command prints in a process of its own, as bytes."""
    changed = os.environ | environment
    ended = subprocess.run([*UPRIGHT, *words], capture_output=True, check=False, env=changed)
    assert not ended.stderr, ended.stderr
    return ended.stdout


# ------------------------------------------------------------------------------ encodings


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_help_of_every_command_fits_every_encoding(encoding, every_command, stream):
    assert ["ros2", "simulate"] in every_command
    out = stream(encoding)
    for words in every_command:
        with pytest.raises(SystemExit) as ended:
            run([*words, "--help"])
        assert ended.value.code == 0, words
    shown = out.buffer.getvalue().decode(encoding)
    assert shown.count("usage: upright") == len(every_command)
    assert "\\u" not in shown
    assert ("within +/-0.05" in shown) == (encoding == "ascii")


@pytest.mark.parametrize(
    "words", [["agents"], ["agents", "q-learning"], ["plants"], ["terms"], ["cite"], []]
)
def test_lists_fit_ascii(words, stream):
    out = stream("ascii")
    assert run(words) == 0
    shown = out.buffer.getvalue().decode("ascii")
    assert shown
    assert "\\u" not in shown


@pytest.mark.parametrize("columns", [80, 120])
def test_the_terms_fit_the_terminal(columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    assert run(["terms"]) == 0
    longest = max(len(line) for line in capsys.readouterr().out.splitlines())
    assert columns - 10 < longest <= columns


@pytest.fixture(scope="module")
def usual():
    """What learning prints where every sign can be printed."""
    return output_of(*LEARN, LC_ALL="C.UTF-8").decode()


@pytest.mark.slow
@pytest.mark.parametrize(
    "environment",
    [{"LC_ALL": "C"}, {"PYTHONIOENCODING": "ascii"}, {"PYTHONIOENCODING": "latin-1"}],
)
def test_trials_and_tables_fit_every_encoding(environment, usual):
    # The times of two runs differ.
    lines = [line for line in usual.splitlines() if not line.startswith("balanced")]
    assert "█" in usual
    shown = output_of(*LEARN, **environment).decode("ascii").splitlines()
    assert shown[:-1] == [line.replace("█", "#") for line in lines]
    words = ["table", "--agents", "random-search", "--noises", "none", "--steps", "300"]
    environment = environment | {"NO_COLOR": "1"}
    made = subprocess.run([*UPRIGHT, *words], capture_output=True, env=os.environ | environment)
    assert b"\n------" in made.stdout
    assert (made.stdout + made.stderr).isascii()


def test_files_are_in_utf_8_whatever_the_output(tmp_path, stream, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with Store("runs.sqlite") as store:
        study([make_case("random-search", steps=300, trials=1)], 1, 0, store)
    stream("ascii")
    assert run(["show", "runs.sqlite", "--output", "table.txt"]) == 0
    assert "─────" in (tmp_path / "table.txt").read_text(encoding="utf-8")


# ------------------------------------------------------------------------------ full disks


@pytest.mark.parametrize("words", [[], ["--help"], ["learn", "--help"], ["agents"]])
def test_a_full_disk_is_one_sentence(words):
    with open("/dev/full", "w") as full:
        ended = subprocess.run([*UPRIGHT, *words], stdout=full, stderr=subprocess.PIPE, text=True)
    assert ended.returncode == UNWRITTEN
    assert ended.stderr.startswith("upright: error: the output cannot be written: ")
    assert ended.stderr.count("\n") == 1


# ------------------------------------------------------------------------------ greeting


def test_upright_alone_greets_with_five_commands_that_can_be_parsed(capsys):
    assert run([]) == 0
    assert capsys.readouterr().out == GREETING
    lines = [line.strip() for line in GREETING.splitlines() if line.startswith("  upright ")]
    assert len(lines) == 5
    for line in lines:
        words = line.partition("   ")[0].split()[1:]
        assert callable(make_parser([words[0]]).parse(words).command)
    assert max(map(len, GREETING.splitlines())) <= 80


# ------------------------------------------------------------------------------ trials


def shown_trials(steps, lengths, capsys):
    case = make_case("random-search", steps=steps)
    for number, length in enumerate(lengths, 1):
        print_trial(case, number, length)
    return capsys.readouterr().out.splitlines()


@pytest.mark.parametrize("columns", [20, 60, 80, 200])
@pytest.mark.parametrize("steps", [1, 2, 9, 10, 300, 1_000, 3_000, 60_000, 600_000, 6_000_000])
def test_every_mark_of_the_scale_ends_where_its_bar_ends(columns, steps, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    marks = [10**power for power in range(10) if 10**power < steps]
    head, *lines = shown_trials(steps, [*marks, steps], capsys)
    assert "logarithmic" in head
    assert head.endswith(f" {steps:,}")
    ends = {f"{mark:,}": len(line) for mark, line in zip([*marks, steps], lines, strict=True)}
    place = head.index("scale") + len("scale")
    for word in head[place:].split():
        place = head.index(word, place) + len(word)
        assert place == ends[word]
    if columns >= 60:
        assert max(map(len, [head, *lines])) <= max(columns, 60)
    if (columns, steps) == (80, 60_000):
        assert head[41:].split() == ["1", "10", "100", "1,000", "60,000"]


def test_there_is_one_scale_above_all_trials(capsys):
    shown = shown_trials(300, [5, 300], capsys)
    assert ["logarithmic" in line for line in shown] == [True, False, False]
    assert len(shown[2]) > len(shown[1])


# ------------------------------------------------------------------------------ compilation


def test_a_person_is_told_first_that_it_compiles(tmp_path):
    ours, its = pty.openpty()
    empty = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "LC_ALL": "C.UTF-8"}
    with subprocess.Popen([*UPRIGHT, *LEARN], stdout=its, stderr=its, env=empty) as process:
        os.close(its)
        assert os.read(ours, 100).decode() == "compiling, once per version …"
        process.send_signal(signal.SIGKILL)
    os.close(ours)


@pytest.mark.slow
def test_nobody_is_told_again_nor_in_a_file(tmp_path):
    empty = {"NUMBA_CACHE_DIR": str(tmp_path)}
    assert output_of(*LEARN, **empty)
    ours, its = pty.openpty()
    ended = subprocess.run(
        [*UPRIGHT, *LEARN], stdout=subprocess.PIPE, stderr=its, env=os.environ | empty
    )
    os.write(its, b"end\n")
    os.close(its)
    assert os.read(ours, 100) == b"end\r\n"
    assert ended.returncode == 0
    os.close(ours)
