import json
import re

import pytest

from upright.reports.reproduction import reproduce
from upright.studies.case import make_case
from upright.studies.store import Store

PICTURES = ("learning-curves.png", "trials.png", "policies.png", "phases.png")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reproduced")
    reproduce(folder, runs=2, steps=500)
    return folder


def test_the_report_has_tables_and_pictures(folder):
    report = (folder / "report.md").read_text()
    for picture in PICTURES:
        assert f"]({picture})" in report
        assert (folder / picture).stat().st_size > 10_000
    assert "| Report |" not in report, "its N is another"
    assert len(re.findall(r"^\| gaussian-0\.2 \|", report, re.MULTILINE)) == 2


def test_all_cases_are_there_with_random_guessing(folder):
    rows = json.loads((folder / "table.json").read_text())
    assert len(rows) == 5 * 7
    assert {(row["agent"], row["settings"]) for row in rows} == {
        ("reinforce", "as-published"),
        ("reinforce", "default"),
        ("q-learning", "as-published"),
        ("q-learning", "default"),
        ("random-search", "default"),
    }
    assert {row["runs"] for row in rows} == {2}


@pytest.mark.slow
def test_runs_made_before_are_kept(folder):
    case = make_case("reinforce", steps=500)
    store = Store(folder / "runs.sqlite")
    before = store.results(case.key, 0)
    store.close()
    reproduce(folder, runs=3, steps=500)
    store = Store(folder / "runs.sqlite")
    after = store.results(case.key, 0)
    store.close()
    assert len(after) == 3
    # A run made again would have taken another time.
    assert [result.seconds for result in after[:2]] == [result.seconds for result in before]
