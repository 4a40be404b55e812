"""Draw what a store of runs or a saved policy holds."""

import argparse
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

from upright.commands.options import add
from upright.commands.parser import READ, Parser
from upright.commands.showing import tell_file
from upright.errors import UprightError
from upright.reports.sweeps import UNITS

if TYPE_CHECKING:
    from upright.reports.plots import Learned

KINDS = ("curves", "trials", "sweep", "policy", "phases")
"""What can be drawn."""
EXAMPLES = """\
examples:
  upright plot curves results/runs.sqlite --output curves.png
  upright plot trials results/runs.sqlite --output trials.pdf
  upright plot sweep sweep.sqlite --output sweep.png
  upright plot policy results/reinforce.npz --output policy.png
  upright plot phases results/reinforce.npz --output phases.png
A sweep is a table over several values of a parameter:
  upright table --noises none --parameter half_length=0.25:2:8 --runs 20 --store sweep.sqlite
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright plot`."""
    parser.add_argument(
        "kind",
        choices=KINDS,
        metavar="KIND",
        help="what to draw: curves (learning curves of a store, noise-free if it has such runs), "
        "trials (distributions of its trials), sweep (its trials and successes over a parameter "
        "of the plant), policy (map of a policy's pushes) or phases (its phase portraits)",
    )
    parser.add_argument(
        "source",
        metavar="FILE",
        file=READ,
        help="a store, or a policy saved by learn --save",
    )
    add(
        parser,
        "--output",
        metavar="PICTURE",
        help="file for the picture: .png, .pdf or .svg (default: KIND.png in this folder)",
    )
    parser.add_argument(
        "--parameter",
        choices=tuple(UNITS),
        metavar="NAME",
        help="the parameter to draw a sweep over, if the runs of the store differ in several (each "
        "combination of the others has panels of its own): %(choices)s",
    )
    add(parser, "--agent")


def run(options: argparse.Namespace) -> int:
    """Carry out `upright plot`."""
    from upright.policies.files import load_policy
    from upright.reports import plots

    if options.parameter is not None and options.kind != "sweep":
        raise UprightError(f"parameter is {options.parameter!r}; it is for upright plot sweep")
    options.output = options.output or f"{options.kind}.png"
    options.parser.check_files(options)
    output = plots.check_picture(options.output)
    if options.kind == "policy":
        figure = plots.plot_policies([load_policy(options.source, options.agent)])
    elif options.kind == "phases":
        figure = plots.plot_phases(load_policy(options.source, options.agent))
    elif options.kind == "sweep":
        figure = plots.plot_sweep(runs_to_draw(options.source), options.parameter)
    else:
        learned = runs_to_draw(options.source)
        without = [(case, results) for case, results in learned if case.spec.noise == "none"]
        curves = options.kind == "curves"
        figure = plots.plot_curves(without or learned) if curves else plots.plot_trials(learned)
    plots.save(figure, output)
    tell_file("picture", output)
    return 0


def runs_to_draw(path: str) -> "Learned":
    """Return the cases of a store and their results; where a case has several seeds, named by them.

    Raises
    ------
    UprightError
        If there are none.
    """
    from upright.studies.study import stored

    found = [entry for entry in stored(path) if entry[2]]
    if not found:
        raise UprightError(f"store is {path!r}; it holds no runs to draw")
    times = Counter(case for case, _, _ in found)
    return [
        (
            case if times[case] == 1 else replace(case, label=f"{case.settings_name}, seed {seed}"),
            results,
        )
        for case, seed, results in found
    ]
