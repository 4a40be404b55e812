"""Learned policies for other places: a header in C99, a graph in ONNX, a form in JSON.

Each is written from the policy's form (`agents/forms.py`) and carries its contract; no agent is
known here. What they compute is what `Policy.push_probability` returns.
"""

import json
import math
import textwrap
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from upright import __version__
from upright.agents.form_data import form_entries
from upright.agents.forms import BLOCK, Form, Network, Table, Unit
from upright.errors import UprightError, require_module, require_one_of
from upright.files import check_output, write_file
from upright.policy import (
    JSON_FORMAT,
    Policy,
    check_policy,
    describe,
    learned_policy,
    save_policy,
)
from upright.study import Case


def export_policy(path: Path | str, policy: Policy) -> None:
    """Write a policy to a file; its ending says the language.

    Raises
    ------
    UprightError
        As `check_export`; if the policy's agent does not tell its form; or if ONNX is asked for and
        not installed.
    """
    write_file(path, WRITERS[check_export(path).suffix](policy))


def check_learned(path: str, case: Case) -> None:
    """Make sure that what the case's agent learns can be saved there later.

    Raises
    ------
    UprightError
        If it cannot.
    """
    check_output(path)
    check_policy(case)


def save_learned(path: str, case: Case, seed: int, run: int, memory: Any) -> None:
    """Save what an agent learned in a run: as JSON if the path ends so, else as NumPy's archive.

    Raises
    ------
    UprightError
        If it cannot be written.
    """
    policy = learned_policy(case, seed, run, memory)
    if path.endswith(".json"):
        export_policy(path, policy)
    else:
        save_policy(path, policy, case.settings)


def check_export(path: Path | str) -> Path:
    """Return the path of an export to be written later, having made sure that it can be.

    Raises
    ------
    UprightError
        If its ending is not one of WRITERS, or it cannot be written.
    """
    require_one_of(f"the ending of {str(path)!r}", Path(path).suffix, WRITERS)
    return check_output(path)


def _form(policy: Policy) -> Form:
    if policy.form is None:
        raise UprightError(
            f"agent is {policy.agent!r}; its policy cannot be exported: that takes the method "
            "policy_form(), which returns a Network or a Table of upright.agents.forms"
        )
    return policy.form


# ---------------------------------------------------------------------------------------- C99

C_HEADER = """\
/*
 * A policy learned by {agent}, written by upright {version}. Its contract:
 *
{contract}
 *
 * For float in place of double, define UPRIGHT_FLOAT32 before this file is included.
 */
#ifndef UPRIGHT_POLICY_H
#define UPRIGHT_POLICY_H

#include <math.h>

#ifdef UPRIGHT_FLOAT32
typedef float upright_real;
#define UPRIGHT_CHOOSE(for_double, for_float) for_float
#else
typedef double upright_real;
#define UPRIGHT_CHOOSE(for_double, for_float) for_double
#endif
#define UPRIGHT_C(number) ((upright_real)(number))

{function}
#endif
"""

C_FUNCTION = """\
/* Return the probability of a push to the right: 0 to 1. */
static inline upright_real upright_push_probability(const upright_real observation[4])
{{
{body}
}}
"""

C_FUNCTION_WITH_HISTORY = """\
#define UPRIGHT_HISTORY {numbers}

/*
 * Return the probability of a push to the right: 0 or 1. That push is taken as made, and entered
 * into the history. The history is the caller's: all zeros when a trial begins, then left alone.
 */
static inline upright_real upright_push_probability(
    const upright_real observation[4], upright_real history[UPRIGHT_HISTORY])
{{
    if (history[0] == 0) {{
        for (int i = 0; i < UPRIGHT_HISTORY; i++) {{
            history[i] = i % {block} == 0 ? 0 : observation[i % {block} - 1];
        }}
    }}
{body}
}}
"""

C_INPUTS = """\
upright_real layer_0[{count}] = {{
    {inputs}
}};
"""

C_PAST_INPUTS = """\
for (int i = 0; i < UPRIGHT_HISTORY; i++) {
    layer_0[4 + i] = history[i];
}
"""

C_LAYER = """\
static const upright_real weights_{number}[{inputs} * {units}] = {{
{weights}
}};
upright_real layer_{number}[{units}];
for (int k = 0; k < {units}; k++) {{
    upright_real sum = 0;
    for (int j = 0; j < {inputs}; j++) {{
        sum += layer_{before}[j] * weights_{number}[j * {units} + k];
    }}
    layer_{number}[k] = {unit};
}}
"""

C_UNITS: dict[Unit, str] = {
    "isrlu": "sum > 0 ? sum : sum / UPRIGHT_CHOOSE(sqrt, sqrtf)(1 + sum * sum)",
    "tanh": "UPRIGHT_CHOOSE(tanh, tanhf)(sum)",
    "sigmoid": "1 / (1 + UPRIGHT_CHOOSE(exp, expf)(-sum))",
    "above zero": "sum > 0 ? 1 : 0",
    "not below zero": "sum >= 0 ? 1 : 0",
}

C_NEXT_HISTORY = """\
for (int i = UPRIGHT_HISTORY - 1; i >= {block}; i--) {{
    history[i] = history[i - {block}];
}}
history[0] = {push} > 0 ? 1 : -1;
for (int i = 0; i < 4; i++) {{
    history[1 + i] = observation[i];
}}
"""

C_TABLE = """\
static const upright_real probabilities[] = {{
{probabilities}
}};
int box = 0;
{box}return probabilities[box];"""


def c_header(policy: Policy) -> str:
    """Return a policy as a header in C99: one function, no allocation.

    The same header serves float64 and float32.

    Raises
    ------
    UprightError
        If the policy's agent does not tell its form.
    """
    form = _form(policy)
    return C_HEADER.format(
        agent=policy.agent,
        version=__version__,
        contract=_c_lines(describe(policy.contract()).splitlines(), " * ", " *     "),
        function=_c_table(form) if isinstance(form, Table) else _c_network(form),
    )


def _c_network(network: Network) -> str:
    inputs = [f"observation[{i}]" for i in range(4)]
    if network.scales:
        scales = map(_c_number, network.scales)
        inputs = [f"{each} / {scale}" for each, scale in zip(inputs, scales, strict=True)]
    numbers = BLOCK * network.past
    body = C_INPUTS.format(count=4 + numbers, inputs=",\n    ".join(inputs))
    if network.past:
        body += C_PAST_INPUTS
    for number, (weights, unit) in enumerate(network.layers, 1):
        body += C_LAYER.format(
            number=number,
            before=number - 1,
            inputs=weights.shape[0],
            units=weights.shape[1],
            weights=_c_list(map(_c_number, weights.ravel().tolist())),
            unit=C_UNITS[unit],
        )
    output = f"layer_{len(network.layers)}[0]"
    if network.past:
        body += C_NEXT_HISTORY.format(block=BLOCK, push=output)
    body = textwrap.indent(f"{body}return {output};", "    ")
    if network.past:
        return C_FUNCTION_WITH_HISTORY.format(numbers=numbers, block=BLOCK, body=body)
    return C_FUNCTION.format(body=body)


def _c_table(table: Table) -> str:
    box = ""
    for i, edges in enumerate(table.edges):
        box += f"box *= {len(edges) + 1};\n"
        for edge in edges:
            box += f"box += observation[{i}] > {_c_edge(edge)};\n"
    probabilities = _c_list(map(_c_number, table.probabilities))
    body = C_TABLE.format(probabilities=probabilities, box=box)
    return C_FUNCTION.format(body=textwrap.indent(body, "    "))


def _c_edge(edge: float) -> str:
    """Return an edge, for float rounded down: a float is above it if it is above the exact one."""
    below = np.float32(edge)
    if float(below) > edge:
        below = np.nextafter(below, np.float32(-math.inf))
    return f"UPRIGHT_CHOOSE({edge!r}, {float(below)!r}f)"


def _c_number(number: float) -> str:
    return f"UPRIGHT_C({number!r})"


def _c_list(values: Iterable[str]) -> str:
    return _c_lines([", ".join(values)], "    ", "    ")


def _c_lines(lines: list[str], first: str, further: str) -> str:
    wrapped = textwrap.TextWrapper(96, first, further, break_long_words=False)
    return "\n".join(wrapped.fill(line) for line in lines)


# ---------------------------------------------------------------------------------------- ONNX

OPSET, IR_VERSION = 13, 7
"""Of 2020, and all that is needed: old runtimes shall read it."""


def onnx_model(policy: Policy) -> bytes:
    """Return a policy as a graph in ONNX, checked by ONNX itself.

    Inputs and outputs are float32, a row for each cart-pole: `observation`, shape (batch, 4), gives
    `push_probability`, shape (batch, 1). A policy with a history also takes `history`, shape
    (batch, 5 past), zeros when a trial begins, and gives `next_history`. Within, numbers are
    float64: in float32 a probability may be off by some 1e-6, and a push near its border another.

    Raises
    ------
    UprightError
        If the policy's agent does not tell its form, or ONNX is not installed.
    """
    form, onnx = _form(policy), require_module("onnx", "this export needs ONNX", "onnx")
    graph = _Graph(onnx)
    if isinstance(form, Table):
        _add_table(graph, form)
    else:
        _add_network(graph, form)
    past = BLOCK * form.past if isinstance(form, Network) else 0
    inputs, outputs = {"observation": 4}, {"push_probability": 1}
    if past:
        inputs["history"] = outputs["next_history"] = past
    contract = policy.contract()
    model = onnx.helper.make_model(
        onnx.helper.make_graph(
            graph.nodes, "policy", _values(onnx, inputs), _values(onnx, outputs), graph.constants
        ),
        opset_imports=[onnx.helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="upright",
        producer_version=__version__,
        doc_string=describe(contract),
    )
    properties = {name: json.dumps(value) for name, value in contract.items()}
    onnx.helper.set_model_props(model, properties)
    onnx.checker.check_model(model, full_check=True)
    data: bytes = model.SerializeToString()
    return data


def _values(onnx: Any, widths: dict[str, int]) -> list[Any]:
    return [
        onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, ["batch", width])
        for name, width in widths.items()
    ]


class _Graph:
    """The nodes of a graph, and its constants."""

    def __init__(self, onnx: Any) -> None:
        self._onnx = onnx
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def add(self, operator: str, *inputs: str, name: str = "", **attributes: Any) -> str:
        """Add a node and return the name of its output."""
        name = name or f"{operator}_{len(self.nodes)}"
        self.nodes.append(self._onnx.helper.make_node(operator, inputs, [name], **attributes))
        return name

    def cast(self, value: str, kind: str, name: str = "") -> str:
        """Add a change of type, by its name in ONNX."""
        return self.add("Cast", value, name=name, to=getattr(self._onnx.TensorProto, kind))

    def constant(self, value: Any, kind: type = np.float64) -> str:
        """Add a constant and return its name."""
        name = f"constant_{len(self.constants)}"
        array: np.ndarray = np.array(value, kind)
        self.constants.append(self._onnx.numpy_helper.from_array(array, name))
        return name


def _add_network(graph: _Graph, network: Network) -> None:
    observation = graph.cast("observation", "DOUBLE")
    inputs, history = observation, ""
    if network.scales:
        inputs = graph.add("Div", observation, graph.constant(network.scales))
    if network.past:
        history = _add_history(graph, observation, network.past)
        inputs = graph.add("Concat", inputs, history, axis=1)
    for weights, unit in network.layers:
        inputs = _add_unit(graph, graph.add("MatMul", inputs, graph.constant(weights)), unit)
    graph.cast(inputs, "FLOAT", name="push_probability")
    if network.past:
        push = graph.add("Sub", graph.add("Add", inputs, inputs), graph.constant(1))
        longer = graph.add("Concat", push, observation, history, axis=1)
        kept = graph.constant(range(BLOCK * network.past), np.int64)
        graph.cast(graph.add("Gather", longer, kept, axis=1), "FLOAT", name="next_history")


def _add_history(graph: _Graph, observation: str, past: int) -> str:
    """Add the history; where a trial begins, as if it had always been like this."""
    history = graph.cast("history", "DOUBLE")
    push = graph.add("Gather", history, graph.constant([0], np.int64), axis=1)
    begins = _compare(graph, "Equal", push)
    blocks = np.tile(np.eye(4, BLOCK, 1), past)
    unchanged = graph.add("MatMul", observation, graph.constant(blocks))
    return graph.add("Where", begins, unchanged, history)


def _add_unit(graph: _Graph, total: str, unit: Unit) -> str:
    match unit:
        case "isrlu":
            one_more = graph.add("Add", graph.add("Mul", total, total), graph.constant(1))
            bent = graph.add("Div", total, graph.add("Sqrt", one_more))
            return graph.add("Where", _compare(graph, "Greater", total), total, bent)
        case "tanh":
            return graph.add("Tanh", total)
        case "sigmoid":
            return graph.add("Sigmoid", total)
        case "above zero":
            return graph.cast(_compare(graph, "Greater", total), "DOUBLE")
        case "not below zero":
            return graph.cast(_compare(graph, "GreaterOrEqual", total), "DOUBLE")


def _compare(graph: _Graph, operator: str, value: str) -> str:
    """Add a comparison of a value with zero."""
    return graph.add(operator, value, graph.constant(0))


def _add_table(graph: _Graph, table: Table) -> None:
    parts = [len(edges) + 1 for edges in table.edges]
    columns = [i for i, edges in enumerate(table.edges) for _ in edges]
    strides = np.array([[math.prod(parts[i + 1 :])] for i in range(4)])
    observation = graph.cast("observation", "DOUBLE")
    values = graph.add("Gather", observation, graph.constant(columns, np.int64), axis=1)
    edges = graph.constant(np.concatenate(table.edges))
    above = graph.cast(graph.add("Greater", values, edges), "DOUBLE")
    box = graph.add("MatMul", above, graph.constant(strides[columns]))
    probabilities = graph.constant(table.probabilities, np.float32)
    graph.add("Gather", probabilities, graph.cast(box, "INT64"), name="push_probability")


# ---------------------------------------------------------------------------------------- JSON


def json_form(policy: Policy) -> str:
    """Return a policy as JSON, an entry a line; `load_policy` and other languages read it.

    Raises
    ------
    UprightError
        If the policy's agent does not tell its form, or the form is beyond what is read.
    """
    entries = {"format": JSON_FORMAT, **policy.contract(), **form_entries(_form(policy))}
    lines = (f"  {json.dumps(name)}: {json.dumps(value)}" for name, value in entries.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


WRITERS: dict[str, Callable[[Policy], str | bytes]] = {
    ".h": c_header,
    ".onnx": onnx_model,
    ".json": json_form,
}
"""What each ending stands for."""
