import ctypes
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import onnx
import onnxruntime
import pytest
from helpers import ROOT, make_task

from upright.agents import AGENTS
from upright.agents.parts.history import BLOCK
from upright.agents.parts.policy_form import Layer, Network, Table
from upright.agents.q_learning import QLearning
from upright.commands import run
from upright.core.parameters import State
from upright.core.task import TaskSpec
from upright.core.trials import trial
from upright.errors import UprightError
from upright.plants.equations import equations
from upright.policies.c99 import encode as c_header
from upright.policies.files import export_policy, load_policy, save_policy
from upright.policies.form_player import make_memory
from upright.policies.greedy import GREEDY_ACTION, greedy_form
from upright.policies.onnx import IR_VERSION, OPSET
from upright.policies.onnx import encode as onnx_model
from upright.policies.policy import Policy
from upright.studies.case import make_case
from upright.studies.learned import learned_policy
from upright.studies.run import make_run
from upright.support.exit_status import BAD_USE

COUNT = 10_000
FLAGS = "-Wall -Wextra -Werror -pedantic -Wconversion -Wfloat-conversion -Wdouble-promotion"
REALS = {"float64": (np.float64, []), "float32": (np.float32, ["-DUPRIGHT_FLOAT32"])}
PROGRAM = """\
#include "policy.h"

#ifndef ANSWER
#define ANSWER upright_push_probability
#endif

extern void evaluate(int, const upright_real *, upright_real *, upright_real *);

void evaluate(int count, const upright_real *observations, upright_real *histories,
              upright_real *probabilities)
{
    for (int i = 0; i < count; i++) {
#ifdef UPRIGHT_HISTORY
        probabilities[i] = (upright_real)ANSWER(
            observations + 4 * i, histories + UPRIGHT_HISTORY * i);
#else
        (void)histories;
        probabilities[i] = (upright_real)ANSWER(observations + 4 * i);
#endif
    }
}
"""

needs_gcc = pytest.mark.skipif(not shutil.which("gcc"), reason="gcc is missing: no C is compiled")


class Learned(NamedTuple):
    """A policy, measurements, what it saw before them, and what it answers in Python."""

    policy: Policy
    observations: np.ndarray
    histories: np.ndarray
    probabilities: np.ndarray

    @property
    def past(self):
        return getattr(self.policy.form, "past", 0)

    @property
    def close(self):
        """Where the last sum is so near zero that its sign may differ in float32."""
        if isinstance(self.policy.form, Table):
            return np.zeros(COUNT, np.bool_)
        *hidden, (weights, unit) = self.policy.form.layers
        if unit == "sigmoid":
            return np.zeros(COUNT, np.bool_)
        inputs = self.observations / (self.policy.form.scales or 1.0)
        for layer, kind in hidden:
            assert kind == "tanh"
            inputs = np.tanh(inputs @ layer)
        if self.past:
            first = self.histories[:, :1] == 0
            blocks = np.concatenate([np.zeros((COUNT, 1)), self.observations], axis=1)
            seen = np.where(first, np.tile(blocks, self.past), self.histories)
            inputs = np.concatenate([inputs, seen], axis=1)
        terms = inputs * weights[:, 0]
        return np.abs(terms.sum(axis=1)) < 1e-5 * np.abs(terms).sum(axis=1)


def draw_observations(edges):
    """Return measurements that float32 holds: in the limits, beyond, and on edges of boxes."""
    rng = np.random.default_rng(3)
    wide = rng.choice([0.1, 1.0, 10.0], (COUNT, 1)) * [2.4, 3.0, 0.21, 3.0]
    observations = rng.uniform(-wide, wide).astype(np.float32)
    for i, some in enumerate(edges):
        nearest = np.float32(some)
        values = [nearest, np.nextafter(nearest, np.float32(9)), np.nextafter(nearest, -nearest)]
        observations[: COUNT // 2, i] = rng.choice(np.concatenate(values), COUNT // 2)
    return observations.astype(np.float64)


def ask(policy):
    """Let a policy answer; where it has a history, in trials of 20 steps."""
    past = getattr(policy.form, "past", 0)
    observations = draw_observations(getattr(policy.form, "edges", ()))
    histories, probabilities = np.zeros((COUNT, BLOCK * past)), np.zeros(COUNT)
    for i, point in enumerate(observations):
        if i % 20 == 0:
            policy.begin_trial(None)
        elif past:
            histories[i] = policy.memory.regressor[BLOCK:]
        probabilities[i] = policy.push_probability(point)
        policy.learn(State(*point), probabilities[i] > 0.5, None, False)
    return Learned(policy, observations, histories, probabilities)


@pytest.fixture(scope="module", params=[*AGENTS, "q-learning, as published"])
def learned(request):
    agent, _, label = request.param.partition(", ")
    case = make_case(agent, "as-published" if label else "default", steps=2000, trials=100)
    memory, _ = make_run(case, 0, 0)
    found = ask(learned_policy(case, 0, 0, memory))
    assert 0.1 < found.probabilities.mean() < 0.9
    return found


# ------------------------------------------------------------------------------ C99


def compile_c(folder, header, flags=(), compiler=("gcc", "-std=c99")):
    (folder / "policy.h").write_text(header)
    (folder / "program.c").write_text(PROGRAM)
    line = [
        *compiler,
        *FLAGS.split(),
        *flags,
        "-shared",
        "-fPIC",
        "-o",
        "policy.so",
        "program.c",
        "-lm",
    ]
    subprocess.run(line, cwd=folder, check=True)


class InC:
    """A policy in C, as an agent."""

    def __init__(self, folder, policy, real="float64"):
        self.kind, flags = REALS[real]
        flags = [*flags, "-DANSWER=upright_push_right"] if policy.greedy else flags
        compile_c(folder, c_header(policy), flags)
        self.library = ctypes.CDLL(str(folder / "policy.so"))
        self.history = np.zeros((1, BLOCK * getattr(policy.form, "past", 0)), self.kind)

    def evaluate(self, observations, histories):
        probabilities = np.zeros(len(observations), self.kind)
        arrays = (np.ascontiguousarray(observations, self.kind), histories, probabilities)
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in arrays]
        self.library.evaluate(len(observations), *pointers)
        return probabilities

    def begin_trial(self, rng):
        self.history[:] = 0

    def act(self, observation, rng):
        return bool(rng.random() < self.evaluate([observation], self.history)[0])

    def learn(self, before, action, after, fallen): ...

    def end_trial(self, fallen): ...


@needs_gcc
@pytest.mark.parametrize("real", REALS)
def test_c_answers_as_python_does(real, learned, tmp_path):
    compiled = InC(tmp_path, learned.policy, real)
    answers = compiled.evaluate(learned.observations, learned.histories.astype(compiled.kind))
    expected = learned.probabilities.astype(compiled.kind)
    if isinstance(learned.policy.form, Table):
        np.testing.assert_array_equal(answers, expected)
    elif real == "float64":
        np.testing.assert_allclose(answers, expected, rtol=0, atol=1e-12)
    else:
        assert learned.close.sum() < COUNT / 1000
        far = ~learned.close
        np.testing.assert_allclose(answers[far], expected[far], rtol=0, atol=1e-5)


@needs_gcc
@pytest.mark.parametrize("real", REALS)
def test_greedy_c_returns_the_likelier_push(real, learned, tmp_path):
    compiled = InC(tmp_path, replace(learned.policy, greedy=True), real)
    answers = compiled.evaluate(learned.observations, learned.histories.astype(compiled.kind))
    compared = np.ones(COUNT, np.bool_)
    if real == "float32" and not isinstance(learned.policy.form, Table):
        compared = ~learned.close & (np.abs(learned.probabilities - 0.5) > 1e-5)
    assert compared.mean() > 0.99
    np.testing.assert_array_equal(answers[compared], learned.probabilities[compared] > 0.5)
    header = (tmp_path / "policy.h").read_text()
    assert "static inline int upright_push_right(" in header
    assert "upright_push_probability" not in header
    assert GREEDY_ACTION in " ".join(header.replace("\n *", " ").split())


@needs_gcc
def test_c_keeps_the_history(learned, tmp_path):
    compiled = InC(tmp_path, learned.policy)
    for i, (observation, history) in enumerate(
        zip(learned.observations[:200], learned.histories, strict=False)
    ):
        if i % 20 == 0:
            compiled.begin_trial(None)
        np.testing.assert_array_equal(compiled.history[0], history)
        compiled.evaluate([observation], compiled.history)


@needs_gcc
def test_c_balances_as_python_does(learned, tmp_path):
    task = make_task(steps=3000)
    lengths = [
        [trial(agent, equations(), task, np.random.default_rng(seed))[0] for seed in range(5)]
        for agent in (InC(tmp_path, learned.policy), learned.policy)
    ]
    assert lengths[0] == lengths[1]
    if learned.policy.agent in ("reinforce", "adaptive-lqr"):
        assert lengths[0] == [3000] * 5


@pytest.mark.skipif(not shutil.which("g++"), reason="g++ is missing: no C++ is compiled")
@pytest.mark.parametrize("flags", [flags for _, flags in REALS.values()], ids=list(REALS))
def test_the_header_compiles_as_cpp(flags, learned, tmp_path):
    compile_c(tmp_path, c_header(learned.policy), flags, ("g++", "-x", "c++", "-std=c++11"))


def test_the_header_begins_with_the_contract(learned):
    comment = " ".join(c_header(learned.policy).partition("*/")[0].replace("\n *", " ").split())
    for name, value in learned.policy.contract().items():
        assert f"{name}: {json.dumps(value)}" in comment


@needs_gcc
def test_nothing_that_a_policy_says_of_itself_ends_the_comment(tmp_path):
    told = {"name": "mujoco", "*/ #error": "*/ */*/ /* */", "x *": "/ */"}
    case = make_case("random-search")
    policy = learned_policy(case, 0, 0, case.settings.agent(np.random.default_rng(0)))
    header = c_header(replace(policy, plant=told))
    assert header.count("*/") == c_header(policy).count("*/")
    shown = " ".join(header.partition("*/")[0].replace("\n *", " ").split())
    task = json.loads(re.search("task: ({.*}) observation:", shown)[1])
    assert task["plant"] == told
    compile_c(tmp_path, header)


# ------------------------------------------------------------------------------ ONNX


def in_onnx(policy):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    return onnxruntime.InferenceSession(onnx_model(policy), options, ["CPUExecutionProvider"])


def inputs(learned, rows):
    fed = {"observation": learned.observations[rows].astype(np.float32)}
    if learned.past:
        fed["history"] = learned.histories[rows].astype(np.float32)
    return fed


def test_greedy_onnx_returns_the_likelier_push(learned):
    greedy = replace(learned.policy, greedy=True)
    session = in_onnx(greedy)
    names = ["push_right"] + (["next_history"] if learned.past else [])
    assert [each.name for each in session.get_outputs()] == names
    answers = session.run(["push_right"], inputs(learned, slice(COUNT)))[0]
    assert (answers.dtype, answers.shape) == (np.int64, (COUNT, 1))
    np.testing.assert_array_equal(answers[:, 0], learned.probabilities > 0.5)
    metadata = onnx.load_from_string(onnx_model(greedy)).metadata_props
    told = {entry.key: json.loads(entry.value) for entry in metadata}
    assert told == learned.policy.contract() | {"action": GREEDY_ACTION}


@pytest.mark.parametrize("count", [1, COUNT])
def test_onnx_answers_as_python_does(count, learned):
    answers = in_onnx(learned.policy).run(["push_probability"], inputs(learned, slice(count)))[0]
    assert (answers.dtype, answers.shape) == (np.float32, (count, 1))
    expected = learned.probabilities[:count]
    np.testing.assert_allclose(answers[:, 0], expected, rtol=0, atol=1e-6)
    if learned.policy.agent != "reinforce":
        np.testing.assert_array_equal(answers[:, 0], expected.astype(np.float32))


def test_onnx_keeps_the_history(learned):
    session = in_onnx(learned.policy)
    names = {"observation"} | ({"history"} if learned.past else set())
    assert {each.name for each in session.get_inputs()} == names
    if not learned.past:
        assert [each.name for each in session.get_outputs()] == ["push_probability"]
        return
    following = session.run(["next_history"], inputs(learned, slice(COUNT)))[0]
    goes_on = np.arange(1, COUNT) % 20 != 0
    np.testing.assert_array_equal(following[:-1][goes_on], learned.histories[1:][goes_on])


def test_the_onnx_metadata_has_contract_and_versions(learned):
    model = onnx.load_from_string(onnx_model(learned.policy))
    told = {entry.key: json.loads(entry.value) for entry in model.metadata_props}
    assert told == learned.policy.contract()
    assert "theta_dot [rad/s]" in model.doc_string
    used = {name for node in model.graph.node for name in node.input}
    assert {constant.name for constant in model.graph.initializer} <= used
    assert model.ir_version == IR_VERSION
    assert [(each.domain, each.version) for each in model.opset_import] == [("", OPSET)]


def test_greedy_json_holds_sure_pushes_and_stays_greedy(learned, tmp_path):
    export_policy(tmp_path / "policy.json", learned.policy, greedy=True)
    entries = json.loads((tmp_path / "policy.json").read_text())
    assert entries["action"] == GREEDY_ACTION
    if entries["form"] == "table":
        assert set(entries["probabilities"]) == {0.0, 1.0}
    else:
        assert entries["layers"][-1]["unit"] in ("above zero", "not below zero")
    again = load_policy(tmp_path / "policy.json")
    assert again.greedy
    assert ask_again(again, learned) == (learned.probabilities[:2000] > 0.5).tolist()


def ask_again(policy, learned):
    """Return the pushes of a policy for the first measurements."""
    pushes = []
    for i, point in enumerate(learned.observations[:2000]):
        if i % 20 == 0:
            policy.begin_trial(None)
        pushes.append(policy.act(State(*point), None))  # without random numbers
        policy.learn(State(*point), pushes[-1], None, False)
    return pushes


def test_a_missing_onnx_is_reported_in_one_line(monkeypatch, tmp_path, capsys):
    path = saved("random-search", tmp_path)
    monkeypatch.setitem(sys.modules, "onnx", None)
    assert run(["export", str(path), str(tmp_path / "policy.onnx")]) == BAD_USE
    assert capsys.readouterr().err.endswith(
        "pip install 'onnx>=1.16' (the extra 'onnx' of upright)\n"
    )
    assert not (tmp_path / "policy.onnx").exists()


# ------------------------------------------------------------------------------ both


def examples(language):
    page = ROOT / "docs/policies.md"
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(), re.DOTALL)


@needs_gcc
def test_the_example_in_c_compiles(tmp_path):
    run(["export", str(saved("reinforce", tmp_path)), str(tmp_path / "policy.h")])
    (example,) = examples("c")
    called = set(re.findall(r"(\w+)\(\)", example))
    stubs = "".join(f"extern float {name}(void);\n" for name in sorted(called))
    stubs = stubs.replace("float wait_for_tick", "void wait_for_tick")
    (tmp_path / "main.c").write_text(f"{stubs}extern void push(float);\n{example}")
    subprocess.run(["gcc", "-std=c99", *FLAGS.split(), "-c", "main.c"], cwd=tmp_path, check=True)


def test_the_example_in_python_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(["export", str(saved("reinforce", tmp_path)), "policy.onnx"])
    (example,) = (each for each in examples("python") if "onnxruntime" in each)
    found = {}
    exec(example, found)
    assert 0.0 < found["probability"].item() < 1.0


def saved(agent, folder):
    case = make_case(agent, steps=20, trials=2)
    path = folder / "policy.npz"
    save_policy(path, learned_policy(case, 0, 0, make_run(case, 0, 0)[0]))
    return path


def test_a_policy_without_edges_has_one_box():
    edges = {"x_edges": (), "x_dot_edges": (), "theta_edges": (), "theta_dot_edges": ()}
    settings = QLearning(mirrored=False, **edges)
    memory = settings.agent(np.random.default_rng(0))
    memory.table[:] = [0.0, 1.0]
    case = make_case("q-learning")
    policy = learned_policy(case, 0, 0, memory)
    assert policy.push_probability(State(0.0, 0.0, 0.0, 0.0)) == 1.0
    assert "int box = 0;\n    box *= 1;" in c_header(policy)
    assert in_onnx(policy).run(None, {"observation": np.zeros((1, 4), np.float32)})[0] == 1.0


def test_a_greedy_form_is_sure_and_pushes_left_where_both_are_equal():
    table = Table(((), (), (0.0,), ()), (0.5, 0.5 + 1e-9))
    assert greedy_form(table).probabilities == (0.0, 1.0)
    layer = Layer(np.array([[0.0], [0.0], [1.0], [0.0]]), "sigmoid")
    assert greedy_form(Network((layer,))).layers[0].unit == "above zero"
    policy = Policy("mine:Agent", make_memory(Network((layer,))), TaskSpec(), greedy=True)
    points = [State(0.0, 0.0, theta, 0.0) for theta in (-1e-9, 0.0, 1e-9)]
    assert [policy.act(point, None) for point in points] == [False, False, True]
    assert [policy.push_probability(point) for point in points] == [0.0, 0.0, 1.0]


def test_the_file_extension_selects_the_format(tmp_path, capsys):
    path = saved("reinforce", tmp_path)
    assert run(["export", str(path), str(tmp_path / "policy.h")]) == 0
    assert run(["export", str(path), str(tmp_path / "policy.onnx")]) == 0
    assert (tmp_path / "policy.h").read_text().startswith("/*\n * A policy learned by reinforce")
    assert run(["export", str(path), str(tmp_path / "greedy.h"), "--greedy"]) == 0
    assert "int upright_push_right(" in (tmp_path / "greedy.h").read_text()
    onnx.checker.check_model(str(tmp_path / "policy.onnx"))
    assert "exported" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("output", "said"),
    [
        ("policy.txt", "'policy.txt' is '.txt'; it must be one of .h, .onnx"),
        ("policy", "it must be one of .h, .onnx"),
        ("missing/policy.h", "its folder does not exist"),
    ],
)
def test_export_refuses_what_it_cannot_write(output, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(["export", "absent.npz", output]) == BAD_USE  # before the policy is looked for
    assert said in capsys.readouterr().err
    assert run(["export", "absent.npz", "policy.h"]) == BAD_USE
    assert "'absent.npz'; there is no such file" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


class Formless(NamedTuple):
    """A memory that gives probabilities, but not how it computes them."""

    def push_probability(self, observation):
        return 0.5


@pytest.mark.parametrize("ending", [".h", ".onnx"])
def test_a_policy_without_a_form_is_refused(ending, tmp_path):
    with pytest.raises(UprightError, match=r"'mine:Agent'.*cannot be exported.*policy_form\(\)"):
        export_policy(tmp_path / f"policy{ending}", Policy("mine:Agent", Formless(), TaskSpec()))
    assert list(tmp_path.iterdir()) == []
