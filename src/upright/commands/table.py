"""Measure agents over many runs, beside the published figures."""

import argparse
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from upright.agents import AGENTS
from upright.commands.options import (
    CUSTOM_AGENTS,
    CUSTOM_PLANTS,
    UNITS,
    add,
    add_executor_options,
    add_plant_options,
    add_task_file,
    add_task_options,
    cases_of,
    changes_by_agent,
    executor_of,
    noises_of,
    plant_of,
    save_task_of,
    split,
    tasks_of,
)
from upright.commands.parser import WRITTEN, Parser
from upright.commands.showing import (
    put,
    put_table,
    tell_file,
    telling_of_compilation,
    telling_what_is_kept,
)
from upright.support.settings import RANGE

if TYPE_CHECKING:
    from upright.studies.case import Case

EXAMPLES = f"""\
examples:
  upright table --agents reinforce,q-learning,random-search --noises all --runs 100
  upright table --agents reinforce --noises none,gaussian-0.2 --settings as-published
  upright table --runs 100 --steps 600000 --store runs.sqlite   (interrupted? run it again)
  upright table --agents my_module:MyAgent,random-search --noises none --runs 20
  upright table --plant mujoco --agents reinforce,random-search --runs 20
  upright table --plant my_module:MyPlant --agents reinforce,random-search --noises none
  upright table --agents q-learning,reinforce --noises none --set q-learning.discount=0.9,0.99
  upright table --agents adaptive-lqr --noises none --parameter half_length=0.25,0.5,1.0
  upright table --agents q-learning,random-search --noises none --parameter half_length=0.25:2:8
  upright table --agents q-learning --noises none --parameter cart_mass=0.1:10:5:log --runs 20
  upright table --agents q-learning,random-search --settings-file tuned.toml
  upright table --task my-cart.toml                written by hand, or by --save-task
  upright table --agents ndp --noises all --save-study ndp.toml       (then upright study ndp.toml)
  upright table --runs 1000 --store runs.sqlite --executor dask --address tcp://127.0.0.1:8786
  upright table --format json --output table.json
{CUSTOM_AGENTS}{CUSTOM_PLANTS}\
exit status: 0 if every run was made, 2 if something asked for is not possible, 3 if a custom agent
or plant failed; runs that had ended are in the store.
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright table`."""
    add(parser, "--agents", "--noises")
    add_task_options(parser, ("--start", "--condition", "--steps", "--trials"))
    add(
        parser,
        "--parameter",
        metavar="NAME=VALUES",
        help="change a parameter of the plant (see upright plants); values with commas between "
        f"give a row each, and so do the numbers of a range: {RANGE}. May be repeated, and every "
        f"combination is measured; upright plot sweep draws what is in the store. {UNITS}",
    )
    add(parser, "--settings")
    add(
        parser,
        "--settings-file",
        help="take an agent's settings from this file, which tune --output wrote, instead of "
        "--settings; may be repeated",
    )
    add(
        parser,
        "--set",
        metavar="AGENT.NAME=VALUES",
        help="change one of an agent's settings (see upright agents); values with commas between, "
        "and ranges of numbers as above, give a row each; may be repeated, and every combination "
        "is measured. AGENT. may be left out where there is one agent",
    )
    add_plant_options(parser)
    add_task_file(parser)
    parser.add_argument(
        "--save-study",
        metavar="FILE",
        file=WRITTEN,
        help="write all that these options ask for to this file, which ends in .toml, for upright "
        "study",
    )
    add_measuring_options(parser)


def add_measuring_options(parser: Parser) -> None:
    """Add the options that `measure` reads."""
    add(parser, "--runs", "--seed", "--store")
    add_executor_options(parser)
    add(parser, "--format", "--sources", "--output")


def run(options: argparse.Namespace) -> int:
    """Carry out `upright table`."""
    agents = split(options.agents)
    for agent in agents:
        AGENTS.check(agent)
    with telling_of_compilation(agents):
        from dataclasses import replace

        from upright.core.task import TaskSpec
        from upright.support.settings import require_few_cases

        tasks, noises = tasks_of(options), noises_of(options)
        starts = cases_of(options, agents, plant=plant_of(options))
        require_few_cases(len(starts) * len(tasks) * len(noises))
        specs = [TaskSpec.from_data(task | {"noise": noise}) for task in tasks for noise in noises]
        cases = [replace(start, spec=spec) for start in starts for spec in specs]
        save_task_of(options, cases)
        if options.save_study is not None:
            _save_study(options, starts, tasks)
        return measure(cases, options, is_sweep=len(starts) > len(agents) or len(tasks) > 1)


def _save_study(
    options: argparse.Namespace, starts: "Sequence[Case]", tasks: Sequence[dict[str, Any]]
) -> None:
    """Write the study that options ask for to the file that --save-study names."""
    from upright.studies.settings_file import read_settings
    from upright.studies.study_file import save_study
    from upright.support.settings import pairs

    agents = list(dict.fromkeys(split(options.agents)))
    files = [(read_settings(path).agent, path) for path in options.settings_files]
    settings = {}
    for agent, changes in changes_by_agent(options.changes, agents).items():
        own = [start.settings for start in starts if start.agent == agent]
        settings[agent] = {
            "from": [path for owner, path in files if owner == agent] or [options.settings],
            **{name: [getattr(each, name) for each in own] for name in changes},
        }
    swept = dict(pairs("--parameter", options.parameters))  # their order is that of the cases
    parameters = {
        name: [task["parameters"][name] for task in tasks]
        for name in dict.fromkeys([*swept, *tasks[0]["parameters"]])
    }
    plan = {name: getattr(options, name) for name in ("runs", "seed", "store")}
    plan = {"agents": agents, **{name: plan[name] for name in plan if plan[name] is not None}}
    parts = {
        **{name: [value] for name, value in tasks[0].items()},
        "noise": noises_of(options),
        "parameters": parameters,
    }
    save_study(options.save_study, plan, parts, starts[0].plant, settings)
    tell_file("study", options.save_study, sys.stderr)


def measure(cases: "Sequence[Case]", options: argparse.Namespace, *, is_sweep: bool = False) -> int:
    """Run the cases, show their table as the options of `add_measuring_options` say, return 0.

    Of a part of a study, show how far it is instead.

    Parameters
    ----------
    cases
        What to run.
    options
        Those of `add_measuring_options`; and `part`, if only a part of the runs is to be made.
    is_sweep
        Whether to say how many cases there are.

    Raises
    ------
    UprightError
        If something asked for is not possible.
    """
    from upright.reports.standing import status_text
    from upright.reports.statistics import summarise_all
    from upright.studies.estimate import standings
    from upright.studies.progress import study_with_progress
    from upright.studies.store import Store
    from upright.studies.study import WHOLE, check_study
    from upright.support.files import check_output
    from upright.support.words import count

    check_study(options.runs, options.seed)
    executor = executor_of(options)
    if options.output:
        check_output(options.output)
    cases = list(dict.fromkeys(cases))  # a sweep may give the same value twice
    with Store(options.store) as store, telling_what_is_kept(options.store):
        if is_sweep:
            size = f"{count(len(cases), 'case')} of {count(options.runs, 'run')} each"
            print(size, file=sys.stderr)
        part = vars(options).get("part") or WHOLE
        study_with_progress(cases, options.runs, options.seed, store, executor, part)
        if part != WHOLE:
            several = standings(cases, options.runs, options.seed, store, part)
            put(status_text(several, options.store), options.output)
            return 0
        rows = summarise_all(cases, options.runs, options.seed, store)
    put_table(rows, options)
    return 0
