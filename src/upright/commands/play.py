"""Play a saved policy, and show each trial as it ends.

The policy is played on the task it was trained on, except where options override it, and on the
equations unless --plant says otherwise. It does not learn.

With pictures there is one trial of 1,000 steps, 20 s, unless options say otherwise. The pale pole
and the lower mark show what the agent measures, the grey cart-pole the last fall. Esc, q or closing
the window stops playback.
"""

import argparse

from upright.commands.options import (
    add,
    add_plant_options,
    add_task_file,
    add_task_options,
    plant_asked_for,
    save_task_of,
    size_of,
    task_of,
)
from upright.commands.parser import Parser, as_whole
from upright.commands.showing import telling_of_compilation
from upright.core.conditions import STEPS
from upright.support.exit_status import FAILED

EXAMPLES = """\
examples:
  upright play policy.npz                           ten trials, without pictures
  upright play policy.npz --noise gaussian-0.2 --start wide --window
  upright play policy.npz --condition delay-1 --video fall.mp4 --size 1280x720
  upright play policy.npz --episodes 100 --steps 600000
  upright play policy.json                          written by export, or by another language
  upright play policy.npz --greedy                  the more probable push, without drawing
  upright play policy.npz --plant mujoco            on another plant
  upright play policy.npz --plant mujoco --plant-set model=my_cart.urdf
  upright play policy.npz --parameter half_length=1.0   on a longer pole
  upright play policy.npz --task my-cart.toml       on the task of a file, written by --save-task
exit status: 0 if no trial ended by a fall, 1 if one did, 2 if something asked for is not possible.
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright play`."""
    add(parser, "policy")
    task = ("--noise", "--start", "--condition", "--parameter")
    add_task_options(parser, task, as_trained=True)
    add(
        parser,
        "--steps",
        default=None,
        help=f"a trial lasts at most this many steps (default: {STEPS}, with pictures 1000)",
    )
    parser.add_argument(
        "--episodes",
        type=as_whole,
        metavar="N",
        help="number of trials to play (default: 10, with pictures 1)",
    )
    add(parser, "--seed")
    add_plant_options(parser)
    add_task_file(parser)
    add(parser, "--window", "--video", "--size")
    add(parser, "--greedy", "--agent")


def run(options: argparse.Namespace) -> int:
    """Carry out `upright play`."""
    with telling_of_compilation([], "play"):
        return _play(options)


def _play(options: argparse.Namespace) -> int:
    from dataclasses import replace

    from upright.errors import require
    from upright.pictures.video import check_video
    from upright.policies.files import load_policy
    from upright.studies.playing import case_for
    from upright.studies.study import check_study
    from upright.studies.watching import watch_play

    drawn = options.window or options.video is not None
    episodes, steps = (1, 1_000) if drawn else (10, STEPS)
    episodes = episodes if options.episodes is None else options.episodes
    changes = {"steps": steps} | task_of(options)
    policy = load_policy(options.policy, options.agent)
    if options.greedy:
        policy = replace(policy, greedy=True)
    case = case_for(policy, **changes, **plant_asked_for(options))
    require("episodes", episodes, 1, 10**6, whole=True)
    check_study(episodes, options.seed)
    if options.video is not None:
        check_video(options.video)
    save_task_of(options, [case])
    played = watch_play(
        policy,
        case,
        episodes,
        options.seed,
        options.video,
        window=options.window,
        size=size_of(options),
    )
    return 0 if all(trial.balanced for trial in played) else FAILED
