"""Policy forms as plain data: lists, numbers and names, as in JSON.

Files may come from anyone, so every value is checked and sizes are bounded. Some languages write a
one-element list as a scalar; both are accepted.
"""

import math
from collections.abc import Sized
from typing import Any, get_args

import numpy as np

from upright.agents.parts.boxes import Edges, check_cuts
from upright.agents.parts.history import BLOCK
from upright.agents.parts.policy_form import Form, Layer, Network, Table, Unit
from upright.errors import UprightError, require, require_one_of

UNITS: tuple[Unit, ...] = get_args(Unit)
SURE: tuple[Unit, ...] = ("above zero", "not below zero")
"""Units whose output is 0 or 1."""
MOST_WEIGHTS, MOST_LAYERS, MOST_PAST = 10**6, 16, 100
LARGEST = 1e9
"""Upper limit of weights and scales; 1 / LARGEST is the lower limit of scales. No sum overflows."""
NUMBERS = ("layers", "scales", "past", "edges", "probabilities")
"""The entries that hold the numbers of a form, which a header leaves out."""


def form_entries(form: Form) -> dict[str, Any]:
    """Return a form as plain data, from which `restore_form` restores it."""
    return _table_entries(form) if isinstance(form, Table) else _network_entries(form)


def _network_entries(network: Network) -> dict[str, Any]:
    layers = [{"unit": unit, "weights": weights.tolist()} for weights, unit in network.layers]
    scales = network.scales and list(map(float, network.scales))
    return {"form": "network", "layers": layers, "scales": scales, "past": network.past}


def _table_entries(table: Table) -> dict[str, Any]:
    edges = [list(map(float, some)) for some in table.edges]
    return {
        "form": "table",
        "edges": edges,
        "probabilities": list(map(float, table.probabilities)),
    }


def restore_form(entries: dict[str, Any]) -> Form:
    """Return the form described by plain data; entries that are not a form's are ignored.

    Raises
    ------
    UprightError
        If something is missing, of the wrong shape or out of bounds.
    """
    form = _entry(entries, "form")
    require_one_of("form", form, ("network", "table"))
    return _table(entries) if form == "table" else _network(entries)


def _entry(entries: Any, name: str) -> Any:
    if not isinstance(entries, dict) or name not in entries:
        raise UprightError(f"it does not state its {name}")
    return entries[name]


def _listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


def _require_count(name: str, values: Sized, count: int) -> None:
    if len(values) != count:
        raise UprightError(f"the number of {name} is {len(values):,}; it must be {count:,}")


def _network(entries: dict[str, Any]) -> Network:
    past = _entry(entries, "past")
    require("past", past, 0, MOST_PAST, whole=True)
    layers = _layers(_listed(_entry(entries, "layers")), 4 + BLOCK * past)
    weights, unit = layers[-1]
    _require_count("last units", weights.T, 1)
    require_one_of("the last unit", unit, SURE if past else (*SURE, "sigmoid"))
    return Network(layers, _scales(_entry(entries, "scales")), past)


def _layers(found: list[Any], inputs: int) -> tuple[Layer, ...]:
    require("the number of layers", len(found), 1, MOST_LAYERS, whole=True)
    layers: list[Layer] = []
    total = 0
    for number, entries in enumerate(found, 1):
        rows = _rows(_entry(entries, "weights"), inputs, f"layer {number}")
        total += sum(map(len, rows))
        require("the number of weights", total, 1, MOST_WEIGHTS, whole=True)
        for weight in (weight for row in rows for weight in row):
            require(f"a weight of layer {number}", weight, -LARGEST, LARGEST)
        unit = _entry(entries, "unit")
        require_one_of(f"the unit of layer {number}", unit, UNITS)
        layers.append(Layer(np.array(rows, np.float64), unit))
        inputs = len(rows[0])
    return tuple(layers)


def _rows(weights: Any, inputs: int, layer: str) -> list[list[Any]]:
    """Return the rows of a matrix: one for each input, all of the same length."""
    rows = _listed(weights)
    if inputs == 1 and not any(isinstance(row, list) for row in rows):
        rows = [rows]
    rows = [_listed(row) for row in rows]
    _require_count(f"rows of weights of {layer}", rows, inputs)
    require(f"the number of units of {layer}", len(rows[0]), 1, whole=True)
    for row in rows:
        _require_count(f"weights in a row of {layer}", row, len(rows[0]))
    return rows


def _scales(found: Any) -> tuple[float, ...] | None:
    if found in (None, []):  # some languages have no null
        return None
    scales = _listed(found)
    _require_count("scales", scales, 4)
    for scale in scales:
        require("a scale", scale, 1 / LARGEST, LARGEST)
    return tuple(map(float, scales))


def _table(entries: dict[str, Any]) -> Table:
    edges = [_listed(some) for some in _listed(_entry(entries, "edges"))]
    _require_count("lists of edges", edges, 4)
    check_cuts(dict(zip(Edges.__annotations__, edges, strict=True)))
    probabilities = _listed(_entry(entries, "probabilities"))
    boxes = math.prod(len(some) + 1 for some in edges)
    _require_count("probabilities", probabilities, boxes)
    for probability in probabilities:
        require("a probability", probability, 0, 1)
    return Table(tuple(tuple(map(float, some)) for some in edges), tuple(map(float, probabilities)))
