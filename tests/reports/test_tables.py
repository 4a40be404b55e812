import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from upright.core.trials import Result
from upright.errors import UprightError
from upright.reports.statistics import in_order, summarise
from upright.reports.tables import (
    mean_text,
    render,
    study_table,
    success_text,
    to_csv,
    to_json,
    to_latex,
    to_markdown,
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


def test_render_knows_its_formats(rows):
    assert render(rows, "json") == to_json(rows)
    assert render(rows, "csv") == to_csv(rows)
    with pytest.raises(ValueError, match=r"'html'.*text, markdown"):
        render(rows, "html")


# ------------------------------------------------------------------------------ text


LONG_NAME = "examples.compiled_agent:hill_climber_with_a_long_name"


def wide_rows(*agents, **differing):
    """Return rows of agents on two noise cases, with figures that take much room."""
    case = make_case("random-search", steps=600_000, start="zero")
    results = [result(run, 300 + 400 * run, steps=600_000) for run in range(2)]
    row = replace(summarise(case, 0, results), **differing)
    return [
        replace(row, agent=agent, task=replace(row.task, noise=noise))
        for agent in agents
        for noise in ("none", "gaussian-0.2")
    ]


@pytest.mark.parametrize("width", [60, 80, 120, 200])
@pytest.mark.parametrize("agents", [("ndp", "reinforce"), ("ndp", LONG_NAME)])
@pytest.mark.parametrize("sources", [False, True])
def test_no_line_of_a_text_is_wider_than_asked_for_and_nothing_is_cut(width, agents, sources):
    rows = wide_rows(*agents)
    shown = render(rows, "text", width=width, sources=sources)
    assert max(map(len, shown.splitlines())) <= width
    for agent in agents:
        assert agent in shown
    plain = " ".join(shown.split())
    for row in rows:
        assert f"{success_text(row)} {mean_text(row)}" in plain
    for head in study_table(rows).head[3:]:  # in a table, or in the note that it is not
        assert head in plain
    missing = [head for head in study_table(rows).head[3:] if head not in shown.splitlines()[0]]
    assert ("Not shown" in plain) == (bool(missing) and not sources)


def test_a_text_at_80_columns():
    shown = render(wide_rows("ndp", "adaptive-lqr"), "text", width=80)
    assert shown.splitlines()[:3] == [
        "Agent         Noise                 Success           Mean trials  Median    p95",
        "─" * 80,
        "ndp           none          100 % [34, 100]  500.0 [300.0, 700.0]   500.0  680.0",
    ]


def test_a_text_with_long_names_at_60_columns():
    shown = render(wide_rows("ndp", LONG_NAME), "text", width=61)
    assert shown.splitlines()[:8] == [
        "  Noise                 Success           Mean trials  Median",
        "─────────────────────────────────────────────────────────────",
        "ndp",
        "  none          100 % [34, 100]  500.0 [300.0, 700.0]   500.0",
        "  gaussian-0.2  100 % [34, 100]  500.0 [300.0, 700.0]   500.0",
        LONG_NAME,
        "  none          100 % [34, 100]  500.0 [300.0, 700.0]   500.0",
        "  gaussian-0.2  100 % [34, 100]  500.0 [300.0, 700.0]   500.0",
    ]


def test_what_all_rows_share_is_a_note_and_what_differs_is_a_column():
    rows = wide_rows("ndp")
    assert "\nSettings: default.\n" in render(rows, "text", width=200)
    assert "Settings" not in render(rows, "text", width=200).splitlines()[0]
    several = [rows[0], replace(rows[1], settings="as-published", seed=4, runs=7)]
    head = render(several, "text", width=200).splitlines()[0].split()
    assert head[:5] == ["Agent", "Settings", "Noise", "Runs", "Seed"]


def sweep_rows(name="half_length", values=(0.25, 0.5, 2), agents=("ndp", "random-search")):
    """Return rows of agents over values of a parameter."""
    return [
        replace(row, task=replace(row.task, parameters={name: value}))
        for row in wide_rows(*agents)[::2]
        for value in values
    ]


def test_a_parameter_that_differs_is_a_column_with_its_unit():
    shown = render(sweep_rows(), "text", width=80).splitlines()
    assert shown[0].split()[:4] == ["Agent", "half_length", "[m]", "Success"]
    assert [line.split()[:2] for line in shown[2:5]] == [["ndp", v] for v in ("0.25", "0.5", "2")]
    assert "Settings: default. Noise: none." in shown
    assert "| ndp | default | none | 0.25 |" in render(sweep_rows(), "markdown")
    assert "half" not in render(sweep_rows(values=[0.25]), "text", width=200).splitlines()[0]


def test_values_stay_on_their_lines_where_names_are_too_long():
    shown = render(sweep_rows(agents=[LONG_NAME]), "text", width=66).splitlines()
    assert shown[0].startswith("  half_length [m]  ")
    assert shown[2] == LONG_NAME
    assert [line.split()[0] for line in shown[3:6]] == ["0.25", "0.5", "2"]
    noisy = [replace(r, task=replace(r.task, noise="sensor-5")) for r in sweep_rows()]
    shown = render([*sweep_rows(), *noisy], "text", width=66).splitlines()
    assert shown[0].startswith("  Noise     half_length [m]  ")
    assert shown[3].startswith("  none      0.25  ")


def test_a_task_says_nothing_twice():
    rows = sweep_rows()
    rows[0] = replace(rows[0], task=replace(rows[0].task, steps=300))
    table = study_table(rows)
    place = table.head.index("Task")
    assert table.head[place - 1] == "half_length [m]"
    assert [line[place] for line in table.body[:2]] == ["N = 300 steps", "N = 600,000 steps"]


def test_csv_has_a_column_for_a_parameter_that_differs():
    found = csv.DictReader(io.StringIO(to_csv(sweep_rows("force", (5, 10)))))
    assert [line["force"] for line in found] == ["5.0", "10.0"] * 2
    assert "force" not in to_csv(wide_rows("ndp")).splitlines()[0].split(",")


def test_values_of_a_parameter_ascend():
    rows = sweep_rows("force", (2, 5, 10, 20))
    assert in_order(reversed(rows)) == rows


def test_where_published_figures_are_from_is_said_if_asked_for():
    rows = wide_rows("ndp")
    assert "IEEE Trans." in render(rows, "text", width=200, sources=True)
    assert "IEEE Trans." not in render(rows, "text", width=200)
    for name in ("markdown", "latex"):
        assert "IEEE Trans." in render(rows, name)


def test_letters_that_take_two_columns_are_counted_so():
    lines = render(wide_rows("module:倒立", "ndp"), "text", width=200).splitlines()
    assert lines[2].startswith("module:倒立  none")
    assert lines[4].startswith("ndp          none")


def test_numbers_are_flush_right_in_latex(rows):
    head = to_latex(study_table(rows)).partition(r"\toprule")[0]
    assert r"\begin{tabular}{lllll" + "r" * 9 + "}" in head  # rows differ in task and runs, too


@pytest.mark.parametrize(("version", "said"), [("0.1.0", "upright 0.1.0."), (None, "seed 0.")])
def test_the_version_that_made_the_runs_is_named_if_it_is_known(version, said):
    (note, *_) = study_table(wide_rows("ndp", version=version)).notes
    assert note.endswith(said)


def test_rows_stand_in_the_order_of_a_table():
    agents = ["adaptive-lqr", "reinforce", "random-search", "mine:B", "mine:A"]
    rows = wide_rows(*agents)
    others = [replace(row, settings="as-published") for row in rows[:2]]
    expected = [*rows[:2], *others, *rows[2:]]
    given = sorted(expected, key=lambda row: (row.task.noise, row.settings, row.agent != "mine:B"))
    assert in_order(given) == expected


@pytest.mark.parametrize("wrong", [3, "rows", [1], None])
def test_what_is_no_row_is_refused_by_name(wrong, rows):
    with pytest.raises(UprightError, match=r"^rows is .*; it must be a list of what summarise"):
        render(wrong, "text")
    with pytest.raises(UprightError, match=r"^rows is Row"):
        render(rows[0], "text")
