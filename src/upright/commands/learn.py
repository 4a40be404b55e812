"""Train an agent, and show each trial as it ends.

With --window the trials are drawn as the agent learns, in real time until a key changes that; once
the window is closed, the run goes on without it. A video is shortened to at most a minute: the
first trials in real time, the others fast forward, then the beginning and the end of the last. The
trials are the same as without pictures, but take longer to compute. The bars are the lengths of
trials; the grey cart-pole is the last fall.
"""

import argparse

from upright.agents import AGENTS
from upright.commands.options import (
    CUSTOM_AGENTS,
    add,
    add_case_options,
    add_plant_options,
    add_task_file,
    add_task_options,
    case_of,
    plant_of,
    save_task_of,
    size_of,
    whole,
)
from upright.commands.parser import Parser
from upright.commands.showing import telling_of_compilation
from upright.support.exit_status import FAILED

EXAMPLES = f"""\
examples:
  upright learn reinforce --noise gaussian-0.1 --seed 3
  upright learn q-learning --settings as-published --plot curve.png
  upright learn reinforce --steps 600000 --save policy.npz
  upright learn q-learning --set learning_rate=0.2 --set discount=0.98
  upright learn reinforce --plant mujoco --plant-set physics_step=0.001
  upright learn q-learning --parameter half_length=0.3 --save-task my-cart.toml
  upright learn reinforce --task my-cart.toml       the same task
  upright learn q-learning --window --size 1280     see it learn
  upright learn q-learning --video learning.mp4     the same as a video; needs no display
{CUSTOM_AGENTS}\
exit status: 0 if it balanced, 1 if not, 2 if something asked for is not possible, 3 if a custom
agent failed: its code raised an exception, or it breaks the rules for agents.
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright learn`."""
    add(parser, "agent")
    add_task_options(parser)
    add(parser, "--seed")
    add_case_options(parser)
    add_plant_options(parser)
    add_task_file(parser)
    parser.add_argument("--run", **whole(0, "number of the run within its study", "K"))
    parser.add_argument(
        "--twister",
        action="store_true",
        help="draw the MATLAB twin's random numbers: its run K + 1 then has the same trials",
    )
    add(parser, "--window", "--size")
    add(parser, "--video", help="write a video of the run, shortened, to this file, .mp4 or .gif")
    parser.add_argument("--plot", metavar="FILE", help="save the learning curve as a picture")
    parser.add_argument(
        "--save", metavar="FILE", help="save the policy; the name ends in .npz or .json"
    )
    parser.add_argument(
        "--quiet", action="store_true", help="print only the outcome, not every trial"
    )


def run(options: argparse.Namespace) -> int:
    """Carry out `upright learn`."""
    AGENTS.check(options.agent)
    with telling_of_compilation([options.agent]):
        return _learn(options)


def _learn(options: argparse.Namespace) -> int:
    from upright.errors import require
    from upright.studies.study import check_study
    from upright.studies.watching import watch_run

    case = case_of(options, plant=plant_of(options))
    require("run", options.run, 0, 999_999)
    check_study(options.run + 1, options.seed)
    if options.plot:
        from upright.reports.names import case_name, noise_name, task_name
        from upright.reports.plots import check_picture, plot_curve, save

        check_picture(options.plot)
    if options.save:
        from upright.studies.learned import check_learned

        check_learned(options.save, case)
    save_task_of(options, [case])
    memory, result = watch_run(
        case,
        options.seed,
        options.run,
        quiet=options.quiet,
        twister=options.twister,
        window=options.window,
        video=options.video,
        size=size_of(options),
    )
    if options.plot:
        title, task = f"{case_name(case)}, {noise_name(case.spec.noise)}", task_name(case.spec)
        made = f"seed {options.seed}, run {options.run}"
        subtitle = f"{task}; {made}" if task else made
        figure = plot_curve(result.lengths, case.spec.steps, title, subtitle, case.agent)
        save(figure, options.plot)
        print(f"learning curve: {options.plot}")
    if options.save:
        from upright.studies.learned import save_learned

        save_learned(options.save, case, options.seed, options.run, memory)
        print(f"policy: {options.save}")
    return 0 if result.success else FAILED
