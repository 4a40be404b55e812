"""The recorded boards: what the program writes of their figures, and what they were to reach."""

import pytest
from helpers import ROOT, recorded_rows

from upright.core.conditions import PUBLISHED_NOISES
from upright.reports.leaderboards import LEADERBOARD, ROBUST_BOARD, USUAL_STEPS, BoardPlan
from upright.reports.published import SOURCES

DOCS = ROOT / "docs"
BOARDS = {"leaderboard": LEADERBOARD, "robust": ROBUST_BOARD}
MOST = {
    "none": 1.1,
    "actuator-5": 1.3,
    "actuator-10": 1.3,
    "sensor-5": 1.5,
    "sensor-10": 1.5,
    "gaussian-0.1": 1.9,
    "gaussian-0.2": 1.9,
}
"""Mean trials that adaptive LQR may need from the random start."""


def recorded(name):
    """Return the rows of a recorded board by column."""
    rows = recorded_rows(DOCS / f"{name}.json")
    columns = BOARDS[name].columns
    agents = len(rows) // len(columns)
    return {title: rows[agents * i : agents * (i + 1)] for i, title in enumerate(columns)}


@pytest.mark.parametrize("name", BOARDS)
def test_the_recorded_board_is_what_the_program_writes(name):
    rows = recorded(name)
    assert all(row.runs == 100 and row.seed == 0 for some in rows.values() for row in some)
    files = {"output": f"docs/{name}.md", "store": f"docs/results/{name}.sqlite"}
    study = BoardPlan(steps=USUAL_STEPS[name], **files)
    assert (DOCS / f"{name}.md").read_text() == BOARDS[name].markdown(rows, study)


@pytest.mark.parametrize("noise", PUBLISHED_NOISES)
def test_the_readme_quotes_the_leaderboard(noise):
    lines = (DOCS.parent / "README.md").read_text().partition("## The leaderboard")[2].splitlines()
    (line,) = (line for line in lines if line.startswith(f"| {noise} |"))
    head = next(line for line in lines if line.startswith("| noise |"))
    for row in recorded("leaderboard")[f"random {noise}"]:
        place = [cell.strip(" *`") for cell in head.split("|")].index(row.agent)
        mean = f"{row.mean_trials:.{2 if row.mean_trials < 2 else 1}f}"
        rate = "" if row.successes == row.runs else f" ({row.successes} %)"
        assert line.split("|")[place].strip(" *") == mean + rate


@pytest.mark.parametrize("noise", PUBLISHED_NOISES)
def test_adaptive_lqr_beats_every_published_figure_and_its_target(noise):
    rows = recorded("leaderboard")
    published = min(s.mean_trials[noise] for s in SOURCES if noise in s.mean_trials)
    for start, most in (("random", MOST[noise]), ("zero", 2.5)):
        (row,) = (row for row in rows[f"{start} {noise}"] if row.agent == "adaptive-lqr")
        assert row.success_rate == 1.0
        assert row.mean_trials <= most < published
