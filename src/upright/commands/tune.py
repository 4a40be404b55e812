"""Search for better settings of an agent.

Candidates are ranked by the mean number of trials over all runs; a failed run counts as --trials.
The first candidate is the settings the search starts from; hopeless ones are abandoned early. The
best is measured again on fresh runs beside the settings the search started from, which tells
whether a difference can be shown. All runs have seeds of a million or more: those below are for
tables. If interrupted, the same command continues where it stopped.

It needs Optuna (pip install optuna).
"""

import argparse

from upright.agents import AGENTS
from upright.commands.options import (
    CUSTOM_AGENTS,
    add,
    add_case_options,
    add_executor_options,
    add_plant_options,
    add_task_file,
    add_task_options,
    case_of,
    changes_by_agent,
    executor_of,
    noises_of,
    plant_of,
    save_task_of,
    whole,
)
from upright.commands.parser import Parser
from upright.commands.showing import tell_file, telling_of_compilation, telling_what_is_kept
from upright.support.terminal import visible

EXAMPLES = f"""\
examples:
  upright tune q-learning
  upright tune q-learning --search learning_rate --search discount=0.9:0.999 --candidates 50
  upright tune ase-ace --settings as-published --set mirrored=True --noises all --runs 20
  upright tune reinforce --candidates 300             (after the first: 200 more)
  upright tune q-learning --output tuned.toml
  upright tune q-learning --task my-cart.toml         for the task of a file
  upright table --agents q-learning,random-search --settings-file tuned.toml
{CUSTOM_AGENTS}"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright tune`."""
    add(parser, "agent")
    add(parser, "--noises", default="none,actuator-10,gaussian-0.2")
    add_task_options(parser, ("--start", "--condition", "--steps", "--trials", "--parameter"))
    add_case_options(parser)
    add_plant_options(parser)
    add_task_file(parser)
    parser.add_argument(
        "--search",
        action="append",
        default=[],
        metavar="NAME[=LOW:HIGH]",
        help="search this setting, within this range; may be repeated (default: all settings that "
        "have a range)",
    )
    add(parser, "--seed")
    add(parser, "--runs", help="runs of each candidate on each noise case (default: %(default)s)")
    parser.add_argument("--candidates", **whole(100, "total number of settings to try"))
    parser.add_argument(
        "--validation-runs", **whole(100, "fresh runs of the best on each noise case")
    )
    add(
        parser,
        "--store",
        help="keep the candidates in this file (default: tune-AGENT.sqlite in this folder)",
    )
    add(
        parser,
        "--output",
        help="write the settings found to this file, which ends in .toml, for the option "
        "--settings-file of learn, table and tune",
    )
    add_executor_options(parser)


def run(options: argparse.Namespace) -> int:
    """Carry out `upright tune`."""
    AGENTS.check(options.agent)
    with telling_of_compilation([options.agent]):
        return _tune(options)


def _tune(options: argparse.Namespace) -> int:
    from functools import partial

    from upright.studies.progress import search_with_progress, study_with_progress
    from upright.studies.search_space import search_space
    from upright.studies.study import check_study
    from upright.studies.tuning import (
        Search,
        describe,
        place_for,
        require_optuna,
        result_text,
        validate,
    )
    from upright.support.files import write_file
    from upright.support.toml_file import check_toml_output

    require_optuna()
    executor = executor_of(options)
    if options.output:
        check_toml_output(options.output)
    plant = plant_of(options)
    cases = tuple(case_of(options, noise=noise, plant=plant) for noise in noises_of(options))
    fixed = changes_by_agent(options.changes, [options.agent])[options.agent]
    space = search_space(cases[0].settings, options.search, list(fixed))
    wanted = Search(cases, tuple(space), options.runs, options.seed)
    check_study(options.validation_runs, options.seed)
    save_task_of(options, cases)
    if options.store is None:
        options.store = place_for(options.agent)
    options.parser.check_files(options)
    with telling_what_is_kept(options.store, "finished candidates"):
        found = search_with_progress(wanted, options.candidates, options.store, executor)
        make = partial(study_with_progress, executor=executor)
        compared = validate(wanted, found.settings, options.validation_runs, make)
    print(visible(describe(wanted, found, compared, options.settings), "\n"))
    if options.output:
        write_file(options.output, result_text(wanted, found, compared))
        print()
        tell_file("settings", options.output)
    return 0
