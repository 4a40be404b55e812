"""Plants whose parameters differ from episode to episode, and from lane to lane.

An environment without any has `None` in their place, which costs nothing in compiled code.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from upright.core.compiled import compiled, guard, inlined
from upright.core.conditions import Condition, Draw
from upright.core.guards import require_array, require_lane
from upright.core.parameters import SMALLEST, Parameters, check_parameters
from upright.core.rig import (
    PARAMETER,
    Rig,
    apply_changes,
    check_draws,
    check_rig,
    draw_parameters,
    lanes_of,
    parameters_of,
)
from upright.core.task import check_varied
from upright.core.terms import Range
from upright.errors import UprightError, require_kind, require_one_of

Array = NDArray[Any]


class Plants(NamedTuple):
    """The plants of n lanes; rows are parameters, in the order of `Parameters`."""

    present: np.ndarray
    """Their parameters, shape (parameters, n), float64; those of the rig, if there is one."""
    varied: np.ndarray
    """Which of these were drawn, given or may change in this episode, same shape, bool."""
    last: np.ndarray
    """The parameters with which the previous episode of each lane ended."""
    last_varied: np.ndarray
    """Which of these were varied."""
    given: np.ndarray
    """Parameters that the next episode of each lane has instead; NaN for all others."""
    draws: np.ndarray
    """What is drawn for each episode, as in `Rig`."""
    always: np.ndarray
    """Which parameters vary in every episode, shape (parameters,), bool."""


def make_plants(parameters: Parameters, rig: Rig | None, draws: Array, count: int) -> Plants:
    """Return the plants of this many lanes, which are all alike until an episode begins."""
    present = lanes_of(parameters, count) if rig is None else rig.present
    always = np.zeros(len(present), np.bool_)
    always[draws[:, 0].astype(int)] = True
    if rig is not None:
        always[rig.changes[:, 1].astype(int)] = True
    varied = np.zeros(present.shape, np.bool_)
    given = np.full(present.shape, np.nan)
    return Plants(present, varied, present.copy(), varied.copy(), given, draws, always)


@inlined
def plant_of(shared: Parameters, plants: Plants | None, i: int) -> Parameters:
    """Return the present parameters of a lane's plant: the shared ones if no plants vary."""
    if plants is None:
        return shared
    return parameters_of(plants.present, i)


@inlined
def begin_plant(
    shared: Parameters, rig: Rig | None, plants: Plants | None, rng: np.random.Generator, i: int
) -> None:
    """Give a lane the plant of its next episode, before the start is drawn.

    It has the environment's own parameters, `shared`, except for those that have changed in the
    run, are drawn or were given.
    """
    if plants is not None:
        _begin_plant(shared, rig, plants, rng, i)


@compiled
def _begin_plant(
    shared: Parameters, rig: Rig | None, plants: Plants, rng: np.random.Generator, i: int
) -> None:
    present, varied, given = plants.present, plants.varied, plants.given
    for row in range(len(present)):
        plants.last[row, i], plants.last_varied[row, i] = present[row, i], varied[row, i]
        present[row, i], varied[row, i] = shared[row], plants.always[row]
    if rig is not None:
        apply_changes(rig, 0.0, i)
    draw_parameters(plants.draws, present, i, rng)
    for row in range(len(present)):
        if not np.isnan(given[row, i]):
            present[row, i], varied[row, i], given[row, i] = given[row, i], True, np.nan


def check_plants(rig: Rig | None, plants: Plants | None, lanes: int) -> None:
    """Raise UprightError unless a rig and plants, if any, are those of this many lanes."""
    if rig is not None:
        check_rig(rig)
        require_array("memory of the rig", rig.memory, np.float64, len(rig.memory), lanes)
    if plants is not None:
        for name in ("present", "last", "given", "varied", "last_varied"):
            kind = np.bool_ if "varied" in name else np.float64
            value = getattr(plants, name)
            require_array(f"{name} of the plants", value, kind, len(PARAMETER), lanes)
        require_array("always of the plants", plants.always, np.bool_, len(PARAMETER))
        check_draws(plants.draws)


@guard(_begin_plant)
def _check_begin_plant(
    _shared: Parameters, rig: Rig | None, plants: Plants, _rng: np.random.Generator, i: int
) -> None:
    lanes = np.shape(plants.present)[-1]
    check_plants(rig, plants, lanes)
    require_lane(i, lanes)


def report(present: Array, varied: Array, lanes: Array) -> dict[str, Any]:
    """Return the infos of a vector environment about the parameters that vary in these lanes."""
    varied = varied & lanes
    rows = np.flatnonzero(varied.any(axis=1))
    if not len(rows):
        return {}
    parameters = {}
    for row in rows:
        name = Parameters._fields[row]
        parameters[name], parameters[f"_{name}"] = present[row].copy(), varied[row]
    return {"parameters": parameters, "_parameters": varied.any(axis=0)}


def report_one(plants: Plants) -> dict[str, Any]:
    """Return the same for an environment with a single lane."""
    rows = np.flatnonzero(plants.varied[:, 0])
    parameters = {Parameters._fields[row]: float(plants.present[row, 0]) for row in rows}
    return {"parameters": parameters} if parameters else {}


# ---- What users ask for --------------------------------------------------------------------------


def all_draws(
    randomise: Mapping[str, Any] | None, condition: Condition, parameters: Parameters
) -> tuple[Draw, ...]:
    """Return what is drawn for each episode, in the order of drawing: that of the names.

    Parameters
    ----------
    randomise
        For each parameter, its lowest and highest value, and possibly "log".
    condition
        The condition, which may draw others.
    parameters
        The parameters of the plant.

    Raises
    ------
    UprightError
        If a parameter is unknown, cannot have these values, or is set by the condition too.
    """
    require_kind(
        "randomise", randomise or {}, Mapping, "a dictionary such as {'half_length': (0.25, 1.0)}"
    )
    ours = [Draw(name, _range(name, value)) for name, value in (randomise or {}).items()]
    taken = {each.parameter for each in condition.changes}
    taken |= {each.parameter for each in condition.each_episode}
    for name, (low, high, _) in ours:
        if name in taken:
            raise UprightError(f"randomise has {name}, which the condition sets too; choose one")
        for end in (low, high):
            check_parameters(parameters._replace(**{name: end}))
    draws = tuple(sorted((*ours, *condition.each_episode)))
    check_varied(condition._replace(each_episode=draws), parameters)
    return draws


def _range(name: str, value: Any) -> Range:
    """Return the range of a parameter; NamedTuples and "log" survive JSON as lists and true."""
    require_one_of("parameter in randomise", name, Parameters._fields)
    try:
        low, high, *scale = value
        is_ordered = low <= high and (not scale or low >= SMALLEST)
    except (TypeError, ValueError):
        is_ordered, scale = False, []
    if not is_ordered or scale not in ([], ["log"], [True], [False]):
        raise UprightError(
            f"randomise has {name}: {value!r}; it must be (low, high), or (low, high, 'log') "
            f"with low at least {SMALLEST}"
        )
    return Range(low, high, scale in (["log"], [True]))


def closest_limits(parameters: Parameters, draws: tuple[Draw, ...]) -> Parameters:
    """Return the parameters with the closest limits that an episode can have."""
    lows = {name: low for name, (low, _, _) in draws if name.endswith("_limit")}
    return parameters._replace(**lows)


def given_parameters(given: Any, parameters: Parameters, lanes: Array) -> Array | None:
    """Return the parameters that a reset gives to the next episodes; None for none.

    Parameters
    ----------
    given
        A number, or an array of one for each lane, by name; or `Parameters`; or None.
    parameters
        The parameters of the plant.
    lanes
        Which lanes are reset, shape (n,), bool; what is given for others does not matter.

    Returns
    -------
    np.ndarray or None
        Shape (parameters, n), NaN for parameters that are not given.

    Raises
    ------
    UprightError
        If a name is unknown, a value is impossible, or an array has another shape.
    """
    if isinstance(given, Parameters):
        given = given._asdict()
    require_kind("parameters", given or {}, Mapping, "a dictionary of numbers by name")
    if not given:
        return None
    rows = np.full((len(Parameters._fields), len(lanes)), np.nan)
    for name, value in given.items():
        require_one_of("parameter", name, Parameters._fields)
        try:
            rows[PARAMETER[name]] = _numbers(value, len(lanes))
        except (TypeError, ValueError):
            allowed = "a number" if len(lanes) == 1 else f"a number, or {len(lanes)} of them"
            raise UprightError(f"{name} is {value!r}; it must be {allowed}") from None
    for plant in _extremes(rows[:, lanes], parameters, [*given]):
        check_parameters(plant)
    return rows


def _numbers(value: Any, count: int) -> Array:
    array = np.asarray(value)
    if array.shape not in ((), (count,)) or array.dtype.kind not in "fiu":
        raise TypeError
    return array


def _extremes(rows: Array, parameters: Parameters, names: list[str]) -> list[Parameters]:
    """Return the plants that are impossible if any is: it takes long to check each of many."""
    own = np.array(parameters)[:, np.newaxis]
    whole = np.where(np.isnan(rows), own, rows)
    for name in names:  # here NaN is a value that was given
        whole[PARAMETER[name]] = rows[PARAMETER[name]]
    ends = {int(end(whole[PARAMETER[name]])) for name in names for end in (np.argmin, np.argmax)}
    static, moving = whole[PARAMETER["static_friction"]], whole[PARAMETER["cart_friction"]]
    ends |= set(np.flatnonzero((static > 0) & (static < moving))[:1].tolist())
    return [Parameters(*whole[:, i].tolist()) for i in sorted(ends)]
