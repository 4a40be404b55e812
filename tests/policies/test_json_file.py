"""Policies as JSON: the bridge to other languages."""

import copy
import json
import math
import tracemalloc
from typing import NamedTuple

import numpy as np
import pytest
from helpers import LEARNED_ON
from hypothesis import given, settings
from hypothesis import strategies as st

from upright.agents import AGENTS
from upright.agents.parts.history import BLOCK
from upright.agents.parts.policy_form import Layer, Network, Table
from upright.agents.q_learning import QLearning
from upright.commands import run
from upright.core.parameters import State
from upright.core.task import TaskSpec
from upright.errors import UprightError
from upright.policies.c99 import encode as c_header
from upright.policies.checks import JSON_LIMIT, JSON_MARKS, LONGEST_ERROR
from upright.policies.files import export_policy, load_policy, read_header, save_policy
from upright.policies.form_json import MOST_LAYERS, MOST_WEIGHTS, UNITS, form_entries, restore_form
from upright.policies.form_player import make_memory
from upright.policies.json_file import JSON_FORMAT
from upright.policies.policy import Policy, describe
from upright.studies.case import make_case
from upright.studies.learned import learned_policy
from upright.studies.playing import case_for, play_trials
from upright.studies.run import make_run
from upright.support.exit_status import BAD_USE

COUNT = 5_000
HARD = {"noise": "all-10", "start": "wide", "condition": "delay-2", "steps": 3000}
"""A task on which trials vary much in length."""
LESS = {name: value for name, value in LEARNED_ON.items() if name != "noise"}
HEADER = {"format": JSON_FORMAT, "agent": "q-learning", "task": LEARNED_ON}
TABLE = HEADER | {
    "form": "table",
    "edges": [[-0.8, 0.8], [], [0], [-0.5, 0.0, 0.5]],
    "probabilities": [i / 23 for i in range(24)],
}
NETWORK = HEADER | {
    "form": "network",
    "layers": [
        {"unit": "isrlu", "weights": [[0.1, -2], [0.3, 4e-3], [-5.0, 6], [0, 0.8]]},
        {"unit": "sigmoid", "weights": [[1.5], [-2.5]]},
    ],
    "scales": [2.4, 1.5, 0.1, 0.5],
    "past": 0,
}
PAST = HEADER | {
    "form": "network",
    "layers": [{"unit": "above zero", "weights": [[i / 7 - 1] for i in range(4 + 2 * BLOCK)]}],
    "scales": None,
    "past": 2,
}
FORMS = {"table": TABLE, "network": NETWORK, "past": PAST}


class Saved(NamedTuple):
    """A learned policy, and the two files it is kept in."""

    policy: Policy
    npz: str
    json: str


@pytest.fixture(scope="module", params=AGENTS)
def saved(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("policy")
    # Too few trials to balance reliably; adaptive LQR would need only one.
    steps = 20 if request.param == "adaptive-lqr" else 2000
    case = make_case(request.param, trials=5, steps=steps, start="zero")
    policy = learned_policy(case, 0, 0, make_run(case, 0, 0)[0])
    save_policy(folder / "policy.npz", policy)
    found = Saved(policy, str(folder / "policy.npz"), str(folder / "policy.json"))
    assert run(["export", found.npz, found.json]) == 0
    return found


@pytest.fixture
def path(tmp_path):
    return tmp_path / "policy.json"


def read(path, entries):
    path.write_text(json.dumps(entries))
    return load_policy(path)


def measurements(edges):
    """Return measurements in the limits and beyond, some on edges of boxes."""
    rng = np.random.default_rng(3)
    points = rng.choice([0.1, 1.0, 10.0], (COUNT, 1)) * [2.4, 3.0, 0.21, 3.0]
    points = rng.uniform(-points, points)
    for i, some in enumerate(edges):
        points[:100, i] = rng.choice(some or (0.0,), 100)
    return points


# ------------------------------------------------------------------------------ the same policy


def test_answers_are_those_of_the_agent(saved):
    policy, again = saved.policy, load_policy(saved.json)
    exact = policy.agent != "reinforce"
    probabilities = []
    for i, point in enumerate(measurements(getattr(policy.form, "edges", ()))):
        if i % 20 == 0:
            policy.begin_trial(None)
            again.begin_trial(None)
        probabilities.append(policy.push_probability(point))
        answer = again.push_probability(point)
        assert answer == probabilities[-1] if exact else abs(answer - probabilities[-1]) < 1e-15
        for each in (policy, again):
            each.learn(State(*point), probabilities[-1] > 0.5, None, False)
    assert 0.01 < np.mean(probabilities) < 0.99


def test_trials_are_those_of_the_agent(saved):
    first, second = load_policy(saved.npz), load_policy(saved.json)
    trials = [
        list(play_trials(each, case_for(each, **HARD), 8, seed=3)) for each in (first, second)
    ]
    assert trials[0] == trials[1]
    assert len({trial.steps for trial in trials[0]}) > 1


def test_form_and_contract_survive_a_round_trip(saved):
    again = load_policy(saved.json)
    assert form_entries(again.form) == form_entries(saved.policy.form)
    assert again.contract() == saved.policy.contract()
    assert c_header(again) == c_header(saved.policy)


def test_every_command_accepts_json(saved, tmp_path, capsys):
    again, picture = str(tmp_path / "again.json"), str(tmp_path / "policy.png")
    assert run(["play", saved.json, "--steps", "1", "--episodes", "2"]) == 0
    assert run(["export", saved.json, str(tmp_path / "policy.h")]) == 0
    assert run(["export", saved.json, again]) == 0
    assert run(["plot", "policy", saved.json, "--output", picture]) == 0
    capsys.readouterr()
    assert run(["show", again]) == 0
    shown = capsys.readouterr().out
    assert describe(saved.policy.contract()) in shown
    assert "form: " in shown
    assert len(shown) < 2000
    header = read_header(saved.json)
    assert (header.pop("format"), header.pop("form") in FORMS) == (JSON_FORMAT, True)
    assert header == saved.policy.contract()


@pytest.mark.parametrize("parameters", [{"half_length": -1}, {"length": 1}, {"gravity": "9.8"}])
def test_what_play_refuses_show_refuses_alike(parameters, path, capsys):
    task = LEARNED_ON | {"parameters": parameters}
    path.write_text(json.dumps(next(iter(FORMS.values())) | {"task": task}))
    said = []
    for command in ("play", "show"):
        assert run([command, str(path)]) == BAD_USE
        said.append(capsys.readouterr().err)
    assert said[0] == said[1]
    assert said[0].startswith(f"upright: error: policy is '{path}'; it cannot be read: ")


# ------------------------------------------------------------------------------ the format


@pytest.mark.parametrize("entries", FORMS.values(), ids=FORMS)
def test_minimal_files_are_read(entries, path):
    policy = read(path, entries)
    assert (policy.agent, policy.task) == ("q-learning", LEARNED_ON)
    assert form_entries(policy.form) == {k: v for k, v in entries.items() if k not in HEADER}


def test_a_network_computes_what_numpy_does():
    """Against NumPy, for every unit."""
    bend = {
        "isrlu": lambda s: np.where(s > 0, s, s / np.sqrt(1 + s * s)),
        "tanh": np.tanh,
        "sigmoid": lambda s: 1 / (1 + np.exp(-s)),
        "above zero": lambda s: 1.0 * (s > 0),
        "not below zero": lambda s: 1.0 * (s >= 0),
    }
    assert set(bend) == set(UNITS)
    rng = np.random.default_rng(0)
    for unit in UNITS:
        for last in ("sigmoid", "above zero", "not below zero"):
            weights = [rng.normal(size=shape) for shape in ((4, 7), (7, 3), (3, 1))]
            layers = tuple(map(Layer, weights, (unit, "tanh", last)))
            memory = make_memory(Network(layers, (1.0, 2.0, 3.0, 4.0)))
            for point in rng.normal(size=(100, 4)):
                values = point / [1, 2, 3, 4]
                for matrix, kind in layers:
                    values = bend[kind](values @ matrix)
                found = memory.push_probability(State(*point))
                np.testing.assert_allclose(found, values[0], rtol=0, atol=1e-14)


def test_threshold_units_at_zero():
    for unit, probability in (("above zero", 0.0), ("not below zero", 1.0)):
        memory = make_memory(Network((Layer(np.ones((4, 1)), unit),)))
        assert memory.push_probability(State(0.0, 0.0, 0.0, 0.0)) == probability


def test_a_history_counts_from_the_second_step_on():
    weights = np.zeros((4 + 2 * BLOCK, 1))
    weights[4 + BLOCK] = 1.0  # the push before last
    memory = make_memory(Network((Layer(weights, "above zero"),), past=2))
    state, heard = State(1.0, 2.0, 3.0, 4.0), []
    for push in (True, False, False):
        heard.append(memory.push_probability(state))
        memory.remember(state, push)
    heard.append(memory.push_probability(state))
    assert heard == [0.0, 0.0, 1.0, 0.0]
    np.testing.assert_array_equal(memory.history, [-1, 1, 2, 3, 4] * 2)
    memory.begin_trial(None)
    memory.remember(State(5.0, 6.0, 7.0, 8.0), True)
    np.testing.assert_array_equal(memory.history, [1, 5, 6, 7, 8, 0, 5, 6, 7, 8])


def test_a_measurement_on_an_edge_lies_in_the_box_below():
    memory = make_memory(Table(((), (), (0.5,), (-1.0, 1.0)), (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)))
    for theta, theta_dot, box in ((0.5, -1.0, 0), (0.5, 1.0, 1), (0.6, 1.1, 5), (-9.0, 9.0, 2)):
        assert memory.push_probability(State(9.0, 9.0, theta, theta_dot)) == box / 10


def narrow(first, second):
    """Return entries of a network of one hidden unit, its weights written so."""
    layers = [{"unit": "tanh", "weights": first}, {"unit": "above zero", "weights": second}]
    return NETWORK | {"layers": layers}


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        (narrow([1, 2, 3, 4], 5), narrow([[1], [2], [3], [4]], [[5]])),
        (
            NETWORK | {"layers": [*narrow([1, 2, 3, 4], [5, 6])["layers"], NETWORK["layers"][1]]},
            NETWORK
            | {
                "layers": [
                    *narrow([[1], [2], [3], [4]], [[5, 6]])["layers"],
                    NETWORK["layers"][1],
                ]
            },
        ),
        (PAST | {"layers": PAST["layers"][0], "scales": []}, PAST),
        (TABLE | {"edges": [[-0.8, 0.8], [], 0, [-0.5, 0.0, 0.5]]}, TABLE),
        (
            TABLE | {"edges": [[], [], [], []], "probabilities": 1},
            TABLE | {"edges": [[], [], [], []], "probabilities": [1.0]},
        ),
    ],
    ids=["columns", "row", "one layer, no null", "one edge", "one box"],
)
def test_a_list_of_one_may_stand_without_brackets(written, meant, path):
    assert form_entries(read(path, written).form) == form_entries(restore_form(meant))


def test_a_policy_without_edges_survives_a_round_trip(path):
    edges = {"x_edges": (), "x_dot_edges": (), "theta_edges": (), "theta_dot_edges": ()}
    memory = QLearning(mirrored=False, **edges).agent(np.random.default_rng(0))
    memory.table[:] = [0.0, 1.0]
    export_policy(path, learned_policy(make_case("q-learning"), 0, 0, memory))
    assert load_policy(path).push_probability(State(0.0, 0.0, 0.0, 0.0)) == 1.0


def test_descriptive_entries_may_be_reworded(path):
    policy = read(path, TABLE)
    words = {key: ["any"] for key in ("version", "normalisation", "history", "comment")}
    assert read(path, TABLE | policy.contract() | words).form == policy.form


def test_encoding_and_white_space_may_vary(path):
    for text in (json.dumps(TABLE, indent=4), "\n\t " + json.dumps(TABLE)):
        for encoding in ("utf-8", "utf-8-sig"):
            path.write_text(text, encoding)
            assert load_policy(path).task == LEARNED_ON


@pytest.mark.slow
def test_the_largest_forms_are_read(path):
    edges = [[*range(99)], [*range(99)], [*range(99)], []]
    assert len(read(path, TABLE | {"edges": edges, "probabilities": [1 / 3] * 10**6}).form[1])
    assert path.stat().st_size < JSON_LIMIT
    width = MOST_WEIGHTS // 5
    hidden = {"unit": "tanh", "weights": [[-1 / 3] * width] * 4}
    last = {"unit": "sigmoid", "weights": [[1 / 3]] * width}
    policy = read(path, NETWORK | {"layers": [hidden, last]})
    assert 0.0 <= policy.push_probability(State(0.1, 0.1, 0.1, 0.1)) <= 1.0


def test_a_policy_of_a_custom_agent_is_read_if_the_agent_is_named(path):
    path.write_text(json.dumps(TABLE | {"agent": "absent:agent"}))
    with pytest.raises(UprightError, match=r"learned by 'absent:agent'.*--agent MODULE:NAME"):
        load_policy(path)
    assert load_policy(path, "absent:agent").push_probability(State(0, 0, 0, 0)) < 1


# ------------------------------------------------------------------------------ bad files


def changed(entries, place, value):
    """Return entries in which another value stands at a place, a path of keys."""
    entries = copy.deepcopy(entries)
    *way, last = place
    at = entries
    for key in way:
        at = at[key]
    at[last] = value
    return entries


def without(entries, name):
    return {key: value for key, value in entries.items() if key != name}


def layer(unit, rows, columns):
    return {"unit": unit, "weights": [[0.5] * columns] * rows}


EDGES = ("edges", 3)
BAD = {
    # What it is
    "format": (changed(TABLE, ["format"], "upright policy 1"), f"its format is '{JSON_FORMAT}'"),
    "no format": (without(TABLE, "format"), "its format is"),
    "no agent": (without(TABLE, "agent"), "does not state its agent"),
    "no task": (without(TABLE, "task"), "does not state its task"),
    "no form": (without(TABLE, "form"), "does not state its form"),
    "form": (changed(TABLE, ["form"], "tree"), "form is 'tree'; it must be one of network, table"),
    "agent": (changed(TABLE, ["agent"], "nobody"), "agent is 'nobody'; it must be one of adaptive"),
    "outside": (changed(TABLE, ["agent"], "os:system"), "'os:system', a custom agent"),
    "noise": (changed(TABLE, ["task", "noise"], "loud"), "noise is 'loud'; it must be one of none"),
    "start": (changed(TABLE, ["task", "start"], {}), "start is {}; it must be one of random"),
    "steps": (changed(TABLE, ["task", "steps"], 1e5), "steps is 100000.0; it must be a whole"),
    "seed": (changed(TABLE, ["task", "seed"], -1), "seed is -1; it must be a whole number"),
    "more of a task": (changed(TABLE, ["task", "weather"], 1), "part of a task is 'weather'"),
    "less of a task": (changed(TABLE, ["task"], LESS), "its task does not state noise"),
    "units": (TABLE | {"observation": ["x [cm]"]}, r"its observation is \['x \[cm\]'\]"),
    "force": (TABLE | {"force [N]": 1}, r"its force \[N\] is 1; it must be 10.0"),
    "time step": (TABLE | {"time step [s]": 0.01}, r"time step \[s\] is 0.01; it must be 0.02"),
    "action": (TABLE | {"action": "rest"}, "its action is 'rest'"),
    # Tables
    "no edges": (without(TABLE, "edges"), "does not state its edges"),
    "no probabilities": (without(TABLE, "probabilities"), "does not state its probabilities"),
    "three edges": (changed(TABLE, ["edges"], [[], [], []]), "lists of edges is 3; it must be 4"),
    "order": (changed(TABLE, EDGES, [1, 0, 2]), r"theta_dot_edges is \[1, 0, 2\]; .* ascend"),
    "twice": (changed(TABLE, EDGES, [0, 1, 1]), "must ascend"),
    "edge": (changed(TABLE, [*EDGES, 0], "-1"), "an edge in theta_dot_edges is '-1'; it must be"),
    "far edge": (changed(TABLE, [*EDGES, 0], -1e7), "an edge in theta_dot_edges is -10000000.0"),
    "many edges": (changed(TABLE, EDGES, [*range(101)]), "the number of theta_dot_edges is 101"),
    "many boxes": (changed(TABLE, ["edges"], [[*range(40)]] * 4), "boxes is 2825761; .* 1,000,000"),
    "few": (changed(TABLE, ["probabilities"], [1]), "probabilities is 1; it must be 24"),
    "above 1": (changed(TABLE, ["probabilities", 7], 1.1), "a probability is 1.1; .* at most 1"),
    "below 0": (changed(TABLE, ["probabilities", 7], -1e-9), "a probability is -1e-09"),
    "truth": (changed(TABLE, ["probabilities", 7], True), "a probability is True"),
    # Networks
    "no layers": (without(NETWORK, "layers"), "does not state its layers"),
    "no scales": (without(NETWORK, "scales"), "does not state its scales"),
    "no past": (without(NETWORK, "past"), "does not state its past"),
    "empty": (changed(NETWORK, ["layers"], []), "the number of layers is 0"),
    "numbers": (changed(NETWORK, ["layers"], [1, 2]), "does not state its weights"),
    "no unit": (changed(NETWORK, ["layers", 1], {"weights": [1, 1]}), "does not state its unit"),
    "unit": (
        changed(NETWORK, ["layers", 0, "unit"], "relu"),
        "the unit of layer 1 is 'relu'; it must be one of isrlu, tanh",
    ),
    "rows": (
        changed(NETWORK, ["layers", 1, "weights"], [1, 2, 3]),
        "rows of weights of layer 2 is 3; it must be 2",
    ),
    "ragged": (
        changed(NETWORK, ["layers", 0, "weights", 2], [1]),
        "weights in a row of layer 1 is 1; it must be 2",
    ),
    "no units": (
        changed(NETWORK, ["layers", 0, "weights"], [[]] * 4),
        "the number of units of layer 1 is 0; it must be a whole number, at least 1",
    ),
    "two last units": (
        changed(NETWORK, ["layers", 1, "weights"], [[1, 2], [3, 4]]),
        "last units is 2; it must be 1",
    ),
    "last unit": (
        changed(NETWORK, ["layers", 1, "unit"], "tanh"),
        "the last unit is 'tanh'; it must be one of above zero, not below zero, sigmoid",
    ),
    "unsure": (
        changed(PAST, ["layers", 0, "unit"], "sigmoid"),
        "the last unit is 'sigmoid'; it must be one of above zero, not below zero$",
    ),
    "weight": (changed(NETWORK, ["layers", 0, "weights", 1, 1], None), "of layer 1 is None"),
    "large": (changed(NETWORK, ["layers", 0, "weights", 1, 1], 1e10), "layer 1 is 1e\\+?10|100000"),
    "many digits": (changed(NETWORK, ["layers", 0, "weights", 1, 1], 10**400), "layer 1 is 1000"),
    "scales": (changed(NETWORK, ["scales"], [1, 2, 3]), "scales is 3; it must be 4"),
    "scale": (changed(NETWORK, ["scales", 2], 0), "a scale is 0; it must be a number, at least"),
    "past": (changed(PAST, ["past"], -1), "past is -1; it must be a whole number"),
    "long past": (changed(PAST, ["past"], 10**9), "past is 1000000000; .* at most 100"),
    "another past": (changed(PAST, ["past"], 3), "rows of weights of layer 1 is 14; it must be 19"),
    "many layers": (
        NETWORK | {"layers": [layer("tanh", 4, 4)] * (MOST_LAYERS + 1)},
        "the number of layers is 17; .* at most 16",
    ),
    "many weights": (
        NETWORK | {"layers": [layer("tanh", 4, 600), layer("tanh", 600, 1700)]},
        "the number of weights is 1022400; .* at most 1,000,000",
    ),
}


@pytest.mark.parametrize(("entries", "said"), BAD.values(), ids=BAD)
def test_a_bad_file_is_refused_in_one_line(entries, said, path, capsys):
    with pytest.raises(UprightError, match=rf"policy\.json'; it cannot be read: .*{said}") as error:
        read(path, entries)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < LONGEST_ERROR + 200
    assert run(["play", str(path)]) == BAD_USE
    assert len(capsys.readouterr().err.splitlines()) == 1


TEXT = json.dumps(TABLE)
BAD_TEXTS = {
    "cut": (TEXT[:-1], "cannot be read: Expecting"),
    "NaN": (TEXT.replace("0.8]", "NaN]"), "it holds NaN, which is not a number"),
    "infinity": (TEXT.replace("-0.8", "-Infinity"), "it holds -Infinity"),
    "overflow": (TEXT.replace("0.8]", "1e999]"), "an edge in x_edges is inf"),
    "digits": (TEXT.replace("0.8]", "9" * 5000 + "]"), "cannot be read"),
    "deep": ('{"x":' + "[" * 100_000, "cannot be read"),
    "long": ("{" + " " * JSON_LIMIT, "larger than 33,554,432 bytes"),
    "many lists": ('{"x": [' + "[]," * JSON_MARKS + "1]}", "more than 2,000,000 lists"),
    "no UTF-8": (b'{"x": "\xff"}', "cannot be read"),
    "UTF-16": (TEXT.encode("utf-16"), "not a policy's file"),
    "a list": ("[" + TEXT + "]", "not a policy's file"),
    "nothing": ("", "not a policy's file"),
    "a long name": (TEXT.replace("q-learning", "x" * 10**6), "agent is 'xxxx"),
    "signs": (TEXT.replace("q-learning", r"\n\u001b[2J\ud800"), r"agent is '\\n\\x1b"),
}


@pytest.mark.parametrize(("text", "said"), BAD_TEXTS.values(), ids=BAD_TEXTS)
def test_a_bad_text_is_refused_without_using_much_memory(text, said, path):
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    tracemalloc.start()
    with pytest.raises(UprightError, match=rf"policy\.json.*{said}") as error:
        load_policy(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert str(error.value).isprintable()
    assert len(str(error.value)) < LONGEST_ERROR + 200
    assert peak < 2 * JSON_LIMIT


def test_missing_files_are_refused(tmp_path):
    for place in (tmp_path, tmp_path / "absent.json"):
        with pytest.raises(UprightError, match="there is no such file"):
            load_policy(place)


def places(value, way=()):
    """Yield the way to every value within a value."""
    if way:
        yield way
    if isinstance(value, (dict, list)):
        for key in value if isinstance(value, dict) else range(len(value)):
            yield from places(value[key], (*way, key))


LEAVES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=5),
    st.sampled_from([*UNITS, *AGENTS, "table", "network", "none", "zero", "a:b", 10**30, 1e308]),
)
VALUES = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=6,
)
PLACES = [(name, place) for name, entries in FORMS.items() for place in places(entries)]


@pytest.mark.slow
def test_whatever_value_stands_anywhere_the_policy_plays_or_is_refused_in_one_line(path):
    played, refusals = 0, []

    @settings(max_examples=1500)
    @given(where=st.sampled_from(PLACES), value=st.floats(-9, 9) | VALUES)
    def check(where, value):
        nonlocal played
        name, place = where
        try:
            policy = read(path, changed(FORMS[name], place, value))
        except UprightError as error:
            refusals.append(str(error))
            return
        for point in ((0.0, 0.0, 0.0, 0.0), (2.4, -3.0, 0.2, 1e6)):
            assert 0.0 <= policy.push_probability(State(*point)) <= 1.0
            policy.learn(State(*point), True, None, False)
        assert form_entries(policy.form)
        played += 1

    check()
    assert all(len(text.splitlines()) == 1 for text in refusals)
    assert min(played, len(refusals)) > 100


@pytest.mark.slow
def test_whichever_byte_is_damaged_the_policy_plays_or_is_refused(path):
    content = json.dumps(NETWORK).encode()
    played = refused = 0
    for i in range(len(content)):
        for flip in (0x01, 0x55):
            path.write_bytes(content[:i] + bytes([content[i] ^ flip]) + content[i + 1 :])
            try:
                probability = load_policy(path).push_probability(State(0.1, 0.1, 0.1, 0.1))
            except UprightError:
                refused += 1
            else:
                assert 0.0 <= probability <= 1.0
                played += 1
    assert min(played, refused) > 20


# ------------------------------------------------------------------------------ writing


def test_the_largest_numbers_do_not_overflow():
    layers = [Layer(np.full((4, 100), 1e9), "isrlu")]
    layers += [Layer(np.full((100, 100), sign * 1e9), "isrlu") for sign in (1, -1) * 7]
    layers.append(Layer(np.linspace(-1e9, 1e9, 100)[:, np.newaxis], "sigmoid"))
    memory = make_memory(restore_form(form_entries(Network(tuple(layers), (1e-9,) * 4))))
    for point in (State(1e6, 1e6, 1e6, 1e6), State(-1e6, -1e6, -1e6, -1e6)):
        assert 0.0 <= memory.push_probability(point) <= 1.0


class Told(NamedTuple):
    """A memory of a custom agent that has a policy form."""

    form: Network | Table

    def push_probability(self, observation):
        return 0.5

    def policy_form(self):
        return self.form


@pytest.mark.parametrize(
    ("form", "said"),
    [
        (Table(((), (), (), ()), (math.nan,)), "a probability is nan"),
        (Network((Layer(np.full((4, 1), np.inf), "tanh"),)), "a weight of layer 1 is inf"),
        (Network((Layer(np.ones((4, 1)), "tanh"),)), "the last unit is 'tanh'"),
    ],
)
def test_policies_that_could_not_be_read_are_not_written(form, said, path):
    with pytest.raises(UprightError, match=said):
        export_policy(path, Policy("mine:Agent", Told(form), TaskSpec()))
    assert not path.exists()


def test_files_have_one_entry_a_line_and_exact_numbers(path):
    edge, probability = np.float64(0.1) + 0.2, np.nextafter(1 / 3, 1)
    form = Table(((edge,), (), (), ()), (probability, np.float64(-0.0)))
    export_policy(path, Policy("mine:Agent", Told(form), TaskSpec()))
    assert all(line.startswith('  "') for line in path.read_text().splitlines()[1:-1])
    assert load_policy(path, "mine:Agent").form == form
