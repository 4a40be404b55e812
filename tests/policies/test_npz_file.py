"""The files of plain Python agents; test_policy.py has those of memories of arrays."""

import json
import re
import tracemalloc
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest
from helpers import forget

from upright.commands import run
from upright.core.parameters import State
from upright.errors import AgentError, UprightError
from upright.policies import checks
from upright.policies.checks import JSON_MARKS
from upright.policies.files import export_policy, load_policy, read_header, save_policy
from upright.policies.npz_file import FORMAT, PLAIN_FORMAT
from upright.policies.policy import Policy
from upright.reports.learning import learn
from upright.reports.plots import policies as plotted_policies
from upright.studies.case import make_case
from upright.studies.learned import check_policy, learned_policy
from upright.studies.playing import case_for, play, play_trials
from upright.support.exit_status import AGENT_FAILED, BAD_USE, FAILED

PLAIN = """
    import threading
    from collections import defaultdict, deque
    from dataclasses import dataclass
    from pathlib import Path
    from typing import NamedTuple

    import numpy as np

    Path("imported").touch()


    @dataclass
    class Step:
        seen: tuple
        right: bool


    class Line:
        def __init__(self):
            self.weights = np.zeros(4)

        def total(self, seen):
            return float(self.weights @ np.array(seen))


    class Climber:
        '''Draws a line; keeps the best.'''

        def __init__(self, rng):
            self.rng, self.line, self.best = rng, Line(), (0, None)
            self.visits = defaultdict(lambda: [0, 0])
            self.last, self.steps = deque(maxlen=3), 0

        def begin_trial(self, rng):
            self.steps = 0
            self.line.weights = self.rng.normal(size=4) * (1, 1, 9, 3)

        def act(self, observation, rng):
            self.visits[round(observation.theta * 10), observation.x > 0][0] += 1
            return self.line.total(observation) + 0.1 * self.rng.normal() > 0

        def learn(self, before, action, after, fallen):
            self.last.append(Step(before, action))
            self.steps += 1

        def end_trial(self, fallen):
            if self.steps > self.best[0]:
                self.best = self.steps, self.line.weights.copy()
"""
LEARNER = """
    class Guess:
        def __init__(self, rng):
            self.rng, self.weights = rng, None

        def train(self, env):
            while True:
                self.weights = (self.rng.normal(size=4) * (1, 1, 9, 3)).tolist()
                env.reset()
                done = False
                while not done:
                    seen, _, fallen, truncated, _ = env.step(self.rng.integers(2))
                    done = fallen or truncated
"""
PUSH = """
        def push_probability(self, observation):
            return float(sum(w * o for w, o in zip(self.weights, observation)) > 0)
"""


@pytest.fixture
def saved(write):
    """Return the name of a plain agent, what it learned, and the path of its file."""
    agent = f"{write(PLAIN)}:Climber"
    policy, _ = learn(agent, steps=200, trials=10)
    save_policy("plain.npz", policy)
    return agent, policy, Path("plain.npz")


def refused(line, capsys):
    assert run(line.split()) == BAD_USE
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    return error


# ------------------------------------------------------------------------------ use


def test_a_plain_agent_plays_the_same_trials_after_it_was_saved(saved):
    agent, policy, path = saved
    again = load_policy(path, agent)
    names = {"steps": 3000, "noise": "all-10", "start": "wide", "condition": "delay-2"}
    played = play(policy, 5, seed=3, **names)
    assert play(again, 5, seed=3, **names) == played
    assert play(policy, 5, seed=3, **names) == played
    assert len({trial.steps for trial in played}) > 1
    assert again.memory.visits == policy.memory.visits
    assert again.memory.last == policy.memory.last
    for point in np.random.default_rng(0).normal(0, 0.2, (20, 4)):
        assert again.push_probability(point) == policy.push_probability(point)
    assert again.task == policy.task


def test_playing_leaves_a_plain_agent_as_it_is(saved):
    _, policy, path = saved
    before = path.read_bytes()
    play(policy, 3, steps=100)
    policy.push_probability(State(0, 0, 0.1, 0))
    save_policy("again.npz", policy)
    members = [zipfile.ZipFile(each) for each in (path, "again.npz")]
    for name in members[0].namelist():
        assert members[0].read(name) == members[1].read(name)
    assert before


def test_the_commands_work_for_a_plain_agent(write, capsys, monkeypatch):
    monkeypatch.setattr(plotted_policies, "CELLS", 12)  # of 200 each way, plain Python takes long
    agent = f"{write(PLAIN)}:Climber"
    line = f"learn {agent} --steps 100 --trials 20 --save plain.npz --quiet"
    assert run(line.split()) in (0, FAILED)
    assert run(["play", "plain.npz", "--agent", agent, "--steps", "50"]) in (0, FAILED)
    assert "balanced in" in capsys.readouterr().out
    video = ["--steps", "5", "--video", "film.gif"]
    assert run(["play", "plain.npz", "--agent", agent, *video]) in (0, FAILED)
    assert Path("film.gif").stat().st_size > 1000
    for kind in ("policy", "phases"):
        assert run(["plot", kind, "plain.npz", "--agent", agent]) == 0


def test_show_describes_a_plain_agent_without_its_code(saved, capsys):
    agent, policy, path = saved
    forget(agent.partition(":")[0])
    Path("imported").unlink()
    assert run(["show", str(path)]) == 0
    shown = capsys.readouterr().out
    assert f'format: "{PLAIN_FORMAT}"' in shown
    assert f'"visits": "defaultdict of {len(policy.memory.visits)}"' in shown
    assert '"line": "Line"' in shown
    assert '"rng": "Generator"' in shown
    for name in (None, "other:Climber"):
        with pytest.raises(UprightError, match=f"learned by '{agent}'"):
            load_policy(path, name)
    assert not Path("imported").exists()


def test_numpy_and_json_can_read_the_file(saved):
    _, policy, path = saved
    with np.load(path, allow_pickle=False) as archive:
        state = json.loads(archive["state"].item())["attributes"]
        number = state["line"]["attributes"]["weights"]["array"]
        assert archive[f"array {number}"].tolist() == policy.memory.line.weights.tolist()
    assert state["steps"] == policy.memory.steps
    assert state["rng"] == {"left out": "Generator"}


def test_a_plain_agent_that_states_its_probability_is_asked_for_it(write):
    agent = f"{write(PLAIN + PUSH.replace('self.weights', 'self.line.weights'))}:Climber"
    policy, _ = learn(agent, steps=50, trials=3)
    save_policy("plain.npz", policy)
    again = load_policy("plain.npz", agent)
    assert policy.push_probability(State(0, 0, 0.1, 0)) in (0.0, 1.0)
    assert play(again, 3, steps=100) == play(policy, 3, steps=100)


def test_a_gymnasium_learner_is_saved_if_it_can_be_played(write, capsys):
    agent = f"{write(LEARNER + PUSH)}:Guess"
    assert run(f"learn {agent} --steps 50 --trials 3 --save g.npz --quiet".split()) in (0, FAILED)
    policy = load_policy("g.npz", agent)
    assert len(policy.memory.weights) == 4
    assert len(list(play_trials(policy, case_for(policy, steps=50), 2, 0))) == 2
    capsys.readouterr()
    mute = f"{write(LEARNER)}:Guess"
    error = refused(f"learn {mute} --steps 50 --save g.npz", capsys)
    assert f"agent is '{mute}'; its policy cannot be saved: it has no push_probability" in error


def test_a_named_tuple_of_python_values_keeps_them_all(write):
    text = """
        from typing import NamedTuple

        class Agent(NamedTuple):
            gain: float
            counts: list

            def begin_trial(self, rng): ...
            def act(self, observation, rng): return observation.theta * self.gain > 0
            def learn(self, before, action, after, fallen): self.counts[0] += 1
            def end_trial(self, fallen): ...

        def agent(rng):
            return Agent(float(rng.normal()), [0])
    """
    agent = f"{write(text)}:agent"
    policy, result = learn(agent, steps=100, trials=2, seed=5)
    save_policy("plain.npz", policy)
    again = load_policy("plain.npz", agent)
    assert again.memory == policy.memory
    assert again.memory.counts == [sum(result.lengths)]


@pytest.mark.parametrize(
    ("rule", "said"),
    [
        ("return 1 / 0", r"act failed in play at State\(x=.*ZeroDivisionError"),
        ("return -7.3", r"act returned -7\.3 in play at State\(.*; it must be True"),
        ("pass", "act returned None in play at .*forget to return"),
    ],
)
def test_what_goes_wrong_in_play_is_reported_as_the_agents(rule, said, saved, write, capsys):
    agent = saved[0]
    text = PLAIN.replace("return self.line.total(observation) + 0.1 * self.rng.normal() > 0", rule)
    forget(write(text, agent.partition(":")[0]))
    for line in ("play plain.npz --episodes 2", "plot policy plain.npz", "plot phases plain.npz"):
        assert run([*line.split(), "--agent", agent]) == AGENT_FAILED
        assert re.search(f"agent is '{agent}'; {said}", capsys.readouterr().err, re.DOTALL)


def test_a_probability_must_be_one(saved, write):
    agent, _, path = saved
    wrong = "        def push_probability(self, observation): return 1.5\n"
    forget(write(PLAIN + wrong, agent.partition(":")[0]))
    with pytest.raises(
        AgentError, match=r"push_probability returned 1\.5 in play at State.* 0 to 1"
    ):
        play(load_policy(path, agent), 1)


# ------------------------------------------------------------------------------ refusals


def test_what_a_new_agent_keeps_is_refused_before_the_run(write, capsys):
    text = PLAIN.replace("Line(), (0, None)", "Line(), (lambda: 1, 2)")
    agent = f"{write(text)}:Climber"
    error = refused(f"learn {agent} --steps 50 --save plain.npz", capsys)
    assert f"agent is '{agent}'; its policy cannot be saved: its attribute 'best[0]'" in error
    assert "is of type 'function', which is not data" in error
    with pytest.raises(UprightError, match=r"'best\[0\]'"):
        check_policy(make_case(agent))


def test_what_an_agent_keeps_later_is_refused_after_the_result(write, capsys):
    text = PLAIN.replace("self.steps += 1", "self.steps += 1; self.net = [threading.Lock()]")
    agent = f"{write(text)}:Climber"
    assert run(f"learn {agent} --steps 50 --trials 2 --save plain.npz".split()) == BAD_USE
    captured = capsys.readouterr()
    assert "trial" in captured.out
    assert "attribute 'net[0]' is of type 'lock', which is not data" in captured.err
    assert not Path("plain.npz").exists()


def test_json_needs_a_form_and_says_so_before_the_run(write, saved, capsys):
    agent, policy, _ = saved
    error = refused(f"learn {agent} --save plain.json", capsys)
    assert f"agent is '{agent}'; its policy cannot be exported: it lacks the method" in error
    for name in ("plain.h", "plain.json"):
        with pytest.raises(UprightError, match=r"policy_form\(\)"):
            export_policy(name, policy)
    assert not list(Path().glob("plain.[hj]*"))


def test_a_state_that_is_too_large_is_refused(saved, monkeypatch):
    monkeypatch.setattr(checks, "JSON_MARKS", 5000)
    _, policy, _ = saved
    policy.memory.visits = [[]] * 4000
    save_policy("small.npz", policy)
    policy.memory.visits = [[]] * 5000
    with pytest.raises(UprightError, match="cannot be saved: apart from arrays, it has more than"):
        save_policy("large.npz", policy)
    assert not Path("large.npz").exists()


def test_an_agent_whose_code_has_changed_is_refused_by_the_attribute(saved, write):
    agent, _, path = saved

    def change(text):
        forget(write(text, agent.partition(":")[0]))

    change(PLAIN.replace("self.rng,", "self.gamma, self.rng,").replace("= rng,", "= 0.9, rng,"))
    with pytest.raises(UprightError, match=r"lacks the attribute 'gamma', .* code changed since\?"):
        load_policy(path, agent)
    compiled = "\n    Climber = lambda rng: Tuple(np.zeros(4))\n    class Tuple(NamedTuple):\n"
    methods = PUSH + "".join(
        f"        def {each}: ...\n"
        for each in ("begin_trial(s, r)", "act(s, o, r)", "learn(s, b, a, c, f)", "end_trial(s, f)")
    )
    change(PLAIN + compiled + "        weights: np.ndarray\n" + methods)
    with pytest.raises(UprightError, match="holds the state of a plain Python agent; the agent is"):
        load_policy(path, agent)
    case = make_case(agent)
    memory = case.settings.agent(np.random.default_rng(0))
    save_policy("tuple.npz", learned_policy(case, 0, 0, memory))
    assert read_header("tuple.npz")["format"] == FORMAT
    change(PLAIN)
    with pytest.raises(UprightError, match="holds a NamedTuple; the agent is no such thing"):
        load_policy("tuple.npz", agent)


# ------------------------------------------------------------------------------ hostile files


def members_of(path):
    with zipfile.ZipFile(path) as archive:
        return {info.filename: archive.read(info) for info in archive.infolist()}


def rewrite(path, members, packing=zipfile.ZIP_STORED):
    with zipfile.ZipFile(path, "w", packing) as archive, warnings.catch_warnings(action="ignore"):
        for name, data in members:
            archive.writestr(name, data)


def arrays(path, change, save=np.savez):
    with np.load(path) as archive:
        members = dict(archive)
    change(members)
    with path.open("wb") as file:
        save(file, **members)


def with_state(text):
    """Return damage that replaces the state."""
    return lambda path: arrays(path, lambda members: members.update(state=np.array(text)))


def with_header(**values):
    def change(members):
        header = json.loads(str(members["header"])) | values
        members["header"] = np.array(json.dumps(header))

    return lambda path: arrays(path, change)


def with_array(value):
    return lambda path: arrays(path, lambda members: members.update({"array 0": value}))


def with_member(name, data):
    """Return damage that replaces a member, or adds it, with the name as it is."""
    return lambda path: rewrite(path, [*(members_of(path) | {name: data}).items()])


def twice(path):
    rewrite(path, [*members_of(path).items(), ("state.npy", members_of(path)["state.npy"])])


def overlapping(path):
    """Let a hundred members share the same bytes of the file, as archives that explode do."""
    arrays(path, lambda members: members.update({"array 0": np.zeros(30_000)}))
    with zipfile.ZipFile(path, "a") as archive:
        shared = archive.getinfo("array 0.npy")
        while (number := len(archive.namelist()) - 2) < 100:
            info = zipfile.ZipInfo(f"array {number}.npy")
            for part in ("header_offset", "CRC", "file_size", "compress_size", "compress_type"):
                setattr(info, part, getattr(shared, part))
            archive.filelist.append(info)
            archive.NameToInfo[info.filename] = info
        archive._didModify = True


def head(**described):
    """Return the beginning of a NumPy file that declares this."""
    text = repr({"descr": "<f8", "fortran_order": False, "shape": (1,)} | described) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


BAD_FILES = {
    "compressed": (
        lambda path: arrays(path, lambda members: None, np.savez_compressed),
        "it is compressed, and a state must not be",
    ),
    "overlapping": (overlapping, "it holds more than its size|Overlapped"),
    "twice": (twice, "does not hold a header, a state and the arrays"),
    "missing": (
        lambda path: arrays(path, lambda members: members.pop("array 0")),
        "array 0, which is not in the file|does not hold",
    ),
    "no state": (
        lambda path: arrays(path, lambda members: members.pop("state")),
        "does not hold a header, a state",
    ),
    "odd name": (with_member("array 9\x00\x1b[2J.npy", b""), "does not hold"),
    "path": (with_member("../../array 1.npy", head() + bytes(8)), "does not hold"),
    "pickle": (with_array(np.array([print, None], object)), "array 0 is of object"),
    "records": (with_array(np.zeros(1, [("x", "f8")])), "array 0 is of .*neither numbers nor text"),
    "no size": (with_member("array 0.npy", head(descr="|S0", shape=(10**12,))), "array 0 is of"),
    "claims much": (with_member("array 0.npy", head(shape=(10**15,)) + bytes(8)), "shorter"),
    "negative": (with_member("array 0.npy", head(shape=(-1, -1)) + bytes(8)), "cannot be read"),
    "holds much": (with_member("array 0.npy", head() + bytes(10**7)), "longer"),
    "large type": (
        with_member("array 0.npy", head(descr=f"<U{10**8}", shape=(1,))),
        "shorter or longer",
    ),
    "no array": (with_member("array 0.npy", b"hello" * 9), "magic"),
    "numbers for a state": (with_state(3.0), "its state is not a text"),
    "texts": (with_state([b"{}", b"{}"]), "its state is not a text"),
    "no JSON": (with_state(b"{'x': 1}"), "cannot be read"),
    "NaN": (with_state(b'{"object": NaN}'), "it holds NaN"),
    "empty": (with_state(b"{}"), "no state of an agent"),
    "other class": (
        with_state(b'{"object": "Step", "attributes": {}}'),
        "in its state, it is of type 'Step', and the new agent has none",
    ),
    "brackets": (with_state(b"[" * 100_000), "cannot be read"),
    "many brackets": (with_state(b"[" + b"[]," * JSON_MARKS + b"[]]"), "more than 2,000,000"),
    "long number": (with_state(b'{"object": ' + b"9" * 10_000 + b"}"), "cannot be read"),
    "format": (with_header(format=FORMAT), "holds a NamedTuple; the agent is no such thing"),
    "other format": (with_header(format="upright policy 3"), "upright policy 1' or 'upright pol"),
}


@pytest.mark.parametrize(("damage", "said"), BAD_FILES.values(), ids=BAD_FILES)
def test_a_bad_file_is_refused_without_using_much_memory(damage, said, saved):
    agent, _, path = saved
    damage(path)
    size = path.stat().st_size
    tracemalloc.start()
    with pytest.raises(UprightError, match=rf"plain\.npz.*({said})") as error:
        load_policy(path, agent)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 1000
    assert peak < 3 * size + 1_000_000


@pytest.mark.parametrize("agent", ["reinforce", "random-search"])
def test_agents_of_the_package_have_no_plain_state(agent, saved, tmp_path):
    _, _, path = saved
    settings = learn(agent, steps=20, trials=1)[0]
    save_policy("other.npz", settings)
    header = read_header("other.npz")
    with_header(agent=agent, settings=header["settings"])(path)
    with pytest.raises(UprightError, match="holds the state of a plain Python agent; the agent is"):
        load_policy(path)


@pytest.mark.slow
def test_whatever_byte_is_damaged_the_state_is_the_same_or_refused(saved):
    agent, _, path = saved
    content = path.read_bytes()
    expected = load_policy(path, agent).memory
    refusals = 0
    for i in range(0, len(content), 3):
        path.write_bytes(content[:i] + bytes([content[i] ^ 0x55]) + content[i + 1 :])
        try:
            found = load_policy(path, agent).memory
        except UprightError:
            refusals += 1
        else:
            assert found.visits == expected.visits
            assert found.line.weights.tolist() == expected.line.weights.tolist()
    assert refusals > len(content) / 3 / 2


def test_a_policy_without_settings_cannot_be_saved(saved):
    agent, policy, _ = saved
    with pytest.raises(UprightError, match="without its settings"):
        save_policy("x.npz", Policy(agent, policy.memory, policy.learned_on))
