import itertools
import math
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from upright.agents.parts.boxes import find_box
from upright.agents.q_learning import SETTINGS, QLearning, entry
from upright.core.parameters import State
from upright.errors import UprightError
from upright.studies.case import make_case
from upright.studies.run import make_run

EDGES = ("x_edges", "x_dot_edges", "theta_edges", "theta_dot_edges")


def blank(settings, seed=1):
    return settings.agent(np.random.default_rng(seed))


AGENTS = {label: blank(settings) for label, settings in SETTINGS.items()}
BOXES = {label: len(agent.table) // 2 for label, agent in AGENTS.items()}


def middles(edges):
    """Return a value within each interval."""
    ends = np.concatenate([[edges[0] - 1], edges, [edges[-1] + 1]])
    return ((ends[:-1] + ends[1:]) / 2).tolist()


def box_in_numpy(agent, observation):
    index = [
        np.searchsorted(edges, o) for edges, o in zip(agent.boxes.edges, observation, strict=True)
    ]
    return int(np.ravel_multi_index(index, agent.boxes.parts))


# ------------------------------------------------------------------------------ boxes


@pytest.mark.parametrize("label", SETTINGS)
def test_every_box_is_found_in_order(label):
    agent = AGENTS[label]
    places = itertools.product(*map(middles, agent.boxes.edges))
    found = [find_box(agent.boxes, State(*place)) for place in places]
    assert found == list(range(BOXES[label]))


def test_published_boxes_are_the_162():
    assert BOXES["as-published"] == 162


@pytest.mark.parametrize("label", SETTINGS)
@pytest.mark.parametrize("name", EDGES)
def test_an_edge_belongs_to_the_lower_box(label, name):
    agent = AGENTS[label]
    middle = State(*(middles(edges)[0] for edges in agent.boxes.edges))
    field = name.removesuffix("_edges")
    for edge in getattr(SETTINGS[label], name):
        below, at, above = (
            find_box(agent.boxes, middle._replace(**{field: value}))
            for value in (np.nextafter(edge, -9).item(), edge, np.nextafter(edge, 9).item())
        )
        assert below == at < above


@pytest.mark.parametrize("label", SETTINGS)
@given(st.builds(State, *(st.floats(-3, 3) for _ in EDGES)))
def test_the_mirror_image_of_a_box_is_counted_from_the_end(label, state):
    agent = AGENTS[label]
    # An edge belongs to the lower box.
    assume(not any(o in edges for edges, o in zip(agent.boxes.edges, state, strict=True)))
    mirrored = State(*(-value for value in state))
    assert find_box(agent.boxes, mirrored) == BOXES[label] - 1 - find_box(agent.boxes, state)
    assert find_box(agent.boxes, state) == box_in_numpy(agent, state)


def entries(agent, boxes):
    return {(box, push): entry(agent, box, push) for box in range(boxes) for push in (False, True)}


def test_a_mirrored_table_shares_values_between_mirror_images():
    boxes, agent = BOXES["default"], AGENTS["default"]
    assert agent.mirrored
    place = entries(agent, boxes)
    assert all(place[b, a] == place[boxes - 1 - b, not a] for b, a in place)
    assert len(set(place.values())) == boxes


def test_a_plain_table_has_a_value_for_each_box_and_push():
    boxes, agent = BOXES["as-published"], AGENTS["as-published"]
    assert sorted(entries(agent, boxes).values()) == list(range(2 * boxes))


# ------------------------------------------------------------------------------ policy


@pytest.mark.parametrize("label", SETTINGS)
def test_it_pushes_towards_the_better_value(label):
    agent, rng = blank(SETTINGS[label]), np.random.default_rng(2)
    agent.table[:] = rng.normal(size=len(agent.table))
    pushes = set()
    for _ in range(50):
        seen = State(*rng.normal(size=4).tolist())
        box = find_box(agent.boxes, seen)
        right = agent.table[entry(agent, box, True)] > agent.table[entry(agent, box, False)]
        state = rng.bit_generator.state
        assert agent.act(seen, rng) == right
        assert rng.bit_generator.state == state
        pushes.add(bool(right))
    assert pushes == {True, False}


# ------------------------------------------------------------------------------ learning rules

HERE, THERE = State(0.1, 0.2, 0.05, 0.3), State(0.1, 0.2, -0.05, 0.3)


@pytest.mark.parametrize("action", [False, True])
@pytest.mark.parametrize("fallen", [False, True])
def test_an_update_at_every_step_is_the_equation_of_the_report(action, fallen):
    agent = blank(SETTINGS["as-published"])
    agent.table[:] = np.random.default_rng(3).normal(size=len(agent.table))
    q = agent.table.reshape(-1, 2).copy()
    here, there = find_box(agent.boxes, HERE), find_box(agent.boxes, THERE)
    worth = -1 if fallen else 0.9 * q[there].max()
    q[here, int(action)] = 0.7 * q[here, int(action)] + 0.3 * worth
    agent.learn(HERE, action, THERE, fallen)
    assert agent.table == pytest.approx(q.ravel(), rel=1e-14)
    agent.end_trial(fallen)
    assert agent.table == pytest.approx(q.ravel(), rel=1e-14)


def random_moves(trials):
    """Yield steps of trials through random states, some of which stay in their box."""
    rng = np.random.default_rng(4)
    for length in trials:
        state = State(*rng.uniform(-1, 1, 4).tolist())
        for step in range(length):
            after = state if rng.random() < 0.3 else State(*rng.uniform(-1, 1, 4).tolist())
            fallen = step == length - 1
            yield state, bool(rng.random() < 0.5), after, fallen
            state = after


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("kept", [7, 1000])
@pytest.mark.parametrize("replay_passes", [1, 3])
def test_replay_goes_backwards_through_the_last_moves(mirrored, kept, replay_passes):
    """Against a dictionary of values and a list of moves."""
    settings = QLearning(
        learning_rate=0.2,
        discount=0.95,
        trace_decay=0.4,
        mirrored=mirrored,
        replay_size=kept,
        replay_passes=replay_passes,
    )
    agent = blank(settings)
    boxes = len(agent.table) // 2

    def key(box, action):
        return min((box, action), (boxes - 1 - box, not action)) if mirrored else (box, action)

    q = {key(b, a): agent.table[entry(agent, b, a)] for b in range(boxes) for a in (False, True)}
    moves = []
    for before, action, after, fallen in random_moves((5, 12, 1, 40)):
        agent.learn(before, action, after, fallen)
        box, next_box = box_in_numpy(agent, before), box_in_numpy(agent, after)
        if fallen or box != next_box:
            moves.append((key(box, action), None if fallen else next_box))
        if not fallen:
            continue
        agent.end_trial(True)
        for _ in range(replay_passes):
            worth = math.nan
            for place, next_box in reversed(moves[-kept:]):
                if next_box is None:
                    worth = -1.0
                else:
                    best = max(q[key(next_box, False)], q[key(next_box, True)])
                    worth = 0.95 * (0.6 * best + 0.4 * worth)
                q[place] += 0.2 * (worth - q[place])
    ours = [agent.table[entry(agent, b, a)] for b in range(boxes) for a in (False, True)]
    expected = [q[key(b, a)] for b in range(boxes) for a in (False, True)]
    assert ours == pytest.approx(expected, rel=1e-12)
    assert min(expected) < -0.3, "something was learned"


def test_a_success_changes_nothing():
    agent = blank(SETTINGS["default"])
    before = agent.table.copy()
    agent.learn(HERE, True, THERE, False)
    agent.end_trial(False)
    assert np.array_equal(agent.table, before)


def test_first_values_are_as_small_as_the_jitter():
    agent = blank(QLearning(jitter=1e-3))
    assert 0 < np.abs(agent.table).max() <= 0.5e-3
    assert not blank(QLearning(jitter=0.0)).table.any()


# ------------------------------------------------------------------------------ settings


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"learning_rate": 1.1}, "learning_rate is 1.1; it must be a number, at least 0 and at mo"),
        ({"learning_rate": math.nan}, "learning_rate is nan;"),
        ({"discount": -0.1}, "discount is -0.1;"),
        ({"replay_passes": 1.5}, "replay_passes is 1.5; it must be a whole number"),
        ({"replay_size": 0}, "replay_size is 0; it must be a whole number, at least 1"),
        ({"trace_decay": 2.0}, "trace_decay is 2.0;"),
        ({"jitter": -1e-9}, "jitter is -1e-09;"),
        ({"x_edges": (1.0, -1.0)}, "x_edges is (1.0, -1.0); its edges must ascend"),
        ({"x_edges": (0.0, 0.0)}, "x_edges is (0.0, 0.0); its edges must ascend"),
        ({"theta_edges": (-1.0, 0.5)}, "theta_edges is (-1.0, 0.5); mirrored boxes need edges ali"),
        ({"x_dot_edges": (math.nan,)}, "an edge in x_dot_edges is nan; it must be a number"),
        ({"theta_dot_edges": ("0",)}, "an edge in theta_dot_edges is '0'; it must be a number"),
    ],
    ids=str,
)
def test_impossible_settings_are_refused_by_name(change, message):
    with pytest.raises(UprightError) as error:
        QLearning(**change)
    assert str(error.value).startswith(message)


@pytest.mark.parametrize("name", [each.name for each in fields(QLearning) if each.type is int])
def test_a_whole_number_written_as_a_float_is_refused(name):
    with pytest.raises(UprightError, match=f"^{name} is 2.0; it must be a whole number"):
        QLearning(**{name: 2.0})


def test_published_settings_are_those_of_the_report():
    published = SETTINGS["as-published"]
    assert (published.learning_rate, published.discount, published.replay_passes) == (0.3, 0.9, 0)
    assert not published.mirrored
    assert SETTINGS["default"] == QLearning()


# ------------------------------------------------------------------------------ learning


@pytest.mark.parametrize("noise", ["none", "actuator-10"])
def test_it_learns_to_balance(noise):
    case = make_case("q-learning", noise=noise)
    results = [make_run(case, 1, run)[1] for run in range(20)]
    assert all(result.success for result in results)
    assert np.mean([result.trials for result in results]) < 45


def test_published_settings_run():
    case = make_case("q-learning", "as-published", steps=5000, trials=60)
    agent, result = make_run(case, 1, 0)
    assert result.trials == 60 or result.success
    assert agent.table.min() < -0.3
    assert agent.table.min() >= -1


def test_measurements_without_edges_are_ignored():
    settings = QLearning(x_edges=(), x_dot_edges=())
    agent = blank(settings)
    boxes = {find_box(agent.boxes, State(x, x, 0.0, 0.0)) for x in (-9.0, 0.0, 9.0)}
    assert len(boxes) == 1
    assert len(agent.table) == 2 * 5 * 8
