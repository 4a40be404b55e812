import re

import pytest
from helpers import ROOT, recorded_rows

from upright.core.conditions import PUBLISHED_NOISES
from upright.reports.reproduction import report
from upright.reports.tables import mean_text

PAGES = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("benchmarks/*.md")]


@pytest.fixture(scope="module")
def rows():
    """The recorded study that the documentation quotes."""
    return recorded_rows(ROOT / "docs/results/table.json")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_link_leads_to_a_file(page):
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text()):
        assert "://" in target or (page.parent / target).exists(), target


def test_the_readme_quotes_the_recorded_study(rows):
    readme = (ROOT / "README.md").read_text()
    quoted = [row for row in rows if row.settings == "default"]
    assert len(quoted) == 3 * len(PUBLISHED_NOISES)
    for row in quoted:
        line = re.search(rf"^\| {re.escape(row.task.noise)} \|.*$", readme, re.MULTILINE)
        assert line, row.task.noise
        assert mean_text(row) in line[0], (row.agent, row.task.noise)


def test_the_recorded_report_is_what_the_program_writes(rows):
    assert (ROOT / "docs/results/report.md").read_text() == report(rows)


def test_the_recorded_study_meets_its_targets(rows):
    limits = {"reinforce": 10.0, "q-learning": 60.0}
    limited = [row for row in rows if row.settings == "default" and row.agent in limits]
    assert len(limited) == len(limits) * len(PUBLISHED_NOISES)
    for row in limited:
        assert row.runs == row.successes == 100
        assert row.mean_trials <= limits[row.agent]


def recorded(page, where):
    """Return agent, noise, success and mean trials of the runs on a plant or in a language."""
    row = rf"^\| (\S+) \({where}\) \| default \| (\S+) \| (.*?) \| (.*?) \|"
    return re.findall(row, (ROOT / page).read_text(), re.MULTILINE)


def test_the_matlab_page_quotes_its_recorded_study():
    page = (ROOT / "docs/matlab.md").read_text()
    rows = recorded("docs/results/matlab.md", "MATLAB")
    assert len(rows) == 3 * 7
    for agent, noise, success, mean in rows:
        line = re.search(rf"^\| {re.escape(noise)} \|.*$", page, re.MULTILINE)
        assert line, noise
        assert mean in line[0], (agent, noise)
        assert success.startswith("100 %")


def test_the_gazebo_page_quotes_its_recorded_study():
    page = (ROOT / "docs/gazebo.md").read_text()
    rows = recorded("docs/results/gazebo.md", "gazebo")
    assert len(rows) == 3 * 2
    for row in rows:
        assert f"| {' | '.join(row)} |" in page
