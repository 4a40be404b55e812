"""What went wrong is told by the exit status, and on standard error."""

import warnings

import pytest

from upright.errors import AgentError, AgentWarning, Stopped, UprightError
from upright.support.exit_status import AGENT_FAILED, BAD_USE, INTERRUPTED, exit_status


def ends_with(error):
    def work():
        raise error

    return work


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
    assert exit_status(ends_with(error)) == status
    assert capsys.readouterr().err == said


def test_statuses_differ():
    assert len({0, 1, BAD_USE, AGENT_FAILED, INTERRUPTED}) == 5


def test_a_warning_of_an_agent_is_one_line_however_often(capsys):
    def work():
        for _ in range(2):
            warnings.warn("doubtful", AgentWarning, stacklevel=1)
        return 0

    usual = warnings.showwarning
    assert exit_status(work) == 0
    assert capsys.readouterr().err == "upright: warning: doubtful\n" * 2
    assert warnings.showwarning is usual
