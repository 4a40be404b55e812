"""Greedy policies: the more probable push at each step, without a random number.

Where both pushes are equally probable, a greedy policy pushes to the left.
"""

import numpy as np

from upright.agents.parts.policy_form import Form, Table

GREEDY_ACTION = (
    "push to the right (+F) if the policy returns 1, to the left (-F) if it returns 0; no random "
    "number is needed"
)
"""How a greedy policy's output is used."""


def greedy_form(form: Form) -> Form:
    """Return the form that puts out 1 where the probability of a push to the right is above ½.

    Elsewhere it puts out 0.
    """
    if isinstance(form, Table):
        pushes = np.array(form.probabilities) > 0.5
        return form._replace(probabilities=tuple(pushes.astype(float).tolist()))
    *hidden, last = form.layers
    if last.unit == "sigmoid":  # above ½ where its sum is above 0
        last = last._replace(unit="above zero")
    return form._replace(layers=(*hidden, last))
