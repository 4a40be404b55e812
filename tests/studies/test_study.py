import json
import multiprocessing
import weakref
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from upright.core.parameters import Parameters
from upright.core.trials import Result
from upright.errors import UprightError
from upright.plants.equations import EquationsSettings
from upright.studies.case import Case, make_case
from upright.studies.executors import OUTSTANDING
from upright.studies.fingerprint import fingerprint
from upright.studies.random_streams import random_numbers
from upright.studies.run import make_run
from upright.studies.store import Store
from upright.studies.study import make_missing_runs, study

CASES = [
    make_case("random-search", noise=noise, steps=500, trials=40)
    for noise in ("none", "gaussian-0.2", "actuator-10")
]
RUNS, SEED = 6, 11


def table(store, cases=CASES, runs=RUNS, seed=SEED):
    """Return all results of a study except the time they took."""
    return {
        case.spec.noise: [
            (r.run, r.success, r.lengths.tolist()) for r in store.results(case.key, seed)
        ]
        for case in cases
    }


@pytest.fixture(scope="module")
def expected():
    """Return the table of the study by single runs, one after the other."""
    rows = {}
    for case in CASES:
        results = [make_run(case, SEED, run)[1] for run in range(RUNS)]
        rows[case.spec.noise] = [(r.run, r.success, r.lengths.tolist()) for r in results]
    return rows


def processes():
    return ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn"))


@pytest.mark.parametrize(
    "executor",
    [
        nullcontext,
        lambda: ThreadPoolExecutor(1),
        lambda: ThreadPoolExecutor(2),
        lambda: nullcontext("threads"),
        pytest.param(processes, marks=pytest.mark.slow),
        pytest.param(lambda: nullcontext("processes"), marks=pytest.mark.slow),
    ],
    ids=["default", "one thread", "two threads", "threads", "two processes", "processes"],
)
def test_results_do_not_depend_on_the_executor(executor, expected):
    with Store() as store, executor() as given:
        study(CASES, RUNS, SEED, store, executor=given)
        assert table(store) == expected


def test_results_do_not_depend_on_the_order_of_cases(expected):
    with Store() as store:
        study(CASES[::-1], RUNS, SEED, store)
        assert table(store) == expected


def test_results_do_not_depend_on_the_runs_made_before(expected):
    with Store() as store:
        study(CASES[:1], 2, SEED, store)
        study(CASES[1:2], 3, SEED, store)
        study(CASES, RUNS, SEED, store)
        assert table(store) == expected


def test_an_interrupted_study_continues(expected, tmp_path):
    heard = []

    def interrupt(case, result):
        heard.append((case.spec.noise, result.run))
        if len(heard) == 4:
            raise KeyboardInterrupt

    store = Store(tmp_path / "study.db")
    with pytest.raises(KeyboardInterrupt):
        study(CASES, RUNS, SEED, store, interrupt)
    store.close()
    store = Store(tmp_path / "study.db")
    held = {(noise, row[0]) for noise, rows in table(store).items() for row in rows}
    assert held == set(heard)
    resumed = []
    study(
        CASES, RUNS, SEED, store, lambda case, result: resumed.append((case.spec.noise, result.run))
    )
    assert not held & set(resumed), "no run is made twice"
    assert len(resumed) == len(CASES) * RUNS - 4
    assert table(store) == expected
    store.close()


def test_a_finished_study_is_not_repeated():
    heard = []
    with Store() as store:
        study(CASES, RUNS, SEED, store)
        study(CASES, RUNS, SEED, store, lambda *result: heard.append(result))
        assert heard == []
        study(CASES[:1], RUNS + 2, SEED, store, lambda case, result: heard.append(result.run))
    assert sorted(heard) == [RUNS, RUNS + 1]


def test_every_run_is_reported_once():
    heard = []
    with Store() as store:
        study(
            CASES,
            RUNS,
            SEED,
            store,
            lambda case, result: heard.append((case.spec.noise, result.run)),
        )
    assert sorted(heard) == sorted((case.spec.noise, run) for case in CASES for run in range(RUNS))


def test_the_memory_of_a_study_does_not_grow_with_its_runs(monkeypatch):
    alive = most = 0

    def gone():
        nonlocal alive
        alive -= 1

    def make(case, seed, run, stop):
        nonlocal alive, most
        lengths = np.ones(100, np.int64)
        weakref.finalize(lengths, gone)
        alive += 1
        most = max(most, alive)
        return None, Result(run, True, lengths, 0.0)

    monkeypatch.setattr("upright.studies.study.make_run", make)
    with Store() as store, ThreadPoolExecutor(1) as thread:
        make_missing_runs(CASES, 2 * OUTSTANDING, SEED, store, executor=thread)
        assert len(store.finished(CASES[-1].key, SEED)) == 2 * OUTSTANDING
    assert most < 1.1 * OUTSTANDING


def test_runs_seeds_and_cases_differ():
    cases = [
        make_case("q-learning", noise=case.spec.noise, steps=5000, trials=20) for case in CASES
    ]
    runs = [(case, SEED, run) for case in cases for run in range(4)]
    runs.append((cases[0], SEED + 1, 0))
    assert len({tuple(make_run(*each)[1].lengths[:20].tolist()) for each in runs}) == len(runs)


def test_streams_of_runs_are_independent():
    drawn = np.array([random_numbers(SEED, run).random(2000) for run in range(5)])
    correlations = np.corrcoef(drawn) - np.eye(5)
    assert np.abs(correlations).max() < 4 / np.sqrt(2000)
    assert np.array_equal(random_numbers(SEED, 3).random(2000), drawn[3])


def test_a_result_holds_every_trial():
    result = make_run(make_case("random-search", steps=500), SEED, 0)[1]
    assert result.success
    assert result.trials == len(result.lengths)
    assert result.lengths[-1] == 500
    assert result.lengths[:-1].max(initial=0) < 500
    assert result.seconds >= 0


def test_a_failed_run_is_a_result():
    case = make_case("random-search", steps=10**6, trials=2)
    result = make_run(case, SEED, 0)[1]
    assert (result.success, result.trials) == (False, 2)


def test_a_stopped_run_is_no_result():
    agent, result = make_run(CASES[0], SEED, 0, stop=np.ones(1, np.bool_))
    assert result is None
    assert not agent.weights.any()


def test_an_error_in_a_run_reaches_the_caller():
    class Broken(ThreadPoolExecutor):
        def submit(self, function, *arguments):
            return super().submit(lambda: 1 / 0)

    with Store() as store, Broken(1) as broken, pytest.raises(ZeroDivisionError):
        study(CASES, RUNS, SEED, store, executor=broken)


# ------------------------------------------------------------------------------ keys and bad values


def change(case, **parts):
    """Return a case with another agent, another integrator, or other parts of its task."""
    agent, integrator = parts.pop("agent", case.agent), parts.pop("integrator", "euler")
    spec = replace(case.spec, **parts)
    return replace(case, agent=agent, spec=spec, plant=EquationsSettings(integrator))


def test_a_key_holds_everything_that_determines_a_run():
    case = CASES[0]
    changed = [
        change(case, noise="sensor-5"),
        change(case, start="zero"),
        change(case, condition="delay-1"),
        change(case, steps=501),
        change(case, trials=41),
        change(case, parameters=Parameters(half_length=0.6)),
        change(case, integrator="rk4"),
        replace(case, settings=replace(case.settings, x_scale=1.0)),
    ]
    assert len({case.key, *(each.key for each in changed)}) == 9
    assert replace(case).key == case.key
    assert json.loads(case.key)["rule"] == fingerprint("random-search", "equations")


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"agent": "sarsa"}, "agent is 'sarsa'; it must be one of adaptive-lqr, reinforce"),
        ({"noise": "loud"}, "noise is 'loud'; it must be one of none"),
        ({"start": "low"}, "start is 'low'; it must be one of random, zero"),
        ({"integrator": "rk5"}, "integrator is 'rk5'; it must be one of euler"),
        ({"steps": 0}, "steps is 0; it must be a whole number, at least 1"),
        ({"steps": 1.5}, "steps is 1.5; it must be a whole number"),
        ({"trials": 0}, "trials is 0; it must be a whole number"),
        ({"trials": "9"}, "trials is '9'; it must be a whole number"),
    ],
    ids=str,
)
def test_a_case_that_cannot_be_run_is_refused(parts, message):
    with pytest.raises(UprightError) as error:
        change(CASES[0], **parts)
    assert str(error.value).startswith(message)


@pytest.mark.parametrize("name", ["steps", "trials"])
def test_a_whole_number_written_as_a_float_is_refused(name):
    """Accepted, it would break the run, or give the same case another key."""
    number = float(getattr(CASES[0].spec, name))
    with pytest.raises(UprightError, match=f"^{name} is {number}; it must be a whole number"):
        change(CASES[0], **{name: number})


@pytest.mark.parametrize(
    ("runs", "seed", "name"),
    [(0, 1, "runs"), (1.5, 1, "runs"), (True, 1, "runs"), (1, -1, "seed"), (1, 2**63, "seed")],
)
def test_bad_numbers_of_runs_and_seeds_are_refused(runs, seed, name):
    with Store() as store, pytest.raises(UprightError, match=f"^{name} is "):
        study(CASES, runs, seed, store)


@pytest.mark.parametrize("cases", ["reinforce", CASES[0], [CASES[0], "reinforce"], None])
def test_what_is_no_case_is_refused(cases):
    with pytest.raises(UprightError, match=r"^cases is .*; it must be a list of what make_case"):
        study(cases, 1)


def test_what_is_no_store_is_refused():
    with pytest.raises(UprightError, match=r"store is 3; it must be a Store, or the path of its"):
        study(CASES, 1, 0, 3)


def test_a_run_of_what_is_no_case_is_refused():
    with pytest.raises(UprightError, match="case is 'reinforce'; it must be what make_case"):
        make_run("reinforce", 0, 0)


def test_unknown_settings_are_refused():
    with pytest.raises(UprightError, match="settings is 'best'; it must be one of default"):
        make_case("random-search", "best")


def test_a_case_can_be_made_from_names_alone():
    case = make_case("q-learning", "as-published", noise="sensor-5", steps=100)
    assert isinstance(case, Case)
    assert (case.agent, case.label, case.spec.noise, case.spec.steps) == (
        "q-learning",
        "as-published",
        "sensor-5",
        100,
    )
