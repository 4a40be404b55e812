import re
import tomllib

import pytest
import yaml
from helpers import ROOT

import upright
from upright.agents import AGENTS
from upright.reports.citation import ARTICLES, AUTHORS, FORMATS, to_bibtex, to_cff, to_text

CITATION = yaml.safe_load(to_cff())


def test_the_file_is_what_the_command_prints():
    assert (ROOT / "CITATION.cff").read_text() == to_cff()


def test_it_has_what_the_format_requires():
    assert CITATION.keys() >= {"cff-version", "message", "title", "authors"}
    assert CITATION["cff-version"] == "1.2.0"
    for reference in CITATION["references"]:
        assert reference.keys() >= {"type", "title", "authors"}
        assert re.fullmatch(r"10\.\d{4,9}/[A-Za-z0-9.]+", reference["doi"])
    texts = [value for value in CITATION.values() if not isinstance(value, list)]
    assert all(isinstance(text, str) for text in texts)  # a date or a number would be refused


def test_it_agrees_with_the_package():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert CITATION["version"] == upright.__version__
    assert CITATION["license"] == project["license"]
    assert CITATION["authors"] == [{"name": AUTHORS}]
    assert AUTHORS in (ROOT / "LICENSE").read_text()
    summary = upright.__doc__.splitlines()[0].rstrip(".")
    assert CITATION["title"].casefold() == f"upright: {summary}".casefold()
    changes = (ROOT / "CHANGELOG.md").read_text()
    assert f"## [{upright.__version__}] - {CITATION['date-released']}\n" in changes


def test_every_format_has_the_version_and_every_source():
    for write in FORMATS.values():
        assert upright.__version__ in write()
        assert all(article.doi in write() for article in ARTICLES)


def test_agents_whose_rule_was_published_have_a_source():
    uses = " ".join(article.use for article in ARTICLES)
    assert [name for name in AGENTS.built_in if name not in uses] == [
        "adaptive-lqr",
        "random-search",
    ]


def test_the_text_fits_a_terminal():
    assert max(map(len, to_text().splitlines())) <= 80
    assert "Barto, A. G., Sutton, R. S. & Anderson, C. W. (1983). Neuronlike" in to_text()
    assert "Williams, R. J. (1992)." in to_text()


@pytest.mark.parametrize("entry", to_bibtex().split("\n\n"))
def test_entries_for_bibtex_have_balanced_braces_and_fields_of_their_own(entry):
    head, *fields, end = entry.strip().splitlines()
    assert re.fullmatch(r"@(software|article)\{\w+,", head)
    assert end == "}"
    names = [re.fullmatch(r"  (\w+) = \{.+\},", field)[1] for field in fields]
    assert {"author", "title", "year"} <= {*names}
    assert len(names) == len({*names})
    assert all(field.count("{") == field.count("}") for field in fields)
