"""Measure agents over many runs, beside the published figures."""

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

from upright.commands.options import (
    CUSTOM_AGENTS,
    add,
    add_plant_options,
    add_task_options,
    noises_of,
    plant_of,
    split,
    task_of,
)
from upright.commands.parser import Parser
from upright.commands.showing import put, telling_what_is_kept

if TYPE_CHECKING:
    from upright.studies.case import Case

EXAMPLES = f"""\
examples:
  upright table --agents reinforce,q-learning,random-search --noises all --runs 100
  upright table --agents reinforce --noises none,gaussian-0.2 --settings as-published
  upright table --runs 100 --steps 600000 --store runs.sqlite   (interrupted? run it again)
  upright table --agents my_module:MyAgent,random-search --noises none --runs 20
  upright table --plant mujoco --agents reinforce,random-search --runs 20
  upright table --format json --output table.json
{CUSTOM_AGENTS}\
exit status: 0 if every run was made, 2 if something asked for is not possible, 3 if a custom agent
failed; runs that had ended are in the store.
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright table`."""
    add(parser, "--agents", "--noises")
    add_task_options(parser, ("--start", "--condition", "--steps", "--trials", "--parameter"))
    add(parser, "--settings")
    add_plant_options(parser)
    add_measuring_options(parser)


def add_measuring_options(parser: Parser) -> None:
    """Add the options that `measure` reads."""
    add(parser, "--runs", "--seed", "--store", "--format", "--output")


def run(options: argparse.Namespace) -> int:
    """Carry out `upright table`."""
    from upright.studies.case import make_case

    task = {"plant": plant_of(options)} | task_of(options)
    cases = [
        make_case(agent, options.settings, noise=noise, **task)
        for agent in split(options.agents)
        for noise in noises_of(options)
    ]
    return measure(cases, options)


def measure(cases: "Sequence[Case]", options: argparse.Namespace) -> int:
    """Run the cases, show their table as the options of `add_measuring_options` say, return 0.

    Raises
    ------
    UprightError
        If something asked for is not possible.
    """
    from upright.reports.statistics import summarise_all
    from upright.reports.tables import render
    from upright.studies.progress import study_with_progress
    from upright.studies.store import Store
    from upright.studies.study import check_study
    from upright.support.files import check_output

    check_study(options.runs, options.seed)
    if options.output:
        check_output(options.output)
    with Store(options.store) as store, telling_what_is_kept(options.store):
        study_with_progress(cases, options.runs, options.seed, store)
        rows = summarise_all(cases, options.runs, options.seed, store)
    put(render(rows, options.format), options.output)
    return 0
