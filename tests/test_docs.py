import re

import pytest
from helpers import ROOT, recorded_rows

from upright.commands.terms import markdown
from upright.core.conditions import CONDITION_TERMS, NOISE_TERMS, PUBLISHED_NOISES
from upright.reports.reproduction import report
from upright.reports.tables import mean_text
from upright.studies.columns import IDENTITY, KINDS, ORIGIN, RESULT, TRIAL
from upright.studies.schema import PRESENT

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


def cells(line):
    return [cell.strip(" *`") for cell in line.strip("|").split("|")]


def test_the_protocol_quotes_what_was_tried_with_the_settings_of_the_report():
    lines = (ROOT / "docs/results/report-settings.md").read_text().splitlines()
    kept = [cells(line) for line in lines if line.startswith(("| reinforce", "| q-learning"))]
    figures = {(success.partition(" [")[0], mean) for _, _, _, success, mean, *_ in kept}
    assert len(kept) == 16 + 3 + 1 + 4 + 2
    page = (ROOT / "docs/protocol.md").read_text()
    head = "| varied | success | mean trials |\n"
    quoted = [cells(line) for line in page.partition(head)[2].partition("\n\n")[0].splitlines()]
    assert len(quoted) == 1 + 13
    for varied, success, mean in quoted[1:]:
        assert (success, mean) in figures or varied.startswith("report, Table"), varied


@pytest.mark.parametrize("noise", PUBLISHED_NOISES)
def test_ndp_is_quoted_beside_the_figures_of_si_and_wang(noise):
    """From the same start, and with the factors that the text gives."""
    lines = (ROOT / "docs/results/ndp-zero.md").read_text().splitlines()
    (replicate,) = (
        cells(line) for line in lines if line.startswith(f"| ndp | as-published | {noise}")
    )
    mean, published = replicate[4], float(replicate[8])
    rows = {
        row.agent: row
        for row in recorded_rows(ROOT / "docs/leaderboard.json")
        if (row.task.noise, row.task.start) == (noise, "zero")
    }
    tuned, guess = (
        f"{row.mean_trials:.1f} [{row.ci95[0]:.1f}, {row.ci95[1]:.1f}]"
        for row in (rows["ndp"], rows["random-search"])
    )
    expected = [noise, f"{published:g}", mean, tuned, guess]
    lines = (ROOT / "docs/protocol.md").read_text().partition("### Si & Wang")[2].splitlines()
    assert expected in [cells(line) for line in lines]
    lines = (ROOT / "README.md").read_text().splitlines()
    lqr = f"{rows['adaptive-lqr'].mean_trials:.2f}"
    assert [*expected[:4], lqr, guess] in [cells(line) for line in lines]
    ratio = float(mean.split()[0]) / published
    if noise.startswith("actuator"):
        assert 4.95 < ratio < 10.5
    elif noise != "none":
        assert 2.4 < 1 / ratio < 5


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


def test_every_term_is_listed():
    page = (ROOT / "docs/disturbances.md").read_text()
    for terms in (NOISE_TERMS, CONDITION_TERMS):
        assert markdown(terms) in page


@pytest.mark.parametrize(
    "columns", [IDENTITY, RESULT | ORIGIN, TRIAL], ids=["run", "result", "trial"]
)
def test_the_page_on_data_describes_every_column(columns):
    """Those of the plant's parameters as well: a new one needs its line there."""
    lines = [f"| `{name}` | {column.kind} | {column.text} |" for name, column in columns.items()]
    table = "\n".join(["| column | kind | meaning |", "|---|---|---|", *lines, ""])
    assert f"\n{table}\n" in (ROOT / "docs/data.md").read_text()


def test_the_page_on_data_has_every_kind_and_the_tables_of_a_store():
    page = (ROOT / "docs/data.md").read_text()
    for kind, data_type in KINDS.items():
        assert re.search(rf"^\| {kind} \| {re.escape(data_type)}(,| \|)", page, re.MULTILINE), kind
    assert f"```sql\n{PRESENT}```" in page


def test_the_page_on_data_tests_two_agents_in_ten_lines():
    page = (ROOT / "docs/data.md").read_text()
    (block,) = re.findall(r"^Ten lines .*\n\n```python\n((?:.*\n)*?)```", page, re.MULTILINE)
    assert len(block.splitlines()) == 10


def test_the_agents_page_quotes_its_recorded_sweep():
    page = (ROOT / "docs/agents.md").read_text()
    rows = recorded_rows(ROOT / "docs/results/sweep.json")
    assert len(rows) == 3 * 8
    assert {row.runs for row in rows} == {20}
    by = {(row.agent, row.task.parameters.half_length): row for row in rows}
    lqr = [row for (agent, length), row in by.items() if agent == "adaptive-lqr" and length < 2]
    assert {row.mean_trials for row in lqr} == {1.0}
    last = {row.agent: row for row in rows if row.task.parameters.half_length == 2}
    words = " ".join(page.split())
    assert max(row.task.parameters.half_length for row in lqr) == pytest.approx(1.49, abs=0.005)
    assert f"then needs {last['adaptive-lqr'].mean_trials:.0f}, and" in words
    learner = last["q-learning"]
    assert f"{learner.mean_trials:.0f} in the {100 * learner.success_rate:.0f} %" in words
    assert f"random guessing needs {last['random-search'].mean_trials:.0f};"[:-1] in words
