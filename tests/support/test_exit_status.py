"""What went wrong is told by the exit status, and on standard error."""

import errno
import subprocess
import sys
import warnings

import pytest

from upright.errors import AgentError, AgentWarning, Stopped, UprightError
from upright.support.exit_status import AGENT_FAILED, BAD_USE, INTERRUPTED, UNWRITTEN, exit_status

PROGRAM = """
import sys
from upright.support.exit_status import exit_status
def work():
    {work}
    return 5
sys.exit(exit_status(work))
"""


def ended(work, **places):
    """Return how a program ended that does this work, with its output in these places."""
    code = [sys.executable, "-c", PROGRAM.format(work=work)]
    return subprocess.run(code, text=True, check=False, **{"stderr": subprocess.PIPE} | places)


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (UprightError("steps is 0"), BAD_USE, "upright: error: steps is 0\n"),
        (AgentError("act failed\nlate"), AGENT_FAILED, "upright: error: act failed\nlate\n"),
        (KeyboardInterrupt(), INTERRUPTED, "upright: stopped\n"),
        (Stopped(), INTERRUPTED, "upright: stopped\n"),
    ],
)
def test_each_kind_of_failure_has_its_status(error, status, said, capsys):
    def work():
        raise error

    assert exit_status(work) == status
    assert capsys.readouterr().err == said


@pytest.mark.parametrize("buffering", ["", "1"])
@pytest.mark.parametrize("work", ["print('a line')", "print('a line', flush=True)"])
def test_a_full_disk_is_one_sentence_and_a_status_of_its_own(work, buffering, monkeypatch):
    monkeypatch.setenv("PYTHONUNBUFFERED", buffering)
    with open("/dev/full", "w") as full:
        result = ended(work, stdout=full)
    assert result.returncode == UNWRITTEN
    assert result.stderr == (
        "upright: error: the output cannot be written: No space left on device\n"
    )


def test_a_status_is_kept_where_errors_cannot_be_written():
    with open("/dev/full", "w") as full:
        work = "from upright.errors import UprightError; raise UprightError('no')"
        assert ended(work, stderr=full).returncode == BAD_USE


def test_a_reader_that_has_enough_is_not_an_error():
    work = "print('line\\n' * 100_000)"
    code = PROGRAM.format(work=work)
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "line\n"
        process.stdout.close()
        assert process.stderr.read() == ""


def test_other_errors_of_the_system_are_shown_whole():
    def work():
        raise OSError(errno.ECHILD, "no child")

    with pytest.raises(OSError, match="no child"):
        exit_status(work)


def test_statuses_differ():
    assert len({0, 1, BAD_USE, AGENT_FAILED, UNWRITTEN, INTERRUPTED}) == 6


def test_a_warning_of_an_agent_is_one_line_and_the_same_one_is_shown_once(capsys):
    def work():
        for text in ("doubtful", "doubtful", "odd"):
            warnings.warn(text, AgentWarning, stacklevel=1)
        return 0

    usual = warnings.showwarning
    assert exit_status(work) == 0
    assert capsys.readouterr().err == "upright: warning: doubtful\nupright: warning: odd\n"
    assert warnings.showwarning is usual
