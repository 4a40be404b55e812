import numpy as np
import pytest

import upright
from upright.core.conditions import PUBLISHED_NOISES
from upright.reports.comparison import COLUMNS, MEASURED, PLOTS
from upright.reports.notebook import html_table

TASK = {"runs": 3, "steps": 200, "progress": False}


@pytest.fixture(scope="module")
def compared():
    return upright.compare(["reinforce", "q-learning"], ["none", "sensor-5"], seed=4, **TASK)


def test_its_runs_are_those_of_a_study(compared):
    case = upright.make_case("q-learning", noise="sensor-5", steps=200)
    studied = upright.study([case], 3, 4)[case]
    found = compared.results[case]
    assert [r.lengths.tolist() for r in found] == [r.lengths.tolist() for r in studied]


def test_guessing_stands_beside_every_learner_unless_told_otherwise():
    def agents(*given, **options):
        return [row.agent for row in upright.compare(*given, **TASK | options).rows]

    assert agents("reinforce") == ["reinforce", "random-search"]
    assert agents(["reinforce"], guessing=False) == ["reinforce"]
    assert agents(["random-search", "reinforce"]) == ["random-search", "reinforce"]
    assert agents(["reinforce", "reinforce"]) == ["reinforce", "random-search"]


def test_all_noises_are_the_published_ones():
    compared = upright.compare("random-search", "all", runs=1, steps=20, progress=False)
    assert [row.task.noise for row in compared.rows] == list(PUBLISHED_NOISES)


def test_settings_and_parts_of_the_task_are_those_of_a_case():
    compared = upright.compare("q-learning", settings="as-published", start="zero", **TASK)
    assert (
        upright.make_case("q-learning", "as-published", start="zero", steps=200) in compared.results
    )


def test_a_frame_has_a_row_for_each_run(compared):
    frame = compared.frame()
    assert tuple(frame.columns) == COLUMNS + MEASURED["run"]
    assert len(frame) == 3 * 2 * 3
    case = upright.make_case("q-learning", noise="sensor-5", steps=200)
    rows = frame[(frame["agent"] == "q-learning") & (frame["noise"] == "sensor-5")]
    assert rows["trials"].tolist() == [r.trials for r in compared.results[case]]
    assert rows["steps"].tolist() == [r.lengths.sum() for r in compared.results[case]]
    assert rows["success"].dtype == bool
    assert set(rows["seed"]) == {4}


def test_a_frame_has_a_row_for_each_trial(compared):
    runs, trials = compared.frame(), compared.frame("trial")
    assert tuple(trials.columns) == COLUMNS + MEASURED["trial"]
    by_run = trials.groupby(["agent", "noise", "run"], sort=False)
    assert by_run.size().tolist() == runs["trials"].tolist()
    assert by_run["steps"].sum().tolist() == runs["steps"].tolist()
    assert (~by_run["fallen"].last()).tolist() == runs["success"].tolist()
    assert by_run["trial"].first().eq(1).all()


@pytest.fixture(scope="module")
def lengths():
    """A sweep of two lengths and two forces."""
    values = {"half_length": np.array([0.5, 1.0]), "force": (10, 12.5)}
    return upright.compare("q-learning", parameters=values, **TASK)


def test_several_values_of_parameters_give_every_combination(lengths):
    found = [(row.agent, *row.task.parameters[3::3][:2]) for row in lengths.rows]
    each = [(0.5, 10), (0.5, 12.5), (1, 10), (1, 12.5)]
    assert found == [(agent, *both) for agent in ("q-learning", "random-search") for both in each]
    case = upright.make_case("q-learning", steps=200, parameters={"half_length": 1.0})
    assert case in lengths.results
    assert repr(lengths) == (
        "Comparison(q-learning, random-search; none; 2 of half_length; 2 of force; 3 runs each)"
    )


def test_the_frame_of_a_sweep_has_a_column_for_each_parameter_that_differs(lengths):
    frame = lengths.frame()
    assert tuple(frame.columns) == (*COLUMNS, "half_length", "force", *MEASURED["run"])
    assert frame.groupby(["agent", "half_length", "force"]).size().tolist() == [3] * 8
    assert set(lengths.frame("trial")["half_length"]) == {0.5, 1.0}


def test_a_sweep_is_drawn_over_the_parameter_that_is_chosen(lengths, compared):
    figure = lengths.plot("sweep", "force")
    assert figure.get_suptitle().startswith("Trials to success over force")
    with pytest.raises(upright.UprightError, match=r"^runs differ in half_length and force"):
        lengths.plot("sweep")
    with pytest.raises(upright.UprightError, match=r"^there is no sweep"):
        compared.plot("sweep")


@pytest.mark.parametrize("kind", [kind for kind in PLOTS if kind != "sweep"])
def test_it_is_drawn_and_a_notebook_shows_the_figure(compared, kind):
    assert compared.plot(kind)._repr_png_().startswith(b"\x89PNG")


def test_it_is_shown_short_as_text_and_as_html(compared):
    assert repr(compared) == (
        "Comparison(reinforce, q-learning, random-search; none, sensor-5; 3 runs each)"
    )
    assert str(compared) == upright.render(compared.rows, "text")
    shown = compared._repr_html_()
    assert shown.count("<tr>") == 1 + 6
    for row in compared.rows:
        assert f">{row.agent}</td>" in shown
    assert "95 %" in shown


def test_html_is_escaped_and_numbers_are_aligned_to_the_right():
    shown = html_table(["Agent", "Trials"], [["<b>", "1 & 2"]], ["<i>"], ["Agent"])
    assert '<td style="text-align: left">&lt;b&gt;</td>' in shown
    assert '<td style="text-align: right">1 &amp; 2</td>' in shown
    assert "&lt;i&gt;" in shown


def test_a_store_is_given_by_its_path_or_open(tmp_path):
    path = tmp_path / "runs.sqlite"
    first = upright.compare("reinforce", store=path, **TASK)
    with upright.Store(path) as store:
        again = upright.compare("reinforce", store=store, **TASK)
        assert repr(store) == f"Store({str(path)!r}, 2 cases, 6 runs)"
    times = [[r.seconds for r in each] for each in first.results.values()]
    assert times == [[r.seconds for r in each] for each in again.results.values()]


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"agents": "nobody"}, "agent is 'nobody'"),
        ({"agents": 3.5}, "agent is 3.5"),
        ({"noises": "loud"}, "noise is 'loud'"),
        ({"noise": "none"}, "noise is 'none'; compare takes noises"),
        ({"runs": 0}, "runs is 0"),
        ({"stepz": 3}, "part of a task is 'stepz'"),
        ({"parameters": {"force": []}}, "force is []; it must be a number, or several"),
        ({"parameters": {"force": [1, 0]}}, "force is 0; it must be a number, at least 1e-12"),
        ({"parameters": {"force": "1:2:3"}}, "force is '1:2:3'; it must be a number"),
        ({"parameters": {"length": [1, 2]}}, "parameter is 'length'"),
        ({"parameters": {"force": range(1, 1002)}}, "the sweep has 1,001 cases"),
        ({"parameters": {"force": range(1, 600)}}, "the sweep has 1,198 cases"),
        ({"store": "no/folder/runs.sqlite"}, "store is 'no/folder/runs.sqlite'"),
    ],
    ids=str,
)
def test_bad_requests_are_refused_in_one_line(options, told):
    with pytest.raises(upright.UprightError) as error:
        upright.compare(**{"agents": "reinforce", **TASK, **options})
    assert str(error.value).startswith(told)
    assert "\n" not in str(error.value)


def test_unknown_frames_and_plots_are_refused(compared):
    with pytest.raises(
        upright.UprightError, match=r"^each is 'step'; it must be one of run, trial"
    ):
        compared.frame("step")
    with pytest.raises(
        upright.UprightError, match=r"^kind is 'pie'; it must be one of trials, cur"
    ):
        compared.plot("pie")


def test_without_pandas_a_frame_says_how_to_get_it(compared, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    with pytest.raises(upright.UprightError, match=r"^frame\(\) needs pandas"):
        compared.frame()
