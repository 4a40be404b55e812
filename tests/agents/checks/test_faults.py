"""An agent's error is shown with its own frames."""

import pickle

import numpy as np
import pytest

from upright.agents.checks.faults import fault, own_traceback, reporting
from upright.agents.custom import CustomAgent
from upright.errors import AgentError, UprightError

RNG = np.random.default_rng(0)
IMPORTS = {
    "a name": ("x = nothing", "NameError: name 'nothing' is not defined"),
    "a syntax error": ("class A", "SyntaxError: expected ':' ({name}.py, line 1)"),
    "a missing library": ("import no_such_42", "ModuleNotFoundError: No module named 'no_such_42'"),
    "a missing name": ("from math import tau42", "ImportError: cannot import name 'tau42' from "),
    "an exit": ("raise SystemExit", "SystemExit"),
    "bytes": ("\x00", "SyntaxError: source code string cannot contain null bytes"),
}


def error_of(work):
    try:
        work()
    except Exception as error:
        return error
    raise AssertionError


def files(text):
    return [line.split('"')[1] for line in text.splitlines() if line.startswith("  File ")]


def test_the_first_line_says_what_happened_and_the_frames_follow():
    error = error_of(lambda: 1 / 0)
    said = str(fault("mine:Pd", "act failed in run 0, trial 3, step 17", error)).splitlines()
    assert said[0] == (
        "agent is 'mine:Pd'; act failed in run 0, trial 3, step 17: "
        "ZeroDivisionError: division by zero"
    )
    assert said[1] == "Traceback (most recent call last):"
    assert said[-1] == "ZeroDivisionError: division by zero"


def test_a_message_of_several_lines_is_shown_as_a_whole_below():
    def fail():
        raise ValueError("one\ntwo")

    said = str(fault("mine:Pd", "it failed", error_of(fail)))
    assert said.startswith("agent is 'mine:Pd'; it failed: ValueError: one\nTraceback")
    assert said.endswith("ValueError: one\ntwo")


def test_frames_of_libraries_are_left_out():
    def cause():
        try:
            np.linalg.inv(np.zeros((2, 2)))
        except np.linalg.LinAlgError as error:
            raise KeyError("w") from error

    shown = own_traceback(error_of(cause))
    assert set(files(shown)) == {__file__}
    assert "LinAlgError: Singular matrix\n\nThe above exception was the direct cause" in shown


def test_frames_of_an_installed_package_are_shown_if_there_is_nothing_else():
    error = error_of(lambda: pytest.approx("x") + 1)
    error.__traceback__ = None
    assert own_traceback(error).splitlines()[-1].startswith("TypeError")
    namespace = {}
    for folder in ("numpy", "their_agents"):
        code = compile("def fail(): raise KeyError", f"/venv/site-packages/{folder}/a.py", "exec")
        exec(code, namespace)
        error = error_of(namespace["fail"])
        error.__traceback__ = error.__traceback__.tb_next
        assert files(own_traceback(error)) == (
            ["/venv/site-packages/their_agents/a.py"] if folder == "their_agents" else []
        )


def test_an_exception_without_a_message_is_named():
    def fail():
        raise NotImplementedError

    said = str(fault("mine:Pd", "learn failed in run 0", error_of(fail)))
    assert said.splitlines()[0] == "agent is 'mine:Pd'; learn failed in run 0: NotImplementedError"


def test_endless_recursion_is_shown_in_short():
    def climb():
        climb()

    assert len(own_traceback(error_of(climb)).splitlines()) < 20


def test_it_is_the_same_after_crossing_processes():
    error = fault("mine:Pd", "it failed", error_of(lambda: 1 / 0))
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is AgentError
    assert str(again) == str(error)


def test_what_is_reported_already_and_interrupts_pass():
    for passing in (AgentError("once"), KeyboardInterrupt()):
        with (
            pytest.raises(type(passing)) as caught,
            reporting("mine:Pd", "it failed"),
        ):
            raise passing
        assert caught.value is passing


@pytest.mark.parametrize(("text", "said"), IMPORTS.values(), ids=IMPORTS)
def test_an_error_at_import_is_the_agents(text, said, write, tmp_path):
    name = write(text)
    with pytest.raises(AgentError) as caught:
        CustomAgent(f"{name}:A").agent(RNG)
    first, *rest = str(caught.value).splitlines()
    assert first.startswith(
        f"agent is '{name}:A'; its module cannot be imported: {said.format(name=name)}"
    )
    assert set(files("\n".join(rest))) <= {f"{tmp_path / name}.py"}


def test_an_error_in_the_constructor_is_the_agents(write):
    name = write("class A:\n  def __init__(self, rng): self.x = self.y")
    agent = f"{name}:A"
    with pytest.raises(AgentError, match=f"agent is '{agent}'; it cannot be created: Attribute"):
        CustomAgent(agent).agent(RNG)


def test_a_refusal_in_the_agents_code_is_its_error_too(write):
    text = "import upright\ndef A(rng): return upright.make_case('reinforce', steps=0)"
    with pytest.raises(AgentError, match="it cannot be created: UprightError: steps is 0; it must"):
        CustomAgent(f"{write(text)}:A").agent(RNG)


def test_a_missing_module_is_not_the_agents_error():
    with pytest.raises(UprightError) as caught:
        CustomAgent("no_such_42:A").agent(RNG)
    assert not isinstance(caught.value, AgentError)
