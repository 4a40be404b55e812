"""What a sweep changes: the numbers that the tasks of a study differ in.

Tables have a column for each of them, and `plots.sweep` draws trials over one.
"""

from collections.abc import Iterable, Sequence

from upright.core.parameters import Parameters
from upright.core.task import TaskSpec
from upright.errors import UprightError, require_one_of
from upright.support.settings import describe_settings

UNITS = {
    name: text.partition("[")[2].partition("]")[0]
    for name, text in describe_settings(Parameters).items()
}
"""The units of the numbers that a sweep can change."""
HOW = "upright table --parameter half_length=0.25:2:8 --store FILE makes some"
"""How runs for a sweep are made."""


def sizes(task: TaskSpec) -> dict[str, float]:
    """Return the numbers of a task that a sweep can change, by name."""
    return task.parameters._asdict()


def swept(tasks: Iterable[TaskSpec]) -> list[str]:
    """Return the names of the numbers that tasks differ in.

    Examples
    --------
    >>> swept(upright.TaskSpec(parameters={"half_length": size}) for size in (0.25, 0.5))
    ['half_length']
    """
    found = [sizes(task) for task in dict.fromkeys(tasks)]
    names = found[0] if found else ()
    return [name for name in names if len({each[name] for each in found}) > 1]


def heading(name: str) -> str:
    """Return the name of such a number with its unit, for columns and axes.

    Examples
    --------
    >>> heading("half_length")
    'half_length [m]'
    """
    return f"{name} [{UNITS[name]}]"


def choose_swept(tasks: Sequence[TaskSpec], name: str | None) -> str:
    """Return the name of the number to draw a sweep over.

    Parameters
    ----------
    tasks
        The tasks of the runs.
    name
        The name that is asked for; None if there is but one.

    Raises
    ------
    UprightError
        If tasks do not differ in it; or in several, and none is asked for.
    """
    names = swept(tasks)
    if not names:
        raise UprightError(f"there is no sweep: all runs have the same parameters; {HOW}")
    if name is not None:
        require_one_of("parameter of a sweep", name, names)
        return name
    if len(names) > 1:
        how = f"--parameter {names[0]} (in Python, parameter={names[0]!r})"
        raise UprightError(f"runs differ in {' and '.join(names)}; choose one: {how}")
    return names[0]
