"""What holds of all agents: their names, the former names of their settings, mirror symmetry."""

import json
import zipfile
from collections import defaultdict
from dataclasses import asdict, fields
from importlib import import_module
from inspect import isclass
from pkgutil import walk_packages

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import upright.agents
import upright.core
from upright.agents import AGENTS
from upright.agents.parts.policy_form import Table
from upright.core.parameters import State
from upright.errors import UprightError
from upright.policies.files import load_policy, save_policy
from upright.policies.form_player import make_memory
from upright.policies.npz_file import arrays_of
from upright.studies.case import make_case
from upright.studies.learned import learned_policy
from upright.studies.run import make_run
from upright.studies.search_space import search_space
from upright.support.settings import change_settings

ALL_SETTINGS = {
    f"{name} {label}": (name, settings)
    for name in AGENTS
    for label, settings in AGENTS.settings(name).items()
}
RENAMED = [
    (name, old, new)
    for name in AGENTS
    for old, new in getattr(AGENTS.default(name), "RENAMED", {}).items()
]

# ------------------------------------------------------------------------------ names of classes


def named_tuples():
    """Give every NamedTuple that compiled code may see, once: those of core, agents and players."""
    modules = ["upright.plants.equations", "upright.policies.form_player"]
    for package in (upright.core, upright.agents):
        found = walk_packages(package.__path__, f"{package.__name__}.")
        modules += [info.name for info in found]
    for module in map(import_module, modules):
        for kind in filter(isclass, vars(module).values()):
            if hasattr(kind, "_fields") and kind.__module__ == module.__name__:
                yield kind


def test_no_two_named_tuples_have_the_same_name():
    """Called from Python, compiled code tells them apart by names of class and fields alone."""
    places = defaultdict(list)
    for kind in named_tuples():
        places[kind.__name__].append(kind.__module__)
    assert len(places) > 20
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


def test_every_agent_has_a_class_of_its_own_name():
    names = {
        type(settings.agent(np.random.default_rng(1))).__name__
        for _, settings in ALL_SETTINGS.values()
    }
    assert names == {
        "AdaptiveLQRAgent",
        "ReinforceAgent",
        "DirectNDPAgent",
        "QLearningAgent",
        "AseAceAgent",
        "RandomSearchAgent",
    }


# ------------------------------------------------------------------------------ former names


@pytest.mark.parametrize(("name", "old", "new"), RENAMED)
def test_a_former_name_stands_for_one_setting(name, old, new):
    present = {field.name for field in fields(AGENTS.default(name))}
    assert old not in present
    assert new in present


@pytest.mark.parametrize(("name", "settings"), ALL_SETTINGS.values(), ids=ALL_SETTINGS)
def test_settings_written_under_former_names_are_restored(name, settings):
    old = former(settings, asdict(settings))
    assert AGENTS.restore(name, old) == settings
    assert AGENTS.restore(name, asdict(settings)) == settings


def former(settings, values):
    """Return values by the names that they had before settings were renamed."""
    names = {new: old for old, new in getattr(settings, "RENAMED", {}).items()}
    return {names.get(name, name): value for name, value in values.items()}


@pytest.mark.parametrize(("name", "old", "new"), RENAMED)
def test_a_setting_by_both_its_names_is_refused(name, old, new):
    values = asdict(AGENTS.default(name))
    with pytest.raises(UprightError, match=f"'{old}'.* are not those of {name}"):
        AGENTS.restore(name, values | {old: values[new]})


@pytest.mark.parametrize(("name", "old", "new"), RENAMED)
def test_a_person_who_uses_a_former_name_learns_the_new_one(name, old, new):
    default = AGENTS.default(name)
    with pytest.raises(UprightError, match=f"^{old} is now called {new}$"):
        change_settings(default, {old: "0.5"})
    with pytest.raises(UprightError, match=f"^{old} is now called {new}$"):
        search_space(default, [f"{old}=0.1:0.2"])


def write_as_before(path, settings):
    """Write a policy's file anew as it was before settings and arrays were renamed."""
    names = {new: old for old, new in getattr(settings, "RENAMED_ARRAYS", {}).items()}
    with np.load(path) as archive:
        arrays = {names.get(name, name): archive[name] for name in archive.files}
    header = json.loads(str(arrays["header"]))
    header["settings"] = former(settings, header["settings"])
    arrays["header"] = np.array(json.dumps(header))
    np.savez_compressed(path, **arrays)


@pytest.mark.parametrize("name", AGENTS)
def test_a_policy_saved_under_former_names_is_read(name, tmp_path):
    case = make_case(name, steps=500, trials=5)
    policy = learned_policy(case, 3, 0, make_run(case, 3, 0)[0])
    path = tmp_path / "policy.npz"
    save_policy(path, policy)
    write_as_before(path, case.settings)
    again = load_policy(path)
    assert type(again.memory) is type(policy.memory)
    for (place, array), (_, other) in zip(
        arrays_of(policy.memory), arrays_of(again.memory), strict=True
    ):
        np.testing.assert_array_equal(array, other, err_msg=place)


def test_a_file_with_an_array_by_both_its_names_is_refused(tmp_path):
    case = make_case("ase-ace", steps=500, trials=5)
    path = tmp_path / "policy.npz"
    save_policy(path, learned_policy(case, 3, 0, make_run(case, 3, 0)[0]))
    with zipfile.ZipFile(path) as archive:
        written = archive.read("visit_traces.npy")
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("box_traces.npy", written)
    with pytest.raises(UprightError, match="it does not hold the arrays of its agent"):
        load_policy(path)


# ------------------------------------------------------------------------------ mirror symmetry

SYMMETRIC = ("adaptive-lqr", "ndp", "q-learning", "ase-ace", "random-search")
"""Agents that see a cart-pole and its mirror image alike, with their default settings. REINFORCE's
units are not odd functions."""


@pytest.fixture(scope="module")
def learned():
    """Return for each agent what it has learned in a few trials, and a player of its form."""
    found = {}
    for name in SYMMETRIC:
        agent, _ = make_run(make_case(name, noise="all-10", steps=300, trials=6), 3, 0)
        agent.begin_trial(np.random.default_rng(4))
        found[name] = agent, make_memory(agent.policy_form())
    return found


def thousandths(limit):
    return st.integers(int(-1000 * limit), int(1000 * limit)).map(
        lambda number: (number + 0.5) / 1000
    )


@pytest.mark.parametrize("name", SYMMETRIC)
@given(state=st.builds(State, *map(thousandths, (2, 2, 0.2, 2))))
def test_a_policy_pushes_the_mirror_image_to_the_other_side(name, state, learned):
    mirrored = State(*(-value for value in state))
    form = learned[name][0].policy_form()
    if isinstance(form, Table):  # an edge belongs to the box below
        assume(all(o not in edges for edges, o in zip(form.edges, mirrored, strict=True)))
    for policy in learned[name]:
        right, left = policy.push_probability(state), 1 - policy.push_probability(mirrored)
        assert right == pytest.approx(left, abs=1e-12)


def test_unmirrored_boxes_are_not_symmetric():
    """The test above would notice."""
    agent, _ = make_run(make_case("q-learning", "as-published", steps=300, trials=6), 3, 0)
    points = np.random.default_rng(5).normal(0, (1, 1, 0.1, 1), (100, 4))
    pushes = [
        [agent.push_probability(State(*(side * point).tolist())) for side in (1, -1)]
        for point in points
    ]
    assert any(right == left for right, left in pushes)


@pytest.mark.parametrize("name", AGENTS)
def test_an_agent_shows_its_arrays_by_their_shapes(name):
    shown = repr(AGENTS.default(name).agent(np.random.default_rng(0)))
    assert "float64[" in shown
    assert "array(" not in shown
    assert len(shown) < 2000
