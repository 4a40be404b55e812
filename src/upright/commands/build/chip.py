"""Build a learner for a microcontroller: it learns there, from its own falls.

The folder gets an object file, its header in C, a JSON file that says where everything lies in the
learner's memory, and an example for CMake: the learner on a simulated cart-pole, from the same
sources, which QEMU runs. The learner needs no heap and no C library. In float64 it has the same
bits on every processor, and takes longer where there is no unit for it. `upright export` writes a
policy that does not learn any more.
"""

import argparse

from upright.agents import AGENTS
from upright.builds.chip_package import CPUS, PRECISIONS
from upright.commands.options import (
    CUSTOM_AGENTS,
    add,
    add_case_options,
    add_task_options,
    case_of,
)
from upright.commands.parser import Parser
from upright.commands.showing import tell_file
from upright.support import terminal

EXAMPLES = f"""\
examples:
  upright build chip adaptive-lqr --cpu cortex-m7 --output firmware
  upright build chip reinforce --set episodes=4 --set kept_steps=500 --output firmware
                                             106 kB of memory; by default it takes 400 kB
  cd firmware
  cmake -S . -B build -DCMAKE_TOOLCHAIN_FILE=toolchain.cmake && cmake --build build
  qemu-system-arm -M mps2-an500 -nographic -semihosting -kernel build/example.elf
{CUSTOM_AGENTS}\
exit status: 0 if it was built, 2 if something asked for is not possible.
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright build chip`."""
    add(parser, "agent")
    parser.add_argument(
        "--cpu",
        default="cortex-m7",
        metavar="CPU",
        choices=CPUS,
        help="the processor: %(choices)s (default: %(default)s)",
    )
    parser.add_argument(
        "--precision",
        metavar="NAME",
        choices=PRECISIONS,
        help="numbers of the learner: float64, with the bits that it has on a computer, or "
        "float32, which is faster and smaller, but has other trials (default: float64 where the "
        "processor has a unit for it, else float32)",
    )
    help_text = "the folder to write to; it is created if it is missing (default: %(default)s)"
    add(parser, "--output", default="firmware", metavar="FOLDER", help=help_text)
    add_task_options(parser)
    add_case_options(parser)


def run(options: argparse.Namespace) -> int:
    """Carry out `upright build chip`."""
    AGENTS.check(options.agent)
    from upright.builds.chip_package import build_chip

    case = case_of(options)
    terminal.notice("building, which takes some 20 seconds …")
    tell_file("learner", build_chip(case, options.cpu, options.output, options.precision))
    return 0
