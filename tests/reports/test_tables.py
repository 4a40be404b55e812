import csv
import io
import json

import numpy as np
import pytest
from scipy.stats import norm

from upright.core.trials import Result
from upright.reports.statistics import summarise
from upright.reports.tables import (
    render,
    study_table,
    to_csv,
    to_json,
    to_latex,
    to_markdown,
    to_text,
)
from upright.studies.case import make_case
from upright.studies.intervals import bootstrap_interval, wilson_interval


def result(run, trials, success=True, steps=100):
    lengths = np.full(trials, 7)
    lengths[-1] = steps if success else 7
    return Result(run, success, lengths, 0.5)


@pytest.fixture
def rows():
    case = make_case("q-learning", noise="none")
    noisy = make_case("q-learning", "as-published", noise="sensor-5", start="zero")
    results = [result(0, 3), result(1, 5), result(2, 10), result(3, 1000, success=False)]
    return [summarise(case, 0, results), summarise(noisy, 0, [result(0, 1000, success=False)])]


def test_wilson_interval_is_the_published_formula():
    successes, runs, z = 17, 20, norm.ppf(0.975)
    p = successes / runs
    middle = (p + z**2 / (2 * runs)) / (1 + z**2 / runs)
    half = z * np.sqrt(p * (1 - p) / runs + z**2 / (4 * runs**2)) / (1 + z**2 / runs)
    assert wilson_interval(successes, runs) == pytest.approx((middle - half, middle + half))


def test_bootstrap_interval_covers_the_mean_as_often_as_it_says():
    rng = np.random.default_rng(3)
    intervals = [bootstrap_interval(rng.geometric(0.1, 40)) for _ in range(60)]
    covered = sum(low <= 10 <= high for low, high in intervals)
    assert covered >= 50
    assert np.mean([high - low for low, high in intervals]) < 8


def test_bootstrap_interval_of_values_alike_or_alone_is_that_value():
    assert bootstrap_interval(np.array([4, 4, 4])) == (4, 4)
    assert bootstrap_interval(np.array([9])) == (9, 9)


def test_failed_runs_count_in_the_rate_and_not_in_the_mean(rows):
    row = rows[0]
    assert (row.runs, row.successes, row.success_rate) == (4, 3, 0.75)
    assert row.mean_trials == 6
    assert row.median_trials == 5
    assert row.max_trials == 10
    assert row.p95_trials == pytest.approx(9.5)
    assert row.ci95[0] < 6 < row.ci95[1]
    assert row.steps_simulated == 2 * 7 + 4 * 7 + 9 * 7 + 3 * 100 + 1000 * 7
    assert row.seconds == 2.0


def test_a_case_without_success_has_no_mean(rows):
    row = rows[1]
    assert (row.successes, row.mean_trials, row.ci95, row.median_trials) == (0, None, None, None)
    table = study_table(rows)
    assert table.body[1][table.head.index("Mean trials")] == "–"


def test_published_figures_appear_beside_their_case(rows):
    assert rows[0].published["Report"] == 42
    assert "Si & Wang 2001" not in rows[0].published
    assert "Report" not in rows[1].published
    assert rows[1].published["Si & Wang 2001"] == 32


def test_a_published_column_is_there_only_if_a_row_has_its_figure(rows):
    other = summarise(make_case("q-learning", noise="none", steps=100), 0, [result(0, 3)])
    assert "Report" in study_table([rows[0], other]).head
    assert not {"Report", "Si & Wang 2001", "gym-cartpolemod"} & {*study_table([other]).head}
    place = study_table([rows[0], other]).head.index("Report")
    assert [line[place] for line in study_table([rows[0], other]).body] == ["42.00", "–"]
    notes = study_table([rows[0]]).notes
    assert any(note.endswith("(20 runs, N = 60,000, start random).") for note in notes)


def test_changed_settings_are_named_in_every_format():
    case = make_case("q-learning", settings={"learning_rate": 0.3})
    row = summarise(case, 0, [result(0, 3)])
    assert json.loads(to_json([row]))[0]["settings"] == "default, learning_rate=0.3"
    for name in ("text", "markdown", "csv"):
        assert "default, learning_rate=0.3" in render([row], name)
    assert r"default, learning\_rate=0.3" in render([row], "latex")


def test_json_is_read_back(rows):
    first, second = json.loads(to_json(rows))
    assert first["mean_trials"] == 6
    assert second["mean_trials"] is None


def test_csv_is_read_back(rows):
    first, second = csv.DictReader(io.StringIO(to_csv(rows)))
    assert float(first["ci95_low"]) < 6 < float(first["ci95_high"])
    assert second["ci95_low"] == ""
    assert float(first["published: Report"]) == 42


def test_every_line_of_every_table_has_all_columns(rows):
    table = study_table(rows)
    assert {len(line) for line in table.body} == {len(table.head)}
    bars = [line.count("|") for line in to_markdown(table).splitlines() if line.startswith("|")]
    assert set(bars) == {len(table.head) + 1}
    ands = [line for line in to_latex(table).splitlines() if line.endswith(r"\\")]
    assert {line.replace(r"\&", "").count("&") for line in ands} == {len(table.head) - 1}
    assert all("%" not in line.replace(r"\%", "") for line in ands)
    assert "6.0 [" in to_text(table)


def test_render_knows_its_formats(rows):
    assert render(rows, "json") == to_json(rows)
    assert render(rows, "csv") == to_csv(rows)
    with pytest.raises(ValueError, match=r"'html'.*text, markdown"):
        render(rows, "html")
