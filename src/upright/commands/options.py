"""Options that several commands share, and what they ask for.

Allowed names come from where the things themselves stand; help, errors and completion follow.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from upright.agents import AGENTS, LABELS
from upright.commands.parser import MODEL, READ, WRITTEN, Parser, as_whole
from upright.commands.showing import tell_file
from upright.core.conditions import (
    CONDITIONS,
    NOISES,
    PUBLISHED_NOISES,
    RUNS,
    STARTS,
    STEPS,
    TRIALS,
)
from upright.core.parameters import Parameters, parse_parameters
from upright.errors import UprightError, did_you_mean, said
from upright.plants import PLANTS
from upright.reports.sweeps import heading
from upright.reports.tables import FORMATS
from upright.studies.executors import ADDRESS, EXECUTORS
from upright.support.settings import as_options

if TYPE_CHECKING:
    from upright.pictures.size import Size
    from upright.plants.settings import PlantSettings
    from upright.studies.belonging import Belonging
    from upright.studies.case import Case
    from upright.studies.settings_file import SettingsFile

AS_TRAINED = "as the policy was trained"
"""The default of a task's options where a policy is played."""
LIKELIER = "the more probable push (to the left where both are equally probable), without drawing"
"""What a greedy policy does."""
CUSTOM_AGENTS = """\
Custom agents: module:name, a class or function which, given a run's random numbers, returns an
agent with the methods begin_trial, act, learn and end_trial, or train(env) (see examples/).
"""
"""How a custom agent is named, for the end of a command's help."""
CUSTOM_PLANTS = """\
Custom plants: --plant module:name, a class or function which, given the parameters, returns a plant
with the methods reset and step; or --plant mujoco --plant-set model=FILE, a URDF or MJCF file.
"""
"""How a custom plant is named, for the end of a command's help."""


def _one_of(names: Any, default: str, text: str, metavar: str = "NAME") -> dict[str, Any]:
    return {
        "choices": names,
        "default": default,
        "metavar": metavar,
        "help": f"{text}: %(choices)s (default: %(default)s)",
    }


def whole(default: int, text: str, metavar: str = "N") -> dict[str, Any]:
    """Return what `add_argument` needs for an option that is a whole number."""
    help_text = f"{text} (default: %(default)s)"
    return {"type": as_whole, "default": default, "metavar": metavar, "help": help_text}


UNITS = ", ".join(map(heading, Parameters._fields))
"""The parameters of a plant with their units."""

TASK: dict[str, dict[str, Any]] = {
    "--noise": {
        "default": "none",
        "metavar": "NOISE",
        "help": f"noise case: {', '.join(NOISES)}; or terms with sizes, such as "
        "actuator=0.1,gaussian=0.5 (see upright terms) (default: %(default)s)",
    },
    "--start": _one_of(
        STARTS,
        "random",
        "where trials start, random being within ±0.05 of upright in each measurement and wide "
        "up to 6° in the angle",
    ),
    "--condition": {
        "default": "nominal",
        "metavar": "TERMS",
        "help": f"what else differs from the published task: {', '.join(CONDITIONS)}; or terms, "
        "such as delay=1,encoder=1024 (see upright terms) (default: %(default)s)",
    },
    "--steps": whole(STEPS, "a trial that lasts this many steps of 0.02 s is a success"),
    "--trials": whole(TRIALS, "a run ends after at most this many trials"),
    "--parameter": {
        "action": "append",
        "default": [],
        "metavar": "NAME=VALUE",
        "dest": "parameters",
        "help": f"change a parameter of the plant (see upright plants); may be repeated: {UNITS}",
    },
}
"""The options of a task; each is the part of a task that has its name."""

SHARED: dict[str, dict[str, Any]] = {
    "agent": {
        "metavar": "AGENT",
        "help": f"the agent: {', '.join(AGENTS.built_in)}, or module:name of a custom one",
    },
    "--agents": {
        "default": ",".join(AGENTS.built_in),
        "metavar": "AGENTS",
        "help": "agents, separated by commas (default: %(default)s)",
    },
    "--noises": {
        "default": "all",
        "metavar": "CASES",
        "help": f"noise cases, separated by commas: {', '.join(NOISES)}; or terms, joined by +; or "
        "all, the seven published cases (default: %(default)s)",
    },
    "--settings": _one_of(LABELS, "default", "the agent's named settings, default being tuned"),
    "--set": {
        "action": "append",
        "default": [],
        "metavar": "NAME=VALUE",
        "dest": "changes",
        "help": "change one of the agent's settings (see upright agents); may be repeated",
    },
    "--settings-file": {
        "action": "append",
        "default": [],
        "metavar": "FILE",
        "dest": "settings_files",
        "file": READ,
        "help": "take the agent's settings from this file, which tune --output wrote, instead of "
        "--settings",
    },
    "--plant": {
        "default": "equations",
        "metavar": "PLANT",
        "help": f"the plant to balance (see upright plants): {', '.join(PLANTS.built_in)}, or "
        "module:name of a custom one (default: %(default)s)",
    },
    "--plant-set": {
        "action": "append",
        "default": [],
        "metavar": "NAME=VALUE",
        "dest": "plant_changes",
        "file": MODEL,
        "help": "change one of the plant's settings (see upright plants); may be repeated; with "
        "--plant mujoco, model=FILE is a URDF or MJCF of your own",
    },
    "--seed": whole(0, "random seed; the same seed gives the same result"),
    "--runs": whole(RUNS, "independent runs of each case"),
    "--store": {
        "metavar": "FILE",
        "file": WRITTEN,
        "help": "keep every finished run in this file, and reuse the runs it already holds",
    },
    "--executor": {
        "choices": EXECUTORS,
        "metavar": "WHERE",
        "help": "make the runs in %(choices)s, the last being a cluster (default: threads, or "
        "processes where custom code is plain Python)",
    },
    "--address": {
        "metavar": "ADDRESS",
        "help": "with --executor dask: where the scheduler is, such as tcp://127.0.0.1:8786 "
        f"(default: the variable {ADDRESS}); docs/scale.md describes how to start one",
    },
    "--format": _one_of(FORMATS, "text", "format of the table"),
    "--sources": {
        "action": "store_true",
        "help": "in a table as text: leave nothing out, neither published figures nor where they "
        "are from (default: as many columns as fit the terminal, or 80 characters where there is "
        "none; the variable COLUMNS sets another width)",
    },
    "--task": {
        "metavar": "FILE",
        "file": READ,
        "help": "take the task and the plant from this TOML file; other options override what it "
        "says",
    },
    "--save-task": {
        "metavar": "FILE",
        "file": WRITTEN,
        "help": "write the task and the plant to this file, which ends in .toml, for --task",
    },
    "--output": {
        "metavar": "FILE",
        "file": WRITTEN,
        "help": "write the table to this file, not to the screen",
    },
    "policy": {
        "metavar": "POLICY",
        "file": READ,
        "help": "a policy saved by learn --save, or exported as JSON",
    },
    "--greedy": {"action": "store_true", "help": f"make {LIKELIER}"},
    "--agent": {
        "metavar": "MODULE:NAME",
        "help": "the custom agent that trained the policy; its code is executed",
    },
}
"""Other arguments that several commands have."""


class Named(NamedTuple):
    """An option that gives values to names: --FLAG NAME=VALUE."""

    flag: str
    """The option."""
    dest: str
    """Where its texts are in the options of a command."""


NAMED = {
    "parameter": Named("--parameter", "parameters"),
    "plant": Named("--plant-set", "plant_changes"),
    "agent": Named("--set", "changes"),
}
"""The options that give values to names, by what the names are (`studies.belonging`)."""


PICTURES: dict[str, dict[str, Any]] = {
    "--window": {
        "action": "store_true",
        "help": "show the trials in a window, at first in real time; its keys: + faster, - slower, "
        "space pause, right arrow or n one step while paused, q or Esc close",
    },
    "--video": {
        "metavar": "FILE",
        "file": WRITTEN,
        "help": "write a video to this file, .mp4 or .gif",
    },
    "--size": {
        "metavar": "SIZE",
        "help": "size of the window and the video in pixels: WIDTHxHEIGHT, or a width, such as "
        "1280 (default: 640x352)",
    },
}
"""The options of commands that draw the cart-pole."""


def add(parser: Parser, *names: str, **changes: Any) -> None:
    """Add arguments of TASK, SHARED and PICTURES, changed where this command's differ."""
    for name in names:
        parser.add_argument(name, **(TASK | SHARED | PICTURES)[name] | changes)


def add_task_options(
    parser: Parser,
    names: tuple[str, ...] = tuple(TASK),
    *,
    as_trained: bool = False,
    from_policy: bool = False,
) -> None:
    """Add the options of a task, which `task_of` reads.

    Parameters
    ----------
    parser
        Of the command.
    names
        Which of TASK it has.
    as_trained
        Whether those not given are to be as a policy was trained, and absent from `task_of`.
    from_policy
        Whether that is so where the command is given a policy, and only then.
    """
    for name in names:
        form = dict(TASK[name])
        default = AS_TRAINED if as_trained else str(form["default"])
        if from_policy and name not in ("--steps", "--trials"):
            default += f"; with --from {AS_TRAINED}"
        if as_trained or (from_policy and name != "--parameter"):
            form |= {"default": None, "help": form["help"].replace("%(default)s", default)}
        parser.add_argument(name, **form)


def add_task_file(parser: Parser) -> None:
    """Add the options --task, whose file gives the defaults of others, and --save-task."""
    add(parser, "--task", "--save-task")


def defaults_in_file(path: str) -> dict[str, Any]:
    """Return the defaults of options that a file of a task gives, and all it says as `in_file`.

    Raises
    ------
    UprightError
        If it cannot be read.
    """
    from upright.studies.task_file import read_task

    task = read_task(path)
    defaults = {name: value for name, value in task.items() if name != "parameters"}
    if "plant" in task:
        defaults["plant"] = task["plant"].name
    if "noise" in task:
        defaults["noises"] = [task["noise"]]
    return defaults | {"in_file": task}


def save_task_of(options: argparse.Namespace, cases: "Sequence[Case]") -> None:
    """Write the task that cases share to the file that --save-task names, if it is given.

    Raises
    ------
    UprightError
        If they have several tasks, or the file cannot be written.
    """
    if options.save_task is None:
        return
    from upright.studies.task_file import save_task

    tasks = {(case.spec, case.plant) for case in cases}
    if len(tasks) > 1:
        why = f"a file holds one task, and these options ask for {len(tasks)}"
        raise UprightError(f"--save-task is {options.save_task!r}; {why}")
    save_task(options.save_task, cases[0])
    tell_file("task", options.save_task, sys.stderr)


def task_of(options: argparse.Namespace) -> dict[str, Any]:
    """Return the parts of the task that the options of `add_task_options` ask for, by name."""
    task = _parts_of_task(options)
    texts = vars(options).get("parameters") or []
    _refuse_misplaced("parameter", texts, options)
    changed = in_file(options).get("parameters", {}) | parse_parameters(texts, "--parameter")
    return task | ({"parameters": changed} if changed else {})


def in_file(options: argparse.Namespace) -> dict[str, Any]:
    """Return what the file of --task says, as `read_task` returned it; nothing without a file."""
    task: dict[str, Any] = vars(options).get("in_file", {})
    return task


def tasks_of(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Return the parts of each task where --parameter may ask for several: as `task_of`."""
    from upright.support.settings import combinations, numbers_in, pairs

    _refuse_misplaced("parameter", options.parameters, options)
    values = {
        name: [
            parse_parameters([f"{name}={value}"], "--parameter")[name]
            for value in numbers_in(name, text)
        ]
        for name, text in pairs("--parameter", options.parameters)
    }
    task = _parts_of_task(options)
    usual = in_file(options).get("parameters", {})
    return [task | {"parameters": usual | chosen} for chosen in combinations(values)]


def _parts_of_task(options: argparse.Namespace) -> dict[str, Any]:
    """Return the parts of the task but for its parameters."""
    given = vars(options)
    parts = (name.removeprefix("--") for name in TASK)
    return {part: given[part] for part in parts if given.get(part) is not None}


def add_plant_options(parser: Parser) -> None:
    """Add the options that choose a plant, which `plant_of` reads."""
    add(parser, "--plant", "--plant-set")


def plant_of(options: argparse.Namespace) -> "PlantSettings":
    """Return the plant that is asked for.

    Raises
    ------
    UprightError
        If it has no such setting, or a value is not allowed.
    """
    from upright.support.settings import change_settings, pairs

    _refuse_misplaced("plant", options.plant_changes, options)
    changes = dict(pairs("--plant-set", options.plant_changes))
    if changes and PLANTS.is_path(options.plant):
        raise UprightError(
            f"plant is {options.plant!r}; it has no settings that --plant-set could change"
        )
    plant: PlantSettings | None = in_file(options).get("plant")
    if plant is None or plant.name != options.plant:
        plant = PLANTS.default(options.plant)
    return change_settings(plant, changes)


def plant_asked_for(options: argparse.Namespace) -> "dict[str, PlantSettings]":
    """Return the plant as a part of the case, if an option or the file of --task names one."""
    named = options.plant != "equations" or options.plant_changes or "plant" in in_file(options)
    return {"plant": plant_of(options)} if named else {}


def _refuse_misplaced(
    kind: str, texts: Sequence[str], options: argparse.Namespace, agents: Sequence[str] = ()
) -> None:
    """Raise UprightError if an option is given a name that belongs to another, and name that.

    Parameters
    ----------
    kind
        What the option sets: one of NAMED.
    texts
        What it is given: texts of the form NAME=VALUE, or AGENT.NAME=VALUE.
    options
        All options of the command.
    agents
        Names of the agents.
    """
    from upright.studies.belonging import belongings

    plant = vars(options).get("plant", "equations")
    for text in texts:
        path, _, value = text.partition("=")
        name = path.rpartition(".")[2].strip().replace("-", "_")
        if any(each.kind == kind and each.is_chosen for each in belongings(name, plant, agents)):
            continue
        for belonging in belongings(name, plant, agents or agents_of(options)):
            if advice := _option_for(belonging, name, value, options):
                why = f"{name} is {belonging}: {advice}"
                raise UprightError(f"{NAMED[kind].flag} is {text!r}; {why}")


def _option_for(belonging: "Belonging", name: str, value: str, options: argparse.Namespace) -> str:
    """Return the option to write for a name, or an empty string if the command does not have it."""
    given = vars(options)
    if belonging.kind == "task":
        return f"--{name} {value}" if name in given else ""
    place = NAMED[belonging.kind]
    if place.dest not in given:
        return ""
    owner = f"{belonging.owner}." if belonging.kind == "agent" and "agents" in given else ""
    (setting,) = as_options(place.flag, {owner + name: value})
    is_other = belonging.kind == "plant" and not belonging.is_chosen
    return f"--plant {belonging.owner} {setting}" if is_other else setting


def agents_of(options: argparse.Namespace) -> list[str]:
    """Return the agents that a command is given, by name."""
    given = vars(options)
    if given.get("agent"):
        return [given["agent"]]
    agents = given.get("agents") or ""
    return split(agents) if isinstance(agents, str) else list(agents)


def size_of(options: argparse.Namespace) -> "Size":
    """Return the size of pictures that --size asks for.

    Raises
    ------
    UprightError
        If it is not a size, or nothing is to be drawn.
    """
    from upright.errors import UprightError
    from upright.pictures.size import SIZE, parse_size

    if options.size is None:
        return SIZE
    if not (options.window or options.video):
        raise UprightError(f"size is {options.size!r}; it needs --window or --video")
    return parse_size(options.size)


def add_executor_options(parser: Parser) -> None:
    """Add the options about where to run, which `executor_of` reads."""
    add(parser, "--executor", "--address")


def executor_of(options: argparse.Namespace) -> str | None:
    """Return where to run, as `study` takes it.

    Raises
    ------
    UprightError
        If an address is given without a cluster, or the reverse, or it is not an address.
    """
    if options.executor != "dask":
        if options.address:
            raise UprightError(f"address is {options.address!r}; it needs --executor dask")
        return None if options.executor is None else str(options.executor)
    address = options.address or os.environ.get(ADDRESS)
    if not address:
        raise UprightError("executor is 'dask'; it needs --address tcp://HOST:PORT")
    if "://" not in address:
        raise UprightError(f"address is {address!r}; it must be like tcp://HOST:PORT")
    return str(address)


def add_case_options(parser: Parser) -> None:
    """Add the settings of one agent, which `case_of` reads."""
    add(parser, "--settings", "--settings-file", "--set")


def case_of(options: argparse.Namespace, **parts: Any) -> "Case":
    """Return the case of one agent that is asked for.

    Parameters
    ----------
    options
        Those of a task among them.
    **parts
        Parts of the case that are no options of the task.

    Raises
    ------
    UprightError
        If a name is unknown, a value is not allowed, or several cases are asked for.
    """
    first, *others = cases_of(options, [options.agent], **(task_of(options) | parts))
    if others:
        raise UprightError(
            f"--set and --settings-file ask for {1 + len(others)} cases; this command has one"
        )
    return first


def cases_of(options: argparse.Namespace, agents: Sequence[str], **parts: Any) -> "list[Case]":
    """Return the cases of agents with all the settings that are asked for.

    Parameters
    ----------
    options
        Those of `add_case_options`.
    agents
        Names of the agents.
    **parts
        The other parts of the cases.

    Raises
    ------
    UprightError
        If a name is unknown, or a value is not allowed.
    """
    from dataclasses import replace

    from upright.studies.case import make_case, name_settings, refuse_settings_of_custom
    from upright.studies.settings_file import read_settings
    from upright.support.settings import sweep_settings

    _refuse_misplaced("agent", options.changes, options, agents)
    changes = changes_by_agent(options.changes, agents)
    files = [read_settings(path) for path in options.settings_files]
    _check_files(files, agents)
    cases = []
    for agent in agents:
        if changes[agent]:
            refuse_settings_of_custom(agent)
        own = [file for file in files if file.agent == agent]
        for file in own:
            start = make_case(agent, settings=file.values, **parts)
            for settings in sweep_settings(start.settings, changes[agent]):
                label = name_settings(file.name, start.settings, settings)
                cases.append(replace(start, label=label, settings=settings))
        if not own:
            start = make_case(agent, options.settings, **parts)
            every = sweep_settings(start.settings, changes[agent])
            cases += [replace(start, settings=settings) for settings in every]
    return cases


def _check_files(files: "Sequence[SettingsFile]", agents: Sequence[str]) -> None:
    """Raise UprightError if a file is for no agent, or two could not be told apart."""
    names = [file.name for file in files]
    for file in files:
        if file.agent not in agents:
            why = f"it is for {file.agent}, which is not among the agents: {', '.join(agents)}"
            raise UprightError(f"settings file is {file.name!r}; {why}")
        if names.count(file.name) > 1:
            raise UprightError(f"settings file is {file.name!r}; there are two of this name")


def changes_by_agent(texts: Sequence[str], agents: Sequence[str]) -> dict[str, dict[str, str]]:
    """Return the changes of settings that --set asks for: for each agent, the values by name.

    Raises
    ------
    UprightError
        If a text is not of the form AGENT.NAME=VALUE with one of these agents. Where there is one
        agent alone, its name may be left out.
    """
    from upright.support.settings import pairs

    found: dict[str, list[str]] = {agent: [] for agent in agents}
    for text in texts:
        owner, dot, _ = text.partition("=")[0].rpartition(".")
        if not dot and len(agents) > 1:
            why = f"it must name one of the agents: AGENT.{said(text)[1:-1]}"
            raise UprightError(f"--set is {said(text)}; {why}")
        agent = owner.strip() if dot else agents[0]
        if agent not in found:
            hint = did_you_mean(agent, agents)
            why = f"{agent!r} is not among the agents: {', '.join(agents)}{hint}"
            raise UprightError(f"--set is {text!r}; {why}")
        found[agent].append(text[len(owner + dot) :])
    return {agent: dict(pairs("--set", changes)) for agent, changes in found.items()}


def noises_of(options: argparse.Namespace) -> list[str]:
    """Return the noise cases that --noises asks for, or else the one of the file of --task."""
    if not isinstance(options.noises, str):
        return list(options.noises)
    return list(PUBLISHED_NOISES) if options.noises == "all" else split(options.noises)


def split(names: str) -> list[str]:
    """Return names that have commas between, each once."""
    return list(dict.fromkeys(name.strip() for name in names.split(",")))
