"""Names from anyone are text in every format, and nothing but text."""

import csv
import io
import json
import re
import sys
from dataclasses import replace

import numpy as np
import pandas
import pytest
from helpers import python
from markdown_it import MarkdownIt
from matplotlib.text import Text

import upright
from upright.commands import run
from upright.reports import plots
from upright.reports.escaping import csv_cell, html_text, latex, markdown, markdown_code
from upright.reports.leaderboards import ROBUST, board, board_text
from upright.reports.notebook import html_table
from upright.reports.standing import plan_text, status_text
from upright.reports.tables import FORMATS, Table, render, to_markdown
from upright.studies.estimate import Probe, Standing
from upright.studies.progress import _terminal_bar
from upright.support.terminal import visible

NASTY = [
    "\x1b[31mred\x1b[0m",
    "\x1b]0;title\x07",
    "two\nlines\r\n",
    "\x9b2J",
    "\u202eright to left\u2066",
    "\u2028\x00\x7f\ud800",
    '=HYPERLINK("http://evil","x")',
    "@SUM(1)",
    "+1|2",
    "-1",
    "'quoted",
    " =1",
    "\t=1",
    "\uff1d1",
    r"\input{/etc/passwd} ^^5c $x$ ~ # % & _ { }",
    r"a\|b | c",
    "<script>alert(1)</script> &lt; &#60;",
    "[link](javascript:alert(1)) ![image](x) [a][b] <http://x>",
    "`code` ``` **bold** __bold__ _it_ ~~gone~~ # head",
    r"$\frac$ and $",
    "[red]markup[/blue]",
]


def controls(text, keep="\n"):
    """Return the characters of a text that a terminal might obey."""
    return {sign for sign in text if not sign.isprintable()} - set(keep)


@pytest.fixture(scope="module", params=NASTY)
def rows(request):
    case = replace(upright.make_case("random-search", steps=9, trials=3), label=request.param)
    result = upright.Result(0, True, np.array([2, 9]), 0.1)
    return [upright.summarise(each, 0, [result]) for each in (case, replace(case, label="usual"))]


@pytest.mark.parametrize("text", NASTY)
def test_every_character_is_seen(text):
    shown = visible(text)
    assert shown.isprintable()
    assert shown.replace("\\", "") == repr(text)[1:-1].replace("\\", "")
    assert visible(text, "\n").count("\n") == text.count("\n")


@pytest.mark.parametrize("format_name", FORMATS)
def test_a_table_has_no_character_that_a_terminal_obeys(format_name, rows):
    assert not controls(render(rows, format_name, width=200))


@pytest.mark.parametrize("format_name", ["csv", "markdown", "latex"])
def test_a_name_adds_no_line(format_name, rows):
    usual = [replace(rows[1], settings="another"), rows[1]]
    assert render(rows, format_name).count("\n") == render(usual, format_name).count("\n")


def test_json_has_the_name_itself(rows):
    assert json.loads(render(rows, "json"))[0]["settings"] == rows[0].settings


def test_csv_has_no_formula_and_can_be_read_again(rows):
    text = render(rows, "csv")
    (line, usual) = csv.DictReader(io.StringIO(text))
    assert usual["settings"] == "usual"
    assert not re.match(r"\s*[=+\-@\uff1d]", line["settings"])
    assert line["settings"].removeprefix("'") == visible(rows[0].settings)
    frame = pandas.read_csv(io.StringIO(text))
    assert frame["settings"].str.removeprefix("'")[0] == visible(rows[0].settings)
    assert frame["mean_trials"][0] == 2.0


@pytest.mark.parametrize("value", [-1.5, -3, None, True, float("inf")])
def test_in_csv_numbers_stay_numbers(value):
    assert csv_cell(value) is value


def test_the_apostrophe_that_is_added_can_be_told_from_others():
    for text in NASTY:
        cell = csv_cell(text)
        assert (cell[1:] if cell.startswith("'") else cell) == visible(text)


@pytest.mark.parametrize("text", NASTY)
def test_latex_has_no_command_but_those_of_the_escapes(text):
    written = latex(text)
    rest = re.sub(
        r"\\(textbackslash|textasciicircum|textasciitilde|textless|textgreater|textbar){}",
        "",
        written,
    )
    rest = re.sub(r"\\[{}$&%_#]|{\[}|{\]}", "", rest)
    assert not set(rest) & set("\\{}$&%_#^~<>|[]")


@pytest.mark.parametrize("text", NASTY)
def test_markdown_shows_the_text_and_nothing_else(text):
    reader = MarkdownIt("commonmark").enable(["table", "strikethrough"])
    table = to_markdown(Table(["Name", "n"], [[text, "1 [2, 3]"]], [f"Note: {text}."]))
    tokens = reader.parse(table)
    cells = [token for token in tokens if token.type == "inline"]
    assert [token.type for token in tokens if token.type.endswith("_open")] == [
        *("table_open", "thead_open", "tr_open", "th_open", "th_open"),
        *("tbody_open", "tr_open", "td_open", "td_open"),
        *("bullet_list_open", "list_item_open", "paragraph_open"),
    ]
    shown = ["".join(part.content for part in cell.children) for cell in cells]
    kinds = {part.type for cell in cells for part in cell.children}
    assert shown == ["Name", "n", visible(text).strip(), "1 [2, 3]", f"Note: {visible(text)}."]
    assert kinds <= {"text", "text_special"}


@pytest.mark.parametrize("text", [*NASTY, "`", "``x`` `"])
def test_code_in_markdown_stays_code(text):
    table = to_markdown(Table(["Name"], [[markdown_code(text)]], []))
    cell = MarkdownIt("commonmark").enable("table").parse(table)[-5]
    (code,) = cell.children
    assert (code.type, code.content.strip()) == ("code_inline", visible(text).strip())


def test_figures_and_usual_names_are_written_as_they_are():
    usual = ["3.2 [2.1, 4.0]", "100 % [83, 100]", "default, learning_rate=0.1", "half_length [m]"]
    for text in (*usual, "J. Si & Y.-T. Wang, 12, 264 (2001)", "N = 60,000 steps", "–"):
        assert markdown(text) == text
        assert visible(text) == text


def test_html_shows_the_text():
    text = "<script>\x1b</script>&"
    assert html_text(text) == r"&lt;script&gt;\x1b&lt;/script&gt;&amp;"
    drawn = html_table([text], [[text]], [text], [])
    assert "<script" not in drawn
    assert not controls(drawn)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("draw", [plots.plot_trials, plots.plot_curves])
@pytest.mark.parametrize(
    ("label", "shown"),
    [
        ("\u4e2d \U0001f9ea", r"\u4e2d \U0001f9ea"),
        ("x" * 5000, "xxx"),
        ("some words " * 500, "words …"),
    ],
)
def test_pictures_of_any_name_are_drawn_without_a_warning(draw, label, shown, tmp_path):
    case = upright.make_case("random-search", steps=9, trials=3)
    result = upright.Result(0, True, np.array([2, 9]), 0.1)
    figure = draw([(replace(case, label=name), [result]) for name in (label, "usual")])
    plots.save(figure, tmp_path / "picture.png")
    texts = [part.get_text() for part in figure.findobj(Text)]
    assert any(shown in text for text in texts)
    assert max(text.count("\n") for text in texts) < 8


def test_pictures_show_the_text_itself(tmp_path):
    case = upright.make_case("random-search", steps=9, trials=3)
    result = upright.Result(0, True, np.array([2, 9]), 0.1)
    figure = plots.plot_trials([(replace(case, label=text), [result]) for text in NASTY])
    plots.save(figure, tmp_path / "trials.svg")
    shown = {part.get_text() for part in figure.findobj(Text)}
    assert not any(map(controls, shown))
    assert any(r"$\frac$ and $" in text for text in shown)
    figure = plots.plot_curve(np.array([2, 9]), 9, r"$\frac$", r"$\frac{$")
    plots.save(figure, tmp_path / "curve.pdf")


def test_a_progress_bar_takes_no_markup(monkeypatch):
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with _terminal_bar(len(NASTY), "starting") as advance:
        for text in NASTY:
            advance(text, "1.0 M steps/s")
    shown = sys.stderr.getvalue()
    assert "[red]markup[/blue]" in shown
    assert not any(text in shown for text in ("\x1b]0;", "\x07", "\x9b2J", "\u202e"))


@pytest.mark.parametrize("text", NASTY)
def test_errors_are_one_line_that_no_terminal_obeys(text, capsys):
    for words in (["show", text], ["table", "--noises", text], ["cite", "--format", text], [text]):
        try:
            status = run(words)
        except SystemExit as ended:  # as argparse ends
            status = ended.code
        error = capsys.readouterr().err
        assert status == 2
        assert error.count("\n") == 1
        assert not controls(error)


def test_what_a_database_says_is_obeyed_by_no_terminal():
    ended = python(
        "from upright.errors import UprightError\n"
        "from upright.support.exit_status import exit_status\n"
        "def work(): raise UprightError('near \"\\x1b[2J\\nstore is fine\": syntax error')\n"
        "raise SystemExit(exit_status(work))"
    )
    assert ended.returncode == 2
    assert ended.stderr == 'upright: error: near "\\x1b[2J\\nstore is fine": syntax error\n'


def test_boards_show_agents_as_text():
    case = upright.make_case("random-search", steps=9, trials=3)
    row = upright.summarise(case, 0, [upright.Result(0, True, np.array([2, 9]), 0.1)])
    for text in NASTY:
        columns = {title: [replace(row, agent=text)] for title in ROBUST}
        assert not controls(board_text(columns))
        cells = MarkdownIt("commonmark").enable("table").parse(board(columns))
        assert "code_inline" in {part.type for cell in cells for part in cell.children or ()}


@pytest.mark.parametrize(
    "line",
    [
        "new FOLDER/my_agent.py",
        "study FOLDER/study.toml --dry-run",
        "study FOLDER/study.toml --status",
        "table --agents random-search --runs 1 --steps 9 --save-study FOLDER/new.toml",
        "table --agents random-search --runs 1 --steps 9 --save-task FOLDER/new.toml",
        "learn random-search --steps 9 --quiet --save FOLDER/policy.npz",
        "leaderboard --agents random-search --runs 1 --steps 9 --output FOLDER/board.md",
    ],
)
def test_names_of_files_are_obeyed_by_no_terminal(line, tmp_path, capsys):
    folder = tmp_path / "\x1b]8;;x\x07\x9b2J\u202e\r"
    folder.mkdir()
    (folder / "study.toml").write_text('agents = ["random-search"]\nruns = 1\nsteps = 9\n')
    run([word.replace("FOLDER", str(folder)) for word in line.split()])
    shown = "".join(capsys.readouterr())
    assert r"\x1b]8;;x\x07\x9b2J\u202e\r" in shown
    assert not controls(shown)


def test_the_standing_of_a_study_shows_names_as_text():
    case = upright.make_case("random-search", steps=9, trials=3)
    usual = Standing(case, range(1), 0, 0, 0, None, None, None)
    several = [usual._replace(case=replace(case, label=text)) for text in NASTY]
    store = "two\nlines\x1b[2J"
    for text in (status_text(several, store), plan_text(Probe(several, {}, False), 1, store)):
        assert not controls(text)
        assert r"two\nlines\x1b[2J" in text
