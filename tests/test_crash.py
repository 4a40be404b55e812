"""A short form of tools/crash.py, and what that program must find."""

import json
import os
import subprocess

import crash
import numpy as np
import pytest
import reliability

from upright.commands import COMMANDS
from upright.core.trials import Result
from upright.studies.case import make_case
from upright.studies.store import Store

CHEAPEST = ("new", "cite")
SHORT = crash.Scenario(
    "table-short",
    "table --agents random-search --noises none --runs 50 --steps 300 --store a.sqlite",
)
READ_ONLY = {"agents", "check", "completion", "plants", "terms", "verify"}
"""Commands that write nothing but to the terminal."""
ELSEWHERE = {"build", "gazebo", "ros2", "watch"}
"""Commands tested in tests/builds, tests/plants/test_gazebo.py and tests/nodes/test_ros2.py."""


@pytest.mark.slow
def test_killed_commands_lose_nothing(tmp_path):
    scenarios = [SHORT, *(each for each in crash.SCENARIOS if each.name in CHEAPEST)]
    tallies = crash.crash(scenarios, 20, 0, tmp_path)
    assert [fault for tally in tallies for fault in tally.faults] == []
    assert sum(tally.kills for tally in tallies) == 20
    assert all(tally.completions for tally in tallies)


def test_a_command_that_fails_undisturbed_is_a_fault(tmp_path):
    wrong = crash.Scenario("wrong", "cite --format runes --output a.bib")
    (tally,) = crash.crash([wrong], 3, 0, tmp_path)
    assert (tally.kills, len(tally.faults)) == (0, 1)
    assert "wrong fails with status 2: " in tally.faults[0]


def test_every_command_that_writes_is_killed():
    killed = {scenario.command.split()[0] for scenario in crash.SCENARIOS}
    assert killed | READ_ONLY | ELSEWHERE == set(COMMANDS)


def test_the_plan_follows_from_the_seed_and_covers_all_kinds_of_kills():
    plans = [crash.plan(SHORT, 0, number) for number in range(50)]
    assert plans == [crash.plan(SHORT, 0, number) for number in range(50)]
    assert plans != [crash.plan(SHORT, 1, number) for number in range(50)]
    kills = [kill for planned, _ in plans for kill in planned]
    assert {len(planned) for planned, _ in plans} == {4, 5, 6, 7, 8}
    assert {(kill.change is None, kill.alone) for kill in kills} == {
        (a, b) for a in (False, True) for b in (False, True)
    }
    assert {preset for _, preset in plans} == {False, True}
    timing = crash.Ended(0, b"", "", 2.0, [1.0, 1.9])
    moments = [kill.after(timing) for kill in kills]
    assert {count for count, _ in moments} == {0, 1, 2}
    assert all(0 <= delay <= (2.0, 1.0, 0.11)[count] for count, delay in moments)


# ------------------------------------------------------------------------------ what it must find


def round_of(tmp_path, **files):
    """Return a round whose reference has these files, in a place that holds them all."""
    place = crash.Place(tmp_path / "round")
    for name, text in files.items():
        (place.files / name).write_text(text)
    ended = crash.Ended(0, b"done", "", 1.0, [0.5])
    reference = crash.Reference(
        ended, place.listing(), crash.contents(place.files, place.listing()["files"])
    )
    return crash.Round(SHORT, reference, place, crash.Tally(SHORT), {"old": b"old"})


def test_what_equals_the_reference_passes(tmp_path):
    game = round_of(tmp_path, old="new", other="text")
    game.check_complete(game.reference.ended)
    assert game.tally.completions == 1


@pytest.mark.parametrize(
    ("spoil", "found"),
    [
        (lambda files: (files / "old").write_text("ne"), "old is half-written"),
        (lambda files: (files / "old").unlink(), "old is gone"),
        (lambda files: (files / "old").write_text("old"), "old differs from the reference"),
        (lambda files: (files / ".old.tmp").touch(), r"files has besides: \.old\.tmp"),
        (lambda files: (files / "../temporary/x").touch(), "temporary has besides: x"),
        (lambda files: (files / "empty").unlink(), "empty differs from the reference"),
    ],
)
def test_what_differs_is_a_fault(spoil, found, tmp_path):
    game = round_of(tmp_path, old="new", empty="")
    spoil(game.place.files)
    with pytest.raises(crash.Fault, match=found):
        game.check_complete(game.reference.ended)


def test_another_status_or_other_words_are_a_fault(tmp_path):
    game = round_of(tmp_path, old="new")
    ended = game.reference.ended
    with pytest.raises(crash.Fault, match="status is 2, not 0: wrong"):
        game.check_complete(ended._replace(status=2, errors="wrong"))
    with pytest.raises(crash.Fault, match="what it prints differs"):
        game.check_complete(ended._replace(printed=b"do"))


def test_a_store_may_grow_but_not_lose_or_invent_a_run(tmp_path):
    key = make_case("random-search", steps=300).key

    def put(path, *runs):
        with Store(path) as store:
            for run in runs:
                store.add(key, 0, Result(run, True, np.array([300]), 0.5))

    place = crash.Place(tmp_path / "round")
    path = place.files / "a.sqlite"
    put(tmp_path / "whole.sqlite", 0, 1, 2)
    put(path, 0)
    whole = {"a.sqlite": crash.content_of(tmp_path / "whole.sqlite")}
    ended = crash.Ended(0, b"", "", 1.0, [])
    game = crash.Round(SHORT, crash.Reference(ended, {}, whole), place, crash.Tally(SHORT), {})
    game.check_whole()
    put(path, 1)
    game.check_whole()
    path.unlink()
    put(path, 0, 2)
    with pytest.raises(crash.Fault, match="lost what it held"):
        game.check_whole()
    put(path, 1, 3)
    with pytest.raises(crash.Fault, match="holds what the reference does not"):
        game.check_whole()
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(crash.Fault, match="cannot be read"):
        game.check_whole()


def test_children_that_outlive_a_command_are_found_and_killed(tmp_path, monkeypatch):
    monkeypatch.setattr(crash, "PATIENCE", 0.1)
    place = crash.Place(tmp_path / "place")
    child = subprocess.Popen(["sleep", "100"], env=os.environ | {crash.MARK: place.mark})
    assert place.left_processes() == [child.pid]
    assert child.wait(10) == -9
    assert place.left_processes() == []


def test_figures_are_recorded_beside_those_of_other_long_runs(tmp_path):
    tallies = [crash.Tally(SHORT, 4, 3, 2), crash.Tally(SHORT, 1, 0, 1, 0.9, ["lost"])]
    (path := tmp_path / "records.json").write_text('{"fuzz": 1, "crash": 2}')
    reliability.put("crash", crash.figures(tallies, 7), path)
    records = json.loads(path.read_text())
    assert records["fuzz"] == 1
    assert records["crash"]["rows"][-1] == ["all", 5, 3, 3, 1]


def test_a_long_run_may_be_recorded_in_parts(tmp_path):
    path = tmp_path / "records.json"
    scenarios = [each for each in crash.SCENARIOS if each.name in CHEAPEST]
    for scenario, kills in zip(scenarios, (3, 4), strict=True):
        part = crash.Tally(scenario, kills=kills, writing=1, completions=1)
        reliability.put("crash", crash.figures([part], 0, reliability.rows("crash", path)), path)
    assert [row[:2] for row in reliability.rows("crash", path)] == [
        ["`new` (new)", 3],
        ["`cite` (cite)", 4],
    ]
    assert json.loads(path.read_text())["crash"]["rows"][-1] == ["all", 7, 2, 2, 0]
