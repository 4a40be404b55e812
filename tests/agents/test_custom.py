import importlib
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import asdict
from textwrap import dedent

import numpy as np
import pytest
from helpers import ROOT, forget, new_module_name, python
from numba._dispatcher import compute_fingerprint

from upright.agents import AGENTS
from upright.agents.checks.contract import is_learner
from upright.agents.custom import CustomAgent
from upright.commands import run
from upright.core import loops, trials
from upright.core.compiled import explain
from upright.core.parameters import State
from upright.environments.trial_protocol import run_learner
from upright.errors import AgentError, UprightError
from upright.plants.equations import Equations, equations
from upright.policies.files import load_policy
from upright.reports.plots import trajectory
from upright.studies.case import make_case
from upright.studies.executors import local_executor
from upright.studies.playing import play
from upright.studies.random_streams import random_numbers
from upright.studies.run import choose_loop, make_run
from upright.studies.store import Store
from upright.studies.study import study
from upright.support.exit_status import AGENT_FAILED, BAD_USE, FAILED, INTERRUPTED
from upright.support.machine_code import cache_folder

EXAMPLES = ("examples.plain_agent:PlainAgent", "examples.compiled_agent:hill_climber")

# The same rule twice: a linear policy, each trial with other weights near the best so far.
PLAIN = """
    import os
    from pathlib import Path


    class Climber:
        '''Climbs a hill.

        Slowly.
        '''

        def __init__(self, rng):
            self.best, self.tried, self.steps = [0.0] * 4, [0.0] * 4, [0, 0]
            Path(f"{os.getpid()}.pid").touch()

        def begin_trial(self, rng):
            self.steps[1] = 0
            self.tried = [best + (2.0 * rng.random() - 1.0) for best in self.best]

        def act(self, observation, rng):
            x, x_dot, theta, theta_dot = observation
            w = self.tried
            return w[0] * x + w[1] * x_dot + w[2] * 9.0 * theta + w[3] * theta_dot > 0.0

        def learn(self, before, action, after, fallen):
            self.steps[1] += 1

        def end_trial(self, fallen):
            if self.steps[1] > self.steps[0]:
                self.steps[0], self.best = self.steps[1], self.tried
"""
COMPILED = """
    from typing import NamedTuple

    import numpy as np
    from upright.core.compiled import compiled


    class Climber(NamedTuple):
        best: np.ndarray
        tried: np.ndarray
        steps: np.ndarray

        @compiled
        def begin_trial(self, rng):
            self.steps[1] = 0
            for i in range(4):
                self.tried[i] = self.best[i] + (2.0 * rng.random() - 1.0)

        @compiled
        def act(self, observation, rng):
            return self.push_probability(observation) > 0.5

        @compiled
        def learn(self, before, action, after, fallen):
            self.steps[1] += 1

        @compiled
        def end_trial(self, fallen):
            if self.steps[1] > self.steps[0]:
                self.steps[0] = self.steps[1]
                for i in range(4):
                    self.best[i] = self.tried[i]

        @compiled
        def push_probability(self, observation):
            x, x_dot, theta, theta_dot = observation
            w = self.tried
            total = w[0] * x + w[1] * x_dot + w[2] * 9.0 * theta + w[3] * theta_dot
            return 1.0 if total > 0.0 else 0.0


    def climber(rng):
        return Climber(np.zeros(4), np.zeros(4), np.zeros(2, np.int64))
"""
METHODS = """
        def begin_trial(self, rng): ...
        def act(self, observation, rng): ...
        def learn(self, before, action, after, fallen): ...
        def end_trial(self, fallen): ...
"""


@pytest.fixture(scope="module")
def compiled_case(tmp_path_factory):
    """Return a case of the compiled agent, shared by all tests, as each would be compiled."""
    folder, name = tmp_path_factory.mktemp("compiled"), new_module_name()
    (folder / f"{name}.py").write_text(dedent(COMPILED))
    sys.path.insert(0, str(folder))
    importlib.invalidate_caches()
    yield make_case(f"{name}:climber", steps=300, trials=15)
    sys.path.remove(str(folder))
    forget(name)


def broken(old, new):
    assert COMPILED.count(old) == 1
    return COMPILED.replace(old, new)


def lengths(case, seed=3, runs=4):
    """Return the trials of the case's runs, made one after the other in this thread."""
    return [make_run(case, seed, run)[1].lengths.tolist() for run in range(runs)]


def kept(store, case, seed=3):
    return [result.lengths.tolist() for result in store.results(case.key, seed)]


def refused(line, capsys, status=BAD_USE):
    """Return the one line with which a command is refused."""
    assert run(line.split()) == status
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.count("\n") == 1
    return shown.err


# ------------------------------------------------------------------------------ runs


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES)
def test_example_agents_appear_in_tables_beside_built_in_ones(
    example, tmp_path, monkeypatch, capsys
):
    """Their runs are the same as when made one after the other."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "path", sys.path.copy())
    store = tmp_path / "runs.sqlite"
    line = f"table --agents {example},random-search --noises none --runs 3 --seed 3 --store {store}"
    assert run(f"{line} --steps 300 --trials 15".split()) == 0
    shown = capsys.readouterr().out
    for agent in (example, "random-search"):
        assert sum(text.startswith(agent) for text in shown.splitlines()) == 1
        case = make_case(agent, steps=300, trials=15)
        with Store(store) as found:
            assert kept(found, case) == lengths(case, runs=3)


@pytest.mark.slow
@pytest.mark.parametrize("noise", ["none", "all-10"])
def test_a_rule_gives_the_same_results_plain_and_compiled(noise, write, compiled_case):
    plain = make_case(f"{write(PLAIN)}:Climber", steps=300, trials=15, noise=noise)
    fast = make_case(compiled_case.agent, steps=300, trials=15, noise=noise)
    assert choose_loop(plain, make_run(plain, 3, 0)[0], equations()) is trials.run
    agent = make_run(fast, 3, 0)[0]
    assert choose_loop(fast, agent, equations()) is loops.custom_run(type(agent), Equations)
    assert lengths(plain) == lengths(fast)
    assert len({tuple(each) for each in lengths(fast)}) == 4


@pytest.mark.slow
def test_custom_agents_with_the_same_name_are_not_confused(write, compiled_case):
    """Numba, called from Python, identifies a NamedTuple by its name and fields alone."""
    other = make_case(
        f"{write(broken('9.0 * theta', '0.0 * theta'))}:climber", steps=300, trials=15
    )
    first, second = (make_run(case, 3, 0)[0] for case in (compiled_case, other))
    assert type(first) is not type(second)
    assert compute_fingerprint(first) == compute_fingerprint(second)
    for case in (compiled_case, other):
        rng, agent = random_numbers(3, 0), case.settings.agent(None)
        slow = np.zeros(15, np.int64)
        trials.run(agent, equations(), case.spec.task(), rng, slow, np.zeros(1, np.bool_))
        assert lengths(case, runs=1) == [slow[slow > 0].tolist()]
    assert lengths(compiled_case, runs=1) != lengths(other, runs=1)


def test_built_in_agents_are_not_confused():
    """They share one loop, so names or fields of their memories must differ."""
    prints = {}
    for name in AGENTS:
        memory = AGENTS.settings(name)["default"].agent(np.random.default_rng(1))
        prints[compute_fingerprint(memory)] = type(memory)
    assert len(prints) == len(AGENTS)


@pytest.mark.slow
def test_plain_agents_give_the_same_results_in_processes(write, tmp_path):
    case = make_case(f"{write(PLAIN)}:Climber", steps=300, trials=15)
    for file in tmp_path.glob("*.pid"):
        file.unlink()
    with Store() as store:
        study([case], 4, 3, store)
        assert len(list(tmp_path.glob("*.pid"))) > (tmp_path / f"{os.getpid()}.pid").exists()
        assert kept(store, case) == lengths(case)
    with Store() as store, ThreadPoolExecutor(1) as thread:
        study([case], 4, 3, store, executor=thread)
        assert kept(store, case) == lengths(case)


def test_compiled_agents_run_in_threads_and_plain_ones_in_processes(write, compiled_case):
    plain = make_case(f"{write(PLAIN)}:Climber")
    package = make_case("random-search")
    for cases, kind in (
        ([package], ThreadPoolExecutor),
        ([compiled_case, package], ThreadPoolExecutor),
        ([compiled_case, plain, package], ProcessPoolExecutor),
    ):
        with local_executor(cases) as workers:
            assert isinstance(workers, kind)


# ------------------------------------------------------------------------------ refusals


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("class A:" + METHODS, "it must be callable with the run's random generator alone"),
        ("def A(rng, size): ...", "alone: missing a required argument: 'size'"),
        (
            "class A:\n  def __init__(self, rng): ...\n  def act(self, observation, rng): ...",
            "it lacks begin_trial(rng), learn(before, action, after, fallen), end_trial(fallen); "
            "an agent has the methods begin_trial(rng), act(observation, rng), learn(",
        ),
        ("def A(rng): ...", "it lacks begin_trial(rng), act(observation, rng), "),
        ("def A(rng): ...", "; a learner that only knows Gymnasium has train(env)"),
    ],
    ids=str,
)
def test_an_agent_that_cannot_work_is_refused_in_one_line(text, said, write, tmp_path, capsys):
    agent = f"{write(text)}:A"
    before = set(tmp_path.iterdir())
    for line in (f"table --agents {agent} --store runs.sqlite", f"learn {agent}"):
        error = refused(line, capsys, AGENT_FAILED)
        assert f"agent is {agent!r}; " in error
        assert said in error
    assert set(tmp_path.iterdir()) == before


@pytest.mark.parametrize("text", ["x = 3", "A = 3"])
def test_a_module_without_the_agent_is_refused_in_one_line(text, write, capsys):
    error = refused(f"learn {write(text)}:A", capsys)
    assert "there is no class or function 'A'" in error


def test_a_name_in_other_letters_is_guessed(write, capsys):
    assert "; did you mean 'Climber'?" in refused(f"learn {write(PLAIN)}:climber", capsys)


@pytest.mark.parametrize(
    ("agent", "said"),
    [
        ("no_such_module_42:A", "there is no module 'no_such_module_42'"),
        ("no_such_package_42.part:A", "there is no module 'no_such_package_42.part'"),
        ("numpy.no_such_part_42:A", "there is no module 'numpy.no_such_part_42'"),
        ("os:system", "os is a module of Python itself, which has no agent"),
        ("xml.dom:A", "xml.dom is a module of Python itself"),
        (":A", "'' is not the name of a module"),
        (".here:A", "'.here' is not the name of a module"),
        ("some/file.py:A", "there is no file 'some/file.py'; a custom agent is named module:name"),
        ("numpy:", "there is no class or function ''"),
        ("numpy:dot:x", "there is no class or function 'dot:x'"),
    ],
)
def test_a_name_that_leads_nowhere_is_refused_in_one_line(agent, said, capsys):
    for line in (f"table --agents {agent}", f"learn {agent}", f"agents {agent}"):
        assert said in refused(line, capsys)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            broken("self.steps[1] = 0\n", "self.tried[:] = np.zeros(4)\n"),
            "it allocates an array; do so when the agent is created",
        ),
        (
            broken("self.steps[1] += 1", "self.steps = 1"),
            "fields cannot change; keep numbers that do in an array",
        ),
        (
            broken("@compiled\n        def learn", "def learn"),
            "a method that the loop calls lacks @compiled",
        ),
        (
            broken("return self.push_probability(observation) > 0.5", "return self.nothing"),
            "Unknown attribute 'nothing' of type Climber",
        ),
    ],
    ids=["allocation", "assigned field", "plain method", "unknown attribute"],
)
def test_compilation_errors_are_reported_in_one_line(text, said, write, capsys):
    agent = f"{write(text)}:climber"
    error = refused(f"learn {agent} --steps 10 --trials 2 --quiet", capsys, AGENT_FAILED)
    assert f"agent is {agent!r}; it cannot be compiled: " in error
    assert said in error
    assert len(error) < 400


@pytest.mark.slow
def test_compilation_errors_name_the_line_and_keep_their_cause(write):
    text = broken("self.steps[1] += 1", "self.steps[1] += before.nothing")
    name = write(text)
    line = dedent(text).splitlines().index("        self.steps[1] += before.nothing") + 1
    with pytest.raises(AgentError, match=f"{name}.py line {line}$") as caught:
        make_run(make_case(f"{name}:climber"), 0, 0)
    assert "\n" in str(caught.value.__cause__)


def test_an_error_without_a_message_is_explained_by_its_type():
    assert explain(KeyError()) == "KeyError()"


# ------------------------------------------------------------------------------ a changed source


def test_a_changed_source_is_another_case_and_the_store_keeps_them_apart(write):
    name = write(PLAIN)
    seen = []
    with Store() as store, ThreadPoolExecutor(1) as thread:
        for text in (PLAIN, PLAIN.replace("9.0 * theta", "0.0 * theta"), PLAIN):
            write(text, name)
            forget(name)
            case = make_case(f"{name}:Climber", steps=300, trials=5)
            study([case], 2, 3, store, executor=thread)
            seen.append((case.key, kept(store, case)))
            assert kept(store, case) == lengths(case, runs=2)
        assert len(store.cases()) == 2
    assert seen[0] == seen[2]
    assert seen[0][0] != seen[1][0]
    assert seen[0][1] != seen[1][1]


@pytest.mark.slow
def test_a_source_changed_after_its_import_makes_no_further_runs(write):
    """The key stays that of the imported code, and worker processes refuse other code."""
    name = write(PLAIN)
    case = make_case(f"{name}:Climber", steps=300, trials=5)
    write(PLAIN.replace("9.0 * theta", "0.0 * theta"), name)
    same = make_case(f"{name}:Climber", steps=300, trials=5)
    assert same.key == case.key
    with Store() as store:
        with pytest.raises(UprightError, match="its source changed after it was imported"):
            study([case], 2, 3, store)
        assert store.cases() == []


# ------------------------------------------------------------------------------ learners elsewhere

LEARNER = """
    import numpy as np


    class Guess:
        '''Draws a new linear policy for every episode.'''

        def __init__(self, rng):
            self.rng = rng

        def train(self, env):
            while True:
                weights = self.rng.uniform(-1.0, 1.0, 4) * (1.0, 1.0, 10.0, 1.0)
                observation, _ = env.reset()
                over = False
                while not over:
                    action = int(observation @ weights > 0.0)
                    observation, _, fallen, truncated, _ = env.step(action)
                    over = fallen or truncated
"""


@pytest.mark.slow
def test_a_learner_that_only_knows_gymnasium_stands_in_the_table(write, tmp_path, capsys):
    """Its runs are the same as when made one after the other, and are kept and shown."""
    agent = f"{write(LEARNER)}:Guess"
    line = f"table --agents {agent},random-search --noises sensor-10 --runs 3 --seed 3 --steps 300"
    assert run(f"{line} --store runs.sqlite".split()) == 0
    assert run(["show", "runs.sqlite"]) == 0
    for shown in capsys.readouterr().out.split("Agent")[1:]:
        assert [
            sum(text.startswith(name) for text in shown.splitlines())
            for name in (agent, "random-search")
        ] == [1, 1]
    case = make_case(agent, noise="sensor-10", steps=300)
    assert choose_loop(case, case.settings.agent(None), equations()) is run_learner
    with Store("runs.sqlite") as store:
        found = store.results(case.key, 3)
        assert kept(store, case) == lengths(case, runs=3)
    assert all(result.success and result.lengths[-1] == 300 for result in found)
    assert len({result.trials for result in found}) > 1


def test_a_run_of_a_learner_can_be_watched_and_stopped(write, capsys):
    agent = f"{write(LEARNER)}:Guess"
    assert run(f"learn {agent} --steps 300".split()) == 0
    shown = capsys.readouterr().out
    result = make_run(make_case(agent, steps=300), 0, 0)[1]
    assert shown.count("\ntrial ") == result.trials
    assert f"balanced at trial {result.trials}:" in shown
    assert make_run(make_case(agent, steps=300), 0, 0, stop=np.ones(1, np.bool_))[1] is None


def test_a_learner_that_ends_early_is_refused_in_one_line(write, capsys):
    agent = f"{write(LEARNER.replace('while True', 'for _ in range(3)'))}:Guess"
    error = refused(f"learn {agent} --quiet", capsys, AGENT_FAILED)
    assert "train returned in run 0, trial 4, step 1; it must go on until" in error


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("fallen or", "nothing or", "NameError: name 'nothing' is not defined"),
        (
            "action = int(",
            "action = -int(",
            "InvalidAction: action is -1; it must be in Discrete(2): 1 pushes",
        ),
        ("action = int(", "action = float(", "InvalidAction: action is "),
        ("action = int(", "action = print(", "InvalidAction: action is None; it must be in"),
    ],
)
def test_errors_in_a_learner_are_its_own(old, new, said, write):
    agent = f"{write(LEARNER.replace(old, new))}:Guess"
    with pytest.raises(AgentError, match=r"train failed in run 0, trial \d+, step ") as caught:
        make_run(make_case(agent, steps=300), 0, 0)
    assert said in str(caught.value).splitlines()[0]
    assert "trial_protocol" not in str(caught.value)


def test_an_agent_with_a_method_train_is_still_an_agent(write):
    text = PLAIN + "\n        def train(self, env): ...\n"
    assert not is_learner(make_case(f"{write(text)}:Climber").settings.agent(None))


# ------------------------------------------------------------------------------ other commands


def test_learn_accepts_a_custom_agent(write, capsys):
    agent = f"{write(PLAIN)}:Climber"
    assert run(f"learn {agent} --steps 20 --trials 50".split()) == 0
    assert "balanced at trial" in capsys.readouterr().out
    assert run(f"learn {agent} --steps 100000 --trials 1 --quiet".split()) == FAILED
    capsys.readouterr()


def test_a_policy_of_a_custom_agent_is_saved_and_played(compiled_case, tmp_path, capsys):
    path = tmp_path / "policy.npz"
    line = f"learn {compiled_case.agent} --steps 300 --condition delay-1 --save {path} --quiet"
    run(line.split())
    policy = load_policy(path, agent=compiled_case.agent)
    memory = make_run(make_case(compiled_case.agent, steps=300, condition="delay-1"), 0, 0)[0]
    assert policy.memory.tried.tolist() == memory.tried.tolist()
    assert policy.task["condition"] == "delay-1"
    points = np.random.default_rng(0).normal(0, 0.2, (50, 4))
    pushes = [policy.push_probability(point) for point in points]
    assert pushes == [float(memory.push_probability(State(*point))) for point in points]
    assert {0.0, 1.0} == set(pushes)
    assert trajectory(policy, compiled_case.spec.task()).shape[1] == 4
    capsys.readouterr()


def test_agents_that_only_act_are_saved_and_played_alike(write, tmp_path):
    head, method = COMPILED.split(
        "        @compiled\n        def push_probability(self, observation):\n"
    )
    rule, tail = method.split("            return 1.0 if total > 0.0 else 0.0\n")
    act = "            return self.push_probability(observation) > 0.5\n"
    mute = head.replace(act, f"{rule}            return total > 0.0\n") + tail
    played = []
    for agent in (f"{write(PLAIN)}:Climber", f"{write(mute)}:climber"):
        path = tmp_path / "policy.npz"
        line = f"learn {agent} --steps 300 --trials 40 --save {path} --quiet"
        assert run(line.split()) in (0, FAILED)
        policy = load_policy(path, agent)
        played.append(play(policy, 5, steps=2000, start="wide"))
    assert played[0] == played[1]
    assert len({trial.steps for trial in played[0]}) > 1


@pytest.mark.slow
def test_a_policy_whose_agent_is_missing_or_changed_is_refused(compiled_case, write, tmp_path):
    path = tmp_path / "policy.npz"
    name = write(COMPILED)
    run(f"learn {name}:climber --steps 10 --trials 2 --save {path} --quiet".split())
    write(PLAIN + "\n    climber = Climber\n", name)
    forget(name)
    with pytest.raises(UprightError, match=r"policy\.npz.*it cannot be read"):
        load_policy(path, agent=f"{name}:climber")
    (tmp_path / f"{name}.py").unlink()
    forget(name)
    with pytest.raises(UprightError, match=rf"policy\.npz.*there is no module '{name}'"):
        load_policy(path, agent=f"{name}:climber")


def test_the_agents_command_describes_a_custom_agent(write, capsys):
    agent = f"{write(PLAIN)}:Climber"
    assert run(["agents", agent]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith(f"{agent}: Climbs a hill.\n")
    assert "module:name" in shown
    silent = f"{write(COMPILED)}:climber"
    assert run(["agents", silent]) == 0
    assert capsys.readouterr().out.startswith(f"{silent}: \n")


def test_a_store_outlives_its_agent(write, tmp_path, capsys):
    name = write(PLAIN)
    case = make_case(f"{name}:Climber", steps=50, trials=4)
    with Store(tmp_path / "runs.sqlite") as store, ThreadPoolExecutor(1) as thread:
        study([case], 3, 0, store, executor=thread)
    (tmp_path / f"{name}.py").unlink()
    forget(name)
    for command in ("show runs.sqlite", "plot trials runs.sqlite"):
        assert run(command.split()) == 0
    assert f"{name}:Climber" in capsys.readouterr().out


def test_settings_of_a_custom_agent_are_read_back(write):
    agent = f"{write(PLAIN)}:Climber"
    settings = AGENTS.settings(agent)["default"]
    assert AGENTS.restore(agent, asdict(settings)) == settings == CustomAgent(agent)
    with pytest.raises(UprightError, match="are not those of"):
        AGENTS.restore(agent, {"tempo": 3})


def test_tuning_a_custom_agent_is_refused_in_one_line(write, capsys):
    assert "search" in refused(f"tune {write(PLAIN)}:Climber --store tune.sqlite", capsys)


# ------------------------------------------------------------------------------ kernels on disk


@pytest.mark.slow
def test_kernels_of_custom_agents_are_not_kept_on_disk(compiled_case):
    make_run(make_case("random-search", steps=10, trials=1), 0, 0)  # so that its kernel is on disk
    folder = cache_folder()
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert before
    case = make_case(compiled_case.agent, steps=300, trials=3)
    agent, _ = make_run(case, 0, 0)
    agent.push_probability(State(0.0, 0.0, 0.0, 0.0))
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    ended = python(
        "from upright.studies.case import make_case\nfrom upright.studies.run import make_run\n"
        "from upright.core.loops import compiled_run\n"
        "make_run(make_case('random-search', steps=10, trials=1), 0, 0)\n"
        "stats = compiled_run._outer.stats\n"
        "print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))"
    )
    assert ended.stdout == "1 0\n", ended.stderr


# ------------------------------------------------------------------------------ Ctrl-C and others

ENDLESS = PLAIN.replace("2.0 * rng.random() - 1.0", "0.0").replace(
    "w = self.tried", "w = (1.0, 1.5, 20.0 / 9.0, 3.0)"
)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_signal_ends_a_study_of_plain_agents_and_its_processes(number, write, tmp_path):
    """Even a signal that only the main process receives, or that it cannot handle."""
    agent = f"{write(ENDLESS)}:Climber"
    program = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from upright.commands import main; main()"
    )
    line = f"table --agents {agent} --noises none --runs 4 --steps 1000000000"
    process = subprocess.Popen(
        [sys.executable, "-c", program, *line.split()],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,  # a group of its own, to see what is left of it
    )
    try:
        until = time.monotonic() + 120
        while len(list(tmp_path.glob("*.pid"))) < 2:  # the main process and a worker
            assert process.poll() is None, process.communicate()
            assert time.monotonic() < until
            time.sleep(0.05)
        process.send_signal(number)
        _, error = process.communicate(timeout=60)  # the runs would go on for hours
        if number == signal.SIGKILL:
            assert process.returncode == -number
        else:
            assert process.returncode == INTERRUPTED
            assert "nothing was kept" in error
            assert error.endswith("upright: stopped\n")  # and nobody complains of what is left
        assert "Traceback" not in error
        until = time.monotonic() + 60
        while time.monotonic() < until and is_alive(process.pid):
            time.sleep(0.05)
        assert not is_alive(process.pid)
    finally:
        if is_alive(process.pid):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def is_alive(group):
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True
