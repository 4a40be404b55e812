from dataclasses import replace
from os import cpu_count

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from upright.core.trials import Result
from upright.errors import UprightError
from upright.plants import PLANTS
from upright.studies import estimate as module
from upright.studies.case import make_case
from upright.studies.estimate import Measure, Standing, estimate, probe, standings
from upright.studies.store import Store
from upright.studies.study import runs_of_part, study

CASE = make_case("random-search", steps=300)
OTHER = make_case("random-search", steps=300, noise="sensor-5")


@given(st.integers(1, 20), st.integers(1, 50), st.integers(1, 9))
def test_parts_deal_every_run_once_and_evenly(cases, runs, parts):
    several = list(range(cases))
    dealt = [runs_of_part(several, runs, (number, parts)) for number in range(1, parts + 1)]
    for case in several:
        assert sorted(run for part in dealt for run in part[case]) == list(range(runs))
    sizes = [sum(map(len, part.values())) for part in dealt]
    assert max(sizes) - min(sizes) <= 1
    for part in dealt:  # and each has about as many of every case
        assert max(map(len, part.values())) - min(map(len, part.values())) <= 1


def test_the_parts_of_a_study_are_together_the_whole():
    cases = [CASE, OTHER]
    whole, together = study(cases, 5), {case: [] for case in cases}
    for part in ((1, 3), (2, 3), (3, 3)):
        made = study(cases, 5, part=part)
        for case in cases:
            assert len(made[case]) in (1, 2)
            together[case] += made[case]
    for case in cases:
        lengths = {result.run: result.lengths.tolist() for result in together[case]}
        assert lengths == {result.run: result.lengths.tolist() for result in whole[case]}


@pytest.mark.parametrize("part", [(0, 2), (3, 2), (1, 0), (1,), (1.0, 2), "12", None])
def test_a_part_that_is_none_is_refused(part):
    with pytest.raises(UprightError, match=r"^parts? is "):
        study([CASE], 2, part=part)


def test_a_study_takes_the_path_of_a_store(tmp_path):
    path = tmp_path / "runs.sqlite"
    study([CASE], 2, store=path)
    with Store(path) as store:
        assert store.finished(CASE.key, 0) == {0, 1}


def test_what_is_known_of_a_case_comes_from_the_store():
    with Store() as store:
        lengths = np.array([5, 300])
        store.add(CASE.key, 7, Result(0, True, lengths, 2.0))
        store.add(CASE.key, 7, Result(3, False, lengths[:1], 4.0))
        one, other = standings([CASE, OTHER], 5, 7, store)
        (part, _) = standings([CASE, OTHER], 5, 7, store, (2, 2))
    assert (one.finished, one.missing, one.known, one.successes) == (2, 3, 2, 1)
    assert one.mean_trials == 2.0
    assert one.seconds == Measure(3.0, pytest.approx(2.0**0.5), 2)
    assert (other.missing, other.known, other.seconds) == (5, 0, None)
    assert (part.missing, part.finished, part.known) == (1, 1, 2)


def standing(case=CASE, missing=10, seconds=None):
    """Return how far a case is of whose runs the time is known."""
    known = seconds.runs if seconds else 0
    return Standing(case, range(missing), 0, known, known, 1.0, seconds, seconds)


def test_an_estimate_adds_up_what_is_known():
    found = estimate(
        [standing(seconds=Measure(2.0, 1.0, 25)), standing(seconds=Measure(1.0, 0.5, 1))]
    )
    workers = cpu_count()
    assert found.workers == workers
    assert found.seconds == pytest.approx(30.0 / workers)
    deviation = (1.0 * (10 + 100 / 25) + 0.25 * (10 + 100 / 1)) ** 0.5 / workers
    assert found.high - found.seconds == pytest.approx(2 * deviation)
    assert found.low == pytest.approx(found.seconds - 2 * deviation)


def test_an_unknown_case_is_like_those_of_its_agent_or_like_all():
    lqr = replace(make_case("adaptive-lqr"), spec=CASE.spec)
    known = [
        standing(missing=0, seconds=Measure(1.0, 0.0, 5)),
        standing(lqr, missing=0, seconds=Measure(9.0, 0.0, 5)),
    ]
    alike = estimate([*known, standing(OTHER)])
    assert alike.seconds == pytest.approx(10.0 / alike.workers)
    assert alike.low == 0.0 < alike.seconds < alike.high
    other = estimate([*known, standing(make_case("q-learning"))])
    assert other.seconds == pytest.approx(50.0 / other.workers)


def test_nothing_is_estimated_of_nothing_and_nothing_takes_no_time():
    assert estimate([standing()]) is None
    assert estimate([standing(missing=0)]).seconds == 0.0


def test_a_plant_that_is_alone_makes_one_run_at_once():
    alone = replace(CASE, plant=PLANTS.default("ros2"))
    assert estimate([standing(alone, seconds=Measure(2.0, 1.0, 5))]).workers == 1


def test_runs_are_tried_and_not_kept():
    with Store() as store:
        study([CASE], 2, store=store)
        several = standings([CASE, OTHER], 3, 0, store)
        found = probe(several, 0)
        assert standings([CASE, OTHER], 3, 0, store) == several
    assert found.tried == {OTHER: 3}
    assert not found.is_least
    assert found.several[0] == several[0]
    results = study([OTHER], 3)[OTHER]
    trials = np.mean([result.trials for result in results])
    assert found.several[1].bytes.mean == pytest.approx(module.ROW + module.LENGTH * trials)
    assert found.several[1].seconds.runs == 3


def test_a_success_of_very_many_steps_is_not_simulated():
    long = make_case("random-search", steps=10**9)
    with Store() as store:
        found = probe(standings([long], 1, 0, store), 0)
    assert found.tried == {long: 1}
    assert found.several[0].seconds.mean > 1.0  # a billion steps; those that were made took 0.01 s


def test_a_run_that_takes_too_long_is_stopped(monkeypatch):
    endless = make_case("random-search", steps=10**9, trials=10**6, noise="gaussian=10000")
    with Store() as store:
        found = probe(standings([endless], 5, 0, store), 0, seconds=0.05)
    assert found.is_least
    assert found.tried == {endless: 1}
    assert 0.05 <= found.several[0].seconds.mean < 60.0


def test_plants_that_run_elsewhere_are_not_tried():
    with Store() as store:
        cases = [replace(CASE, plant=PLANTS.default(name)) for name in module.NOT_PROBED]
        assert probe(standings(cases, 2, 0, store), 0).tried == {}


@pytest.mark.parametrize("trials", [1, 30, 1000])
def test_the_size_of_a_store_is_as_estimated(trials, tmp_path):
    path, runs = tmp_path / "runs.sqlite", 400
    rng = np.random.default_rng(0)
    with Store(path) as store:
        for run in range(runs):
            store.add(CASE.key, 0, Result(run, True, rng.integers(1, 100, trials), 0.1))
        (found,) = standings([CASE], runs, 0, store)
    size = runs * found.bytes.mean
    tables = 7 * 4096  # those without runs, and the environment
    assert size == pytest.approx(path.stat().st_size, rel=0.35, abs=tables)
