"""The errors that docs/first-hour.md shows are those that the commands print."""

import importlib.util
import re

import pytest
from helpers import ROOT

spec = importlib.util.spec_from_file_location(
    "record_transcript", ROOT / "tools/record_transcript.py"
)
record_transcript = importlib.util.module_from_spec(spec)
spec.loader.exec_module(record_transcript)

PAGE = (ROOT / "docs/first-hour.md").read_text()


@pytest.mark.slow
def test_wrong_agents_are_told_what_the_page_shows(tmp_path):
    section = PAGE[PAGE.index("## Where it goes wrong") :]
    shown, printed = (
        # which run of a table fails first, and what the dice give
        re.sub(r"in run \d, |took \d+ steps", "", page)
        for page in (section, record_transcript.recorded(section, tmp_path))
    )
    assert printed == shown


def test_the_page_shows_each_wrong_agent():
    agents = re.findall(r"^class (\w+)\(Base\)", PAGE, re.MULTILINE)
    assert len(agents) == 7
    assert all(f"wrong:{agent}" in PAGE for agent in agents)


def test_a_command_that_fails_is_shown_with_its_status(tmp_path):
    page = "```text\n$ echo one; exit 3\nold\n```\n"
    shown = "```text\n$ echo one; exit 3\none\n[exit status 3]\n```\n"
    assert record_transcript.recorded(page, tmp_path) == shown


def test_a_file_is_written_before_the_commands_run(tmp_path):
    page = "```python\n# word.py\nprint(3)\n```\n\n```text\n$ python word.py\n```\n"
    assert record_transcript.recorded(page, tmp_path).endswith("$ python word.py\n3\n```\n")
