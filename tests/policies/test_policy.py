import io
import json
import sys
import tracemalloc
import zipfile
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from helpers import LEARNED_ON

from upright.agents import AGENTS
from upright.agents.reinforce import MOST_KEPT, Reinforce
from upright.commands import run
from upright.core.parameters import Parameters, State
from upright.errors import UprightError
from upright.plants import describe_plant
from upright.plants.mujoco import Mujoco
from upright.policies.files import load_policy, read_header, save_policy
from upright.policies.npz_file import FORMAT
from upright.policies.policy import describe
from upright.reports.plots import trajectory
from upright.studies.case import make_case
from upright.studies.learned import learned_policy
from upright.studies.run import make_run
from upright.support.exit_status import BAD_USE


def learn(agent):
    case = make_case(agent, steps=2000)
    memory, result = make_run(case, 0, 0)
    assert result.success
    return case, learned_policy(case, 0, 0, memory)


@pytest.fixture(scope="module", params=AGENTS)
def learned(request):
    return learn(request.param)


@pytest.fixture(scope="module")
def content(tmp_path_factory):
    """The file of a small policy, that of random search."""
    path = tmp_path_factory.mktemp("policy") / "policy.npz"
    _, policy = learn("random-search")
    save_policy(path, policy)
    return path.read_bytes()


@pytest.fixture
def path(content, tmp_path):
    """That file, to be damaged."""
    path = tmp_path / "policy.npz"
    path.write_bytes(content)
    return path


def test_a_policy_read_back_balances_alike(learned, tmp_path):
    case, policy = learned
    save_policy(tmp_path / "policy.npz", policy)
    again = load_policy(tmp_path / "policy.npz")
    assert again.task == policy.task == LEARNED_ON
    for point in np.random.default_rng(0).normal(0, 0.2, (200, 4)):
        assert again.push_probability(point) == policy.push_probability(State(*point))
    states = trajectory(again, case.spec.task())
    np.testing.assert_array_equal(states, trajectory(policy, case.spec.task()))
    assert len(states) > 200  # far more than without control


def test_playing_teaches_nothing():
    case, policy = learn("reinforce")
    before = [array.copy() for array in policy.memory.network]
    trajectory(policy, case.spec.task()._replace(steps=100_000), seed=3)
    for array, old in zip(policy.memory.network, before, strict=True):
        np.testing.assert_array_equal(array, old)


# ------------------------------------------------------------------------------ contract


def test_the_file_holds_its_contract(learned, tmp_path, capsys):
    case, policy = learned
    save_policy(tmp_path / "policy.npz", policy)
    header = read_header(tmp_path / "policy.npz")
    assert header.pop("format") == FORMAT
    assert header.pop("settings") == json.loads(json.dumps(asdict(case.settings)))
    assert header == policy.contract()
    assert header["observation"] == ["x [m]", "x_dot [m/s]", "theta [rad]", "theta_dot [rad/s]"]
    assert "right (+F)" in header["action"]
    assert header["force [N]"] == Parameters().force
    assert header["time step [s]"] == Parameters().time_step
    assert header["task"] == LEARNED_ON
    assert ("history" in header) == (case.agent == "adaptive-lqr")
    assert run(["show", str(tmp_path / "policy.npz")]) == 0
    assert describe(policy.contract()) in capsys.readouterr().out


def test_the_contract_states_the_normalisation_of_the_settings():
    told = {}
    for agent in ("reinforce", "q-learning", "random-search"):
        case = make_case(agent)
        memory = case.settings.agent(np.random.default_rng(0))
        told[agent] = learned_policy(case, 0, 0, memory).contract()["normalisation"]
    settings = AGENTS.settings("reinforce")["default"]
    scales = [settings.x_scale, settings.x_dot_scale, settings.theta_scale]
    assert told["reinforce"] == {"divided by": [*scales, settings.theta_dot_scale]}
    settings = AGENTS.settings("q-learning")["default"]
    edges = [settings.x_edges, settings.x_dot_edges, settings.theta_edges, settings.theta_dot_edges]
    assert told["q-learning"] == {"cut at": [list(some) for some in edges]}
    assert told["random-search"] == "none"


def test_a_policy_names_its_plant_unless_it_is_the_equations(tmp_path):
    path = str(tmp_path / "policy.npz")
    assert run(["learn", "random-search", "--plant", "mujoco", "--quiet", "--save", path]) == 0
    assert load_policy(path).task == LEARNED_ON | {
        "steps": 60_000,
        "plant": describe_plant(Mujoco()),
    }
    assert run(["export", path, str(tmp_path / "policy.json")]) == 0
    assert load_policy(tmp_path / "policy.json").task == load_policy(path).task
    assert run(["play", path, "--steps", "100", "--episodes", "1"]) == 0


def test_show_escapes_what_a_terminal_would_obey(path, capsys):
    change_header(lambda header: header.update({"x\x1b[2J": "\x1b]0;title\x07"}))(path)
    assert run(["show", str(path)]) == 0
    assert capsys.readouterr().out.replace("\n", "").isprintable()
    assert run(["show", str(path), "--format", "json"]) == BAD_USE
    assert "format of a policy is 'json'; it must be one of text" in capsys.readouterr().err


def test_a_file_without_the_newer_parts_of_the_contract_is_read(path):
    def forget(header):
        for name in ("normalisation", "force [N]", "time step [s]"):
            header.pop(name)

    change_header(forget)(path)
    assert load_policy(path).task == LEARNED_ON


# ------------------------------------------------------------------------------ bad files


def rewrite(path, arrays, **options):
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays, **options)


def arrays_of(path):
    with np.load(path) as archive:
        return dict(archive)


def change_arrays(change):
    def damage(path):
        arrays = arrays_of(path)
        change(arrays)
        rewrite(path, arrays)

    return damage


def change_header(change):
    def damage(path):
        arrays = arrays_of(path)
        header = json.loads(str(arrays["header"]))
        change(header)
        rewrite(path, arrays | {"header": np.array(json.dumps(header))})

    return damage


def change_task(**values):
    return change_header(lambda header: header["task"].update(values))


def change_settings(**values):
    return change_header(lambda header: header["settings"].update(values))


STAGE = {"task": {}, "trials": 1, "steps": 20, "balanced": False}


def change_stages(stages):
    return change_header(lambda header: header.update(stages=stages))


def of_agent(agent, **changes):
    """Return damage that makes the file that of another agent, with bad settings."""

    def change(header):
        header["agent"] = agent
        header["settings"] = asdict(AGENTS.settings(agent)["default"]) | changes

    return change_header(change)


def replace_header(text):
    return change_arrays(lambda arrays: arrays.update(header=np.array(text)))


def member(array, rest=b"", shape=None):
    """Return a NumPy file, which may claim another shape and have trailing bytes."""
    written = io.BytesIO()
    described = {"descr": array.dtype.str, "fortran_order": False, "shape": shape or array.shape}
    np.lib.format.write_array_header_1_0(written, described)
    return written.getvalue() + array.tobytes() + rest


def replace_member(name, data, packing=zipfile.ZIP_DEFLATED):
    def damage(path):
        with zipfile.ZipFile(path) as archive:
            members = {each: archive.read(each) for each in archive.namelist()}
        with zipfile.ZipFile(path, "w", packing) as archive:
            for each, old in members.items():
                archive.writestr(each, data if each == name else old)

    return damage


def damage_cut(path):
    path.write_bytes(path.read_bytes()[:-100])


def damage_pickle(path):
    with path.open("wb") as file:
        np.savez(file, header=np.array([{"format": "a pickled object"}], dtype=object))


def damage_twice(path):
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr("weights.npy", archive.read("weights.npy"))


def damage_encrypted(path):
    content = bytearray(path.read_bytes())
    for signature, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = content.find(signature)
        content[at + offset] |= 1
    path.write_bytes(content)


EDGES = ("x_edges", "x_dot_edges", "theta_edges", "theta_dot_edges")
BOMB = bytes(100_000_000)
BAD_FILES = {
    "cut": (damage_cut, "damaged"),
    "text": (lambda path: path.write_text("hello"), "not a policy's file"),
    "gone": (lambda path: path.unlink(), "no such file"),
    "encrypted": (damage_encrypted, "cannot be read"),
    "packed otherwise": (
        replace_member("weights.npy", member(np.zeros(4)), zipfile.ZIP_LZMA),
        "compressed in an unknown way",
    ),
    # Objects
    "pickled header": (damage_pickle, "its header is not a text"),
    "pickled weights": (
        change_arrays(lambda arrays: arrays.update(weights=np.array([print] * 4, dtype=object))),
        "weights is object",
    ),
    # Members
    "missing": (change_arrays(lambda arrays: arrays.pop("weights")), r"\['weights.npy'\]"),
    "extra": (change_arrays(lambda arrays: arrays.update(more=np.zeros(1))), r"\['more.npy'\]"),
    "twice": (damage_twice, "twice"),
    "no header": (change_arrays(lambda arrays: arrays.pop("header")), "header.npy"),
    "no array": (replace_member("weights.npy", b"hello" * 99), "magic"),
    # Arrays
    "shape": (
        change_arrays(lambda arrays: arrays.update(weights=np.zeros(5))),
        r"weights is float64 of shape \(5,\); it must be float64 of shape \(4,\)",
    ),
    "type": (
        change_arrays(lambda arrays: arrays.update(weights=np.zeros(4, np.float32))),
        "weights is float32",
    ),
    "infinite": (
        change_arrays(lambda arrays: arrays.update(weights=np.array([0, 1, np.inf, 0]))),
        "weights holds a number that is not finite",
    ),
    "not a number": (
        change_arrays(lambda arrays: arrays.update(scales=np.full(4, np.nan))),
        "scales holds a number that is not finite",
    ),
    "claims much": (
        replace_member("weights.npy", member(np.zeros(4), shape=(10**10,))),
        r"weights is float64 of shape \(10000000000,\)",
    ),
    "holds much": (replace_member("weights.npy", member(np.zeros(4), BOMB)), "longer"),
    "holds little": (replace_member("weights.npy", member(np.zeros(4))[:-1]), "shorter"),
    # Header
    "no JSON": (replace_header("{format"), "cannot be read"),
    "no dictionary": (replace_header("[1, 2]"), "its format is"),
    "deep": (replace_header("[" * 100_000), "cannot be read"),
    "empty header": (replace_header(""), "cannot be read"),
    "long header": (replace_header("x" * 2_000_000), "not a text of at most"),
    "header of numbers": (replace_header(3.0), "not a text"),
    "header claims much": (
        replace_member("header.npy", member(np.array("{}"), shape=(10**10,))),
        "not a text",
    ),
    "header holds much": (replace_member("header.npy", member(np.array("{}"), BOMB)), "longer"),
    "no character": (
        replace_member("header.npy", member(np.array("{}")).replace(b"{", b"\xff" * 4)),
        "cannot be read",
    ),
    "format": (change_header(lambda header: header.update(format="upright policy 99")), FORMAT),
    "no format": (change_header(lambda header: header.pop("format")), FORMAT),
    "no agent": (change_header(lambda header: header.pop("agent")), "agent"),
    "agents": (change_header(lambda header: header.update(agent=["os:system"])), "agent"),
    "no task": (change_header(lambda header: header.update(task=None)), "task"),
    "unknown agent": (
        change_header(lambda header: header.update(agent="nobody")),
        "'nobody'; it must be one of adaptive-lqr",
    ),
    "agent's path": (
        change_header(lambda header: header.update(agent="../x")),
        "named module:name",
    ),
    # Contract
    "units": (
        change_header(lambda header: header["observation"].__setitem__(2, "theta [deg]")),
        r"its observation is .*\[deg\].*must be .*\[rad\]",
    ),
    "force": (
        change_header(lambda header: header.update({"force [N]": 1.0})),
        r"force \[N\] is 1.0; it must be 10.0",
    ),
    # Task
    "noise": (change_task(noise="loud"), "noise is 'loud'; it must be one of none"),
    "start": (change_task(start=1), "start is 1; it must be one of random"),
    "integrator": (change_task(integrator=["euler"]), "integrator is"),
    "condition": (change_task(condition="*/ #error"), "condition is"),
    "steps": (change_task(steps=10**12), "steps is"),
    "seed": (change_task(seed="*/"), "seed is"),
    "plant": (change_task(plant="moon"), "plant is 'moon'; it must be one of equations"),
    "more of a task": (
        change_task(weather="fair"),
        "part of a task is 'weather'; it must be one of noise, .* parameters",
    ),
    "less of a task": (
        change_header(lambda header: header["task"].pop("steps")),
        "its task does not state steps",
    ),
    "trials": (change_task(trials=0), "trials is 0"),
    "parameters": (change_task(parameters={"mass": 1.0}), "parameter is 'mass'"),
    "a parameter": (change_task(parameters={"half_length": "1"}), "half_length is '1'"),
    "list of parameters": (
        change_task(parameters=[9.8]),
        "must be Parameters, or map names to numbers",
    ),
    "list of plants": (change_task(plant=["mujoco"]), "plant is .*mujoco.*; it must state"),
    "plant's name": (change_task(plant={"integrator": "rk4"}), "plant is ''; it must be one of"),
    "plant's integrator": (
        change_task(plant={"name": "equations", "integrator": "magic"}),
        "integrator is 'magic'; it must be one of euler",
    ),
    "more of a plant": (
        change_task(plant={"name": "equations", "integrator": "euler", "colour": 1}),
        "'colour' are not those of equations",
    ),
    # Stages
    "stages": (change_stages("many"), "stages is 'many'; it must be a list"),
    "many stages": (change_stages([STAGE] * 501), "number of stages is 501; .* at most 500"),
    "a stage": (change_stages([3]), "a stage is 3"),
    "task of a stage": (change_stages([{"trials": 1}]), "task of a stage is None"),
    "trials of a stage": (change_stages([STAGE | {"trials": -1}]), "trials of a stage is -1"),
    "outcome of a stage": (change_stages([STAGE | {"balanced": 2}]), "balanced of a stage is 2"),
    "source of a stage": (change_stages([STAGE | {"from": "x"}]), "from of a stage is 'x'"),
    "digest of a stage": (
        change_stages([STAGE | {"from": {"file": "x", "sha256": "00"}}]),
        "sha256 of a stage is '00'",
    ),
    # Settings
    "impossible": (
        change_settings(x_scale=-1),
        "x_scale is -1.0; it must be a number, at least 1e-09",
    ),
    "endless": (change_settings(x_scale=float("inf")), "x_scale is inf"),
    "too large": (change_settings(x_scale=10**400), "cannot be read"),
    "words": (change_settings(x_scale="1"), "x_scale is '1'; it must be like 2.4"),
    "unknown": (change_settings(tempo=1), "the settings .*'tempo' are not those of random-search"),
    "lacking": (change_header(lambda header: header["settings"].pop("x_scale")), "are not those"),
    "many steps": (
        of_agent("reinforce", episodes=10**6, kept_steps=10**6),
        r"episodes \* kept_steps is 1000000000000; it must be .* at most 5,000,000",
    ),
    "many edges": (
        of_agent("q-learning", mirrored=False, x_edges=[i / 1000 for i in range(1000)]),
        "the number of x_edges is 1000; it must be .* at most 100",
    ),
    "many boxes": (
        of_agent("ase-ace", mirrored=False, **{name: [*range(90)] for name in EDGES}),
        "the number of boxes is 68574961; it must be .* at most 1,000,000",
    ),
    "no truth": (of_agent("q-learning", mirrored="yes"), "mirrored is 'yes'; it must be like True"),
    "large network": (of_agent("ndp", hidden=10**9), "hidden is 1000000000"),
}


@pytest.mark.parametrize(("damage", "said"), BAD_FILES.values(), ids=BAD_FILES)
def test_a_bad_file_is_refused_without_using_much_memory(damage, said, path):
    damage(path)
    tracemalloc.start()
    with pytest.raises(UprightError, match=rf"policy\.npz.*{said}") as error:
        load_policy(path)
    assert "\n" not in str(error.value)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 20_000_000


@pytest.mark.slow
def test_whatever_byte_is_damaged_the_policy_is_the_same_or_refused(content, path):
    expected = load_policy(path).memory.weights.tolist()
    refused = 0
    for i in range(len(content)):
        path.write_bytes(content[:i] + bytes([content[i] ^ 0x55]) + content[i + 1 :])
        try:
            assert load_policy(path).memory.weights.tolist() == expected
        except UprightError:
            refused += 1
    assert refused > len(content) / 2


def test_the_largest_settings_take_a_quarter_of_a_gigabyte():
    settings = Reinforce(episodes=MOST_KEPT // 10**6, kept_steps=10**6)
    episodes = settings.agent(np.random.default_rng(0)).episodes
    assert sum(array.nbytes for array in episodes) < 2**28


# ------------------------------------------------------------------------------ foreign code

TRAP = """\
from pathlib import Path

import numpy as np
from typing import NamedTuple

Path("sprung").touch()


class Agent(NamedTuple):
    weights: np.ndarray

    def push_probability(self, observation): return 0.5
    def begin_trial(self, rng): ...
    def act(self, observation, rng): ...
    def learn(self, before, action, after, fallen): ...
    def end_trial(self, fallen): ...


def agent(rng):
    return Agent(np.zeros(4))
"""


@pytest.fixture
def trap(path, monkeypatch):
    """A policy whose agent is a module in this folder; it leaves a file when it is imported."""
    monkeypatch.chdir(path.parent)
    monkeypatch.syspath_prepend(str(path.parent))
    Path("foreign.py").write_text(TRAP)

    def change(header):
        for name in ("normalisation", "history"):
            header.pop(name, None)
        header.update(agent="foreign:agent", settings={"agent_name": "foreign:agent"})

    change_header(change)(path)
    change_arrays(lambda arrays: arrays.pop("scales"))(path)
    yield path
    sys.modules.pop("foreign", None)


@pytest.mark.parametrize("named", [None, "other:agent", "reinforce"])
def test_code_that_a_file_names_is_not_run(named, trap):
    with pytest.raises(UprightError, match=r"policy\.npz.*'foreign:agent'"):
        load_policy(trap, agent=named)
    assert not Path("sprung").exists()


def test_no_command_runs_code_that_a_file_names(trap, capsys):
    for line in ("plot policy", "plot phases", "export"):
        output = [] if line.startswith("plot") else ["policy.h"]
        assert run([*line.split(), str(trap), *output]) == BAD_USE
        assert "--agent MODULE:NAME" in capsys.readouterr().err
    assert run(["show", str(trap)]) == 0
    assert 'agent: "foreign:agent"' in capsys.readouterr().out
    assert not Path("sprung").exists()


def test_settings_cannot_name_other_code(trap):
    change_settings(agent_name="foreign:agent")(trap)
    change_header(lambda header: header.update(agent="examples.trusted:agent"))(trap)
    with pytest.raises(UprightError, match=r"foreign:agent.*not those of 'examples.trusted:agent'"):
        load_policy(trap, agent="examples.trusted:agent")
    assert not Path("sprung").exists()


def test_code_that_the_caller_names_is_run(trap, capsys):
    policy = load_policy(trap, agent="foreign:agent")
    assert Path("sprung").exists()
    assert policy.push_probability(State(0.0, 0.0, 0.0, 0.0)) == 0.5
    assert run(["plot", "policy", str(trap), "--agent", "foreign:agent"]) == 0
    assert run(["export", str(trap), "policy.h", "--agent", "foreign:agent"]) == BAD_USE
    assert "cannot be exported" in capsys.readouterr().err


def test_objects_are_refused_even_of_an_agent_that_has_them(trap):
    Path("foreign.py").write_text(TRAP.replace("np.zeros(4)", "np.zeros(4, dtype=object)"))
    change_arrays(lambda arrays: arrays.update(weights=np.array([1] * 4, dtype=object)))(trap)
    with pytest.raises(UprightError, match=r"weights is object .* never objects"):
        load_policy(trap, agent="foreign:agent")
    assert run(["learn", "foreign:agent", "--save", "mine.npz"]) == BAD_USE


def test_a_built_in_agent_may_be_named_too(path):
    assert load_policy(path, agent="random-search").task == LEARNED_ON
    with pytest.raises(UprightError, match="learned by 'random-search', not by 'reinforce'"):
        load_policy(path, agent="reinforce")
