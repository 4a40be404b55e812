"""Play a saved policy in Gazebo's window, in real time.

If you close the window, the trial goes on without it; Ctrl-C stops it.
"""

import argparse
from pathlib import Path

from upright.commands.options import add, add_task_options, task_of
from upright.commands.parser import WRITTEN, Parser
from upright.commands.showing import tell_file
from upright.errors import require_one_of
from upright.support.exit_status import FAILED

EXAMPLES = """\
examples:
  upright gazebo view policy.npz
  upright gazebo view policy.npz --noise gaussian-0.2 --steps 500
  upright gazebo view policy.npz --screenshot gazebo.png   without a display; it needs Xvfb
exit status: 0 if the pole stayed up, 1 if it fell, 2 if something asked for is not possible.
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright gazebo view`."""
    add(parser, "policy")
    add_task_options(parser, ("--noise", "--parameter"), as_trained=True)
    add(
        parser,
        "--steps",
        default=3_000,
        help="the trial lasts at most this many steps (default: %(default)s)",
    )
    add(parser, "--seed", "--agent")
    parser.add_argument(
        "--screenshot",
        metavar="FILE",
        file=WRITTEN,
        help="write a picture of the window to this file",
    )


def run(options: argparse.Namespace) -> int:
    """Carry out `upright gazebo view`."""
    import numpy as np

    from upright.plants.gazebo.plant import Gazebo
    from upright.plants.gazebo.window import photograph
    from upright.policies.files import load_policy
    from upright.studies.playing import case_for, play_run
    from upright.studies.run import make_plant
    from upright.studies.study import check_study
    from upright.studies.watching import watch_play
    from upright.support.files import check_output

    check_study(1, options.seed)
    if options.screenshot:
        ending = Path(options.screenshot).suffix
        require_one_of(f"the ending of {options.screenshot!r}", ending, [".png"])
    policy = load_policy(options.policy, options.agent)
    plant = Gazebo(gui=True, real_time_factor=1.0)
    case = case_for(policy, plant=plant, **task_of(options))
    if options.screenshot:

        def play_there(stop: np.ndarray) -> None:
            plant, _ = make_plant(case, options.seed, 0, stop)
            play_run(policy, case, options.seed, plant, np.zeros(case.spec.trials, np.int64), stop)

        photograph(play_there, check_output(options.screenshot))
        tell_file("picture", options.screenshot)
        return 0
    played = watch_play(policy, case, 1, options.seed)
    return 0 if all(trial.balanced for trial in played) else FAILED
