"""The Octave that tests share: one test must not notice what another did to it."""

import pytest
from octave import MATLAB, Session

pytestmark = pytest.mark.octave


@pytest.fixture
def session():
    session = Session()
    yield session
    session.close()


def test_statements_are_evaluated_in_one_process(session):
    assert session.evaluate("for k = 1:2\n  printf('%d\\n', k);  % a comment\nend") == "1\n2\n"
    process = session.process
    assert session.evaluate("disp(getfield(upright.parameters(), 'gravity'))") == "9.8000\n"
    assert session.process is process


def test_nothing_is_left_of_earlier_statements(session, tmp_path):
    (tmp_path / "counted.m").write_text(
        "function n = counted()\n  persistent k = 0;\n  n = ++k;\nend\n"
    )
    count = f"addpath('{tmp_path}'); x = counted(); disp(counted())"
    assert session.evaluate(count) == "2\n"
    assert session.evaluate(count) == "2\n"
    assert session.evaluate("disp([exist('x'), exist('counted')])").split() == ["0", "0"]
    session.evaluate(f"rmpath('{MATLAB}')")
    assert session.evaluate("disp(getfield(upright.parameters(), 'gravity'))") == "9.8000\n"


@pytest.mark.parametrize(
    ("statements", "message"),
    [
        ("disp('before'); error('upright:some', 'some reason')", "before\n\nerror: some reason"),
        ("x = [1", "parse error"),
        ("no_such_function()", "'no_such_function' undefined"),
        ("disp('before'); exit(3)", "before\n\nOctave ended"),
        ("fputs(stderr, 'words'); error('x')", "words"),
    ],
    ids=["error", "syntax", "unknown function", "exit", "standard error"],
)
def test_failures_are_reported_and_the_session_goes_on(session, statements, message):
    with pytest.raises(AssertionError, match=message):
        session.evaluate(statements)
    assert session.evaluate("disp(1)") == "1\n"


def test_what_takes_too_long_is_ended(session):
    session.evaluate("disp(1)")
    process = session.process
    with pytest.raises(AssertionError, match="not done in"):
        session.evaluate("disp('at work'); while true, end", timeout=0.5)
    assert process.poll() is not None
    assert session.evaluate("disp(1)") == "1\n"


def test_a_killed_process_is_replaced(session):
    session.evaluate("disp(1)")
    session.process.kill()
    session.process.wait()
    assert session.evaluate("disp(1)") == "1\n"
