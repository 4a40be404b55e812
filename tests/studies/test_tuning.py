import math
import os
import shlex
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import count

import numpy as np
import pytest
from helpers import python

from upright.agents import AGENTS
from upright.agents.ase_ace import AseAce
from upright.agents.q_learning import QLearning
from upright.agents.random_search import RandomSearch
from upright.agents.reinforce import Reinforce
from upright.commands import run
from upright.errors import UprightError, require
from upright.studies import tuning
from upright.studies.case import Case, make_case
from upright.studies.intervals import bootstrap_interval
from upright.studies.run import make_run
from upright.studies.search_space import Range, search_space
from upright.studies.settings_file import read_settings
from upright.studies.store import Store
from upright.studies.study import study
from upright.studies.tuning import (
    SEEDS,
    Comparison,
    Search,
    Validation,
    as_python,
    search,
    search_seed,
    validate,
    validation_seed,
)
from upright.support.exit_status import BAD_USE, INTERRUPTED
from upright.support.settings import as_options, change_settings, changed_values

QUICK = {"steps": 300, "trials": 60}


def wanted(runs=4, seed=0, search=(), noises=("none", "gaussian-0.2"), **task):
    cases = [make_case("random-search", noise=noise, **QUICK | task) for noise in noises]
    return Search(tuple(cases), tuple(search_space(cases[0].settings, search)), runs, seed)


def tried(path):
    """Return the candidates of a store: what was drawn, what came of it."""
    with closing(sqlite3.connect(path)) as database:
        return database.execute(
            "SELECT t.state, group_concat(p.param_name || '=' || p.param_value), v.value "
            "FROM trials t LEFT JOIN trial_params p USING (trial_id) "
            "LEFT JOIN trial_values v USING (trial_id) "
            "WHERE t.state IN ('COMPLETE', 'PRUNED') GROUP BY trial_id ORDER BY t.number"
        ).fetchall()


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return the result of an uninterrupted search, and its store."""
    path = tmp_path_factory.mktemp("tune") / "whole"
    return search(wanted(), 14, path), path


# ------------------------------------------------------------------------------ the space


def space(settings, *names, fixed=()):
    return {each.setting: each for each in search_space(settings, names, fixed)}


def test_numbers_are_searched_around_their_values_on_a_logarithmic_scale():
    found = space(QLearning(learning_rate=0.02, replay_size=2000, trace_decay=0.15))
    assert found["learning_rate"][2:] == (pytest.approx(0.002), pytest.approx(0.2), "float")
    assert found["replay_size"][2:] == (500, 8000, "int")
    assert found["learning_rate"].distribution().log
    assert found["replay_size"].distribution().log


def test_a_fraction_near_one_is_searched_by_its_distance_from_one():
    found = space(QLearning(discount=0.99))["discount"]
    assert found.label == "1 - discount"
    assert found[2:] == (pytest.approx(0.001), pytest.approx(0.1), "gap")
    assert found.value(0.0123456) == 0.9877
    assert found.drawn(0.99) == pytest.approx(0.01)
    assert found.drawn(0.5) is None


def test_a_range_ends_where_the_settings_refuse():
    assert space(QLearning(learning_rate=0.3))["learning_rate"].high == pytest.approx(1)
    assert space(Reinforce(beta1=0.4))["beta1"].high == pytest.approx(0.999999)
    assert space(QLearning(replay_passes=2))["replay_passes"][2:4] == (1, 8)
    assert space(QLearning(replay_passes=400))["replay_passes"][2:4] == (100, 1000)
    assert space(Reinforce(weight_decay=0.0))["weight_decay"][2:4] == (0, pytest.approx(0.999999))


def test_settings_without_a_range_are_left_alone():
    assert not [name for name in space(QLearning()) if name.endswith("edges")]
    assert "jitter" not in space(QLearning(jitter=0.0))
    assert "replay_passes" not in space(QLearning(replay_passes=0))


def test_choices_are_searched_where_they_are_allowed():
    assert space(QLearning())["mirrored"].choices == (False, True)
    assert "mirrored" not in space(QLearning(mirrored=False, x_edges=(0.0, 1.0)))
    assert space(Reinforce())["baseline"].choices == ("fitted", "mean")


@pytest.mark.parametrize("label", ["default", "as-published"])
@pytest.mark.parametrize("agent", AGENTS)
def test_every_agent_can_be_searched_and_both_ends_of_a_range_are_allowed(agent, label):
    named = AGENTS.settings(agent)
    settings = named.get(label, named["default"])
    found = search_space(settings)
    assert len(found) >= 4
    for each in found:
        for drawn in each.choices or (each.low, each.high):
            replace(settings, **{each.setting: each.value(drawn)})


def test_names_and_limits_narrow_the_space():
    limited = ("discount=0.9:0.999", "replay_passes=1:3", "trace_decay=0:0.5")
    found = space(QLearning(), "learning-rate", *limited)
    assert list(found) == ["learning_rate", "discount", "replay_passes", "trace_decay"]
    assert found["discount"] == Range(
        "discount", (), pytest.approx(0.001), pytest.approx(0.1), "gap"
    )
    assert found["replay_passes"][2:] == (1, 3, "int")
    assert found["trace_decay"][2:] == (0, 0.5, "float")
    assert "trace_decay" not in space(QLearning(), fixed=["trace_decay"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("tempo", "search is 'tempo'; the setting must be one of learning_rate, discount"),
        ("x_edges", "search is 'x_edges'; it has no default range"),
        ("discount=0.9", "search is 'discount=0.9'; it must be NAME=LOW:HIGH"),
        ("discount=a:b", "search is 'discount=a:b'; it must be NAME=LOW:HIGH"),
        ("discount=0.9:0.8", "search is 'discount=0.9:0.8'; it must be a number from LOW"),
        ("mirrored=0:1", "search is 'mirrored=0:1'; it must be a number"),
        ("discount=0.9:1.5", "discount is 1.5; it must be a number, at least 0 and at most 1"),
        ("trace_decay", "search is 'trace_decay'; the same setting is fixed"),
    ],
    ids=str,
)
def test_what_cannot_be_searched_is_refused(text, message):
    with pytest.raises(UprightError) as error:
        search_space(QLearning(), [text], fixed=["trace_decay"])
    assert str(error.value).startswith(message)


# ------------------------------------------------------------------------------ what is measured


@pytest.mark.slow
def test_a_candidate_is_worth_its_mean_trials_with_failures_at_their_limit(tmp_path):
    look = wanted(runs=5, trials=2)
    found = search(look, 1, tmp_path / "tune")
    assert found.settings == look.cases[0].settings, "the first candidate is what it begins with"
    results = [make_run(case, search_seed(0), run)[1] for case in look.cases for run in range(5)]
    assert not all(result.success for result in results)
    assert found.mean_trials == np.mean([r.trials if r.success else 2 for r in results])
    assert all(r.trials == 2 for r in results if not r.success)


def test_the_best_is_the_least_of_the_finished(whole):
    found, path = whole
    rows = tried(path)
    assert found.candidates == len(rows) == 14
    assert found.pruned == sum(state == "PRUNED" for state, *_ in rows) > 0
    assert found.mean_trials == min(value for state, _, value in rows if state == "COMPLETE")


def test_no_run_has_a_seed_of_a_table(tmp_path, monkeypatch):
    """Recorded where random numbers are made."""
    from upright.studies import run as running

    seeds = {}
    made = running.random_numbers

    def record(seed, run):
        seeds.setdefault(seed, set()).add(run)
        return made(seed, run)

    monkeypatch.setattr(running, "random_numbers", record)
    look = wanted(seed=7)
    found = search(look, 3, tmp_path / "tune")
    assert seeds == {search_seed(7): set(range(4))}
    validate(look, found.settings, 6)
    assert seeds == {search_seed(7): set(range(4)), validation_seed(7): set(range(6))}
    assert min(seeds) >= SEEDS


def test_seeds_of_searches_and_of_validations_never_meet():
    ends = (0, SEEDS - 1)
    assert SEEDS <= search_seed(ends[0]) < search_seed(ends[1]) < validation_seed(ends[0])
    for seed in (-1, SEEDS):
        with pytest.raises(UprightError, match=r"^seed is "):
            wanted(seed=seed)


def test_the_best_is_measured_again_beside_the_start():
    look = wanted()
    better = RandomSearch(x_scale=9.0)
    compared = validate(look, better, 10)
    made = []
    for settings, worth in zip((better, look.cases[0].settings), compared[:2], strict=True):
        cases = [replace(case, settings=settings) for case in look.cases]
        runs = [make_run(case, validation_seed(0), run)[1] for case in cases for run in range(10)]
        assert worth.mean_trials == np.mean([r.trials for r in runs])
        assert worth.ci95[0] < worth.mean_trials < worth.ci95[1]
        assert (worth.successes, worth.runs) == (sum(r.success for r in runs), 20)
        made.append(np.array([r.trials for r in runs]))
    gains = made[1] - made[0]
    assert compared.gain == gains.mean() != 0
    assert compared.gain_ci95 == bootstrap_interval(gains)


@pytest.mark.parametrize(
    ("gain", "interval", "said"),
    [
        (3.12, (1.2, 5.04), "The tuned settings are better by 3.1 trials [1.2, 5.0]."),
        (-3.12, (-5.04, -1.2), "The tuned settings are worse by 3.1 trials [1.2, 5.0]."),
        (0.02, (0.01, 0.04), "The tuned settings are better by 0.02 trials [0.01, 0.04]."),
        (1.0, (-0.5, 2.5), "can be shown: +1.0 trials [-0.5, +2.5]."),
        (-1.0, (-2.5, 0.5), "can be shown: -1.0 trials [-2.5, +0.5]."),
        (1.0, (0.0, 2.5), "No difference between the tuned and the original settings can be shown"),
        (0.0, (0.0, 0.0), "need as many trials as the original ones in every run."),
    ],
)
def test_the_verdict_is_one_sentence_about_the_interval(gain, interval, said):
    anything = Validation(1.0, (1.0, 1.0), 1, 1)
    verdict = Comparison(anything, anything, gain, interval).verdict()
    assert said in verdict
    assert verdict.count(". ") == 0


def test_candidates_that_are_not_allowed_are_given_up(tmp_path, monkeypatch):
    @dataclass(frozen=True)
    class Picky(RandomSearch):
        def __post_init__(self):
            scales = (self.x_scale, self.theta_scale)
            changed = sum(a != b for a, b in zip(scales, (2.4, math.radians(6)), strict=True))
            require("changes", changed, 0, 1)

    look = wanted()
    case = replace(look.cases[0], settings=Picky())
    picky = Search((case,), tuple(search_space(Picky(), ["x_scale", "theta_scale"])), 4, 0)
    found = search(picky, 3, tmp_path / "tune")
    assert found == (Picky(), found.mean_trials, 3, 2)


# ------------------------------------------------------------------------------ going on


def test_another_seed_gives_another_search(whole, tmp_path):
    search(wanted(seed=1), 2, tmp_path / "tune")
    rows = tried(tmp_path / "tune")
    assert rows[0][1] == tried(whole[1])[0][1], "the start"
    assert rows[1][1] != tried(whole[1])[1][1]


@pytest.mark.slow
def test_an_interrupted_search_resumes_with_the_same_result(whole, tmp_path):
    """With the same candidates, whether drawn at random or from earlier ones."""
    heard = []

    def interrupt(standing):
        heard.append(standing)
        if standing[:2] == stop:
            raise KeyboardInterrupt

    for stop in ((0, 0), (0, 2), (6, 0), (11, 1)):
        with pytest.raises(KeyboardInterrupt):
            search(wanted(), 14, tmp_path / "tune", interrupt)
        assert len(tried(tmp_path / "tune")) == stop[0]
    heard.clear()
    stop = None
    assert search(wanted(), 14, tmp_path / "tune", interrupt) == whole[0]
    assert min(standing.finished for standing in heard) == 11
    assert heard[-1] == (14, 0, whole[0].mean_trials)
    assert tried(tmp_path / "tune") == tried(whole[1])


@pytest.mark.slow
@pytest.mark.parametrize("statement", [40, 75, 90, 105, 120, 135, 150])
def test_an_interrupt_while_writing_leaves_the_store_unlocked(whole, tmp_path, statement):
    from sqlalchemy import Engine, event

    numbers, interrupted = count(), []

    def interrupt(*_):
        if next(numbers) == statement:
            interrupted.append(time.monotonic())
            signal.raise_signal(signal.SIGINT)

    event.listen(Engine, "after_cursor_execute", interrupt)
    try:
        with pytest.raises(KeyboardInterrupt):
            search(wanted(), 14, tmp_path / "tune")
    finally:
        event.remove(Engine, "after_cursor_execute", interrupt)
    (began,) = interrupted
    assert time.monotonic() - began < 50  # a connection that is locked out waits for 60 s
    assert search(wanted(), 14, tmp_path / "tune") == whole[0]


def test_a_finished_search_makes_no_run(whole, monkeypatch):
    monkeypatch.setattr(tuning, "make_missing_runs", None)
    assert search(wanted(), 14, whole[1]) == whole[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"runs": 5}, "runs"),
        ({"seed": 1}, "seed"),
        ({"steps": 301}, "task"),
        ({"noises": ("none",)}, "task"),
        ({"search": ["x_scale"]}, "space"),
    ],
    ids=str,
)
def test_a_store_of_another_search_is_refused(change, said, tmp_path):
    search(wanted(), 1, tmp_path / "tune")
    with pytest.raises(UprightError, match=f"another search, which differs in: {said};"):
        search(wanted(**change), 2, tmp_path / "tune")


def test_a_store_of_another_rule_is_refused(tmp_path, monkeypatch):
    search(wanted(), 1, tmp_path / "tune")
    monkeypatch.setattr(Case, "rule", "another")
    with pytest.raises(UprightError, match="differs in: rule;"):
        search(wanted(), 2, tmp_path / "tune")


RACE = """
import sys
from pathlib import Path
from upright.studies import tuning
from upright.studies.case import make_case
from upright.studies.search_space import search_space

me, other = sys.argv[1:]
case = make_case("random-search", steps=300, trials=60)
plan = tuning.Search((case,), tuple(search_space(case.settings, ())), 1, 0)
tuning.require_optuna()
for number in range(5):
    Path(f"{number}-{me}").touch()
    while not Path(f"{number}-{other}").exists():
        pass
    with tuning._opened(plan, f"{number}.sqlite") as optuna_study:
        assert optuna_study.user_attrs["upright"] == plan.key()
"""


@pytest.mark.slow
def test_two_searches_that_begin_at_the_same_moment_share_a_store(tmp_path):
    lines = [[sys.executable, "-c", RACE, *names] for names in ("ab", "ba")]
    started = [
        subprocess.Popen(line, cwd=tmp_path, stderr=subprocess.PIPE, text=True) for line in lines
    ]
    try:
        errors = [process.communicate(timeout=100)[1] for process in started]
    finally:
        for process in started:
            process.kill()
    assert errors == ["", ""]
    stores = {f"{number}.sqlite" for number in range(5)}
    assert {path.name for path in tmp_path.iterdir() if "-" not in path.name} == stores


CROWD = """
import signal, sys
from pathlib import Path
from upright.studies import tuning
from upright.studies.case import make_case
from upright.studies.search_space import search_space

path, holds, candidates = sys.argv[1], sys.argv[2] == "holds", int(sys.argv[3])
case = make_case("random-search", steps=300, trials=60)
plan = tuning.Search((case,), tuple(search_space(case.settings, ())), 4, 0)

def tell(progress):
    if holds and (progress.finished, progress.batch) == (1, 2):
        print("holds", flush=True)
        signal.pause()

tuning.search(plan, candidates, path, tell)
"""


@pytest.mark.slow
def test_processes_take_turns_and_one_that_is_killed_holds_up_no_other(tmp_path):
    def begin(path, role):
        line = [sys.executable, "-c", CROWD, str(path), role, "6"]
        return subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    alone, shared = tmp_path / "alone", tmp_path / "shared"
    shared.touch()  # several find it empty
    started = [begin(shared, "holds")]
    try:
        assert started[0].stdout.readline() == "holds\n"
        started += [begin(shared, "joins") for _ in range(4)]
        started[0].kill()
        errors = [process.communicate(timeout=200)[1] for process in started]
        began = begin(alone, "joins")
        started.append(began)
        errors.append(began.communicate(timeout=200)[1])
    finally:
        for process in started:
            process.kill()
    assert errors == [""] * 6
    assert len(tried(shared)) == 6
    assert tried(shared) == tried(alone)
    assert {path.name for path in tmp_path.iterdir()} == {"alone", "shared"}


@pytest.mark.parametrize(
    "name", ["t%41", "q?mode=memory&x=1", "a #b", "-x", ":memory:", "file:ä", "{SCHEMA_VERSION}"]
)
def test_a_store_has_the_name_it_is_given(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for _ in range(2):
        search(wanted(1, noises=["none"]), 1, name)
        assert [path.name for path in tmp_path.iterdir()] == [name]
        assert len(tried(tmp_path / name)) == 1


@pytest.mark.parametrize("value", ["", "\x1b[2J\n", "[", "{}", "3"])
@pytest.mark.parametrize(
    ("table", "column"),
    [("study_user_attributes", "value_json"), ("trial_params", "distribution_json")],
)
def test_a_damaged_store_is_refused(table, column, value, tmp_path):
    path = tmp_path / "tune"
    search(wanted(), 2, path)
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(f"UPDATE {table} SET {column} = ?", (value,))
    with pytest.raises(UprightError, match=r"^store is '.*tune'; it ") as caught:
        search(wanted(), 3, path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["", ".", "/"])
def test_a_folder_is_no_store(name):
    with pytest.raises(UprightError, match=r"^store is '.*'; it is a folder, a file is needed$"):
        search(wanted(), 1, name)


def test_a_store_that_is_gone_is_missed(tmp_path):
    def remove(standing):
        (tmp_path / "tune").unlink()

    with pytest.raises(UprightError, match="tune'; it cannot be opened: No such file or directory"):
        search(wanted(), 1, tmp_path / "tune", remove)


def test_a_store_is_there_whole_or_not_at_all(tmp_path, monkeypatch):
    def fail(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(tuning, "_check_same", fail)
    with pytest.raises(KeyboardInterrupt):
        search(wanted(), 1, tmp_path / "tune")
    assert not list(tmp_path.iterdir())


def test_files_that_are_no_search_are_refused_and_left_alone(tmp_path):
    (tmp_path / "text").write_text("not a database")
    with Store(tmp_path / "runs") as store:
        study([make_case("random-search", steps=50, trials=1)], 1, 0, store)
    for name, said in (("text", "not a database"), ("runs", "another program"), ("a/b", "folder")):
        before = (tmp_path / name).read_bytes() if (tmp_path / name).exists() else None
        with pytest.raises(UprightError, match=said):
            search(wanted(), 1, tmp_path / name)
        assert ((tmp_path / name).read_bytes() if before else None) == before


# ------------------------------------------------------------------------------ saying it


@pytest.mark.parametrize(
    ("agent", "label"), [(agent, label) for agent in AGENTS for label in AGENTS.settings(agent)]
)
def test_settings_are_printed_in_forms_that_make_them_again(agent, label):
    start = AGENTS.settings(agent)[label]
    rng = np.random.default_rng(5)
    for _ in range(10):
        drawn = {
            each.setting: each.value(
                rng.choice(each.choices).item()
                if each.choices
                else each.low + (each.high - each.low) * rng.random()
                if each.kind != "int"
                else int(rng.integers(each.low, each.high + 1))
            )
            for each in search_space(start)
        }
        settings = replace(start, **drawn)
        options = as_options("--set", changed_values(start, settings))
        texts = dict(shlex.split(option)[1].split("=") for option in options)
        assert change_settings(start, texts) == settings
        scope = {}
        exec(as_python(settings).replace("\n\n", "\n\nmade = "), scope)
        assert scope["made"] == settings


def test_tuples_are_quoted_for_the_shell():
    changed = changed_values(AseAce(), AseAce(x_edges=(-1.5, 1.5)))
    assert as_options("--set", changed) == ["--set 'x_edges=(-1.5, 1.5)'"]


# ------------------------------------------------------------------------------ the command

LINE = "tune random-search --steps 300 --noises none --runs 4 --candidates 8 --validation-runs 9"


@pytest.mark.slow
def test_tune_prints_its_result_and_can_be_resumed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for candidates in (8, 10):
        line = [*LINE.split(), "--candidates", str(candidates), "--set", "x_scale=2.0"]
        line += ["--output", "tuned.toml"]
        assert run([*line, "--search", "theta_scale", "--search", "x_dot_scale"]) == 0
        shown = capsys.readouterr().out
        assert f"best of {candidates} candidates" in shown
        assert "a failed run counts as 1,000" in shown
        assert shown.count("9 of 9 runs succeeded") == 2
        assert "upright learn random-search --set x_scale=2.0" in shown
        assert "\nRandomSearch(x_scale=2.0" in shown
        assert "\nThe tuned settings are " in shown or "\nNo difference " in shown
        file = read_settings("tuned.toml")
        assert (file.agent, file.values["x_scale"]) == ("random-search", 2.0)
        assert repr(RandomSearch(**file.values)).startswith("RandomSearch(x_scale=2.0")
        learn = next(text for text in shown.splitlines() if text.startswith("upright learn"))
        for name, value in changed_values(RandomSearch(), RandomSearch(**file.values)).items():
            assert f"--set {name}={value}" in learn
        assert f"candidates = {candidates}\n" in (tmp_path / "tuned.toml").read_text()
    assert len(tried(tmp_path / "tune-random-search.sqlite")) == 10


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("--candidates 0", "candidates is 0"),
        ("--runs 0", "runs is 0"),
        ("--validation-runs 0", "runs is 0"),
        (
            "--seed 1000000",
            "seed is 1000000; it must be a whole number, at least 0 and at most 999",
        ),
        ("--noises loud", "'loud'"),
        ("--search tempo", "'tempo'"),
        ("--set x_scale=2 --search x_scale", "the same setting is fixed"),
        ("--set x_scale", "NAME=VALUE"),
        ("--store missing/tune", "folder"),
        ("--output missing/tuned.toml", "folder"),
        ("--output tuned.json", "'.json'; it must be one of .toml"),
        ("--set x_scale=2,3", "ask for 2 cases; this command has one"),
    ],
)
def test_bad_usage_prints_one_clear_line_and_changes_nothing(
    more, said, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    assert run([*LINE.split(), *more.split()]) == BAD_USE
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert said in error
    assert not list(tmp_path.iterdir())


def test_help_has_examples_and_does_not_import_optuna(capsys):
    with pytest.raises(SystemExit):
        run(["tune", "--help"])
    shown = capsys.readouterr().out
    assert "examples:\n  upright tune q-learning" in shown
    code = "import sys; from upright.commands import run\ntry: run(['tune', '--help'])\n"
    code += "except SystemExit: print({'optuna', 'numpy', 'numba'} & set(sys.modules))"
    assert python(code).stdout.endswith("set()\n")


def test_without_optuna_one_line_says_how_to_get_it():
    code = "import sys; sys.modules['optuna'] = None\nfrom upright.commands import run\n"
    ended = python(code + "raise SystemExit(run(['tune', 'q-learning']))")
    assert ended.returncode == BAD_USE
    command = "pip install 'optuna>=4.0' (the extra 'tune' of upright)"
    assert ended.stderr == f"upright: error: tuning needs Optuna: {command}\n"


def candidates_kept(path) -> Iterator[int]:
    until = time.monotonic() + 120
    while time.monotonic() < until:
        try:
            yield len(tried(path))
        except sqlite3.OperationalError:  # the tables do not exist yet
            yield 0
        time.sleep(0.02)


@pytest.mark.slow
def test_an_interrupt_says_how_to_go_on(tmp_path):
    command = [sys.executable, "-m", "upright", *LINE.split(), "--candidates", "100000"]
    with subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, env=os.environ | {"TERM": "dumb"}
    ) as process:
        try:
            kept = candidates_kept(tmp_path / "tune-random-search.sqlite")
            next(count for count in kept if count > 2)
            process.send_signal(signal.SIGINT)
            _, error = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == INTERRUPTED
    assert "finished candidates are kept in tune-random-search.sqlite; the same command" in error
    assert "Traceback" not in error
