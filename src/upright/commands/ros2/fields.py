"""Options of the ROS 2 commands: one for each setting of a node."""

import argparse
from collections.abc import Sequence
from typing import Any

from upright.agents import LABELS
from upright.commands.options import TASK, add
from upright.commands.parser import READ, WRITTEN, Parser, as_number, as_whole
from upright.core.conditions import STARTS
from upright.errors import UprightError
from upright.nodes.settings import SIMULATED
from upright.plants.ros2.settings import STARTERS, VELOCITIES
from upright.support.settings import describe_settings

NAMES: dict[str, Any] = {
    "plant": SIMULATED,
    "start": STARTS,
    "settings": LABELS,
    "velocities": VELOCITIES,
    "start_by": STARTERS,
}
"""What is allowed where a setting is one of several names."""
REPEATED = {
    "plant_set": (
        "--plant-set",
        "change one of the plant's settings (see upright plants); may be repeated",
    ),
    "parameters": (
        "--parameter",
        "change a parameter of the plant (see upright plants); may be repeated",
    ),
    "task_parameters": (
        "--parameter",
        "change a parameter of the task: force [N], time_step [s], position_limit [m] or "
        "angle_limit [rad]; may be repeated",
    ),
}
"""Settings that list several values with commas between: the option that gives one, and its help.
"""
READERS = {int: as_whole, float: as_number}
"""What reads a setting of another kind than text."""
FLAGS = {"from_policy": "--from"}
"""Options that are not named after their setting."""
FILES = {"policy": READ, "from_policy": READ, "save": WRITTEN}
"""Settings that name a file, and what is done with it."""


def add_learning_agent(parser: Parser) -> None:
    """Add the argument that names the agent of a learner."""
    text = "agent to train (default: reinforce; with --from that of the policy)"
    add(parser, "agent", nargs="?", help=text)


def add_fields(
    parser: "Parser | argparse._ArgumentGroup", kind: Any, without: Sequence[str] = ()
) -> None:
    """Add an option for each setting; those not given are absent from what is parsed."""
    for name, text in describe_settings(kind).items():
        default = getattr(kind, name)
        if name in without or isinstance(default, tuple):
            continue
        flag = FLAGS.get(name, f"--{name.replace('_', '-')}")
        described = text.rstrip(".")
        form: dict[str, Any] = {"type": READERS.get(type(default)), "metavar": "VALUE"}
        if name in REPEATED:
            flag, described = REPEATED[name]
            form |= {"action": "append", "metavar": "NAME=VALUE"}
            del form["type"]
        elif name in NAMES:
            form |= {"choices": NAMES[name], "metavar": "NAME"}
            # The names that a text lists are these.
            described = f"{text.partition(':')[0].rstrip('.')}: %(choices)s"
        elif name == "noise":
            form["metavar"] = TASK["--noise"]["metavar"]
            described = TASK["--noise"]["help"].removesuffix(" (default: %(default)s)")
        elif name in FILES:
            form |= {"metavar": "FILE", "file": FILES[name]}
        elif isinstance(default, bool):
            form = {"action": argparse.BooleanOptionalAction}
        if default != "":
            described += f" (default: {default})"
        parser.add_argument(flag, dest=name, default=argparse.SUPPRESS, help=described, **form)


def given(options: argparse.Namespace, kind: Any) -> dict[str, Any]:
    """Return the settings of one kind that were given.

    Raises
    ------
    UprightError
        If a value is not allowed; ROS 2 has no parameters for some, such as a seed of 65 bits.
    """
    names = vars(options).keys() & kind.__dataclass_fields__.keys()
    values = {name: value for name in names if (value := getattr(options, name)) is not None}
    for name in REPEATED.keys() & values.keys():
        flag, _ = REPEATED[name]
        for text in values[name]:
            if "," in text:
                raise UprightError(f"{flag} is {text!r}; give {flag} again for each NAME=VALUE")
    values = {name: ",".join(v) if name in REPEATED else v for name, v in values.items()}
    kind(**values)
    return values


def add_ros_arguments(parser: Parser) -> None:
    """Add the option after which everything is passed to ROS 2, as `ros_arguments` returns it."""
    parser.add_argument(
        "--ros-args",
        nargs=argparse.REMAINDER,
        default=[],
        help="pass everything that follows to ROS 2",
    )


def ros_arguments(options: argparse.Namespace) -> list[str]:
    """Return what is passed to ROS 2."""
    return ["--ros-args", *options.ros_args]
