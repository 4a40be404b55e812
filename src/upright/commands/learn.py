"""Train an agent, and show each trial as it ends.

With --window the trials are drawn as the agent learns, in real time until a key changes that; once
the window is closed, the run goes on without it. A video is shortened to at most a minute: the
first trials in real time, the others fast forward, then the beginning and the end of the last. The
trials are the same as without pictures, but take longer to compute. The bars are the lengths of
trials; the grey cart-pole is the last fall.

With --from the agent is not new: it goes on learning from a policy, with all that it had learned
and with the policy's settings. The task is the one that the policy was trained on, except where
options override it; but --steps and --trials have their usual defaults, and the plant is the
equations unless --plant says otherwise. The policy's file stays as it is.
"""

import argparse
from typing import TYPE_CHECKING

from upright.agents import AGENTS
from upright.commands.options import (
    CUSTOM_AGENTS,
    CUSTOM_PLANTS,
    add,
    add_case_options,
    add_plant_options,
    add_task_file,
    add_task_options,
    case_of,
    changes_by_agent,
    plant_asked_for,
    plant_of,
    save_task_of,
    size_of,
    task_of,
    whole,
)
from upright.commands.parser import READ, WRITTEN, Parser
from upright.commands.showing import tell_file, tell_what_was_found, telling_of_compilation
from upright.errors import UprightError
from upright.support.exit_status import FAILED
from upright.support.terminal import visible

if TYPE_CHECKING:
    from upright.policies.policy import Policy
    from upright.studies.case import Case

EXAMPLES = f"""\
examples:
  upright learn reinforce --noise gaussian-0.1 --seed 3
  upright learn q-learning --settings as-published --plot curve.png
  upright learn reinforce --steps 600000 --save policy.npz
  upright learn q-learning --set learning_rate=0.2 --set discount=0.98
  upright learn reinforce --plant mujoco --plant-set physics_step=0.001
  upright learn q-learning --parameter half_length=0.3 --save-task my-cart.toml
  upright learn reinforce --task my-cart.toml       the same task
  upright learn --from policy.npz --condition delay-1 --save delayed.npz    go on learning
  upright learn --from policy.npz --plant mujoco --set learning_rate=0.005
  upright learn my_agent:MyAgent --from mine.npz    a custom agent goes on
  upright learn reinforce --plant mujoco --plant-set model=my_cart.urdf
  upright learn reinforce --plant my_module:MyPlant
  upright learn q-learning --window --size 1280     see it learn
  upright learn q-learning --video learning.mp4     the same as a video; needs no display
{CUSTOM_AGENTS}{CUSTOM_PLANTS}\
exit status: 0 if it balanced, 1 if not, 2 if something asked for is not possible, 3 if a custom
agent or plant failed: its code raised an exception, or it breaks the rules for them.
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright learn`."""
    parser.set_defaults(check=_check)
    add(parser, "agent", nargs="?")
    parser.add_argument(
        "--from",
        dest="start_policy",
        metavar="POLICY",
        file=READ,
        help="go on from this policy, saved by learn --save as .npz; AGENT may be left out, unless "
        "it is a custom one, whose code is executed",
    )
    add_task_options(parser, from_policy=True)
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
    parser.add_argument(
        "--plot", metavar="FILE", file=WRITTEN, help="save the learning curve as a picture"
    )
    parser.add_argument(
        "--save",
        metavar="FILE",
        file=WRITTEN,
        help="save the policy; the name ends in .npz or .json",
    )
    parser.add_argument(
        "--quiet", action="store_true", help="print only the outcome, not every trial"
    )


def _check(options: argparse.Namespace) -> None:
    """End with an error if no agent is named."""
    if options.agent is None and options.start_policy is None:
        options.parser.error("AGENT is missing; name one, or a policy to go on from: --from POLICY")


def run(options: argparse.Namespace) -> int:
    """Carry out `upright learn`."""
    agents = [] if options.agent is None else [options.agent]
    for agent in agents:
        AGENTS.check(agent)
    with telling_of_compilation(agents):
        return _learn(options)


def _learn(options: argparse.Namespace) -> int:
    from upright.errors import require
    from upright.policies.files import load_policy, save_policy
    from upright.policies.going_on import describe_going_on, describe_total
    from upright.studies.learned import check_learned, learned_policy
    from upright.studies.study import check_study
    from upright.studies.watching import watch_run

    start = load_policy(options.start_policy, options.agent) if options.start_policy else None
    case = _case_from(start, options) if start else case_of(options, plant=plant_of(options))
    require("run", options.run, 0, 10**6 - 1, whole=True)
    check_study(options.run + 1, options.seed)
    if options.plot:
        from upright.reports.names import case_name, noise_name, task_name
        from upright.reports.plots import check_picture, plot_curve, save

        check_picture(options.plot)
    if options.save:
        check_learned(options.save, case)
    save_task_of(options, [case])
    if not options.quiet:
        tell_what_was_found(case)
        if start:
            print(visible(describe_going_on(start), "\n"), flush=True)
    memory, result = watch_run(
        case,
        options.seed,
        options.run,
        quiet=options.quiet,
        twister=options.twister,
        window=options.window,
        video=options.video,
        size=size_of(options),
        policy=start,
    )
    learned = learned_policy(case, options.seed, options.run, memory, result, start)
    if start:
        print(visible(describe_total(learned), "\n"))
    if options.plot:
        title, task = f"{case_name(case)}, {noise_name(case.spec.noise)}", task_name(case.spec)
        made = f"seed {options.seed}, run {options.run}"
        subtitle = f"{task}; {made}" if task else made
        figure = plot_curve(result.lengths, case.spec.steps, title, subtitle, case.agent)
        save(figure, options.plot)
        tell_file("learning curve", options.plot)
    if options.save:
        save_policy(options.save, learned)
        tell_file("policy", options.save)
    return 0 if result.success else FAILED


def _case_from(policy: "Policy", options: argparse.Namespace) -> "Case":
    """Return the case that is asked for in which a policy's agent goes on learning."""
    from upright.policies.going_on import check_going_on
    from upright.studies.case import refuse_settings_of_custom
    from upright.studies.learned import KEEPS_SETTINGS, case_from
    from upright.support.settings import change_settings

    if options.twister:
        raise UprightError("--twister cannot be given with --from: the MATLAB twin has no such run")
    if options.settings != "default" or options.settings_files:
        option = "--settings-file" if options.settings_files else "--settings"
        raise UprightError(f"{option} cannot be given with --from: {KEEPS_SETTINGS}, by --set")
    settings, task = check_going_on(policy), task_of(options)
    if changes := changes_by_agent(options.changes, [policy.agent])[policy.agent]:
        refuse_settings_of_custom(policy.agent)
        settings = change_settings(settings, changes)
    return case_from(policy, settings, **task, **plant_asked_for(options))
