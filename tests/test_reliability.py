"""What docs/reliability.md says of long runs is recorded; test_docs.py follows its links."""

import json
import re

import reliability
from helpers import ROOT

PAGE = (ROOT / "docs/reliability.md").read_text()
RECORDS = json.loads((ROOT / "docs/results/reliability.json").read_text())
RECORD = {
    "command": "make x",
    "version": "1.2",
    "head": ["what", "how many"],
    "rows": [["a", 9999]],
}


def test_the_page_has_the_recorded_figures():
    assert reliability.filled(PAGE, RECORDS) == PAGE


def test_every_record_has_its_place_in_the_page():
    places = set(
        re.findall(r"^<!-- (\w+): from results/reliability\.json -->$", PAGE, re.MULTILINE)
    )
    assert len(places) == 3
    assert set(RECORDS) <= places


def test_records_are_tables_without_faults():
    for name, record in RECORDS.items():
        columns = dict(zip(record["head"], zip(*record["rows"], strict=True), strict=True))
        assert not any(columns.get("faults", ())), name


def test_a_record_is_shown_as_a_table():
    page = "a\n<!-- x: from b -->\nold\n<!-- end -->\nc\n<!-- y: from b -->\n<!-- end -->\n"
    assert reliability.filled(page, {"x": RECORD}) == (
        "a\n<!-- x: from b -->\n`make x`, upright 1.2:\n\n"
        "| what | how many |\n| --- | ---: |\n| a | 9,999 |\n<!-- end -->\nc\n"
        "<!-- y: from b -->\nNot recorded yet.\n<!-- end -->\n"
    )
