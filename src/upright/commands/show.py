"""Show the table of a store of runs, or its runs or trials as data, or what a saved policy is."""

import argparse
import io
import json
import sys
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO

from upright.commands.options import add
from upright.commands.parser import READ, Parser
from upright.commands.showing import put, put_table
from upright.errors import UprightError, require_one_of
from upright.reports import data_files, tables
from upright.studies.columns import COLUMNS, IDENTITY, TRIAL

FORMATS = {
    "case": tables.FORMATS,
    "run": data_files.FORMATS,
    "trial": data_files.FORMATS,
    "environment": ("text", "json"),
}
"""What a row may be, and the formats that it is written in; the first one is the default."""


def _listed(text: str) -> str:
    return textwrap.fill(text, 100, initial_indent="  ", subsequent_indent="    ")


EXAMPLES = f"""\
examples:
  upright show runs.sqlite
  upright show results/runs.sqlite --format markdown --output table.md
  upright show runs.sqlite --each run                      the runs themselves, as CSV
  upright show runs.sqlite --each trial --output trials.csv
  upright show runs.sqlite --format parquet --output runs.parquet
  upright show runs.sqlite --each environment              versions and processors that made them
  upright show policy.npz                its inputs, its output, and the task it was trained on
columns of runs and trials, which docs/data.md describes; in Python, Store.frame() has the same:
{_listed("run: " + ", ".join(COLUMNS["run"]))}
{_listed(f"trial: the same up to {[*IDENTITY][-1]}, then " + ", ".join(TRIAL))}
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright show`."""
    parser.add_argument(
        "source",
        metavar="FILE",
        file=READ,
        help="a store, or a policy saved by learn --save; no code in it is executed",
    )
    parser.add_argument(
        "--each",
        choices=FORMATS,
        metavar="ROW",
        help="what has a row: case, for the table with its statistics; run, for what came out of "
        "each run; trial, for the length of each trial; or environment, for the versions and "
        "processors that made the runs (default: case; run for parquet)",
    )
    add(
        parser,
        "--format",
        choices=(*tables.FORMATS, "parquet"),
        default=None,
        help=f"format: {', '.join(tables.FORMATS)} of the table (default: text); "
        f"{', '.join(data_files.FORMATS)} of runs or trials (default: csv)",
    )
    add(parser, "--sources")
    add(parser, "--output", help="write to this file, not to the screen")


def run(options: argparse.Namespace) -> int:
    """Carry out `upright show`."""
    from upright.policies.files import is_policy

    if is_policy(options.source):
        _show_policy(options)
        return 0
    each = options.each or ("run" if options.format == "parquet" else "case")
    options.format = options.format or FORMATS[each][0]
    require_one_of(f"format with --each {each}", options.format, FORMATS[each])
    if each == "case":
        _show_table(options)
    elif each == "environment":
        _show_environments(options)
    else:
        _show_data(options, each)
    return 0


def _show_policy(options: argparse.Namespace) -> None:
    from upright.policies.files import read_header
    from upright.policies.policy import describe

    if options.each:
        raise UprightError(f"--each is {options.each!r}; it needs a store, and this is a policy")
    require_one_of("format of a policy", options.format or "text", ("text",))
    put(describe(read_header(options.source)) + "\n", options.output)


def _show_table(options: argparse.Namespace) -> None:
    from upright.reports.statistics import stored_rows

    rows = stored_rows(options.source)
    _require_runs(options.source, bool(rows))
    put_table(rows, options)


def _show_data(options: argparse.Namespace, each: str) -> None:
    from upright.studies.store import Store
    from upright.support.files import write_file

    if options.format == "parquet" and not options.output:
        raise UprightError("format is 'parquet'; it is not for a screen: name a file with --output")
    with Store(options.source, must_exist=True) as store:
        _require_runs(options.source, store.count() > 0)
        if options.format == "parquet":
            write_file(options.output, data_files.to_parquet(store, each))
            return
        write = data_files.write_csv if options.format == "csv" else data_files.write_json
        with _opened(options.output) as file:
            write(store, each, file)


def _show_environments(options: argparse.Namespace) -> None:
    from upright.studies.recorded_environment import read_environment
    from upright.studies.store import Store

    with Store(options.source, must_exist=True) as store:
        found = store.environments()
    _require_runs(options.source, bool(found))
    rows = [
        {"environment": number, "runs": runs, **read_environment(description)}
        for number, (description, runs) in found.items()
    ]
    if options.format == "json":
        put(json.dumps(rows, indent=2) + "\n", options.output)
        return
    texts = (
        "".join(f"{name:<12} {'not recorded' if value == '' else value}\n" for name, value in each)
        for each in map(dict.items, rows)
    )
    put("\n".join(texts), options.output)


def _require_runs(path: str, found: bool) -> None:
    if not found:
        raise UprightError(f"store is {path!r}; it holds no runs")


@contextmanager
def _opened(output: str | None) -> Iterator[TextIO]:
    """Yield the file of this name, or the screen."""
    from upright.support.files import writing

    if output is None:
        yield sys.stdout
    else:
        with writing(output) as file:
            text = io.TextIOWrapper(file, encoding="utf-8", newline="")
            yield text
            text.detach()
