import json
import sqlite3

import numpy as np
import pytest

import upright
from upright.commands import run
from upright.studies.store import Store
from upright.studies.verify import SAMPLE, verify

CASE = upright.make_case("random-search", steps=300)


@pytest.fixture(scope="module")
def made():
    """Runs of two seeds, as they are made."""
    return {seed: upright.study([CASE], 6, seed)[CASE] for seed in (0, 7)}


@pytest.fixture
def path(made, tmp_path):
    with Store(tmp_path / "runs.sqlite") as store:
        for seed, results in made.items():
            for result in results:
                store.add(CASE.key, seed, result)
    return tmp_path / "runs.sqlite"


def change(path, statement):
    database = sqlite3.connect(path)
    database.execute(statement)
    database.commit()
    database.close()


def longer(result):
    return result._replace(lengths=np.append(result.lengths, 5))


def test_all_runs_are_made_again_and_the_file_stays_as_it_is(path):
    content = path.read_bytes()
    found = verify(path, None)
    assert (found.runs, found.compared, found.is_sound) == (12, 12, True)
    assert str(found) == "12 runs read, 12 of them made again: 12 the same bit for bit, 0 different"
    assert str(verify(path, 0)) == "12 runs read, none made again"
    assert path.read_bytes() == content
    assert [each.name for each in path.parent.iterdir()] == [path.name]


def test_a_sample_is_drawn_by_its_seed(path):
    def drawn(seed):
        chosen = []

        def make(cases, runs, study_seed, store):
            for case in cases:
                missing = set(range(runs)) - store.finished(case.key, study_seed)
                chosen.extend((study_seed, run) for run in missing)

        verify(path, 4, seed, make=make)
        return chosen

    assert drawn(1) == drawn(1)
    assert len({tuple(drawn(seed)) for seed in range(5)}) > 1
    assert all(len({*drawn(seed)}) == 4 for seed in range(5))


def test_runs_that_come_out_differently_are_named(made, tmp_path, capsys):
    path = tmp_path / "runs.sqlite"
    with Store(path) as store:
        store.add(CASE.key, 0, made[0][0])
        store.add(CASE.key, 0, longer(made[0][1]))
        store.add(CASE.key, 0, made[0][2]._replace(success=False))
        wrong = made[0][3].lengths.copy()
        wrong[0] += 1
        store.add(CASE.key, 0, made[0][3]._replace(lengths=wrong))
    found = verify(path)
    assert (found.compared, found.differing.total) == (4, 3)
    assert sorted(each.run for each in found.differing.first) == [1, 2, 3]
    assert run(["verify", str(path), "--all"]) == 1
    told = capsys.readouterr().out
    count = made[0][1].trials
    assert f"run 1 of seed 0 of {CASE!r}:\n    {count + 1} trials in {path}" in told
    assert f"{count} trial{'s' * (count > 1)} in this run" in told
    assert "no success in" in told
    assert f"{wrong[0]} steps in trial 1 in" in told


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE runs SET lengths = zeroblob(length(lengths)) WHERE run = 3",
        "UPDATE runs SET steps = steps + 1 WHERE run = 3",
        "UPDATE runs SET success = 1 - success WHERE run = 3",
        "UPDATE runs SET seconds = 9.5 WHERE run = 3",
        "UPDATE runs SET ended = '2026-01-01 00:00:00', version = '1.0' WHERE run = 3",
        "UPDATE cases SET key = replace(key, '300', '301')",
    ],
)
def test_damage_is_found_and_named(statement, path, capsys):
    change(path, statement)
    assert run(["verify", str(path), "--sample", "0"]) == 1
    told = capsys.readouterr().out
    assert "damaged:\n  run" in told
    assert "run 3 of seed 7 of case 1" in told
    with (
        Store(path) as store,
        pytest.raises(upright.UprightError, match=r"runs\.sqlite'; it is dam"),
    ):
        list(store.runs())


def test_runs_of_other_code_are_counted_but_not_compared(made, tmp_path, capsys):
    path = tmp_path / "runs.sqlite"
    other = json.dumps(json.loads(CASE.key) | {"rule": "0123456789ab"}, sort_keys=True)
    with Store(path) as store:
        store.add(CASE.key, 0, made[0][0])
        store.add(other, 0, longer(made[0][0]))
        store.add('{"agent": "no_such_module:Agent"}', 0, made[0][0])
    assert run(["verify", str(path)]) == 0
    told = capsys.readouterr().out
    assert "3 runs read, 1 of them made again: 1 the same" in told
    assert "1 run not comparable: other code made them" in told
    assert "1 run not comparable: store is" in told


def test_runs_beyond_those_of_any_study_are_counted_but_not_compared(made, path):
    with Store(path) as store:
        store.add(CASE.key, 0, made[0][0]._replace(run=10**15))
    found = verify(path)
    assert (found.runs, found.compared, found.is_sound) == (13, 12, True)
    assert sum(found.not_comparable.values()) == 1


def test_the_recorded_environment_is_shown_where_it_differs(path, capsys):
    assert run(["show", str(path), "--each", "environment", "--format", "json"]) == 0
    (shown,) = json.loads(capsys.readouterr().out)
    assert (shown["environment"], shown["runs"], shown["upright"]) == (1, 12, upright.__version__)
    assert shown["numpy"] == np.__version__
    assert all(shown.values())
    part = '"numpy": "'
    change(
        path, f"UPDATE environments SET description = replace(description, '{part}', '{part}9.')"
    )
    assert "numpy: 9." in str(verify(path, 0))


def test_the_help_names_the_number_that_is_the_default(capsys):
    with pytest.raises(SystemExit):
        run(["verify", "--help"])
    assert f"(default: {SAMPLE})" in " ".join(capsys.readouterr().out.split())


def test_an_interrupt_ends_it(path):
    def make(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        verify(path, make=make)
