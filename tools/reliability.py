"""Write the recorded figures of the long runs into docs/reliability.md.

    python tools/reliability.py

docs/results/reliability.json has a section for each long run: the command, the version that was
run, and a table, its head and its rows. In the page, each stands between two marks.
"""

import json
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/reliability.md"
RECORDS = ROOT / "docs/results/reliability.json"
MARKED = re.compile(r"(<!-- (\w+): from .*? -->\n).*?(<!-- end -->)", re.DOTALL)


def section(record: dict[str, Any] | None) -> str:
    """Return what the page says of a long run."""
    if record is None:
        return "Not recorded yet.\n"
    lines = [record["head"], ["---"] + ["---:"] * (len(record["head"]) - 1), *record["rows"]]
    table = "".join(f"| {' | '.join(map(_text, line))} |\n" for line in lines)
    return f"`{record['command']}`, upright {record['version']}:\n\n{table}"


def _text(value: object) -> str:
    return f"{value:,}" if isinstance(value, int) else str(value)


def filled(page: str, records: dict[str, Any]) -> str:
    """Return the page with these records."""
    return MARKED.sub(lambda part: f"{part[1]}{section(records.get(part[2]))}{part[3]}", page)


def put(name: str, found: dict[str, Any], path: Path = RECORDS) -> None:
    """Write the figures of a long run into a file of records, in place of its previous ones."""
    records = _read(path)
    path.write_text(json.dumps(records | {name: found}, indent=1) + "\n", encoding="utf-8")


def rows(name: str, path: Path = RECORDS) -> list[list[Any]]:
    """Return the rows of a long run in a file of records, but for the last, of all together."""
    record = _read(path).get(name)
    return record["rows"][:-1] if record else []


def _read(path: Path) -> dict[str, Any]:
    records: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return records


def main() -> None:
    """Write the page."""
    records = json.loads(RECORDS.read_text(encoding="utf-8"))
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), records), encoding="utf-8")


if __name__ == "__main__":
    main()
