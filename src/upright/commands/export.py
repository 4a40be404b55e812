"""Write a saved policy as C99, ONNX or JSON.

C and ONNX return the probability of a push to the right, and the user draws the push; with --greedy
they return the more probable push itself, and no random number is needed. docs/policies.md
documents names, types and the JSON format.
"""

import argparse

from upright.commands.options import LIKELIER, add
from upright.commands.parser import WRITTEN, Parser
from upright.commands.showing import tell_file

EXAMPLES = """\
examples:
  upright learn reinforce --save policy.npz
  upright export policy.npz policy.h     C99: one function, no allocation, float64 or float32
  upright export policy.npz policy.h --greedy   the same, but it returns the push: 1 or 0
  upright export policy.npz policy.onnx  ONNX (needs: pip install onnx)
  upright export policy.npz policy.json  JSON: the numbers, for play, MATLAB and Octave
  cc -std=c99 main.c -lm                 where main.c has: #include "policy.h"
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright export`."""
    add(parser, "policy")
    parser.add_argument(
        "output",
        metavar="OUTPUT",
        file=WRITTEN,
        help="the file to write; it ends in .h, .onnx or .json",
    )
    add(
        parser,
        "--greedy",
        help=f"export the push itself, 1 to the right or 0 to the left: {LIKELIER}",
    )
    add(parser, "--agent")


def run(options: argparse.Namespace) -> int:
    """Carry out `upright export`."""
    from upright.policies.files import check_export, export_policy, load_policy

    check_export(options.output)
    policy = load_policy(options.policy, options.agent)
    export_policy(options.output, policy, greedy=options.greedy)
    tell_file("exported", options.output)
    return 0
