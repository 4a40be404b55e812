"""Pictures: what they show, and that they can be drawn of everything there can be."""

import doctest
from dataclasses import replace
from itertools import combinations, pairwise

import matplotlib
import numpy as np
import pytest
from helpers import GOOD_WEIGHTS, POOR_WEIGHTS
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.collections import LineCollection, PolyCollection, QuadMesh
from matplotlib.colors import same_color, to_rgb

from upright.agents import AGENTS
from upright.agents.custom import CustomAgent
from upright.agents.parts.policy_form import Table
from upright.agents.random_search import RandomSearchAgent
from upright.core.conditions import NOISES
from upright.core.task import TaskSpec
from upright.core.trials import Result
from upright.errors import UprightError
from upright.policies.policy import Policy
from upright.reports import plots
from upright.reports.plots import curves, distributions, phases, policies, style, sweep
from upright.studies.case import Case, make_case
from upright.studies.intervals import wilson_interval


def results_of(*trials, steps=60_000, limit=None):
    """Return results of runs that succeeded after so many trials, or failed where 0 is given."""
    return [
        Result(run, True, np.array([*range(10, 9 + count), steps]), 0.1)
        if count
        else Result(run, False, np.arange(10, 10 + (limit or 1000)), 0.1)
        for run, count in enumerate(trials)
    ]


def custom(agent, label="default", **task):
    return Case(agent, label, CustomAgent(agent), TaskSpec(**task))


def drawn(figure):
    """Draw a figure, so that positions and tick labels are final."""
    figure.savefig("/dev/null", format="png")
    return figure


def tick_labels(axis):
    low, high = sorted(axis.get_view_interval())
    return [
        label.get_text()
        for value, label in zip(axis.get_ticklocs(), axis.get_ticklabels(), strict=True)
        if low <= value <= high
    ]


def labels_of(figure):
    """Return all entries of the legends of a figure."""
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes)]
    return [text.get_text() for legend in legends if legend for text in legend.get_texts()]


def lines_of(axes, label):
    return [line for line in axes.get_lines() if line.get_label() == label]


def panels_of(figure):
    return [axes for axes in figure.axes if axes.axison and axes.get_label() != "<colorbar>"]


# Ticks


@given(st.integers(1, 10**6))
def test_trials_are_marked_by_few_whole_numbers_from_the_first_on(last):
    ticks = style.whole_ticks(last)
    assert all(isinstance(tick, int) and 1 <= tick <= last for tick in ticks)
    assert ticks == sorted(set(ticks))
    assert 1 <= len(ticks) <= 11
    assert ticks[0] <= 2


@given(st.integers(1, 1000), st.integers(1, 10**9))
def test_logarithmic_axes_are_marked_by_whole_numbers_within(low, factor):
    ticks = style.logarithmic_ticks(low, low * factor)
    assert all(isinstance(tick, int) and low <= tick <= low * factor for tick in ticks)
    assert len(ticks) <= 13


@pytest.mark.parametrize("trials", [4, 5, 7, 23, 41, 1000])
def test_a_learning_curve_has_whole_trials_and_numbers_as_people_write_them(trials):
    lengths = np.array([*np.arange(8, 7 + trials), 60_000])
    (axes,) = drawn(plots.plot_curve(lengths, 60_000, "title")).axes
    numbers = [int(text.replace(",", "")) for text in tick_labels(axes.xaxis)]
    assert all(1 <= number <= trials for number in numbers)
    assert set(tick_labels(axes.yaxis)) >= {"1,000", "10,000"}
    assert axes.get_ylabel() == "steps balanced"


@pytest.mark.parametrize("module", [style, distributions, sweep])
def test_the_examples_hold(module):
    result = doctest.testmod(module)
    assert result.attempted
    assert not result.failed


# The curve of a run


def test_a_learning_curve_holds_its_trials_and_the_success():
    lengths = np.array([9, 30, 20, 500, 60_000])
    (axes,) = plots.plot_curve(lengths, 60_000, "REINFORCE", "seed 3").axes
    (line,) = lines_of(axes, "trial")
    np.testing.assert_array_equal(line.get_xydata(), np.stack([[1, 2, 3, 4, 5], lengths], axis=1))
    assert axes.get_title(loc="left") == "REINFORCE"
    texts = [text.get_text() for text in axes.texts]
    assert texts == ["seed 3", "success: 60,000 steps"]
    assert [line.get_marker() for line in axes.get_lines()].count("*") == 1


def test_a_failed_run_is_seen_to_have_failed():
    (axes,) = plots.plot_curve(np.full(12, 9), 500, "NDP", "seed 3").axes
    assert axes.texts[0].get_text() == "seed 3; no success in 12 trials"
    (end,) = (line for line in axes.get_lines() if line.get_marker() == "X")
    assert end.get_xydata().tolist() == [[12, 9]]


@pytest.mark.parametrize("lengths", [[60_000], [9, 60_000], [9, 12, 60_000], [8]])
def test_few_trials_are_bars_from_zero(lengths):
    (axes,) = drawn(plots.plot_curve(np.array(lengths), 60_000, "title", agent="ndp")).axes
    assert [bar.get_height() for bar in axes.patches] == lengths
    assert axes.get_yscale() == "linear"
    assert axes.get_ylim()[0] == 0
    assert tick_labels(axes.xaxis) == [str(trial) for trial in range(1, len(lengths) + 1)]
    assert f"{lengths[-1]:,}" in [text.get_text() for text in axes.texts]
    pale = axes.patches[0].get_facecolor()
    assert same_color(pale, style.AGENT_COLOURS["ndp"]) == (lengths[0] == 60_000)


def test_a_long_run_is_pale_points_and_their_running_median():
    lengths = np.random.default_rng(0).geometric(0.01, 400)
    (axes,) = plots.plot_curve(lengths, 60_000, "title").axes
    points, median = lines_of(axes, "trial") + lines_of(axes, "median of 21 trials")
    np.testing.assert_array_equal(points.get_ydata(), lengths)
    assert sum(to_rgb(points.get_color())) > sum(to_rgb(median.get_color()))
    trials, medians = median.get_xydata().T
    np.testing.assert_array_equal(trials, np.arange(1, 401))
    assert medians[199] == np.median(lengths[189:210])
    assert (medians[0], medians[-1]) == (lengths[0], lengths[-1])


def test_the_running_median_of_very_long_runs_has_few_points():
    trials, medians, window = curves.running_median(np.arange(100_000))
    assert len(trials) <= curves.POINTS
    assert window == 5_001
    np.testing.assert_array_equal(medians, trials - 1)


# Learning curves of studies


def test_the_median_run_lies_within_the_middle_half():
    results = results_of(3, 8, 20, 5, 9, 30)
    low, median, high = curves.quartiles(results, 60_000)
    assert np.all((low <= median) & (median <= high))
    (axes,) = panels_of(plots.plot_curves([(make_case("ndp"), results)]))
    (line,) = lines_of(axes, "median run")
    np.testing.assert_array_equal(line.get_ydata(), median)
    (band,) = (part for part in axes.collections if isinstance(part, PolyCollection))
    corners = band.get_paths()[0].vertices
    for trial in (1, 9, 30):
        heights = corners[corners[:, 0] == trial][:, 1]
        assert (heights.min(), heights.max()) == (low[trial - 1], high[trial - 1])


def test_a_run_that_has_succeeded_counts_with_all_steps_later_and_a_failed_one_does_not():
    _, median, _ = curves.quartiles(results_of(1, 3, 2), 60_000)
    assert median.tolist() == [10, 60_000, 60_000]
    _, median, _ = curves.quartiles(results_of(0, 0, 1, limit=4), 60_000)
    assert median.tolist() == [10, 11, 12, 13]


def test_successes_and_failures_are_marked_where_they_were():
    results = results_of(3, 0, 7, limit=20)
    (axes,) = panels_of(plots.plot_curves([(make_case("ndp", trials=20), results)]))
    (success,), (failure,) = lines_of(axes, "success of a run"), lines_of(axes, "failed run")
    assert success.get_xdata().tolist() == [3, 7]
    assert failure.get_xydata().tolist() == [[20, 29]]
    assert axes.texts[0].get_text() == "3 runs, 1 failed"


def test_panels_wrap_to_rows_and_share_their_axes():
    learned = [(make_case(agent), results_of(3, number + 4)) for number, agent in enumerate(AGENTS)]
    figure = plots.plot_curves([*learned, *learned[:2]])
    panels = panels_of(figure)
    assert len(panels) == 8
    assert len({round(axes.get_position().y0, 2) for axes in panels}) == 3
    assert len({(axes.get_xlim(), axes.get_ylim()) for axes in panels}) == 1
    assert figure.get_figwidth() == style.WIDTH
    titles = [axes.get_title(loc="left") for axes in panels]
    assert titles[:2] == ["Adaptive LQR", "REINFORCE"]
    assert figure.get_suptitle() == "Learning curves, without noise"


@pytest.mark.parametrize("plot", [plots.plot_curves, plots.plot_trials])
def test_what_all_tasks_have_in_common_is_said_once(plot):
    tasks = ({"noise": "none", "trials": 20}, {"noise": "all-5", "trials": 20})
    figure = plot([(make_case("ndp", **task), results_of(3)) for task in tasks])
    assert figure.get_suptitle().lower().endswith("at most 20 trials")
    texts = [text.get_text() for axes in panels_of(figure) for text in axes.texts]
    assert not any("20 trials" in text for text in texts)
    figure = plot([(make_case("ndp", trials=count), results_of(3)) for count in (20, 30)])
    for axes, number in zip(panels_of(figure), ("20", "30"), strict=True):
        assert f"at most {number} trials" in axes.texts[0].get_text()


def test_panels_of_several_noise_cases_say_which():
    learned = [(make_case("ndp", noise=noise), results_of(3)) for noise in ("none", "sensor-5")]
    panels = panels_of(plots.plot_curves(learned))
    titles = [axes.get_title(loc="left") for axes in panels]
    assert titles == ["NDP, without noise", "NDP, 5 % sensor noise"]


# Distributions


def curve_of(axes, colour, line="-"):
    """Return the trials and the fractions of the curve of a colour."""
    (found,) = (
        drawn
        for drawn in axes.get_lines()
        if drawn.get_drawstyle() == "steps-post"
        and same_color(drawn.get_color(), colour)
        and drawn.get_linestyle() == line
    )
    return found.get_xydata()


def test_a_distribution_is_the_fraction_of_all_runs_that_succeeded():
    learned = [(make_case("reinforce"), results_of(3, 5, 5, 0))]
    figure = drawn(plots.plot_trials(learned))
    (axes,) = panels_of(figure)
    steps = curve_of(axes, style.AGENT_COLOURS["reinforce"])
    assert steps[1:3].tolist() == [[3, 0.25], [5, 0.75]]
    assert (steps[0, 1], steps[-1, 1]) == (0, 0.75)
    assert "75 %" in [text.get_text() for text in axes.texts]
    assert tick_labels(axes.xaxis) == ["1", "10", "100", "1,000"]
    assert axes.get_title(loc="left") == "Without noise"


def test_the_band_of_a_distribution_is_wilsons_interval():
    (axes,) = panels_of(plots.plot_trials([(make_case("ndp"), results_of(2, 2, 9, 0, 0))]))
    (band,) = (part for part in axes.collections if isinstance(part, PolyCollection))
    corners = band.get_paths()[0].vertices
    at_success = corners[corners[:, 0] == 9][:, 1]
    assert (at_success.min(), at_success.max()) == pytest.approx(
        (wilson_interval(2, 5)[0], wilson_interval(3, 5)[1])
    )


def test_published_means_are_drawn_for_the_published_task_alone():
    runs = results_of(3, 5)
    ours = plots.plot_trials([(make_case("q-learning"), runs), (make_case("reinforce"), runs)])
    means = {
        line.get_xdata()[0]: line.get_color()
        for line in panels_of(ours)[0].get_lines()
        if line.get_drawstyle() == "default"
    }
    assert set(means) == {35.65, 42.0}
    assert means[42.0] == style.AGENT_COLOURS["q-learning"]
    assert labels_of(ours)[:2] == ["Q-learning", "REINFORCE"]
    assert set(labels_of(ours)[2:]) == {
        "Report, REINFORCE (mean)",
        "Report, Q-learning (mean)",
    }
    upright = plots.plot_trials([(make_case("ndp", start="zero", steps=600_000), runs)])
    assert labels_of(upright) == ["NDP", "Si & Wang 2001 (mean)"]
    for changed in (
        {"steps": 100},
        {"condition": "delay-2"},
        {"start": "wide"},
        {"parameters": {"force": 5}},
        {"plant": "mujoco"},
    ):
        figure = plots.plot_trials([(make_case("q-learning", **changed), runs)])
        assert len(labels_of(figure)) == 1, changed


def test_tasks_have_panels_in_the_order_of_noises_with_their_differences_in_words():
    tasks = ({"noise": "sensor-5"}, {}, {"steps": 600, "condition": "delay-1"})
    learned = [(make_case("reinforce", **task), results_of(3)) for task in tasks]
    panels = panels_of(plots.plot_trials(learned))
    assert [axes.get_title(loc="left") for axes in panels] == [
        "Without noise",
        "Without noise",
        "5 % sensor noise",
    ]
    assert panels[1].texts[-1].get_text() == "success after 600 steps, condition\ndelay-1"


def test_custom_agents_and_settings_are_told_apart_and_named():
    cases = [
        custom("mine:Pd"),
        custom("mine:Lqr"),
        make_case("q-learning"),
        make_case("q-learning", "as-published"),
        replace(make_case("q-learning"), label="default, learning_rate=0.3"),
        replace(make_case("q-learning"), label="default, learning_rate=0.5"),
    ]
    looks = style.looks(cases)
    assert len(set(looks)) == len(cases)
    assert looks[0].colour != looks[1].colour
    assert [look.line for look in looks[:4]] == ["-", "-", "-", "--"]
    figure = plots.plot_trials([(case, results_of(2, 4)) for case in cases])
    assert labels_of(figure)[:6] == [
        "Pd",
        "Lqr",
        "Q-learning",
        "Q-learning, as published",
        "Q-learning, learning_rate=0.3",
        "Q-learning, learning_rate=0.5",
    ]


def test_the_first_settings_shown_have_a_solid_line_if_the_default_ones_are_absent():
    swept = [replace(make_case("ndp"), label=f"default, discount=0.{n}") for n in (5, 7)]
    first, second = style.looks(swept)
    assert first == style.Look(style.AGENT_COLOURS["ndp"], "-")
    assert second.line != "-"
    first, default = style.looks([swept[0], make_case("ndp")])
    assert (first.line, default.line) == (":", "-")


def test_the_same_settings_elsewhere_have_another_line():
    here, there = style.looks([make_case("ndp"), make_case("ndp", plant="mujoco")])
    assert here != there
    tasks = [make_case("ndp"), make_case("ndp", noise="sensor-5")]
    assert len(set(style.looks(tasks))) == 1


VISION = {
    "usual": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
"""How colours are seen: matrices of linear RGB (Machado et al., IEEE TVCG 15, 2009, severity 1)."""


def seen(colour, vision):
    """Return a colour as it is seen, in CIELAB."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    xyz = to_xyz @ np.clip(VISION[vision] @ linear, 0, 1) / [0.9505, 1.0, 1.089]
    x, y, z = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("vision", VISION)
def test_agents_can_be_told_apart_with_any_colour_vision(vision):
    colours = [*style.AGENT_COLOURS.values(), *style.CUSTOM_COLOURS]
    for one, other in combinations(colours, 2):
        difference = np.linalg.norm(seen(one, vision) - seen(other, vision))
        assert difference > 10, (one, other)


def test_an_agent_has_its_colour_in_every_picture():
    assert set(style.AGENT_COLOURS) == set(AGENTS.built_in)
    for cases in ([make_case("ndp")], [custom("a:b"), make_case("ndp"), make_case("reinforce")]):
        found = dict(zip((case.agent for case in cases), style.looks(cases), strict=True))
        assert found["ndp"].colour == style.AGENT_COLOURS["ndp"]


def test_twelve_custom_agents_have_different_looks():
    assert len(set(style.looks([custom(f"a:b{number}") for number in range(12)]))) == 12


@given(st.lists(st.floats(0, 1), max_size=9).map(sorted))
def test_labels_do_not_overlap_nor_leave_the_picture(values):
    moved = distributions.spread(values, 0.1)
    assert len(moved) == len(values)
    assert all(after - before > 0.1 - 1e-9 for before, after in pairwise(moved))
    assert all(-1e-9 <= value <= 1 + 1e-9 for value in moved)
    if all(after - before >= 0.1 for before, after in pairwise(values)):
        np.testing.assert_allclose(moved, values, atol=1e-9)


# Sweeps


def swept(agent, lengths, *trials, **task):
    """Return cases of an agent over lengths of the pole, each with its runs."""
    return [
        (make_case(agent, parameters={"half_length": length}, **task), results_of(*own))
        for length, own in zip(lengths, trials, strict=True)
    ]


LENGTHS = [0.25, 0.5, 1.0, 2.0]
ALL_SUCCEED = [(3, 5), (4, 4), (6, 2), (9, 11)]


def points(axes, look):
    """Return the line of a colour in a panel, and which of its marks are hollow."""
    lines = [line for line in axes.get_lines() if line.get_color() == look]
    marks = [line for line in lines if line.get_marker() == "o"]
    hollow = [mark.get_xdata()[0] for mark in marks if same_color(mark.get_mfc(), "white")]
    return lines[0].get_xydata().tolist(), hollow


def test_a_sweep_shows_mean_trials_and_successes_over_the_values():
    learned = [
        *swept("ndp", LENGTHS[::-1], (0, 0), (9, 11), (4, 0), (3, 5)),
        *swept("random-search", LENGTHS, *ALL_SUCCEED),
    ]
    upper, lower = drawn(plots.plot_sweep(learned)).axes
    line, hollow = points(upper, style.AGENT_COLOURS["ndp"])
    assert line[:3] == [[0.25, 4], [0.5, 4], [1, 10]]
    assert np.isnan(line[3][1])  # no run succeeded
    assert hollow == [0.5, 2]
    line, hollow = points(lower, style.AGENT_COLOURS["ndp"])
    assert line == [[0.25, 1], [0.5, 0.5], [1, 1], [2, 0]]
    line, hollow = points(upper, style.AGENT_COLOURS["random-search"])
    assert (line, hollow) == ([[0.25, 4], [0.5, 4], [1, 4], [2, 10]], [])


def test_the_intervals_of_a_sweep_are_those_of_tables():
    upper, lower = plots.plot_sweep(swept("ndp", [1, 2], (3, 9, 9), (4, 4, 0))).axes
    for axes, low, high in ((upper, 3, 9), (lower, wilson_interval(3, 3)[0], 1)):
        (bars,) = (each for each in axes.collections if isinstance(each, LineCollection))
        (_, bottom), (_, top) = bars.get_segments()[0]
        assert low <= bottom < top <= high
        assert len(bars.get_segments()) == 2
    assert bottom == low


@pytest.mark.parametrize(
    ("lengths", "scale", "labels"),
    [
        (LENGTHS, "log", ["0.25", "0.5", "1", "2"]),
        ([0.25, 0.336475, 0.452862, 0.609507], "log", ["0.25", "0.336", "0.453", "0.61"]),
        ([0.5, 1.0, 1.5, 2.0], "linear", ["0.5", "1", "1.5", "2"]),
        ([0.5, 0.50001, 1.0, 1.5], "linear", ["0.5", "1", "1.5"]),
    ],
)
def test_an_axis_of_values_has_plain_numbers_that_do_not_touch(lengths, scale, labels):
    upper, lower = drawn(plots.plot_sweep(swept("ndp", lengths, *ALL_SUCCEED))).axes
    assert upper.get_xscale() == lower.get_xscale() == scale
    assert lower.get_xlabel() == "half_length [m]"
    assert tick_labels(lower.xaxis) == labels
    assert {len(set(axes.get_xlim())) for axes in (upper, lower)} == {2}
    assert upper.get_xlim() == lower.get_xlim()
    boxes = [label.get_window_extent() for label in lower.get_xticklabels()]
    assert all(one.x1 < other.x0 for one, other in pairwise(boxes))


def test_the_legend_of_a_sweep_names_each_learner_once_and_hollow_marks():
    learned = [*swept("ndp", [1, 2], (3,), (4,)), *swept("random-search", [1, 2], (3,), (4,))]
    assert labels_of(plots.plot_sweep(learned)) == ["NDP", "Random search"]
    learned += swept("q-learning", [1, 2], (3,), (0,))
    assert labels_of(plots.plot_sweep(learned))[-1] == "some runs failed"


def test_other_differences_of_a_sweep_have_panels_of_their_own():
    task = {"parameters": {"half_length": 3, "force": 5}}
    learned = [
        *swept("ndp", [1, 2], (3,), (4,), steps=300),
        *swept("ndp", [1, 2], (3,), (4,), steps=300, noise="sensor-5"),
        (make_case("ndp", steps=300, **task), results_of(1)),  # a task of its own, with one value
    ]
    figure = plots.plot_sweep(learned, "half_length")
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles == ["Without noise", "5 % sensor noise", "", ""]
    texts = figure.axes[0].texts[0].get_text().splitlines()
    assert texts == ["force=10", "1 run each, with 95 % intervals"]
    assert figure.get_suptitle() == "Trials to success over half_length, success after 300 steps"
    with pytest.raises(
        UprightError, match=r"^no task has runs at several values of force; upright"
    ):
        plots.plot_sweep(learned, "force")


@pytest.mark.parametrize(
    "learned",
    [
        pytest.param(swept("ndp", [1, 2], (0,), (0,)), id="all failed"),
        pytest.param(swept("ndp", [1, 2], (1,), (1,)), id="first trials"),
        pytest.param(
            [
                entry
                for steps in range(1, 4)
                for entry in swept("ndp", [1e-3, 1, 1e3], *[(1, 900)] * 3, steps=steps)
            ],
            id="three tasks",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_extreme_sweeps_can_be_drawn_without_a_warning(learned, tmp_path):
    plots.save(plots.plot_sweep(learned), tmp_path / "picture.svg")
    assert (tmp_path / "picture.svg").stat().st_size > 10_000


# Whatever there can be


@pytest.mark.parametrize("plot", [plots.plot_curves, plots.plot_trials])
@pytest.mark.parametrize(
    "learned",
    [
        pytest.param([(make_case("ndp", steps=1), results_of(1, steps=1))], id="one trial, step"),
        pytest.param([(make_case("ndp", trials=1), results_of(0, limit=1))], id="one failed trial"),
        pytest.param([(make_case("ndp"), results_of(0, 0, 0))], id="all failed"),
        pytest.param(
            [(make_case("ndp", noise=noise), results_of(1, 9)) for noise in NOISES],
            id="all noises",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            [(custom(f"a_module:{'VeryLong' * 6}Agent{n}"), results_of(n + 1)) for n in range(9)],
            id="nine custom agents",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_extremes_can_be_drawn_without_a_warning(plot, learned, tmp_path):
    plots.save(plot(learned), tmp_path / "picture.svg")
    assert (tmp_path / "picture.svg").stat().st_size > 10_000


@pytest.mark.parametrize("lengths", [[1], [3, 3, 3, 3], [9] * 41, [1] * 999 + [5]])
def test_extreme_runs_can_be_drawn_without_a_warning(lengths, tmp_path):
    figure = plots.plot_curve(np.array(lengths), 5, "Very long title " * 20)
    plots.save(figure, tmp_path / "picture.pdf")
    assert (tmp_path / "picture.pdf").read_bytes().startswith(b"%PDF")


# Policies


def linear(*weights, **task):
    """Return the policy that pushes right where the weighted sum of measurements is above zero."""
    memory = RandomSearchAgent(np.array(weights), np.ones(4))
    return Policy("random-search", memory, TaskSpec(**task), seed=4, run=2)


def test_a_map_says_who_where_and_to_which_side():
    figure = drawn(plots.plot_policies([linear(*GOOD_WEIGHTS, noise="sensor-5")]))
    pole, cart, bar = figure.axes
    assert pole.get_title(loc="left") == "Random search, 5 % sensor noise"
    assert pole.texts[0].get_text() == "seed 4, run 2\ncart at rest in the middle"
    assert (pole.get_xlabel(), pole.get_ylabel()) == (
        "angle of the pole [°]",
        "angular velocity [°/s]",
    )
    assert (cart.get_xlabel(), cart.get_ylabel()) == ("position of the cart [m]", "velocity [m/s]")
    assert [label.get_text() for label in bar.get_yticklabels()][::4] == ["0  left", "1  right"]
    for axes, limit in ((pole, 12), (cart, 2.4)):
        edges = {round(line.get_xdata()[0], 9) for line in axes.get_lines()}
        assert edges == {-limit, limit}


def test_a_map_shows_the_probabilities_at_their_places():
    policy = linear(0.0, 0.0, 1.0, 0.5)
    pole, _ = policies.planes(policy.learned_on.parameters)
    across, up, pushes = policies.policy_map(policy, pole)
    angles, speeds = (across[1:] + across[:-1]) / 2, (up[1:] + up[:-1]) / 2
    expected = angles[None, :] + 0.5 * speeds[:, None] > 0
    np.testing.assert_array_equal(pushes > 0.5, expected)
    axes = plots.plot_policies([policy]).axes[0]
    (mesh,) = (part for part in axes.collections if isinstance(part, QuadMesh))
    np.testing.assert_array_equal(mesh.get_array(), pushes)
    assert mesh.norm.vmin + mesh.norm.vmax == 1


class Boxes:
    """What a table policy has learned, in plain Python."""

    form = Table(
        ((-0.8, 0.8), (), (-0.1, 0.0, 0.05), (-0.9, 0.9, 8.0)),
        tuple(np.random.default_rng(0).integers(0, 2, 3 * 4 * 4).astype(float)),
    )

    def policy_form(self):
        return self.form

    def push_probability(self, observation):
        boxes = map(np.searchsorted, self.form.edges, observation)
        shape = [len(cuts) + 1 for cuts in self.form.edges]
        return self.form.probabilities[np.ravel_multi_index(tuple(boxes), shape)]


def test_boxes_of_a_table_are_drawn_as_they_are():
    policy = Policy("q-learning", Boxes(), TaskSpec())
    pole, _ = policies.planes(policy.learned_on.parameters)
    across, up, pushes = policies.policy_map(policy, pole)
    assert across[1:-1].tolist() == [-0.1, 0.0, 0.05]
    assert up[1:-1].tolist() == [-0.9, 0.9]  # the last cut is beyond the map
    for angle, speed in ((0.03, 0.4), (-0.2, -1.9), (0.001, 1e-6), (0.2, 2.0)):
        box = pushes[np.searchsorted(up, speed) - 1, np.searchsorted(across, angle) - 1]
        assert box == policy.push_probability(pole.state(angle, speed))
    axes = plots.plot_policies([policy]).axes[0]
    (mesh,) = (part for part in axes.collections if isinstance(part, QuadMesh))
    assert not mesh.get_rasterized()  # edges stay sharp in vector files


def test_the_line_of_a_map_separates_the_sides():
    across, up = np.array([0, 1, 2]), np.array([0, 10, 20])
    pushes = np.array([[0.0, 1.0], [0.5, 1.0]])
    assert policies.boundary(across, up, pushes) == [[(1, 0), (1, 10)]]


# Phase portraits


@pytest.fixture(scope="module")
def portrait():
    return linear(*GOOD_WEIGHTS, noise="gaussian-0.1"), plots.plot_phases(linear(*GOOD_WEIGHTS))


def test_a_portrait_holds_every_step_and_a_smooth_line_in_colours_of_time(portrait):
    _, figure = portrait
    policy = linear(*GOOD_WEIGHTS)
    task = replace(policy.learned_on, steps=phases.PORTRAIT_STEPS).task()
    states = plots.trajectory(policy, task)
    assert states.shape == (501, 4)
    for axes, columns, unit in zip(
        figure.axes[:2], (slice(0, 2), slice(2, 4)), (1, 180 / np.pi), strict=True
    ):
        (steps,) = lines_of(axes, "every step")
        np.testing.assert_allclose(steps.get_xydata(), states[:, columns] * unit)
        (line,) = (part for part in axes.collections if isinstance(part, LineCollection))
        np.testing.assert_allclose(line.get_array(), 0.02 * np.arange(500))
        (start,), (end,) = lines_of(axes, "start"), lines_of(axes, "end")
        pieces = line.get_segments()
        np.testing.assert_allclose(start.get_xydata()[0], pieces[0][0], atol=1e-9)
        np.testing.assert_allclose(end.get_xydata()[0], pieces[-1][1], atol=1e-9)
    assert figure.axes[2].get_ylabel() == "time [s]"


def test_a_portrait_has_limits_and_a_title_in_words(portrait):
    _, figure = portrait
    cart, pole, _ = figure.axes
    for axes, limit, text in ((cart, 2.4, "±2.4 m"), (pole, 12, "±12°")):
        edges = [line.get_xdata()[0] for line in axes.get_lines() if line.get_linestyle() == "--"]
        assert sorted(edges) == pytest.approx([-limit, limit])
        assert f"limits {text}" in axes.texts[-1].get_text()
    assert figure.get_suptitle() == "Random search, without noise: balanced for 10 s"
    assert "smoothed over 17 steps (0.34 s)" in labels_of(figure)


@pytest.mark.slow
def test_a_portrait_is_of_the_plant_and_the_integrator_that_the_policy_had():
    def states(integrator="rk4", **task):
        plant = {"name": "equations", "integrator": integrator}
        figure = plots.plot_phases(replace(linear(*GOOD_WEIGHTS, **task), plant=plant))
        return lines_of(figure.axes[1], "every step")[0].get_xydata()

    long = states(parameters={"half_length": 2.0})
    np.testing.assert_array_equal(states(condition="at-0.half_length=2"), long)
    assert (states()[1] != long[1]).any()
    assert (states()[1] != states("euler")[1]).any()


@pytest.mark.parametrize("weights", [POOR_WEIGHTS, (0.0, 0.0, -1.0, 0.0)])
def test_the_portrait_of_a_fall_says_so(weights, tmp_path):
    figure = plots.plot_phases(linear(*weights))
    assert "fallen after" in figure.get_suptitle()
    plots.save(figure, tmp_path / "picture.png")


def test_smoothing_removes_zigzag_and_keeps_motion_and_ends():
    seconds = np.linspace(0, 10, 501)
    slow = np.stack([np.sin(2 * seconds), np.cos(2 * seconds)], axis=1)
    zigzag = slow + 0.3 * (-1.0) ** np.arange(501)[:, None]
    smooth = phases.smoothed(zigzag)
    assert np.abs(smooth - slow)[20:-20].max() < 0.05
    np.testing.assert_allclose(smooth[[0, -1]], zigzag[[0, -1]])
    for count in (2, 3, 4, 20):
        assert phases.smoothed(zigzag[:count]).shape == (count, 2)


def test_arrows_are_spread_along_the_path():
    path = np.stack([np.arange(100.0) ** 2, np.zeros(100)], axis=1)
    places = phases.arrow_places(path, 5)
    np.testing.assert_allclose(path[places, 0] / 99**2, [0.1, 0.3, 0.5, 0.7, 0.9], atol=0.03)


# Files


@pytest.mark.parametrize(
    ("ending", "start"), [("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")]
)
def test_the_ending_selects_the_format(ending, start, tmp_path):
    figure = plots.plot_curve(np.array([5]), 5, "title")
    plots.save(figure, tmp_path / f"picture.{ending}")
    assert (tmp_path / f"picture.{ending}").read_bytes().startswith(start)


def test_the_same_runs_give_the_same_file(tmp_path):
    for ending in ("png", "pdf", "svg"):
        for name in ("one", "two"):
            plots.save(plots.plot_curve(np.array([5]), 5, "title"), tmp_path / f"{name}.{ending}")
        one, two = tmp_path / f"one.{ending}", tmp_path / f"two.{ending}"
        assert one.read_bytes() == two.read_bytes()


def test_other_endings_are_refused(tmp_path):
    with pytest.raises(UprightError, match=r"'.doc'.*\.png, \.pdf, \.svg"):
        plots.check_picture(tmp_path / "picture.doc")


def test_pictures_look_the_same_whatever_the_style_of_the_program():
    with matplotlib.rc_context({"axes.facecolor": "black", "font.size": 30, "axes.grid": False}):
        figure = plots.plot_curve(np.arange(5, 20), 30, "title")
    (axes,) = figure.axes
    assert same_color(axes.get_facecolor(), "white")
    assert axes.xaxis.label.get_size() == style.STYLE["axes.labelsize"]
