import json
import re
import shlex
from dataclasses import fields

import numpy as np
import pytest
from helpers import ROOT, recorded_rows

from upright import __version__
from upright.agents import AGENTS
from upright.commands import run
from upright.core.conditions import PUBLISHED_NOISES
from upright.core.task import TaskSpec
from upright.core.trials import Result
from upright.errors import UprightError
from upright.reports import leaderboards
from upright.reports.leaderboards import (
    LEADERBOARD,
    ROBUST,
    ROBUST_BOARD,
    BoardPlan,
    board,
    board_text,
    make_board,
    make_rows,
    ranks,
)
from upright.reports.published import SOURCES
from upright.reports.statistics import Row, summarise
from upright.studies.case import make_case
from upright.studies.store import Store
from upright.support.exit_status import BAD_USE

SMALL = BoardPlan(("q-learning", "random-search"), runs=3, seed=4, steps=200)
BOARDS = (LEADERBOARD, ROBUST_BOARD)


def row(agent="random-search", low=1.0, high=2.0, mean=1.5, successes=10, runs=10, task=TaskSpec()):
    """Return a row in which only the given values matter."""
    some = successes > 0
    return Row(
        agent=agent,
        settings="default",
        task=task,
        runs=runs,
        successes=successes,
        success_rate=successes / runs,
        success_ci95=(0.0, 1.0),
        mean_trials=mean if some else None,
        ci95=(low, high) if some else None,
        median_trials=mean if some else None,
        p95_trials=mean if some else None,
        max_trials=2 if some else None,
        mean_trials_all_runs=mean,
        all_runs_ci95=(low, high),
        steps_simulated=1,
        seconds=1.0,
        published={},
        seed=0,
    )


def cells(line):
    return [cell.strip() for cell in line.strip("|").split("|")]


def tables(text):
    """Return the tables in a Markdown text: lists of cells, the header first."""
    found = re.findall(r"(?:^\|.*\|\n)+", text, re.MULTILINE)
    return [[cells(line) for line in table.splitlines() if "---" not in line] for table in found]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a folder with small versions of both boards, and the rows of each."""
    folder = tmp_path_factory.mktemp("boards")
    plan = SMALL._replace(store=folder / "runs.sqlite")
    rows = {
        each.name: make_board(each, plan._replace(output=folder / f"{each.name}.md"))
        for each in BOARDS
    }
    return folder, rows


# ------------------------------------------------------------------------------ ranks


@pytest.mark.parametrize(
    ("intervals", "expected"),
    [
        ([(1, 2), (3, 4), (5, 6)], [1, 2, 3]),
        ([(5, 6), (1, 2), (3, 4)], [3, 1, 2]),
        ([(1, 3), (2, 4), (5, 6)], [1, 1, 3]),  # two tied, and both before the third
        ([(1, 2), (2, 3)], [1, 1]),  # touching intervals overlap
        ([(1, 2), (2.001, 3)], [1, 2]),
        ([(1, 3), (2, 5), (4, 6)], [1, 1, 2]),  # the one in the middle is tied with both
        ([(1, 10), (2, 3), (4, 5)], [1, 1, 2]),  # a wide one is better than none of them
        ([(7, 7), (7, 7)], [1, 1]),
        ([(1, 2)], [1]),
    ],
)
def test_disjoint_intervals_are_ranked_and_overlapping_ones_are_tied(intervals, expected):
    assert ranks([row(low=low, high=high) for low, high in intervals]) == expected


def test_ranks_go_by_all_runs():
    """An agent that fails often ranks behind, even if its successful runs were short."""

    def results(*runs):
        return [
            Result(run, success, np.ones(trials, np.int64), 0.1)
            for run, (trials, success) in enumerate(runs)
        ]

    case = make_case("random-search")
    lucky = summarise(case, 0, results((1, True), (2, True), (1000, False), (1000, False)))
    steady = summarise(case, 0, results((20, True), (21, True), (19, True), (22, True)))
    assert lucky.mean_trials == 1.5 < steady.mean_trials
    assert lucky.mean_trials_all_runs == (1 + 2 + 1000 + 1000) / 4
    low, high = lucky.all_runs_ci95
    assert 1 <= low < lucky.mean_trials_all_runs < high <= 1000
    failing = summarise(case, 0, results(*[(1000, False)] * 3, (999, False)))
    assert failing.mean_trials is None
    assert ranks([failing, steady]) == [2, 1]
    assert ranks([steady, failing, steady]) == [1, 3, 1]


# ------------------------------------------------------------------------------ a board


def test_the_best_agent_stands_first():
    columns = {
        "calm": [row("slow", 5, 6), row("quick", 1, 2), row("middling", 3, 4)],
        "windy": [row("slow", 5, 6), row("quick", 2, 3), row("middling", 1, 1.5)],
    }
    (table,) = tables(board(columns))
    assert table[0] == ["Agent", "Mean rank", "calm", "windy"]
    assert [line[:2] for line in table[1:]] == [
        ["`quick`", "1.5"],
        ["`middling`", "1.5"],
        ["`slow`", "3.0"],
    ]


@pytest.mark.parametrize(
    ("made", "expected"),
    [
        (row(mean=1.5, low=1, high=2), "**1. 1.50 [1.00, 2.00]**"),
        (row(mean=1.5, low=1, high=2, successes=7), "**1. 1.50 [1.00, 2.00]** 70 %"),
        (row(mean=9.5, low=9, high=10), "2. 9.50 [9.00, 10.00]"),
        (row(mean=9.5, low=9, high=10, successes=9), "2. 9.50 [9.00, 10.00] 90 %"),
        (row(low=1000, high=1000, mean=1000, successes=0), "2. never"),
    ],
)
def test_a_cell_has_rank_mean_interval_and_the_rate_where_runs_failed(made, expected):
    other = row("other", 3, 4)
    (table,) = tables(board({"calm": [made, other]}))
    assert [line[2] for line in table if line[0] == f"`{made.agent}`"] == [expected]


def published_columns(start, steps=600_000):
    return {noise: [row(task=TaskSpec(noise, start, steps=steps))] for noise in PUBLISHED_NOISES}


@pytest.mark.parametrize("start", ["random", "zero"])
def test_published_lines_follow_the_agents_where_the_start_is_theirs(start):
    (table,) = tables(board(published_columns(start), published=True))
    assert {len(line) for line in table} == {2 + len(PUBLISHED_NOISES)}
    sources = [source for source in SOURCES if source.start == start]
    assert len(table) == 2 + len(sources) > 2
    for source, line in zip(sources, table[2:], strict=True):
        name = f"{source.name} ({source.agent})" if source.agent else source.name
        assert line[0] == f"*{name}, {source.runs} runs, N = {source.steps:,}*"
        figures = [
            None if source.has_own_noise and noise != "none" else source.mean_trials.get(noise)
            for noise in PUBLISHED_NOISES
        ]
        assert line[2:] == ["–" if each is None else f"{each:.2f}" for each in figures]


def test_no_published_line_stands_below_another_task():
    (table,) = tables(board(published_columns("zero", steps=200), published=True))
    assert len(table) == 2


# ------------------------------------------------------------------------------ on the screen


def test_the_board_on_the_screen_has_the_same_order_means_and_rates():
    columns = {
        "as published": [row("slow", 5, 6, 5.5), row("quick", 1, 2, 1.25)],
        "friction ×100": [row("slow", 5, 6, 123.4, successes=7), row("quick", 2, 3, 2.5)],
        "no velocities": [row("slow", 5, 6, 5.5, successes=0), row("quick", 2, 3, 2.5)],
    }
    assert board_text(columns).splitlines() == [
        "      mean        as friction         no",
        "      rank published     ×100 velocities",
        "─" * 40,
        "quick  1.0     *1.25     *2.5       *2.5",
        "slow   2.0       5.5  123 70%      never",
    ]


def test_sources_of_one_name_are_numbered_on_the_screen():
    lines = board_text(published_columns("random"), published=True).splitlines()
    assert lines[4].split()[:5] == ["Report", "(1)", "35.65", "34.6", "49.6"]
    assert lines[5].split()[:4] == ["Report", "(2)", "42", "–"]
    assert "Report (2): Q-learning, 20 runs, N = 60,000." in lines
    zero = board_text(published_columns("zero"), published=True)
    assert "Si & Wang 2001: direct NDP, 100 runs, N = 600,000." in zero


@pytest.mark.parametrize("each", BOARDS, ids=lambda each: each.name)
def test_the_recorded_board_fits_a_terminal(each):
    rows = recorded_rows(ROOT / "docs" / f"{each.name}.json")
    agents = len(rows) // len(each.columns)
    columns = {title: rows[agents * i : agents * (i + 1)] for i, title in enumerate(each.columns)}
    shown = each.text(columns, BoardPlan(steps=rows[0].task.steps))
    assert max(map(len, shown.splitlines())) <= 80
    assert f"N = {rows[0].task.steps:,} steps" in shown
    for agent in AGENTS:
        assert f"\n{agent} " in shown


# ------------------------------------------------------------------------------ whole boards


def test_the_leaderboard_has_all_cases_and_agents(made):
    text = (made[0] / "leaderboard.md").read_text()
    found = tables(text)
    assert len(found) == 2
    for table in found:
        assert table[0] == ["Agent", "Mean rank", *PUBLISHED_NOISES]
        assert {line[0] for line in table[1:3]} == {"`q-learning`", "`random-search`"}
        assert not table[3:]
    assert text.index("## Start within ±0.05") < text.index("## Start exactly upright")
    assert "Published figures are left out, because they are for another task." in text


def test_the_robust_board_has_all_columns_and_lists_failures(made):
    text = (made[0] / "robust.md").read_text()
    (table,) = tables(text)
    assert table[0] == ["Agent", "Mean rank", *ROBUST]
    rows = json.loads((made[0] / "robust.json").read_text())
    broken = text[text.index("## Where agents fail") : text.index("## Settings")]
    for agent in SMALL.agents:
        (line,) = (line for line in broken.splitlines() if line.startswith(f"- `{agent}`: "))
        mine = [each for each in rows if each["agent"] == agent]
        failing = [
            f"{title} ({100 * each['success_rate']:.0f} %)"
            for title, each in zip(ROBUST, mine, strict=True)
            if each["success_rate"] < 0.95
        ]
        assert line == f"- `{agent}`: " + (", ".join(failing) or "nothing")


def test_failures_are_listed_for_each_agent():
    rows = {"calm": [row("a"), row("b")], "windy": [row("a", successes=9), row("b", runs=10)]}
    assert leaderboards._failures(rows) == "- `a`: windy (90 %)\n- `b`: none"


@pytest.mark.parametrize("name", ["leaderboard", "robust"])
def test_a_board_states_everything_needed_to_repeat_it(made, name):
    text = (made[0] / f"{name}.md").read_text()
    command = f"upright {name} --agents q-learning,random-search --runs 3 --steps 200 --seed 4"
    command += f" --output {made[0] / name}.md --store {made[0] / 'runs.sqlite'}"
    assert f"3 runs per case; generated with\n`{command}`, upright {__version__}." in text
    assert "N = 200 steps" in text
    for agent in SMALL.agents:
        assert f"- `{agent}`: `{make_case(agent).settings}`" in text


def test_defaults_are_left_out_of_the_command():
    assert "`upright leaderboard --seed 0`" in leaderboards._origin(
        BoardPlan(), "leaderboard", "1.2"
    )
    assert BoardPlan().agents == tuple(AGENTS)


@pytest.mark.parametrize("name", ["leaderboard", "robust"])
def test_the_command_that_a_board_names_repeats_it(made, name, capsys):
    path = made[0] / f"{name}.md"
    wrote = path.read_text()
    path.unlink()
    assert run(shlex.split(re.search(r"`upright (.*)`", wrote)[1])) == 0
    assert path.read_text() == wrote
    shown = capsys.readouterr()
    assert "\nq-learning " in shown.out
    assert f"board: {path}" in shown.err


@pytest.mark.parametrize(("name", "usual"), [("leaderboard", 600_000), ("robust", 60_000)])
def test_a_default_board_names_the_command_that_makes_it(name, usual, tmp_path, monkeypatch):
    """The number of steps that the command leaves out is its default."""
    plans = []
    monkeypatch.setattr(leaderboards, "make_board", lambda board, plan: plans.append(plan) or {})
    for each in BOARDS:
        changed = each._replace(text=lambda rows, plan: "")
        attribute = "LEADERBOARD" if each is LEADERBOARD else "ROBUST_BOARD"
        monkeypatch.setattr(leaderboards, attribute, changed)
    monkeypatch.chdir(tmp_path)
    assert run([name]) == 0
    (plan,) = plans
    assert (plan.steps, plan.output, plan.store) == (usual, None, None)
    command = re.search(r"`upright (.*)`", leaderboards._origin(plan, name, "1.2"))[1]
    assert command == f"{name} --seed 0"
    assert run(command.split()) == 0
    assert plans[1] == plans[0]
    assert "--steps 600 " in leaderboards._origin(plan._replace(steps=600), name, "1.2")
    other = 660_000 - usual  # the usual one of the other board
    assert f"--steps {other} " in leaderboards._origin(plan._replace(steps=other), name, "1.2")


def test_the_figures_beside_a_board_are_read_back(made):
    folder, _ = made
    rows = json.loads((folder / "leaderboard.json").read_text())
    assert len(rows) == 2 * len(PUBLISHED_NOISES) * 2
    parts = {field.name for kind in (Row, TaskSpec) for field in fields(kind)}
    assert set(rows[0]) == parts - {"task"}
    cases = {(each["agent"], each["start"], each["noise"]) for each in rows}
    assert len(cases) == len(rows)
    assert {(each["runs"], each["steps"], each["seed"]) for each in rows} == {(3, 200, 4)}
    rows = json.loads((folder / "robust.json").read_text())
    conditions = [each["condition"] for each in rows if each["agent"] == "q-learning"]
    assert conditions == [task.get("condition", "nominal") for task in ROBUST.values()]
    with Store(folder / "runs.sqlite") as store:
        for each in rows:
            parts = {name: each[name] for name in ("noise", "start", "steps", "condition")}
            case = make_case(each["agent"], **parts)
            assert summarise(case, 4, store.results(case.key, 4)).ci95 == (
                each["ci95"] and tuple(each["ci95"])
            )


def test_a_board_made_again_takes_its_runs_from_the_store(made, tmp_path, monkeypatch):
    folder, rows = made
    monkeypatch.setattr("upright.studies.study.make_run", None)  # nothing may be run
    for each in BOARDS:
        plan = SMALL._replace(store=folder / "runs.sqlite", output=tmp_path / f"{each.name}.md")
        assert make_board(each, plan) == rows[each.name]
        old = (folder / f"{each.name}.json").read_text()
        assert (tmp_path / f"{each.name}.json").read_text() == old


def test_a_larger_board_makes_only_the_runs_that_are_missing(tmp_path, monkeypatch):
    from upright.studies import study as studying

    made, make = [], studying.make_run
    monkeypatch.setattr(
        studying,
        "make_run",
        lambda case, seed, run, **more: made.append(run) or make(case, seed, run, **more),
    )
    small = SMALL._replace(store=tmp_path / "runs.sqlite", agents=("random-search",), runs=2)
    columns = {"calm": {}, "tilted": {"start": "wide"}}
    rows = make_rows(small, columns)
    assert sorted(made) == [0, 0, 1, 1]
    assert list(rows) == ["calm", "tilted"]
    assert [each.task.start for (each,) in rows.values()] == ["random", "wide"]
    made.clear()
    rows = make_rows(small._replace(runs=3), columns)
    assert made == [2, 2]
    assert {each.runs for (each,) in rows.values()} == {3}


# ------------------------------------------------------------------------------ refusals


@pytest.fixture
def no_runs(monkeypatch):
    """Make every run an error."""
    monkeypatch.setattr("upright.reports.leaderboards.study_with_progress", None)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"output": "folder"}, "it is a folder"),
        ({"output": "."}, "it is a folder"),
        ({"output": "missing/board.md"}, "its folder does not exist"),
        ({"output": "taken.md"}, r"taken\.json'; it is a folder"),
        ({"output": "board.json"}, r"it must not end in \.json"),
        ({"agents": ("nobody",)}, "agent is 'nobody'; it must be one of "),
        ({"agents": ("no_such_module_42:A",)}, "there is no module"),
        ({"runs": 0}, "runs is 0"),
        ({"seed": -1}, "seed is -1"),
        ({"steps": 0}, "steps is 0"),
        ({"store": "missing/runs.sqlite"}, "folder"),
        ({"store": "file"}, "not a database"),
    ],
    ids=str,
)
@pytest.mark.parametrize("each", BOARDS, ids=lambda each: each.name)
def test_impossible_boards_are_refused_before_anything_is_written(
    each, change, said, tmp_path, monkeypatch, no_runs
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "taken.json").mkdir()
    (tmp_path / "file").write_text("no database, and no folder")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(UprightError, match=said):
        make_board(each, SMALL._replace(**{"output": "board.md"} | change))
    assert sorted(tmp_path.rglob("*")) == before


def test_bad_usage_prints_one_clear_line(tmp_path, monkeypatch, capsys, no_runs):
    monkeypatch.chdir(tmp_path)
    for line, said in (
        ("leaderboard --agents nobody", "agent is 'nobody'"),
        ("robust --runs 0", "runs is 0"),
        ("robust --output .", "it is a folder"),
        ("leaderboard --runs many", "'many'"),
    ):
        try:
            status = run(line.split())
        except SystemExit as refusal:  # argparse's own way
            status = refusal.code
        assert status == BAD_USE
        error = capsys.readouterr().err
        assert said in error
        assert error.count("\n") == 1


@pytest.mark.slow
def test_the_command_writes_where_it_is_told_and_nowhere_else(tmp_path, monkeypatch, capsys):
    """A custom agent appears on the board like any other."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(ROOT)
    agent = "examples.compiled_agent:hill_climber"
    line = f"robust --agents {agent},random-search --runs 1 --steps 50"
    assert run(line.split()) == 0
    assert not list(tmp_path.iterdir())
    shown = capsys.readouterr().out
    assert run([*line.split(), "--output", "b.md", "--store", "c.sqlite"]) == 0
    assert capsys.readouterr().out == shown
    made = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*"))
    assert made == ["b.json", "b.md", "c.sqlite"]
    text = (tmp_path / "b.md").read_text()
    assert {line[0] for line in tables(text)[0][1:]} == {f"`{agent}`", "`random-search`"}
    assert f"`upright {line} --seed 0 --output b.md --store c.sqlite`" in text
