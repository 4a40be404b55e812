"""The `upright` command."""

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NoReturn

from upright import __version__
from upright.agents import AGENTS
from upright.core.conditions import PUBLISHED_NOISES, RUNS, STEPS, STRICT_RUNS, STRICT_STEPS, TRIALS
from upright.errors import UprightError
from upright.support.exit_status import BAD_USE, FAILED, INTERRUPTED, exit_status

if TYPE_CHECKING:
    from upright.plants.settings import PlantSettings
    from upright.studies.case import Case

MATLAB_AGENTS = ("q-learning", "reinforce", "random-search")
TASK_HELP = f"""\
noise cases: {", ".join(PUBLISHED_NOISES)}
  (published), all-5, all-10 (all four measurements); "all" means the published seven.
agents: {", ".join(AGENTS)}; `upright agents` tells more.
  Your own: module:name, a class or function that, given a run's random numbers, returns an agent
  with the methods begin_trial, act, learn and end_trial, or train(env) (see examples/).
"""


class Parser(argparse.ArgumentParser):
    """A parser whose complaints take one line."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong, and end."""
        self.exit(BAD_USE, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


def main() -> NoReturn:
    """Run the command of this process and end with its status."""
    status = run(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    if status == INTERRUPTED:
        os._exit(status)  # a thread may still be compiling, which nothing can interrupt
    sys.exit(status)


def run(arguments: Sequence[str]) -> int:
    """Carry out a command line and return the exit status."""

    def work() -> int:
        options = _parser().parse_args(arguments)
        status: int = options.command(options)
        return status

    return exit_status(work)


def _parser() -> Parser:
    parser = Parser(
        prog="upright",
        description="Learn to balance an inverted pendulum, and measure how fast it was learned.",
        epilog="""\
examples:
  upright learn reinforce                      watch one run learn, trial by trial
  upright play results/reinforce.npz --window  watch what was learned
  upright table --agents reinforce,random-search --runs 20
                                               a study: success rate and mean trials
  upright reproduce                            the published tables again, with pictures
  upright leaderboard                          all agents, ranked, on the published cases
  upright show results/runs.sqlite             what a store of runs holds
  upright plot policy results/reinforce.npz    a picture of what was learned
  upright export policy.npz policy.h           the same in C, for a microcontroller
  upright tune q-learning                      search for better settings
  upright matlab table                         Q-learning in MATLAB code, run by Octave
`upright COMMAND --help` shows more of each.
""",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"upright {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    for add in (
        _add_learn,
        _add_play,
        _add_table,
        _add_reproduce,
        _add_leaderboard,
        _add_robust,
        _add_show,
        _add_plot,
        _add_export,
        _add_agents,
        _add_plants,
        _add_tune,
        _add_matlab,
        _add_ros2,
        _add_gazebo,
    ):
        add(commands)
    return parser


def _command(
    commands: "argparse._SubParsersAction[Parser]", name: str, summary: str, epilog: str
) -> Parser:
    return commands.add_parser(
        name,
        help=summary,
        description=summary[0].upper() + summary[1:] + ".",
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def _whole(default: int, text: str, metavar: str = "N") -> dict[str, Any]:
    return {
        "type": int,
        "default": default,
        "metavar": metavar,
        "help": f"{text} (default {default:,})",
    }


SHARED: dict[str, dict[str, Any]] = {
    "--steps": _whole(STEPS, "a trial of this many steps of 0.02 s succeeds"),
    "--trials": _whole(TRIALS, "a run is at most this many trials"),
    "--agents": {
        "default": ",".join(AGENTS),
        "metavar": "LIST",
        "help": "agents, with commas between (default: all)",
    },
    "--noises": {
        "default": "all",
        "metavar": "LIST",
        "help": "noise cases, with commas between (default: all)",
    },
    "--store": {
        "metavar": "FILE",
        "help": "keep every finished run there, and take from it what is done",
    },
    "--runs": _whole(RUNS, "independent runs of each case"),
    "--seed": _whole(0, "the same seed gives the same result"),
    "--start": {
        "default": "random",
        "metavar": "NAME",
        "help": "random: each of the four within ±0.05 (default); zero; or wide: angles to 6°",
    },
    "--condition": {
        "default": "nominal",
        "metavar": "NAME",
        "help": "nominal (default), varied-plant, friction-100, delay-1, delay-2 or no-velocities",
    },
    "--settings": {
        "default": "default",
        "metavar": "NAME",
        "help": "default (tuned) or as-published",
    },
    "--format": {
        "default": "text",
        "metavar": "NAME",
        "help": "text (default), markdown, csv, json or latex",
    },
    "--output": {"metavar": "FILE", "help": "write the table there, not on the screen"},
    "--set": {
        "action": "append",
        "default": [],
        "metavar": "NAME=VALUE",
        "dest": "changes",
        "help": "change one setting; may be repeated",
    },
    "--plant": {
        "default": "equations",
        "metavar": "NAME",
        "help": "the body: equations (default), mujoco, gazebo, gz-sim or ros2; see upright plants",
    },
    "--plant-set": {
        "action": "append",
        "default": [],
        "metavar": "NAME=VALUE",
        "dest": "plant_changes",
        "help": "change one of the plant's settings (see upright plants); may be repeated",
    },
    "--agent": {
        "metavar": "MODULE:NAME",
        "help": "the agent from outside that learned the policy; its code is run",
    },
}
"""Options that several commands have."""
PLANT = ("--plant", "--plant-set")
TASK = ("--steps", "--trials", "--start", "--condition", "--seed", "--settings")


def _add_shared(parser: Parser, *names: str) -> None:
    for name in names:
        parser.add_argument(name, **SHARED[name])


def _add_learn(commands: "argparse._SubParsersAction[Parser]") -> None:
    parser = _command(
        commands,
        "learn",
        "let an agent learn, and show each trial as it ends",
        f"""\
examples:
  upright learn reinforce --noise gaussian-0.1 --seed 3
  upright learn q-learning --settings as-published --plot curve.png
  upright learn reinforce --steps 600000 --save policy.npz
  upright learn q-learning --set learning_rate=0.2 --set discount=0.98
  upright learn reinforce --plant mujoco --plant-set physics_step=0.001
{TASK_HELP}exit status: 0 if it balanced, 1 if not, 2 if something asked for is not possible.
""",
    )
    parser.add_argument("agent", metavar="AGENT", help="who learns")
    parser.add_argument("--noise", default="none", metavar="CASE", help="noise case (default none)")
    _add_shared(parser, *TASK, *PLANT)
    parser.add_argument("--run", **_whole(0, "number of the run within its study", "K"))
    _add_shared(parser, "--set")
    parser.add_argument(
        "--twister",
        action="store_true",
        help="draw the random numbers of the MATLAB twin, whose run K + 1 has the same trials",
    )
    parser.add_argument("--plot", metavar="FILE", help="save the learning curve as a picture")
    parser.add_argument("--save", metavar="FILE", help="save the policy: FILE.npz, or FILE.json")
    parser.add_argument("--quiet", action="store_true", help="print only how it ended")
    parser.set_defaults(command=learn)


def _add_play(commands: "argparse._SubParsersAction[Parser]") -> None:
    parser = _command(
        commands,
        "play",
        "let a saved policy balance, and show each trial as it ends",
        """\
examples:
  upright play policy.npz                           ten trials, without pictures
  upright play policy.npz --noise gaussian-0.2 --start wide --window
  upright play policy.npz --condition delay-1 --video fall.mp4
  upright play policy.npz --episodes 100 --steps 600000
  upright play policy.json                          what export wrote, or another language
  upright play policy.npz --plant mujoco            in another body
The policy plays what it learned on, but for the options given, and on the equations unless another
plant is named. It learns no more.
With pictures there is one trial of 1,000 steps, 20 s, unless said otherwise. The pale pole and the
lower mark are what the agent measured. Esc, q or closing the window ends the playing.
exit status: 0 if no trial ended by a fall, 1 if one did, 2 if something asked for is not possible.
""",
    )
    parser.add_argument(
        "policy", metavar="POLICY", help="a policy saved by learn --save, or exported as .json"
    )
    for part in ("noise", "start", "condition"):
        parser.add_argument(f"--{part}", metavar="NAME", help=f"another {part}")
    parser.add_argument(
        "--episodes", type=int, metavar="N", help="trials to play (default 10, with pictures 1)"
    )
    parser.add_argument(
        "--steps",
        type=int,
        metavar="N",
        help=f"a trial lasts so many steps at most (default {STEPS:,}, with pictures 1,000)",
    )
    _add_shared(parser, "--seed", *PLANT)
    parser.add_argument("--video", metavar="FILE", help="write what happens there, .mp4 or .gif")
    parser.add_argument("--window", action="store_true", help="show what happens, as it happens")
    _add_shared(parser, "--agent")
    parser.set_defaults(command=play)


def _add_table(commands: "argparse._SubParsersAction[Parser]") -> None:
    parser = _command(
        commands,
        "table",
        "measure agents over many runs, beside published figures",
        f"""\
examples:
  upright table --agents reinforce,q-learning,random-search --noises all --runs 100
  upright table --agents reinforce --noises none,gaussian-0.2 --settings as-published
  upright table --runs 100 --steps 600000 --store runs.sqlite   (stopped? the same goes on)
  upright table --agents my_module:MyAgent,random-search --noises none --runs 20
  upright table --plant mujoco --agents reinforce,random-search --runs 20
  upright table --format json --output table.json
{TASK_HELP}""",
    )
    _add_shared(parser, "--agents", "--noises", "--runs", *TASK, *PLANT)
    _add_shared(parser, "--store", "--format", "--output")
    parser.set_defaults(command=table, language="Python")


def _add_reproduce(commands: "argparse._SubParsersAction[Parser]") -> None:
    parser = _command(
        commands,
        "reproduce",
        "make the published tables again, with pictures",
        """\
examples:
  upright reproduce                      20 runs a case, as the report, into results/
  upright reproduce --runs 100           the stricter form; keeps the runs already made
  upright reproduce --output /tmp/again
Stopped, the same command goes on where it was.
""",
    )
    _add_shared(parser, "--runs", "--seed", "--steps")
    parser.add_argument(
        "--output",
        default="results",
        metavar="FOLDER",
        help="where everything is written (default results)",
    )
    parser.set_defaults(command=reproduce)


def _add_leaderboard(commands: "argparse._SubParsersAction[Parser]") -> None:
    parser = _command(
        commands,
        "leaderboard",
        "rank all agents on the published cases, from both starts",
        """\
examples:
  upright leaderboard                    100 runs a case, N = 600,000, into docs/leaderboard.md
  upright leaderboard --agents adaptive-lqr,my_module:MyAgent,random-search --runs 20
Stopped, the same command goes on where it was.
""",
    )
    _add_board_options(parser, "leaderboard", STRICT_STEPS)


def _add_robust(commands: "argparse._SubParsersAction[Parser]") -> None:
    parser = _command(
        commands,
        "robust",
        "rank all agents on tasks beyond the published ones",
        """\
The plant varies from run to run, pushes are delayed, velocities are not measured, the pole leans at
the start, friction is a hundredfold: what breaks which agent?

examples:
  upright robust                         100 runs a task, N = 60,000, into docs/robust.md
  upright robust --agents adaptive-lqr,my_module:MyAgent,random-search --runs 20
Stopped, the same command goes on where it was.
""",
    )
    _add_board_options(parser, "robust", STEPS)


def _add_board_options(parser: Parser, name: str, steps: int) -> None:
    _add_shared(parser, "--agents")
    parser.add_argument("--runs", **_whole(STRICT_RUNS, "independent runs of each case"))
    parser.add_argument("--steps", **_whole(steps, "a trial of this many steps of 0.02 s succeeds"))
    _add_shared(parser, "--seed")
    parser.add_argument(
        "--output",
        default=f"docs/{name}.md",
        metavar="FILE",
        help="the board, in Markdown; its figures go beside it as JSON (default %(default)s)",
    )
    parser.add_argument(
        "--store",
        default=f"results/{name}.sqlite",
        metavar="FILE",
        help="where finished runs are kept (default %(default)s)",
    )
    parser.set_defaults(command=board, board=name)


def _add_show(commands: "argparse._SubParsersAction[Parser]") -> None:
    parser = _command(
        commands,
        "show",
        "show the table of what a store holds, or the contract of a saved policy",
        """\
examples:
  upright show runs.sqlite
  upright show results/runs.sqlite --format markdown --output table.md
  upright show policy.npz                what it takes, what it gives, what it learned on
""",
    )
    parser.add_argument(
        "source", metavar="FILE", help="a store, or a policy saved by learn --save; no code is run"
    )
    _add_shared(parser, "--format", "--output")
    parser.set_defaults(command=show)


def _add_plot(commands: "argparse._SubParsersAction[Parser]") -> None:
    parser = _command(
        commands,
        "plot",
        "draw what a store or a saved policy holds",
        """\
examples:
  upright plot curves results/runs.sqlite --output curves.png
  upright plot trials results/runs.sqlite --output trials.pdf
  upright plot policy results/reinforce.npz --output policy.png
  upright plot phases results/reinforce.npz --output phases.png
""",
    )
    parser.add_argument(
        "what",
        choices=("curves", "trials", "policy", "phases"),
        help="learning curves (noise-free) or distributions of trials, of a store; "
        "map of pushes or phase portraits, of a policy",
    )
    parser.add_argument("source", metavar="FILE", help="a store, or a policy saved by learn --save")
    parser.add_argument(
        "--output",
        metavar="PICTURE",
        help="png, pdf or svg (default: named after what is drawn, in this folder)",
    )
    _add_shared(parser, "--agent")
    parser.set_defaults(command=plot)


def _add_export(commands: "argparse._SubParsersAction[Parser]") -> None:
    parser = _command(
        commands,
        "export",
        "write a saved policy as C99, ONNX or JSON",
        """\
examples:
  upright learn reinforce --save policy.npz
  upright export policy.npz policy.h     C99: one function, no allocation, float64 or float32
  upright export policy.npz policy.onnx  ONNX (pip install onnx)
  upright export policy.npz policy.json  JSON: the numbers; play reads it, and MATLAB and Octave
  cc -std=c99 main.c -lm                 where main.c has: #include "policy.h"
C and ONNX return the probability of a push to the right; docs/policies.md tells names and types,
and the format of the JSON.
""",
    )
    parser.add_argument("policy", metavar="POLICY", help="a file saved by learn --save")
    parser.add_argument("output", metavar="OUTPUT", help="a file that ends in .h, .onnx or .json")
    _add_shared(parser, "--agent")
    parser.set_defaults(command=export)


def _add_agents(commands: "argparse._SubParsersAction[Parser]") -> None:
    parser = _command(
        commands,
        "agents",
        "tell which agents there are, and their settings",
        """\
examples:
  upright agents
  upright agents q-learning
""",
    )
    parser.add_argument("agent", nargs="?", metavar="AGENT", help="tell of this one's settings")
    parser.set_defaults(command=agents)


def _add_plants(commands: "argparse._SubParsersAction[Parser]") -> None:
    parser = _command(
        commands,
        "plants",
        "tell which plants there are, the bodies that agents balance, and their settings",
        """\
examples:
  upright plants
  upright plants mujoco
""",
    )
    parser.add_argument("plant", nargs="?", metavar="PLANT", help="tell of this one's settings")
    parser.set_defaults(command=plants)


def _add_tune(commands: "argparse._SubParsersAction[Parser]") -> None:
    parser = _command(
        commands,
        "tune",
        "search for better settings of an agent",
        f"""\
examples:
  upright tune q-learning
  upright tune q-learning --search learning_rate --search discount=0.9:0.999 --candidates 50
  upright tune ase-ace --settings as-published --set mirrored=True --noises all --runs 20
  upright tune reinforce --candidates 300             (after the first: 200 more)
What counts is the mean number of trials over all runs; a failed run counts as --trials. The first
candidate is the settings it begins with; hopeless ones are given up early. The best is measured
again on fresh runs. No run has a seed below a million: those are for tables. Stopped, the same
command goes on where it was.
{TASK_HELP}It needs Optuna: pip install optuna
""",
    )
    parser.add_argument("agent", metavar="AGENT", help="whose settings")
    parser.add_argument(
        "--noises",
        default="none,actuator-10,gaussian-0.2",
        metavar="LIST",
        help="noise cases, with commas between (default none,actuator-10,gaussian-0.2)",
    )
    _add_shared(parser, *TASK)
    parser.add_argument(
        "--search",
        action="append",
        default=[],
        metavar="NAME[=LOW:HIGH]",
        help="search this setting, in this range; may be repeated (default: all that have a range)",
    )
    _add_shared(parser, "--set")
    parser.add_argument("--runs", **_whole(RUNS, "runs of a candidate on each noise case"))
    parser.add_argument("--candidates", **_whole(100, "settings to try in all"))
    parser.add_argument(
        "--validation-runs", **_whole(100, "fresh runs of the best on each noise case")
    )
    parser.add_argument(
        "--store",
        metavar="FILE",
        help="where candidates are kept (default tune-AGENT.sqlite in this folder)",
    )
    parser.set_defaults(command=tune, plant="equations", plant_changes=[])


def _add_matlab(commands: "argparse._SubParsersAction[Parser]") -> None:
    parser = _command(
        commands,
        "matlab",
        "the MATLAB twin: Q-learning and REINFORCE in MATLAB code, run by GNU Octave or MATLAB",
        """\
examples:
  upright matlab table --runs 100        the seven noise cases, learned in MATLAB code
  upright matlab path                    the folder to add to MATLAB's or Octave's path
docs/matlab_twin.md tells more.
""",
    )
    parts = parser.add_subparsers(metavar="COMMAND", required=True)
    parser = _command(
        parts,
        "table",
        "measure the twin's agents over many runs, beside published figures",
        f"""\
examples:
  upright matlab table --agents q-learning,random-search --noises none --runs 20
  upright matlab table --runs 100 --store runs.sqlite   (stopped? the same goes on)
  upright show runs.sqlite                              with what Python learned
agents: {", ".join(MATLAB_AGENTS)}. Run K draws what MATLAB's rand gives after
  rng(10^6 seed + K); so does `upright learn --twister --run K-1`, and has the same trials.
What runs it is MATLAB where that is on the path, else Octave; the variable UPRIGHT_MATLAB names
another program. Q-learning is some hundred times as fast once upright.build_mex() was called.
""",
    )
    agents = SHARED["--agents"] | {"default": ",".join(MATLAB_AGENTS)}
    parser.add_argument("--agents", **agents)
    _add_shared(parser, "--noises", "--runs", "--steps", "--trials", "--start", "--seed")
    _add_shared(parser, "--settings", "--store", "--format", "--output")
    parser.set_defaults(command=table, language="MATLAB")
    parser.set_defaults(condition="nominal", plant="equations")
    parser.set_defaults(plant_changes=[])
    parser = _command(
        parts,
        "path",
        "print the folder of the MATLAB code",
        """\
examples:
  upright matlab path
Then, in MATLAB or Octave:
  addpath FOLDER
  help upright.Contents
""",
    )
    parser.set_defaults(command=matlab_path)


def _add_ros2(commands: "argparse._SubParsersAction[Parser]") -> None:
    from upright.nodes.settings import LearnerSettings, SimulatorSettings

    parser = _command(
        commands,
        "ros2",
        "a simulated cart on ROS 2's topics, and a learner for any cart that has them",
        """\
examples:
  upright ros2 demo                      both sides at once: watch it learn
  upright ros2 simulate                  a cart-pole that waits for commands
  upright ros2 learn reinforce           in another terminal: who learns to balance it
""",
    )
    parts = parser.add_subparsers(metavar="COMMAND", required=True)
    parser = _command(
        parts,
        "simulate",
        "simulate a cart-pole until interrupted",
        """\
examples:
  upright ros2 simulate --plant mujoco --noise gaussian-0.1
  upright ros2 simulate --no-lock-step   by the wall clock, as a real cart
ROS arguments may follow --ros-args, such as --ros-args -r effort:=/cart/effort.
""",
    )
    _add_fields(parser, SimulatorSettings)
    _add_ros_arguments(parser)
    parser.set_defaults(command=ros2_simulate)
    parser = _command(
        parts,
        "learn",
        "let an agent learn, or a policy play, on a cart",
        """\
examples:
  upright ros2 learn reinforce --save policy.npz
  upright ros2 learn --policy policy.npz --steps 3000
ROS arguments may follow --ros-args.
exit status: 0 if it balanced, 1 if not, 2 if something is not possible or the cart is gone, 130 if
it was stopped.
""",
    )
    parser.add_argument("agent", nargs="?", metavar="AGENT", help="who learns (reinforce)")
    _add_fields(parser, LearnerSettings, without=("agent",))
    _add_ros_arguments(parser)
    parser.set_defaults(command=ros2_learn)
    parser = _command(
        parts,
        "demo",
        "start both, and show the trials",
        """\
examples:
  upright ros2 demo
  upright ros2 demo adaptive-lqr --plant mujoco --noise gaussian-0.1 --seed 3
  upright ros2 demo --policy policy.npz --no-lock-step --steps 500   ten seconds by the wall clock
Both have a ROS domain of their own, unless ROS_DOMAIN_ID names one. The seed is for both.
exit status: 0 if it balanced, 1 if not, 2 if something is not possible, 130 if it was stopped.
""",
    )
    parser.add_argument("agent", nargs="?", metavar="AGENT", help="who learns (reinforce)")
    _add_fields(parser, LearnerSettings, without=("agent",))
    _add_fields(parser, SimulatorSettings, without=("seed",))
    parser.set_defaults(command=ros2_demo)


def _add_gazebo(commands: "argparse._SubParsersAction[Parser]") -> None:
    parser = _command(
        commands,
        "gazebo",
        "the robot simulator Gazebo 11: bring it, and see whether it runs",
        """\
examples:
  upright gazebo install                 bring Gazebo 11 and build the plugin that steps it
  upright gazebo doctor                  what is there, and what is missing
  upright learn reinforce --plant gazebo
  upright gazebo view policy.npz         its own window
""",
    )
    parts = parser.add_subparsers(metavar="COMMAND", required=True)
    parser = _command(
        parts,
        "install",
        "bring Gazebo 11, without root, and build the plugin that steps it",
        """\
A Gazebo 11 that is on the path is used. Else Debian's packages are unpacked into a folder of your
own (the variable UPRIGHT_GAZEBO names another); nothing on the machine changes. Interrupted, it
goes on where it stopped. It needs cmake, g++, apt-get and dpkg-deb.
examples:
  upright gazebo install
  upright gazebo install --mirror https://mirror.example/debian
  upright gazebo install --remove
""",
    )
    parser.add_argument(
        "--mirror", metavar="URL", help="a mirror of Debian's archive (default: the machine's)"
    )
    parser.add_argument(
        "--remove", action="store_true", help="remove what was brought and built instead"
    )
    parser.set_defaults(command=gazebo_install)
    parser = _command(
        parts,
        "doctor",
        "tell what is there of Gazebo and what it needs, and how to get the rest",
        """\
examples:
  upright gazebo doctor
exit status: 0 if Gazebo and its plugin are there and it runs, 1 if not.
""",
    )
    parser.set_defaults(command=gazebo_doctor)
    parser = _command(
        parts,
        "view",
        "let a saved policy balance in Gazebo's window, in real time",
        """\
examples:
  upright gazebo view policy.npz
  upright gazebo view policy.npz --noise gaussian-0.2 --steps 500
  upright gazebo view policy.npz --screenshot gazebo.png   without a display; it needs Xvfb
exit status: 0 if the pole stayed up, 1 if it fell, 2 if something asked for is not possible.
""",
    )
    parser.add_argument("policy", metavar="POLICY", help="a policy saved by learn --save")
    parser.add_argument("--noise", metavar="NAME", help="another noise")
    parser.add_argument("--steps", **_whole(3_000, "the trial lasts so many steps at most"))
    _add_shared(parser, "--seed", "--agent")
    parser.add_argument("--screenshot", metavar="FILE", help="write a picture of the window there")
    parser.set_defaults(command=gazebo_view)


def _add_fields(parser: Parser, kind: Any, without: Sequence[str] = ()) -> None:
    """Add an option for each setting; those not given are absent from what is parsed."""
    from upright.support.settings import describe_settings

    for name, text in describe_settings(kind).items():
        default = getattr(kind, name)
        if name in without or isinstance(default, tuple):
            continue
        flag = f"--{name.replace('_', '-')}"
        described = text if default == "" else f"{text} (default {default})"
        form: dict[str, Any] = {"type": type(default), "metavar": "VALUE"}
        if isinstance(default, bool):
            form = {"action": argparse.BooleanOptionalAction}
        parser.add_argument(flag, default=argparse.SUPPRESS, help=described, **form)


def _add_ros_arguments(parser: Parser) -> None:
    parser.add_argument("--ros-args", nargs=argparse.REMAINDER, default=[], help="passed to ROS 2")


def _given(options: argparse.Namespace, kind: Any) -> dict[str, Any]:
    """Return the settings of one kind that were given."""
    names = vars(options).keys() & kind.__dataclass_fields__.keys()
    return {name: value for name in names if (value := getattr(options, name)) is not None}


def ros2_simulate(options: argparse.Namespace) -> int:
    """Carry out `upright ros2 simulate`."""
    from upright.plants.ros2.plant import require_rclpy

    require_rclpy()
    from upright.nodes import settings, simulator

    given = _given(options, settings.SimulatorSettings)
    return simulator.main(given, ["--ros-args", *options.ros_args])


def ros2_learn(options: argparse.Namespace) -> int:
    """Carry out `upright ros2 learn`."""
    from upright.plants.ros2.plant import require_rclpy

    require_rclpy()
    from upright.nodes import learner, settings

    given = _given(options, settings.LearnerSettings)
    return learner.main(given, ["--ros-args", *options.ros_args])


def ros2_demo(options: argparse.Namespace) -> int:
    """Carry out `upright ros2 demo`."""
    from upright.plants.ros2.plant import require_rclpy

    require_rclpy()
    from upright.nodes import demo, settings

    simulated = _given(options, settings.SimulatorSettings)
    return demo.main(simulated, _given(options, settings.LearnerSettings))


def gazebo_install(options: argparse.Namespace) -> int:
    """Carry out `upright gazebo install`."""
    from upright.plants.gazebo.installer import install, remove, size

    if options.remove:
        print(f"freed: {size(remove())}")
        return 0
    found = install(options.mirror)
    print(f"Gazebo {found.version}: {found.server}")
    print(f"plugin: {found.plugin}")
    return 0


def gazebo_doctor(_options: argparse.Namespace) -> int:
    """Carry out `upright gazebo doctor`."""
    from upright.plants.gazebo.doctor import examine

    things = examine()
    for thing in things:
        print(thing)
    return 0 if all(thing.found for thing in things if thing.needed) else FAILED


def gazebo_view(options: argparse.Namespace) -> int:
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
    policy = load_policy(options.policy, options.agent)
    changes = {"steps": options.steps}
    changes |= {"noise": options.noise} if options.noise else {}
    case = case_for(policy, plant=Gazebo(gui=True, real_time_factor=1.0), **changes)
    if options.screenshot:

        def play_there(stop: np.ndarray) -> None:
            plant, _ = make_plant(case, options.seed, 0, stop)
            play_run(policy, case, options.seed, plant, np.zeros(case.spec.trials, np.int64), stop)

        photograph(play_there, check_output(options.screenshot))
        print(f"picture: {options.screenshot}")
        return 0
    played = watch_play(policy, case, 1, options.seed)
    return 0 if all(trial.balanced for trial in played) else FAILED


def learn(options: argparse.Namespace) -> int:
    """Carry out `upright learn`."""
    from upright.errors import require
    from upright.studies.study import check_study
    from upright.studies.watching import watch_run

    case = _changed_case(options)
    require("run", options.run, 0, 999_999)
    check_study(options.run + 1, options.seed)
    if options.plot:
        from upright.reports.plots import check_picture, plot_curve, save

        check_picture(options.plot)
    if options.save:
        from upright.studies.learned import check_learned

        check_learned(options.save, case)
    memory, result = watch_run(
        case, options.seed, options.run, quiet=options.quiet, twister=options.twister
    )
    if options.plot:
        title = f"{case.agent}, {case.spec.noise}, seed {options.seed}, run {options.run}"
        save(plot_curve(result.lengths, case.spec.steps, title), options.plot)
        print(f"learning curve: {options.plot}")
    if options.save:
        from upright.studies.learned import save_learned

        save_learned(options.save, case, options.seed, options.run, memory)
        print(f"policy: {options.save}")
    return 0 if result.success else FAILED


def play(options: argparse.Namespace) -> int:
    """Carry out `upright play`."""
    from upright.errors import require
    from upright.pictures.video import check_video
    from upright.policies.files import load_policy
    from upright.studies.playing import case_for
    from upright.studies.study import check_study
    from upright.studies.watching import watch_play

    drawn = options.window or options.video is not None
    episodes, steps = (1, 1_000) if drawn else (10, STEPS)
    episodes = episodes if options.episodes is None else options.episodes
    names = ("noise", "start", "condition", "steps")
    given = {name: getattr(options, name) for name in names}
    changes = {name: value for name, value in given.items() if value is not None}
    policy = load_policy(options.policy, options.agent)
    if options.plant != "equations" or options.plant_changes:
        changes["plant"] = _plant(options)
    case = case_for(policy, **{"steps": steps} | changes)
    require("episodes", episodes, 1, 10**6, whole=True)
    check_study(episodes, options.seed)
    if options.video is not None:
        check_video(options.video)
    played = watch_play(policy, case, episodes, options.seed, options.video, window=options.window)
    return 0 if all(trial.balanced for trial in played) else FAILED


def _changed_case(options: argparse.Namespace, noise: str | None = None) -> "Case":
    from dataclasses import replace

    from upright.studies.case import make_case
    from upright.support.settings import change_settings, pairs

    noise = noise or options.noise
    case = make_case(options.agent, options.settings, noise=noise, **_task(options))
    changes = dict(pairs("--set", options.changes))
    return replace(case, settings=change_settings(case.settings, changes)) if changes else case


def _plant(options: argparse.Namespace) -> "PlantSettings":
    from upright.plants import PLANTS
    from upright.support.settings import change_settings, pairs

    changes = dict(pairs("--plant-set", options.plant_changes))
    return change_settings(PLANTS.default(options.plant), changes)


def _task(options: argparse.Namespace) -> dict[str, Any]:
    names = ("start", "steps", "trials", "condition")
    return {"plant": _plant(options), **{name: getattr(options, name) for name in names}}


def table(options: argparse.Namespace) -> int:
    """Carry out `upright table` and `upright matlab table`."""
    from upright.errors import require_one_of
    from upright.reports.statistics import summarise_all
    from upright.reports.tables import FORMATS, render
    from upright.studies import matlab_twin
    from upright.studies.case import make_case
    from upright.studies.progress import study_with_progress
    from upright.studies.store import Store
    from upright.studies.study import check_study
    from upright.support.files import check_output

    require_one_of("format", options.format, FORMATS)
    check_study(options.runs, options.seed)
    noises = PUBLISHED_NOISES if options.noises == "all" else _split(options.noises)
    cases = [
        make_case(agent, options.settings, noise=noise, language=options.language, **_task(options))
        for agent in _split(options.agents)
        for noise in noises
    ]
    if options.output:
        check_output(options.output)
    if options.language == "MATLAB":
        matlab_twin.check_seed(options.seed)
        matlab_twin.find_program()
    with Store(options.store) as store, _telling_what_is_kept(options.store):
        study_with_progress(cases, options.runs, options.seed, store)
        rows = summarise_all(cases, options.runs, options.seed, store)
    _put(render(rows, options.format), options)
    return 0


@contextmanager
def _telling_what_is_kept(place: str | None, what: str = "finished runs") -> Iterator[None]:
    """Say, when interrupted, where the finished runs are."""
    try:
        yield
    except KeyboardInterrupt:
        kept = f"{what} are kept in {place}; the same command goes on from there"
        lost = "nothing was kept; with --store FILE finished runs would be"
        print(f"upright: {kept if place else lost}", file=sys.stderr)
        raise


def _split(names: str) -> list[str]:
    return list(dict.fromkeys(name.strip() for name in names.split(",")))


def _put(text: str, options: argparse.Namespace) -> None:
    from upright.support.files import write_file

    if options.output:
        write_file(options.output, text)
    else:
        print(text, end="")


def matlab_path(_options: argparse.Namespace) -> int:
    """Carry out `upright matlab path`."""
    from upright.studies.matlab_twin import folder

    print(folder())
    return 0


def reproduce(options: argparse.Namespace) -> int:
    """Carry out `upright reproduce`."""
    from upright.reports.reproduction import reproduce

    with _telling_what_is_kept(options.output):
        report = reproduce(options.output, options.runs, options.seed, options.steps)
    print(f"report: {report}")
    return 0


def board(options: argparse.Namespace) -> int:
    """Carry out `upright leaderboard` and `upright robust`."""
    from upright.reports import leaderboards

    agents = _split(options.agents)
    study = leaderboards.BoardPlan(agents, options.runs, options.seed, options.steps, options.store)
    with _telling_what_is_kept(options.store):
        getattr(leaderboards, options.board)(options.output, study)
    print(f"board: {options.output}")
    return 0


def show(options: argparse.Namespace) -> int:
    """Carry out `upright show`."""
    from upright.errors import require_one_of
    from upright.policies.files import is_policy, read_header
    from upright.policies.policy import describe
    from upright.reports.statistics import summarise
    from upright.reports.tables import FORMATS, render
    from upright.studies.study import stored

    if is_policy(options.source):
        require_one_of("format of a policy", options.format, ("text",))
        _put(describe(read_header(options.source)) + "\n", options)
        return 0
    require_one_of("format", options.format, FORMATS)
    rows = [summarise(case, seed, results) for case, seed, results in stored(options.source)]
    if not rows:
        raise UprightError(f"store is {options.source!r}; it holds no runs")
    _put(render(rows, options.format), options)
    return 0


def plot(options: argparse.Namespace) -> int:
    """Carry out `upright plot`."""
    from upright.policies.files import load_policy
    from upright.reports import plots
    from upright.studies.study import stored

    output = plots.check_picture(options.output or f"{options.what}.png")
    if options.what == "policy":
        figure = plots.plot_policies([load_policy(options.source, options.agent)])
    elif options.what == "phases":
        figure = plots.plot_phases(load_policy(options.source, options.agent))
    else:
        curves = options.what == "curves"
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


def export(options: argparse.Namespace) -> int:
    """Carry out `upright export`."""
    from upright.policies.files import check_export, export_policy, load_policy

    check_export(options.output)
    export_policy(options.output, load_policy(options.policy, options.agent))
    print(f"exported: {options.output}")
    return 0


def agents(options: argparse.Namespace) -> int:
    """Carry out `upright agents`."""
    for agent in [options.agent] if options.agent else AGENTS:
        named = AGENTS.settings(agent)
        print(f"{agent}: {AGENTS.summary(agent)}")
        if options.agent:
            _print_settings(named)
    return 0


def plants(options: argparse.Namespace) -> int:
    """Carry out `upright plants`."""
    from upright.plants import PLANTS

    for plant in [options.plant] if options.plant else PLANTS:
        default = PLANTS.default(plant)
        print(f"{plant}: {PLANTS.summary(plant)}")
        if options.plant:
            _print_settings({"default": default})
    return 0


def _print_settings(named: dict[str, Any]) -> None:
    from upright.support.settings import describe_settings

    for setting, text in describe_settings(named["default"]).items():
        values = ", ".join(f"{label} {getattr(s, setting)!r}" for label, s in named.items())
        print(f"  {setting}: {text}\n      {values}")


def tune(options: argparse.Namespace) -> int:
    """Carry out `upright tune`."""
    from upright.studies.progress import search_with_progress, study_with_progress
    from upright.studies.search_space import search_space
    from upright.studies.study import check_study
    from upright.studies.tuning import Search, describe, place_for, require_optuna, validate
    from upright.support.settings import pairs

    require_optuna()
    noises = PUBLISHED_NOISES if options.noises == "all" else _split(options.noises)
    cases = tuple(_changed_case(options, noise) for noise in noises)
    fixed = [name for name, _ in pairs("--set", options.changes)]
    space = search_space(cases[0].settings, options.search, fixed)
    wanted = Search(cases, tuple(space), options.runs, options.seed)
    check_study(options.validation_runs, options.seed)
    store = options.store or place_for(options.agent)
    with _telling_what_is_kept(store, "finished candidates"):
        found = search_with_progress(wanted, options.candidates, store)
        worths = validate(wanted, found.settings, options.validation_runs, study_with_progress)
    print(describe(wanted, found, worths, options.settings))
    return 0
