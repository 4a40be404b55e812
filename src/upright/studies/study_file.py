"""Files of a study, in TOML: a file of a task whose values may be several, with agents and runs.

    agents = ["q-learning", "random-search"]
    runs = 100
    noise = ["none", "gaussian-0.2"]
    steps = 6000

    [parameters]
    half_length = "0.25:1:4"

    [settings.q-learning]
    discount = [0.9, 0.99]

A list is several values, and a text LOW:HIGH:COUNT several numbers; every combination is a case, as
in `upright table`. What is no such grid stands in [[tasks]]. A file may come from anyone, so every
name and value is checked, and sizes are bounded; of custom agents, the code is executed.
"""

import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypedDict, TypeVar

from upright import __version__
from upright.agents import AGENTS, LABELS
from upright.core.conditions import PUBLISHED_NOISES, RUNS
from upright.core.parameters import Parameters
from upright.core.task import TaskSpec
from upright.errors import CodeError, UprightError, require_kind, require_one_of, said
from upright.plants import PLANTS
from upright.plants.equations import EQUATIONS
from upright.plants.settings import PlantSettings
from upright.studies.case import Case, make_case, name_settings, refuse_settings_of_custom
from upright.studies.settings_file import read_settings
from upright.studies.study import check_study
from upright.studies.task_file import (
    PARTS,
    TEXTS,
    check_name,
    default_plant,
    placed_beside,
    plant_in,
    read_task,
    text_in,
)
from upright.support.files import check_name as check_file_name
from upright.support.files import require_apart, write_file
from upright.support.settings import (
    RANGE,
    changed_values,
    combinations,
    numbers_in,
    renamed,
    require_few_cases,
    values_of,
    with_values,
)
from upright.support.toml_file import (
    SUFFIX,
    Key,
    TomlFile,
    check_toml_output,
    read_toml,
    refusal,
    toml_text,
)

T = TypeVar("T")

KEYS = {
    "agents": "names of agents, or `module:name` of custom ones; the only key that must be there",
    "runs": f"independent runs of each case ({RUNS})",
    "seed": "random seed; the same seed gives the same result (0)",
    "store": "the store that keeps every finished run (beside the file, with the ending `.sqlite`)",
    "noise": "a noise case or terms; `all` for the seven published cases (`none`)",
    "start": "name of the start (`random`)",
    "condition": "a condition or terms (`nominal`)",
    "steps": "N: a trial that lasts this many steps is a success (60000)",
    "trials": "a run ends after at most this many trials (1000)",
    "parameters": "table: parameters of the plant, each a number, several, or a range",
    "plant": "table: the plant's `name` and its settings; or several tables, `[[plant]]`",
    "settings": "a table for each agent, `[settings.AGENT]`: its settings; and `from`, whence the "
    "others come: `default`, `as-published`, or a file that `upright tune` wrote (`default`)",
    "tasks": "several tasks that are no grid: tables `[[tasks]]` with the keys from `noise` to "
    "`plant`, or names of task files; what one leaves out is as it is above",
}
"""What a file of a study may have, and what each means, with what it is if it is not there."""
GRID = ("plant", "start", "condition", "steps", "trials", "parameters", "noise")
"""The parts of a task in the order of a table: the last one varies fastest."""


class Study(TypedDict):
    """What `upright.study` takes."""

    cases: list[Case]
    runs: int
    seed: int
    store: str


class Axis(NamedTuple):
    """A part of tasks that has several values, or one."""

    keys: tuple[Key, ...]
    """Where it stands in the file."""
    values: list[Any]
    """Its values."""


def read_study(path: Path | str) -> Study:
    r"""Read a file of a study, as `upright study` does.

    Parameters
    ----------
    path
        Path of the file, whose name ends in .toml.

    Returns
    -------
    dict
        What `study` takes: `cases`, in the order of the table, `runs`, `seed`, and `store`, the
        path of the store.

    Raises
    ------
    UprightError
        If there is no such file, it is not one of a study, or a name or value is not allowed. The
        error names the line and the key.
    AgentError
        If a custom agent fails.

    Examples
    --------
    >>> from pathlib import Path
    >>> text = "agents = ['random-search']\nruns = 5\nsteps = 300\n[parameters]\n"
    >>> _ = Path("lengths.toml").write_text(text + "half_length = [0.25, 0.5]")
    >>> plan = upright.read_study("lengths.toml")
    >>> [case.spec.parameters.half_length for case in plan["cases"]], plan["store"]
    ([0.25, 0.5], 'lengths.sqlite')
    >>> results = upright.study(**plan)
    >>> sum(map(len, results.values()))
    10
    """
    return study_in(read_toml(path, "study file"))


def study_in(file: TomlFile) -> Study:
    """Return the study that a file describes, as `read_study` does."""
    for name in file.content:
        _check_key(file, name)
    numbers = file.checked(
        _numbers, {name: file.content[name] for name in ("runs", "seed") if name in file.content}
    )
    agents = _agents(file)
    tasks = _few(file, _tasks(file))
    starts = _few(file, (start for agent in agents for start in _starts(file, agent)))
    with file.at():
        require_few_cases(len(starts) * len(tasks))
    cases = [replace(start, spec=spec, plant=plant) for start in starts for spec, plant in tasks]
    runs, seed = numbers["runs"], numbers["seed"]
    return Study(cases=list(dict.fromkeys(cases)), runs=runs, seed=seed, store=_store(file))


def _check_key(file: TomlFile, name: str) -> None:
    """Raise an error that says where a name belongs, unless a file of a study has such a key."""
    named = file.content.get("agents")
    agents = [agent for agent in AGENTS.built_in if isinstance(named, list) and agent in named]
    for agent in [] if name in KEYS else [*agents, *AGENTS.built_in]:
        if name in values_of(AGENTS.default(agent)):
            why = f"{name} is a setting of the agent {agent}; it belongs in [settings.{agent}]"
            raise file.error(why, name)
    check_name(file, "key", name, KEYS)


def _numbers(given: Mapping[str, Any]) -> dict[str, Any]:
    numbers = {"runs": RUNS, "seed": 0, **given}
    check_study(**numbers)
    return numbers


def _few(file: TomlFile, things: Iterable[T], *keys: Key) -> list[T]:
    """Return things of a file, unless there are more than a study may have cases."""
    found = []
    for thing in things:
        found.append(thing)
        with file.at(*keys):
            require_few_cases(len(found))
    return found


def _store(file: TomlFile) -> str:
    name = file.content.get("store", file.path.with_suffix(".sqlite").name)
    if not isinstance(name, str) or not name or "\0" in name:
        raise file.error(f"store is {said(name)}; it must be the path of a file", "store")
    path = str(file.path.parent / name)
    with file.at(*["store"] * ("store" in file.content)):
        check_file_name("store", path)
        require_apart([("store", path)], [("study file", file.path)])
    return path


# ---------------------------------------------------------------------------------------- values


def _axes(
    file: TomlFile, table: Mapping[str, Any], usual: Mapping[str, Any], *keys: Key
) -> dict[str, Axis]:
    """Return all values of each name in a table, which has others of their kinds in `usual`."""
    axes = {}
    for name, value in table.items():
        with file.at(*keys, name):
            axes[name] = Axis((*keys, name), _several(name, value, usual.get(name)))
    return axes


def _several(name: str, value: Any, usual: object) -> list[Any]:
    """Return the values that a value of a file stands for.

    A tuple is a list by itself, and several are a list of lists.
    """
    is_one = isinstance(usual, tuple) and not _has_lists(value)
    items = value if isinstance(value, list) and not is_one else [value]
    if not items:
        raise UprightError(f"{name} is []; it must have a value")
    is_number = isinstance(usual, (int, float)) and not isinstance(usual, bool)
    values: list[Any] = []
    for place, item in enumerate(items):
        if item in items[:place]:
            raise _repeated(name, items, item)
        values += _numbers_of_range(name, item) if is_number and isinstance(item, str) else [item]
        require_few_cases(len(values))
    return values


def _repeated(name: str, items: Sequence[Any], item: object) -> UprightError:
    """Return the error about an item that a list has twice, which may be meant for another."""
    return UprightError(f"{name} is {said(items)}; it has {said(item)} twice")


def _has_lists(value: Any) -> bool:
    return isinstance(value, list) and any(isinstance(item, list) for item in value)


def _numbers_of_range(name: str, text: str) -> list[float]:
    if ":" not in text or "," in text:
        raise UprightError(
            f"{name} is {said(text)}; it must be a number, several in a list, or {RANGE}"
        )
    numbers = (float(number) for number in numbers_in(name, text))
    return [int(number) if number.is_integer() else number for number in numbers]


def _texts(file: TomlFile, value: Any, *keys: Key) -> list[str]:
    """Return a text or several, each of which is there once."""
    texts = value if isinstance(value, list) else [value]
    if not texts or not all(isinstance(text, str) for text in texts):
        raise file.error(
            f"{keys[-1]} is {said(value)}; it must be a name, or a list of names", *keys
        )
    text, times = Counter(texts).most_common(1)[0]
    if times > 1:
        raise file.error(_repeated(str(keys[-1]), texts, text), *keys)
    return texts


def _made(
    file: TomlFile, make: Callable[[Mapping[str, Any]], T], axes: Mapping[str, Axis], *keys: Key
) -> Iterator[T]:
    """Yield what a function makes of every combination of values by name.

    If it refuses one, the error names the value that is refused by itself, or else the table.
    """
    for chosen in _combinations(file, axes, *keys):
        try:
            made = make(chosen)
        except CodeError:
            raise
        except UprightError as error:
            why = str(error)
            refused = (n for n, value in chosen.items() if refusal(make, {n: value}) == why)
            raise file.error(why, *next((axes[n].keys for n in refused), keys)) from None
        yield made


def _combinations(file: TomlFile, axes: Mapping[str, Axis], *keys: Key) -> list[dict[str, Any]]:
    longest = max(axes.values(), key=lambda axis: len(axis.values), default=Axis(keys, []))
    with file.at(*longest.keys):  # it is most likely to be what makes them too many
        return combinations({name: axis.values for name, axis in axes.items()})


# ---------------------------------------------------------------------------------------- agents


def _agents(file: TomlFile) -> list[str]:
    """Return the names of the agents, each of which may have a table of settings."""
    if "agents" not in file.content:
        raise file.error("it must have the key agents")
    agents = _texts(file, file.content["agents"], "agents")
    with file.at("agents"):
        for agent in agents:
            AGENTS.check(agent)
    settings = file.content.get("settings", {})
    if not isinstance(settings, dict):
        why = f"settings is {said(settings)}; it must have a table for each agent, [settings.AGENT]"
        raise file.error(why, "settings")
    for agent, table in settings.items():
        with file.at("settings", agent):
            require_one_of("agent", agent, agents)
            require_kind(agent, table, dict, "a table, with settings of the agent")
            refuse_settings_of_custom(agent)
    return agents


def _starts(file: TomlFile, agent: str) -> Iterator[Case]:
    """Yield the cases of an agent with all its settings, on the usual task."""
    table = dict(file.content.get("settings", {}).get(agent, {}))
    keys = ("settings", agent)
    sources = _texts(file, table.pop("from", LABELS[0]), *keys, "from")
    usual = values_of(AGENTS.default(agent))
    usual |= {old: usual[new] for old, new in renamed(AGENTS.default(agent)).items()}
    for name in table:
        check_name(file, "setting", name, [*usual, "from"], *keys)
    axes = _axes(file, table, usual, *keys)
    for start in _sources(file, agent, sources):
        make = partial(with_values, start.settings)
        for settings in _made(file, make, axes, *keys):
            named = start.label in LABELS
            label = start.label if named else name_settings(start.label, start.settings, settings)
            yield replace(start, label=label, settings=settings)


def _sources(file: TomlFile, agent: str, names: Sequence[str]) -> Iterator[Case]:
    """Yield a case for each name of settings, or of a file of them."""
    keys = ("settings", agent, "from")
    labels = set()
    for name in names:
        if name in LABELS:
            with file.at("agents"):
                start = make_case(agent, name)
            yield start
            continue
        with file.at(*keys):
            if Path(name).suffix != SUFFIX:
                require_one_of("from", name, [*LABELS, f"FILE{SUFFIX}"])
            read = read_settings(file.path.parent / name)
            require_one_of("agent of the settings file", read.agent, [agent])
            if read.name in labels:
                raise UprightError(f"there are two settings files of the name {read.name!r}")
        labels.add(read.name)
        yield replace(make_case(agent, settings=read.values), label=read.name)


# ----------------------------------------------------------------------------------------- tasks


def _tasks(file: TomlFile) -> Iterator[tuple[TaskSpec, PlantSettings]]:
    """Yield every task with its plant."""
    shared = _parts(file, {name: file.content[name] for name in PARTS if name in file.content})
    if "tasks" not in file.content:
        yield from _made(file, _task, _in_order(shared))
        return
    tasks = file.content["tasks"]
    if not isinstance(tasks, list) or not tasks:
        why = f"tasks is {said(tasks)}; it must be tables, [[tasks]], or a list of task files"
        raise file.error(why, "tasks")
    for place, task in enumerate(tasks):
        axes = _in_order(shared | _parts_of(file, task, "tasks", place))
        yield from _made(file, _task, axes, "tasks", place)


def _in_order(axes: Mapping[str, Axis]) -> dict[str, Axis]:
    """Return the parts of tasks in the order of `GRID`; parameters as they come."""
    names = sorted(axes, key=lambda name: GRID.index(name if name in GRID else "parameters"))
    return {name: axes[name] for name in names}


def _task(parts: Mapping[str, Any]) -> tuple[TaskSpec, PlantSettings]:
    """Return the task that has these parts, the parameters among them, if its plant takes it."""
    own = {name: value for name, value in parts.items() if name in GRID}
    parameters = {name: value for name, value in parts.items() if name not in GRID}
    case = make_case("random-search", parameters=parameters, **own)
    return case.spec, case.plant


def _parts_of(file: TomlFile, task: Any, *keys: Key) -> dict[str, Axis]:
    """Return the parts that a table, or a file of a task, has."""
    if isinstance(task, dict):
        return _parts(file, task, *keys)
    with file.at(*keys):
        require_kind("task", task, str, "a table, or the name of a task file")
        parts = read_task(file.path.parent / task)
    parts |= parts.pop("parameters", {})
    return {name: Axis(keys, [value]) for name, value in parts.items()}


def _parts(file: TomlFile, table: Mapping[str, Any], *keys: Key) -> dict[str, Axis]:
    """Return all values of each part of a task that a table has, the parameters among them."""
    for name in table:
        check_name(file, "key", name, PARTS, *keys)
    plain = {name: value for name, value in table.items() if name not in ("parameters", "plant")}
    if plain.get("noise") == "all":
        plain["noise"] = list(PUBLISHED_NOISES)
    axes = _axes(file, plain, values_of(TaskSpec()), *keys)
    for name in axes.keys() & TEXTS:
        axes[name] = Axis(
            (*keys, name), [text_in(file, text, *keys, name) for text in axes[name].values]
        )
    parameters = table.get("parameters", {})
    with file.at(*keys, "parameters"):
        require_kind("parameters", parameters, dict, "a table, [parameters]")
    for name in parameters:
        check_name(file, "parameter", name, Parameters._fields, *keys, "parameters")
    axes |= _axes(file, parameters, Parameters()._asdict(), *keys, "parameters")
    if "plant" in table:
        axes["plant"] = Axis((*keys, "plant"), _plants(file, table["plant"], *keys, "plant"))
    return axes


def _plants(file: TomlFile, value: Any, *keys: Key) -> list[PlantSettings]:
    """Return the plants of a table, or of several."""
    several = isinstance(value, list) and value
    tables = [((*keys, n), table) for n, table in enumerate(value)] if several else [(keys, value)]
    plants = (plant for places, table in tables for plant in _plants_of(file, table, *places))
    return _few(file, plants, *keys)


def _plants_of(file: TomlFile, table: Any, *keys: Key) -> Iterator[PlantSettings]:
    with file.at(*keys):
        require_kind("plant", table, dict, "a table, [plant]")
    own = {name: value for name, value in table.items() if name != "name"}
    for name in _texts(file, table.get("name", EQUATIONS.name), *keys, "name"):
        axes = _axes(file, own, values_of(default_plant(file, name, *keys)), *keys)
        for chosen in _combinations(file, axes, *keys):
            yield plant_in(file, {"name": name} | chosen, *keys)


# --------------------------------------------------------------------------------------- writing


def save_study(
    path: Path | str,
    plan: Mapping[str, Any],
    parts: Mapping[str, Any],
    plant: PlantSettings,
    settings: Mapping[str, Mapping[str, Sequence[Any]]],
) -> None:
    """Write a file of a study, which `read_study` reads.

    Parameters
    ----------
    path
        Path of the file, whose name ends in .toml.
    plan
        The agents, `runs` and `seed`, and the path of the store if it is to be named.
    parts
        Parts of the task: each a list of its values, which may repeat; `parameters` by name.
    plant
        The plant.
    settings
        For each agent, lists of values of its settings; and `from`, labels or paths of files.

    Raises
    ------
    UprightError
        If the file cannot be written, or its name has another ending.
    """
    check_toml_output(path)
    folder = Path(path).parent

    def beside(name: str) -> str:
        return name if name in LABELS else os.path.relpath(name, folder)

    usual = TaskSpec().as_data()
    plant = placed_beside(path, plant)
    changed = {"name": plant.name, **changed_values(PLANTS.default(plant.name), plant)}
    tables: dict[str, Any] = {
        "parameters": _brief(parts["parameters"], {}),
        "plant": changed if plant != EQUATIONS else {},
    }
    own = {
        agent: _brief({**table, "from": list(map(beside, table["from"]))}, {"from": LABELS[0]})
        for agent, table in settings.items()
        if not AGENTS.is_path(agent)
    }
    tables["settings"] = {agent: table for agent, table in own.items() if table}
    place = {"store": beside(plan["store"])} if plan.get("store") else {}
    content = {
        **plan,
        **place,
        **_brief({name: parts[name] for name in parts if name != "parameters"}, usual),
        **{name: table for name, table in tables.items() if table},
    }
    comment = f"# A study, written by Upright {__version__}. To run it: upright study FILE\n\n"
    write_file(path, comment + toml_text(content))


def _brief(several: Mapping[str, Sequence[Any]], usual: Mapping[str, Any]) -> dict[str, Any]:
    """Return each value once, one alone without a list, and none that is as usual."""
    unique = {name: list(dict.fromkeys(values)) for name, values in several.items()}
    return {
        name: values if len(values) > 1 else values[0]
        for name, values in unique.items()
        if values != [usual.get(name)]
    }
