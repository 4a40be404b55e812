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
them. A file may come from anyone, so every name and value is checked, and its size is bounded.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from upright import __version__
from upright.core.parameters import Parameters, changed_parameters, make_parameters
from upright.core.task import TaskSpec
from upright.errors import UprightError, require_kind, require_one_of
from upright.plants import PLANTS, describe_plant
from upright.plants.equations import EQUATIONS
from upright.plants.settings import PlantSettings
from upright.studies.belonging import belongings
from upright.studies.case import Case
from upright.support.files import write_file
from upright.support.settings import describe_settings, values_of, with_values
from upright.support.toml_file import TomlFile, check_toml_output, read_toml, toml_value

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
        _check_name(file, "key", name, PARTS)
    task = {name: _value(file, name, value) for name, value in file.content.items()}
    if "plant" in task:
        task["plant"] = _plant(file, task["plant"])
    if isinstance(parameters := task.get("parameters"), dict):
        for name in parameters:
            _check_name(file, "parameter", name, Parameters._fields, "parameters")
        file.checked(make_parameters, parameters, "parameters")
    file.checked(TaskSpec.from_data, {name: task[name] for name in task if name != "plant"})
    return task


def _check_name(
    file: TomlFile, what: str, name: str, allowed: Iterable[str], *tables: str, plant: str = ""
) -> None:
    """Raise an error that says where a name belongs, unless it is allowed in these tables."""
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


def _value(file: TomlFile, name: str, value: Any) -> Any:
    """Return the value of a key, with a table of terms as a text."""
    if name not in TEXTS:
        return value
    terms = value
    if isinstance(value, dict):
        terms = ",".join(_terms(file, value, name))
    try:
        require_kind(name, terms, str, "a text, or a table of terms")
    except UprightError as error:
        raise file.error(error, name) from None
    return terms


def _terms(file: TomlFile, table: Mapping[str, Any], *keys: str) -> Iterator[str]:
    """Yield the terms of a table: NAME=VALUE, or the name alone of what is true."""
    for name, value in table.items():
        term = ".".join([*keys[1:], name])
        if isinstance(value, dict):
            yield from _terms(file, value, *keys, name)
        elif isinstance(value, bool):
            if value:
                yield term
        elif isinstance(value, (int, float, str)):
            yield f"{term}={value}"
        else:
            why = f"{term} is {value!r}; it must be a number, a text, or true"
            raise file.error(why, *keys, name)


def _plant(file: TomlFile, values: Any) -> PlantSettings:
    """Return the plant that a table describes."""
    if not isinstance(values, dict):
        raise file.error(f"plant is {values!r}; it must be a table, [plant]", "plant")
    name = values.get("name", EQUATIONS.name)
    if not isinstance(name, str):
        raise file.error(f"plant is {name!r}; it must be the name of a plant", "plant", "name")
    default = file.checked(lambda named: PLANTS.default(named["name"]), {"name": name}, "plant")
    own = {name: value for name, value in values.items() if name != "name"}
    for setting in own:
        if PLANTS.is_path(name):
            raise file.error(f"plant is {name!r}; it has no settings", "plant", setting)
        allowed = [*values_of(default), *getattr(default, "RENAMED", {})]
        _check_name(file, "setting", setting, allowed, "plant", plant=name)
    return file.checked(lambda some: with_values(default, some), own, "plant")


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
    write_file(path, task_text(case.spec, case.plant))


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
