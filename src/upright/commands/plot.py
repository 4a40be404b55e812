"""Draw what a store of runs or a saved policy holds."""

import argparse

from upright.commands.options import add
from upright.commands.parser import Parser
from upright.errors import UprightError

KINDS = ("curves", "trials", "policy", "phases")
"""What can be drawn."""
EXAMPLES = """\
examples:
  upright plot curves results/runs.sqlite --output curves.png
  upright plot trials results/runs.sqlite --output trials.pdf
  upright plot policy results/reinforce.npz --output policy.png
  upright plot phases results/reinforce.npz --output phases.png
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright plot`."""
    parser.add_argument(
        "kind",
        choices=KINDS,
        metavar="KIND",
        help="what to draw: curves (noise-free learning curves of a store), trials (distributions "
        "of its trials), policy (map of a policy's pushes) or phases (its phase portraits)",
    )
    parser.add_argument("source", metavar="FILE", help="a store, or a policy saved by learn --save")
    add(
        parser,
        "--output",
        metavar="PICTURE",
        help="file for the picture: .png, .pdf or .svg (default: KIND.png in this folder)",
    )
    add(parser, "--agent")


def run(options: argparse.Namespace) -> int:
    """Carry out `upright plot`."""
    from upright.policies.files import load_policy
    from upright.reports import plots
    from upright.studies.study import stored

    output = plots.check_picture(options.output or f"{options.kind}.png")
    if options.kind == "policy":
        figure = plots.plot_policies([load_policy(options.source, options.agent)])
    elif options.kind == "phases":
        figure = plots.plot_phases(load_policy(options.source, options.agent))
    else:
        curves = options.kind == "curves"
        found = stored(options.source)
        learned = [
            (case, runs) for case, _, runs in found if case.spec.noise == "none" or not curves
        ]
        if not learned:
            raise UprightError(f"store is {options.source!r}; it holds no runs to draw")
        figure = plots.plot_curves(learned) if curves else plots.plot_trials(learned)
    plots.save(figure, output)
    print(f"picture: {output}")
    return 0
