import tracemalloc

import numpy as np
import pytest
from scipy.stats import bootstrap

from upright.core.trials import Result
from upright.reports.statistics import summarise, summarise_all
from upright.studies.case import make_case
from upright.studies.intervals import FEW, _of_many, _resampled, bootstrap_interval
from upright.studies.outcomes import Outcomes
from upright.studies.store import Store

MB = 2**20


def trials(kind, runs):
    """Return numbers of trials: many alike, or some runs that failed after 1,000, or one alone."""
    rng = np.random.default_rng(5)
    if kind == "failing":
        return np.where(rng.random(runs) < 0.1, 1000, rng.geometric(0.02, runs))
    return rng.geometric(0.1, runs)


def peak(work, *arguments):
    """Return what a function takes of memory at most [bytes]."""
    work(*arguments)  # imports, and what is kept for good
    tracemalloc.start()
    try:
        work(*arguments)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("runs", [2, 20, 100, 997, FEW])
@pytest.mark.parametrize("kind", ["usual", "failing"])
def test_intervals_of_few_runs_are_scipys_bit_for_bit(kind, runs):
    values = trials(kind, runs).astype(float)
    interval = bootstrap(
        (values,), np.mean, n_resamples=9_999, rng=np.random.default_rng(0)
    ).confidence_interval
    assert bootstrap_interval(values) == (interval.low, interval.high)


@pytest.mark.parametrize("kind", ["usual", "failing"])
def test_the_formula_for_many_agrees_with_resamples_within_their_chance(kind):
    values = trials(kind, FEW).astype(float)
    error = values.std() / np.sqrt(len(values))
    # The standard deviation of the ends of 9,999 resamples is 0.027 standard errors.
    assert np.abs(np.subtract(_of_many(values), _resampled(values))).max() < 4 * 0.027 * error


def test_the_formula_for_many_sees_skewness():
    values = trials("failing", 100_000).astype(float)
    low, high = bootstrap_interval(values)
    assert high - values.mean() > 1.01 * (values.mean() - low)
    mirrored = bootstrap_interval(-values)
    assert mirrored == pytest.approx((-high, -low), rel=1e-12)


@pytest.mark.parametrize("kind", [float, int])
def test_an_interval_of_many_stays_among_the_values(kind):
    values = np.full(FEW + 1, 7, kind)
    assert bootstrap_interval(values) == (7, 7)
    values[0] = 1000
    low, high = bootstrap_interval(values)
    assert 7 <= low < values.mean() < high <= 1000


def test_statistics_of_a_million_runs_take_little_memory():
    runs = 10**6
    at = np.arange(runs)
    failed = at % 10 == 0
    outcomes = Outcomes(at, ~failed, trials("failing", runs), 7 * at, np.full(runs, 0.001))
    assert peak(summarise, make_case("random-search"), 0, outcomes) < 100 * MB


@pytest.mark.parametrize("runs", [100, FEW])
def test_resamples_take_little_memory(runs):
    assert peak(bootstrap_interval, trials("failing", runs)) < 40 * MB


def test_statistics_of_a_store_do_not_hold_the_lengths_of_its_trials():
    case = make_case("random-search")
    with Store() as store:
        for run in range(FEW + 1):
            store.add(case.key, 0, Result(run, run % 2 > 0, np.full(1000, 3), 0.5))  # 16 MB in all
        assert peak(summarise_all, [case], FEW + 1, 0, store) < 4 * MB
        (row,) = summarise_all([case], FEW + 1, 0, store)
        results = store.results(case.key, 0)
    assert row == summarise(case, 0, results)
    assert (row.runs, row.successes, row.steps_simulated) == (FEW + 1, FEW // 2, 3000 * (FEW + 1))
