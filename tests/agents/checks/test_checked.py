"""What is said of wrong agents, plain and compiled, and that right ones are not changed."""

from textwrap import dedent, indent

import numpy as np
import pytest
from helpers import ROOT

from upright.agents.checks.checked import checked, is_push
from upright.commands import run
from upright.core import trials
from upright.core.task import TaskSpec
from upright.errors import AgentError
from upright.plants.equations import equations
from upright.studies.case import make_case
from upright.studies.run import make_run
from upright.studies.store import Store
from upright.studies.study import study
from upright.support.exit_status import AGENT_FAILED

PUSHES = [True, False, 0, 1, np.True_, np.int64(0), np.uint8(1), np.array(1), np.array(False)]
NO_PUSHES = [-1, 2, -7.3, 0.0, 1.0, None, "left", "1", [True], np.array([1]), np.float64(1), 1j]
MEANT = "it must be True (or 1) to push right, +F, or False (or 0) to push left, -F"


class Pusher:
    """Returns one value after the other, and keeps what `learn` is given."""

    def __init__(self, *values):
        self.values, self.learned = iter(values), []

    def begin_trial(self, rng): ...

    def act(self, observation, rng):
        return next(self.values)

    def learn(self, before, action, after, fallen):
        self.learned.append(action)

    def end_trial(self, fallen): ...


def play(agent, steps, name="mine:Pd", which="run 4"):
    task = TaskSpec(steps=steps, trials=1).task()
    rng, lengths, stop = np.random.default_rng(0), np.zeros(1, np.int64), np.zeros(1, np.bool_)
    with checked(agent, name, which) as called:
        trials.run(called, equations(), task, rng, lengths, stop)


def message(agent, steps=1):
    with pytest.raises(AgentError) as caught:
        play(agent, steps)
    return str(caught.value)


# ------------------------------------------------------------------------------ actions


@pytest.mark.parametrize("action", PUSHES, ids=repr)
def test_what_means_a_push_is_taken_and_given_to_learn_as_it_is(action):
    assert is_push(action)
    agent = Pusher(action)
    play(agent, 1)
    assert agent.learned[0] is action


@pytest.mark.parametrize("action", NO_PUSHES, ids=repr)
def test_what_means_no_push_is_refused(action):
    said = message(Pusher(True, False, action), 3)
    assert said.startswith("agent is 'mine:Pd'; act returned ")
    assert f"in run 4, trial 1, step 3; {MEANT}" in said
    assert said.endswith("; did it forget to return a value?") == (action is None)
    assert "\n" not in said


def test_a_large_action_is_shown_in_short():
    said = message(Pusher(np.arange(1e4).reshape(100, 100)))
    assert "\n" not in said
    assert len(said) < 250


# ------------------------------------------------------------------------------ wrong agents

PLAIN = """
    import numpy as np


    class A:
        def __init__(self, rng):
            self.w, self.n = np.zeros(4), 0

        def begin_trial(self, rng):
            self.n += 1
{begin_trial}

        def act(self, observation, rng):
            {act}

        def learn(self, before, action, after, fallen):
            {learn}

        def end_trial(self, fallen):
            {end_trial}
"""
COMPILED = """
    from typing import NamedTuple

    import numpy as np
    from upright import compiled


    class Agent(NamedTuple):
        w: np.ndarray
        n: np.ndarray

        @compiled
        def begin_trial(self, rng):
            self.n[0] += 1
{begin_trial}

        @compiled
        def act(self, observation, rng):
            {act}

        @compiled
        def learn(self, before, action, after, fallen):
            {learn}

        @compiled
        def end_trial(self, fallen):
            {end_trial}


    def A(rng):
        return Agent(np.zeros(4), np.zeros(1, np.int64))
"""
HEALTHY = {
    "begin_trial": "",
    "act": "return observation.theta > 0.0",
    "learn": "pass",
    "end_trial": "pass",
}


def text_of(form, **parts):
    parts = HEALTHY | parts
    return form.format(**parts | {"begin_trial": indent(parts["begin_trial"], " " * 12)})


WRONG = {
    "minus one for left": (
        {"act": "return 1 if observation.theta > 0.0 else -1"},
        f"act returned -1 in run 0, trial 1, step 5; {MEANT}",
    ),
    "a force": (
        {"act": "return -7.3"},
        f"act returned -7.3 in run 0, trial 1, step 1; {MEANT}",
    ),
    "no return": (
        {"act": "observation.theta > 0.0"},
        f"act returned None in run 0, trial 1, step 1; {MEANT}; did it forget to return a value?",
    ),
    "NaN among the weights": (
        {"end_trial": "self.w[2] = np.nan"},
        "its w is NaN (not a number) after run 0, trial ",
    ),
    "an exception": (
        {"begin_trial": "if self.n == 2:\n    raise ValueError('too far')"},
        "begin_trial failed in run 0, trial 2: ValueError: too far\nTraceback",
    ),
    "an exit": (
        {"end_trial": "raise SystemExit(0)"},
        "end_trial failed in run 0, trial 1, step ",
    ),
}
WRONG_COMPILED = {
    "minus one for left": (
        WRONG["minus one for left"][0],
        f"act returned -1 in run 0, trial 1, step 5; {MEANT}",
    ),
    "a force": (WRONG["a force"][0], f"act returns float64; {MEANT}"),
    "no return": (WRONG["no return"][0], "act returns none; it must be True"),
    "no return at times": (
        {"act": "if observation.theta > 0.0:\n                return True"},
        "act returns bool or none; it must be True",
    ),
    "NaN among the weights": (
        WRONG["NaN among the weights"][0],
        "its w is NaN (not a number) after run 0, trial 3; ",
    ),
    "an exception": (
        {"learn": "if self.n[0] == 2:\n                raise ValueError('too far')"},
        "learn failed in run 0, trial 2, step 1: ValueError: too far\nTraceback",
    ),
}


def failure(text, write):
    agent = f"{write(text)}:A"
    with pytest.raises(AgentError) as caught:
        make_run(make_case(agent, steps=300, trials=3), 0, 0)
    said = str(caught.value)
    assert said.startswith(f"agent is {agent!r}; ")
    return said


@pytest.mark.parametrize(("parts", "said"), WRONG.values(), ids=WRONG)
def test_a_wrong_agent_is_told_what_is_wrong(parts, said, write):
    assert said in failure(text_of(PLAIN, **parts), write)


@pytest.mark.slow
@pytest.mark.parametrize(("parts", "said"), WRONG_COMPILED.values(), ids=WRONG_COMPILED)
def test_a_wrong_compiled_agent_is_told_what_is_wrong(parts, said, write):
    assert said in failure(text_of(COMPILED, **parts), write)


@pytest.mark.slow
def test_a_compiled_agent_may_return_integers(write):
    """And its wrong form is not confused with it, though called from Python they look alike."""
    ends = []
    for action in ("1 if observation.theta > 0.0 else 0", "observation.theta > 0.0"):
        case = make_case(
            f"{write(text_of(COMPILED, act=f'return {action}'))}:A", steps=300, trials=3
        )
        ends.append(make_run(case, 0, 0)[1].lengths.tolist())
    assert ends[0] == ends[1]
    wrong = text_of(COMPILED, act="return 1 if observation.theta > 0.0 else 2")
    assert "act returned 2 in run 0, trial 1, step " in failure(wrong, write)


@pytest.mark.slow
def test_an_error_of_the_plant_is_not_the_agents(write):
    class Broken(dict):
        def reset(self, state):
            return state

        def step(self, force):
            raise OSError("no cart")

        def close(self): ...

    for form in (PLAIN, COMPILED):
        case = make_case(f"{write(text_of(form))}:A", steps=300, trials=3)
        with pytest.raises(OSError, match="no cart"):
            make_run(case, 0, 0, plant=Broken())


def test_the_package_s_own_agents_are_not_checked(monkeypatch):
    monkeypatch.setattr("upright.studies.run.checked", None)
    assert make_run(make_case("random-search", steps=10, trials=1), 0, 0)[1].success


def test_a_run_keeps_the_exception_and_its_frames_for_debuggers(write):
    case = make_case(f"{write(text_of(PLAIN, learn='1 / 0'))}:A")
    with pytest.raises(AgentError) as caught:
        make_run(case, 0, 0)
    cause = caught.value.__cause__
    assert isinstance(cause, ZeroDivisionError)
    assert cause.__traceback__.tb_next.tb_frame.f_locals["fallen"] is False


# ------------------------------------------------------------------------------ commands


@pytest.mark.slow
def test_a_table_reports_a_failed_agent_once(write, tmp_path, capfd):
    """It runs in processes. Runs that had ended are kept, and the status is one of its own."""
    good, bad = write(text_of(PLAIN)), write(text_of(PLAIN, act="return 1 / 0"))
    line = "table --noises none,gaussian-0.1 --runs 2 --steps 100 --trials 2 --store r.sqlite"
    assert run([*line.split(), "--agents", f"{good}:A"]) == 0
    capfd.readouterr()
    assert run([*line.split(), "--agents", f"{good}:A,{bad}:A"]) == AGENT_FAILED
    shown = capfd.readouterr()
    assert shown.out == ""
    lines = shown.err.strip().splitlines()
    assert lines[0].startswith(f"upright: error: agent is '{bad}:A'; act failed in run ")
    assert lines[0].endswith(", trial 1, step 1: ZeroDivisionError: division by zero")
    assert lines[1] == "Traceback (most recent call last):"
    assert lines[2] == f'  File "{tmp_path / bad}.py", line 14, in act'
    assert lines[-1] == "ZeroDivisionError: division by zero"
    assert sum("Traceback" in line or "File" in line for line in lines) == 2
    with Store("r.sqlite") as store:
        case = make_case(f"{good}:A", steps=100, trials=2)
        assert len(store.results(case.key, 0)) == 2


@pytest.mark.slow
def test_where_a_run_failed_is_said_across_processes(write):
    case = make_case(f"{write(text_of(PLAIN, end_trial='self.gone'))}:A", noise="gaussian-0.1")
    with pytest.raises(AgentError, match=r"in run \d with gaussian-0.1, trial 1, step \d+: Attrib"):
        study([case], 3)


@pytest.mark.slow
def test_an_agent_that_ends_its_process_is_named(write):
    name = write("import os\n" + dedent(text_of(PLAIN, learn="os._exit(0)")))
    with pytest.raises(AgentError, match=f"agent is '{name}:A'; the process of its run ended wi"):
        study([make_case(f"{name}:A")], 3)


def test_no_example_is_refused(monkeypatch):
    monkeypatch.chdir(ROOT)
    assert make_run(make_case("examples.plain_agent:PlainAgent", steps=200, trials=20), 0, 0)[1]
