"""Policies as ONNX graphs."""

import json
import math
from typing import Any

import numpy as np

from upright import __version__
from upright.agents.parts.history import BLOCK
from upright.agents.parts.policy_form import Network, Table, Unit
from upright.errors import require_module
from upright.policies.policy import Policy, describe, form_of

OPSET, IR_VERSION = 13, 7
"""Versions of 2020, which suffice and which old runtimes can read too."""


PROBABILITY, PUSH = "push_probability", "push_right"
"""The output of a policy, float32, and that of a greedy one, int64."""


def encode(policy: Policy) -> bytes:
    """Return a policy as an ONNX graph, checked by ONNX itself.

    Inputs and outputs are float32, one row a cart-pole: from `observation`, shape (batch, 4), the
    graph computes `push_probability`, shape (batch, 1). A policy with a history also takes
    `history`, shape (batch, 5 past), zeros when a trial begins, and returns `next_history`. A
    greedy policy returns `push_right`, int64, 1 or 0, in place of the probability. Inside, numbers
    are float64: in float32 a probability might be off by some 1e-6, and a push near the threshold
    might differ.

    Raises
    ------
    UprightError
        If the policy's agent does not provide its form, or ONNX is not installed.
    """
    form, onnx = form_of(policy), require_module("onnx", "this export needs ONNX", "onnx")
    graph = _Graph(onnx)
    output = PUSH if policy.greedy else PROBABILITY
    if isinstance(form, Table):
        _add_table(graph, form, output)
    else:
        _add_network(graph, form, output)
    past = BLOCK * form.past if isinstance(form, Network) else 0
    inputs, outputs = {"observation": 4}, {output: 1}
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
    kinds = {PUSH: onnx.TensorProto.INT64}
    return [
        onnx.helper.make_tensor_value_info(
            name, kinds.get(name, onnx.TensorProto.FLOAT), ["batch", width]
        )
        for name, width in widths.items()
    ]


class _Graph:
    """The nodes and the constants of a graph."""

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
        """Add a conversion to a type, given its name in ONNX, and return the name of its output."""
        return self.add("Cast", value, name=name, to=getattr(self._onnx.TensorProto, kind))

    def constant(self, value: Any, kind: type = np.float64) -> str:
        """Add a constant and return its name."""
        name = f"constant_{len(self.constants)}"
        array: np.ndarray = np.array(value, kind)
        self.constants.append(self._onnx.numpy_helper.from_array(array, name))
        return name


def _add_network(graph: _Graph, network: Network, output: str) -> None:
    observation = graph.cast("observation", "DOUBLE")
    inputs, history = observation, ""
    if network.scales:
        inputs = graph.add("Div", observation, graph.constant(network.scales))
    if network.past:
        history = _add_history(graph, observation, network.past)
        inputs = graph.add("Concat", inputs, history, axis=1)
    for weights, unit in network.layers:
        inputs = _add_unit(graph, graph.add("MatMul", inputs, graph.constant(weights)), unit)
    graph.cast(inputs, "INT64" if output == PUSH else "FLOAT", name=output)
    if network.past:
        push = graph.add("Sub", graph.add("Add", inputs, inputs), graph.constant(1))
        longer = graph.add("Concat", push, observation, history, axis=1)
        kept = graph.constant(range(BLOCK * network.past), np.int64)
        graph.cast(graph.add("Gather", longer, kept, axis=1), "FLOAT", name="next_history")


def _add_history(graph: _Graph, observation: str, past: int) -> str:
    """Add the history; when a trial begins, as if the past had been like the present."""
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
    """Add a comparison of a value with zero and return the name of its output."""
    return graph.add(operator, value, graph.constant(0))


def _add_table(graph: _Graph, table: Table, output: str) -> None:
    parts = [len(edges) + 1 for edges in table.edges]
    columns = [i for i, edges in enumerate(table.edges) for _ in edges]
    strides = np.array([[math.prod(parts[i + 1 :])] for i in range(4)])
    observation = graph.cast("observation", "DOUBLE")
    values = graph.add("Gather", observation, graph.constant(columns, np.int64), axis=1)
    edges = graph.constant(np.concatenate(table.edges))
    above = graph.cast(graph.add("Greater", values, edges), "DOUBLE")
    box = graph.add("MatMul", above, graph.constant(strides[columns]))
    results = graph.constant(table.probabilities, np.int64 if output == PUSH else np.float32)
    graph.add("Gather", results, graph.cast(box, "INT64"), name=output)
