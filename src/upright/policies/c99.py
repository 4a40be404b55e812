"""Policies as a C99 header: one function, no allocation, float64 or float32."""

import math
import textwrap
from collections.abc import Iterable

import numpy as np

from upright import __version__
from upright.agents.parts.history import BLOCK
from upright.agents.parts.policy_form import Network, Table, Unit
from upright.policies.policy import Policy, describe, form_of

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
/* Return {returned}. */
static inline {kind} {name}(const upright_real observation[4])
{{
{body}
}}
"""

C_FUNCTION_WITH_HISTORY = """\
#define UPRIGHT_HISTORY {numbers}

/*
 * Return {returned}.
 * That push is taken as made, and entered into the history.
 * The history is the caller's: all zeros when a trial begins, then left alone.
 */
static inline {kind} {name}(
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
static const {kind} {outputs}[] = {{
{numbers}
}};
int box = 0;
{box}return {outputs}[box];"""


def encode(policy: Policy) -> str:
    """Return a policy as a C99 header: one function, no allocation.

    The same header serves float64 and float32. That of a greedy policy defines `upright_push_right`
    in place of `upright_push_probability`.

    Raises
    ------
    UprightError
        If the policy's agent does not provide its form.
    """
    form = form_of(policy)
    function = (
        _c_table(form, greedy=policy.greedy)
        if isinstance(form, Table)
        else _c_network(form, greedy=policy.greedy)
    )
    return C_HEADER.format(
        agent=policy.agent,
        version=__version__,
        contract=_c_comment(describe(policy.contract())),
        function=function,
    )


def _c_network(network: Network, *, greedy: bool) -> str:
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
    body = textwrap.indent(f"{body}return {output}{' > 0' if greedy else ''};", "    ")
    if network.past:
        head = _c_head(greedy, "0 or 1")
        return C_FUNCTION_WITH_HISTORY.format(numbers=numbers, block=BLOCK, body=body, **head)
    return C_FUNCTION.format(body=body, **_c_head(greedy))


def _c_head(greedy: bool, values: str = "0 to 1") -> dict[str, str]:
    """Return the name and the type of the function, and what it returns."""
    if greedy:
        returned = "1 to push to the right (+F), 0 to push to the left (-F)"
        return {"name": "upright_push_right", "kind": "int", "returned": returned}
    returned = f"the probability of a push to the right: {values}"
    return {"name": "upright_push_probability", "kind": "upright_real", "returned": returned}


def _c_table(table: Table, *, greedy: bool) -> str:
    box = ""
    for i, edges in enumerate(table.edges):
        box += f"box *= {len(edges) + 1};\n"
        for edge in edges:
            box += f"box += observation[{i}] > {_c_edge(edge)};\n"
    if greedy:
        kind, outputs = "unsigned char", "pushes"
        numbers = _c_list(f"{push:.0f}" for push in table.probabilities)
    else:
        kind, outputs = "upright_real", "probabilities"
        numbers = _c_list(map(_c_number, table.probabilities))
    body = C_TABLE.format(kind=kind, outputs=outputs, numbers=numbers, box=box)
    return C_FUNCTION.format(body=textwrap.indent(body, "    "), **_c_head(greedy))


def _c_edge(edge: float) -> str:
    """Return an edge; for float rounded down, so that the same floats are above it."""
    below = np.float32(edge)
    if float(below) > edge:
        below = np.nextafter(below, np.float32(-math.inf))
    return f"UPRIGHT_CHOOSE({edge!r}, {float(below)!r}f)"


def _c_number(number: float) -> str:
    return f"UPRIGHT_C({number!r})"


def _c_list(values: Iterable[str]) -> str:
    return _c_lines([", ".join(values)], "    ", "    ")


def _c_comment(text: str) -> str:
    r"""Return JSON for use within a comment; \u002f stands for a slash that would end it."""
    text = text.replace("*/", "*\\u002f").replace("/*", "\\u002f*")
    return _c_lines(text.splitlines(), " * ", " *     ")


def _c_lines(lines: list[str], first: str, further: str) -> str:
    wrapped = textwrap.TextWrapper(96, first, further, break_long_words=False)
    return "\n".join(wrapped.fill(line) for line in lines)
