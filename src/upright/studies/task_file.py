"""Files of a task, in TOML: all that the options of a task and its plant say.

    noise = "gaussian-0.1"
    condition = "delay-1"
    steps = 60000

    [parameters]
    half_length = 0.3

    [plant]
    name = "mujoco"
    integrator = "rk4"

The keys are the fields of `TaskSpec`, and the plant with its settings; all may be left out. A noise
or a condition of several terms is a text, `noise = "actuator=0.1,gaussian=0.5"`, or a table of
them. A file that the plant's settings name is relative to the folder of this one. A file may come
from anyone, so every name and value is checked, and its size is bounded.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from upright import __version__
from upright.core.parameters import Parameters, changed_parameters, make_parameters
from upright.core.task import TaskSpec
from upright.errors import UprightError, require_kind, require_one_of, said
from upright.plants import PLANTS, describe_plant
from upright.plants.equations import EQUATIONS
from upright.plants.settings import PlantSettings
from upright.studies.belonging import belongings
from upright.studies.case import Case
from upright.support.files import write_file
from upright.support.settings import describe_settings, renamed, values_of, with_values
from upright.support.toml_file import Key, TomlFile, check_toml_output, read_toml, toml_value

TEXTS = tuple(field.name for field in fields(TaskSpec) if isinstance(field.default, str))
"""Parts of a task that are texts."""
PARTS = (*(field.name for field in fields(TaskSpec)), "plant")
"""What a file of a task may have."""


def read_task(path: Path | str) -> dict[str, Any]:
    r"""Read a file of a task, written by `save_task`, the option ``--save-task``, or by hand.

    Parameters
    ----------
    path
        Path of the file, whose name ends in .toml.

    Returns
    -------
    dict
        What the file says, and nothing else: parts of the task by name, as `make_case`, `learn` and
        `play` take them; `parameters` is a dictionary, and `plant` has the settings of the plant.

    Raises
    ------
    UprightError
        If there is no such file, it is not one of a task, or a name or value is not allowed. The
        error names the line and the key.

    Examples
    --------
    >>> from pathlib import Path
    >>> text = "steps = 600\n[parameters]\nhalf_length = 0.3\n"
    >>> _ = Path("my-cart.toml").write_text(text)
    >>> upright.read_task("my-cart.toml")
    {'steps': 600, 'parameters': {'half_length': 0.3}}
    >>> upright.make_case("q-learning", **upright.read_task("my-cart.toml"))
    Case('q-learning', steps=600, parameters={'half_length': 0.3})
    """
    file = read_toml(path, "task file")
    for name in file.content:
        check_name(file, "key", name, PARTS)
    task = {
        name: text_in(file, value, name) if name in TEXTS else value
        for name, value in file.content.items()
    }
    if "plant" in task:
        task["plant"] = plant_in(file, task["plant"], "plant")
    if isinstance(parameters := task.get("parameters"), dict):
        for name in parameters:
            check_name(file, "parameter", name, Parameters._fields, "parameters")
        file.checked(make_parameters, parameters, "parameters")
    file.checked(TaskSpec.from_data, {name: task[name] for name in task if name != "plant"})
    return task


def check_name(
    file: TomlFile, what: str, name: str, allowed: Iterable[str], *tables: Key, plant: str = ""
) -> None:
    """Raise an error that says where a name belongs, unless it is allowed in these tables.

    Parameters
    ----------
    file
        The file.
    what
        What the name is, for the error.
    name
        The name.
    allowed
        The names that are allowed.
    tables
        The keys that lead to the table that it stands in.
    plant
        Name of the plant that the file is about, if it is not that of equations.
    """
    try:
        require_one_of(what, name, allowed)
    except UprightError as error:
        why = _advice(name, plant or EQUATIONS.name) or error
        raise file.error(why, *tables, name) from None


def _advice(name: str, plant: str) -> str:
    """Return where in a file a name belongs, or an empty string."""
    for belonging in belongings(name, plant):
        places = {
            "parameter": "in [parameters]",
            "plant": f"in [plant], with name = {toml_value(belonging.owner)}",
            "task": "above all tables",
        }
        return f"{name} is {belonging}; it belongs {places[belonging.kind]}"
    return ""


def text_in(file: TomlFile, value: Any, *keys: Key) -> str:
    """Return a part of a task that is a text, or a table of terms.

    Raises
    ------
    UprightError
        If it is neither.
    """
    text = ",".join(_terms(file, value, *keys)) if isinstance(value, dict) else value
    if not isinstance(text, str):
        why = f"{keys[-1]} is {said(text)}; it must be a text, or a table of terms"
        raise file.error(why, *keys)
    return text


def _terms(file: TomlFile, table: Mapping[str, Any], *keys: Key, within: str = "") -> Iterator[str]:
    """Yield the terms of a table: NAME=VALUE, or the name alone of what is true."""
    for name, value in table.items():
        term = f"{within}{name}"
        if isinstance(value, dict):
            yield from _terms(file, value, *keys, name, within=f"{term}.")
        elif isinstance(value, bool):
            if value:
                yield term
        elif isinstance(value, (int, float, str)):
            yield f"{term}={value}"
        else:
            why = f"{term} is {said(value)}; it must be a number, a text, or true"
            raise file.error(why, *keys, name)


def plant_in(file: TomlFile, values: Any, *keys: Key) -> PlantSettings:
    """Return the plant that a table describes.

    A setting that names a file, such as a model, is relative to the folder of the TOML file.

    Raises
    ------
    UprightError
        If it is not a table, there is no such plant, or a setting or value is not allowed.
    """
    if not isinstance(values, dict):
        raise file.error(f"plant is {said(values)}; it must be a table, [plant]", *keys)
    name = values.get("name", EQUATIONS.name)
    default = default_plant(file, name, *keys)
    own = {name: value for name, value in values.items() if name != "name"}
    for setting in own:
        if PLANTS.is_path(name):
            raise file.error(f"plant is {name!r}; it has no settings", *keys, setting)
        allowed = [*values_of(default), *renamed(default)]
        check_name(file, "setting", setting, allowed, *keys, plant=name)
    plant = file.checked(lambda some: with_values(default, some), own, *keys)
    return _with_files(plant, lambda given: file.path.parent / given)


def default_plant(file: TomlFile, name: Any, *keys: Key) -> PlantSettings:
    """Return the default settings of the plant that a table names.

    Raises
    ------
    UprightError
        If there is no such plant.
    """
    if not isinstance(name, str):
        raise file.error(f"plant is {said(name)}; it must be the name of a plant", *keys, "name")
    return file.checked(lambda named: PLANTS.default(named["name"]), {"name": name}, *keys)


def _with_files(plant: PlantSettings, place: Callable[[str], Path | str]) -> PlantSettings:
    """Return a plant with each file that it names, if any, at another place."""
    named = {name: getattr(plant, name) for name in getattr(plant, "FILES", ())}
    return with_values(plant, {name: str(place(path)) for name, path in named.items() if path})


def save_task(path: Path | str, case: Case) -> None:
    """Write the task of a case, with its plant, to a file that people can read and edit.

    Every value stands in it with its meaning and unit, so that the file says all by itself.
    `read_task` and the option ``--task`` of commands read it.

    Parameters
    ----------
    path
        Path of the file, whose name ends in .toml.
    case
        The case; its agent is no part of the task.

    Raises
    ------
    UprightError
        If the file cannot be written, or its name has another ending.

    Examples
    --------
    >>> case = upright.make_case("q-learning", noise="sensor-5", parameters={"half_length": 0.3})
    >>> upright.save_task("my-cart.toml", case)
    >>> upright.make_case("q-learning", **upright.read_task("my-cart.toml")) == case
    True
    """
    require_kind("case", case, Case, "what make_case returns")
    check_toml_output(path)
    write_file(path, task_text(case.spec, placed_beside(path, case.plant)))


def placed_beside(path: Path | str, plant: PlantSettings) -> PlantSettings:
    """Return a plant as a TOML file of this path names it: its own files relative to the folder."""
    folder = Path(path).parent
    return _with_files(
        plant, lambda given: given if os.path.isabs(given) else os.path.relpath(given, folder)
    )


def task_text(spec: TaskSpec, plant: PlantSettings) -> str:
    """Return the content of a file of a task."""
    parts = {name: value for name, value in spec.as_data().items() if name != "parameters"}
    summary = PLANTS.summary(plant.name)
    lines = [
        f"# A task, written by Upright {__version__}. To use it: upright learn AGENT --task FILE,",
        "# and likewise upright table, play and tune; other options override what stands here.",
        "",
        *_lines(parts, describe_settings(TaskSpec)),
        "",
        "[parameters]",
        *_lines(spec.parameters._asdict(), _meanings(spec.parameters)),
        "",
        "[plant]",
        *_lines(
            {"name": plant.name} if PLANTS.is_path(plant.name) else describe_plant(plant),
            {"name": summary, **describe_settings(plant)},
        ),
    ]
    return "\n".join(lines) + "\n"


def _meanings(parameters: Parameters) -> dict[str, str]:
    """Return what each parameter means, with the published value of those that differ from it."""
    published = Parameters()._asdict()
    texts = describe_settings(Parameters)
    for name in changed_parameters(parameters):
        texts[name] += f" Published: {toml_value(published[name])}."
    return texts


def _lines(values: Mapping[str, Any], texts: Mapping[str, str]) -> list[str]:
    """Return a line for each value, with its meaning as a comment."""
    starts = {name: f"{name} = {toml_value(value)}" for name, value in values.items()}
    width = max(map(len, starts.values()))
    return [
        f"{start:<{width}}  # {texts[name].replace('`', '')}" if name in texts else start
        for name, start in starts.items()
    ]
