"""Maps of policies: to which side a policy pushes in which state."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from upright.agents.parts.policy_form import Table
from upright.core.parameters import Parameters, State
from upright.policies.policy import Policy
from upright.reports.names import agent_name, noise_name
from upright.reports.plots.style import INK, WIDTH, entitle, mark_limits, styled

CELLS = 200
"""Number of cells along each side of a map."""
COLOURS = ListedColormap(colormaps["RdBu_r"](np.linspace(0.1, 0.9, 256)))
"""From left, blue, by white, where both sides are as likely, to right, red."""


class Plane(NamedTuple):
    """Two of the four measurements; the other two are zero."""

    across: int
    """Which measurement lies on the horizontal axis, counted from 0."""
    limit: float
    """Where a trial ends [SI units]."""
    fastest: float
    """Where the vertical axis ends, which shows the velocity of the same body [SI units]."""
    unit: float
    """How many of the units shown a unit of SI is."""
    labels: tuple[str, str]
    """Of the two axes."""

    def state(self, position: float, velocity: float) -> State:
        """Return a state in this plane."""
        values = [0.0, 0.0, 0.0, 0.0]
        values[self.across : self.across + 2] = position, velocity
        return State(*values)


def planes(parameters: Parameters) -> tuple[Plane, Plane]:
    """Return the plane of the pole, with the cart at rest, and that of the cart."""
    pole = ("angle of the pole [°]", "angular velocity [°/s]")
    cart = ("position of the cart [m]", "velocity [m/s]")
    degrees = 180 / np.pi
    return (
        Plane(2, parameters.angle_limit, 10 * parameters.angle_limit, degrees, pole),
        Plane(0, parameters.position_limit, parameters.position_limit, 1.0, cart),
    )


@styled()
def plot_policies(policies: Sequence[Policy]) -> Figure:
    """Draw the probability of a push to the right: a column a policy.

    Above, against angle and angular velocity of the pole, with the cart at rest in the middle of
    its track; below, against position and velocity of the cart, with the pole upright and at rest.
    Nothing is interpolated: a table is drawn box by box, other policies in fine cells. A line is
    where both sides are equally likely.
    """
    width = max(min(WIDTH, 1.6 + 3.2 * len(policies)), 1.4 + 2.4 * len(policies))
    figure = Figure((width, 6.4), layout="constrained")
    grid = figure.subplots(2, len(policies), sharey="row", squeeze=False)
    for column, policy in zip(grid.T, policies, strict=True):
        for axes, plane in zip(column, planes(policy.learned_on.parameters), strict=True):
            image = _draw_map(axes, policy, plane)
        title = f"{agent_name(policy.agent)}, {noise_name(policy.learned_on.noise)}"
        learned = f"seed {policy.seed}, run {policy.run}"
        entitle(column[0], title, [learned, "cart at rest in the middle"], beside=1.6)
        entitle(column[1], "", ["pole upright and at rest"])
    for row, plane in zip(grid, planes(Parameters()), strict=True):
        row[0].set_ylabel(plane.labels[1])
    bar = figure.colorbar(image, ax=grid, label="probability of a push to the right", aspect=40)
    bar.set_ticks([0, 0.25, 0.5, 0.75, 1], labels=["0  left", "0.25", "0.5", "0.75", "1  right"])
    return figure


def policy_map(policy: Policy, plane: Plane) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the edges of the cells of a map, across and up, and the probabilities in the cells.

    Returns
    -------
    tuple
        Edges in SI units, and probabilities of a push to the right, shape (cells up, cells across).
        The cells of a table are its boxes, so that nothing lies between them.
    """
    ends = (plane.limit, plane.fastest)
    form = policy.form
    if isinstance(form, Table):
        cuts = form.edges[plane.across : plane.across + 2]
        across, up = (
            np.array([-end, *(cut for cut in own if abs(cut) < end), end])
            for end, own in zip(ends, cuts, strict=True)
        )
    else:
        across, up = (np.linspace(-end, end, CELLS + 1) for end in ends)
    middles = [(edges[1:] + edges[:-1]) / 2 for edges in (across, up)]
    pushes = [
        [policy.push_probability(plane.state(x, x_dot)) for x in middles[0]] for x_dot in middles[1]
    ]
    return across, up, np.array(pushes)


def _draw_map(axes: Axes, policy: Policy, plane: Plane) -> QuadMesh:
    across, up, pushes = policy_map(policy, plane)
    across, up = across * plane.unit, up * plane.unit
    is_table = isinstance(policy.form, Table)
    image = axes.pcolormesh(across, up, pushes, cmap=COLOURS, vmin=0, vmax=1)
    image.set_rasterized(not is_table)  # many cells would make a vector file huge
    if is_table:
        axes.add_collection(LineCollection(boundary(across, up, pushes), colors=INK, lw=0.9))
    elif pushes.min() < 0.5 < pushes.max():
        middles = [(edges[1:] + edges[:-1]) / 2 for edges in (across, up)]
        axes.contour(*middles, pushes, [0.5], colors=INK, linewidths=0.9)
    limit = plane.limit * plane.unit
    axes.set(xlim=(-1.12 * limit, 1.12 * limit), ylim=(up[0], up[-1]), xlabel=plane.labels[0])
    axes.set_xticks(np.linspace(-limit, limit, 5))
    mark_limits(axes, limit)
    axes.grid(visible=False)
    return image


def boundary(across: np.ndarray, up: np.ndarray, pushes: np.ndarray) -> list[Any]:
    """Return the edges between cells that push to different sides, each as its two ends."""
    side = np.sign(pushes - 0.5)
    rows, columns = np.nonzero(side[:, 1:] * side[:, :-1] < 0)
    upright = [
        [(across[column + 1], up[row]), (across[column + 1], up[row + 1])]
        for row, column in zip(rows, columns, strict=True)
    ]
    rows, columns = np.nonzero(side[1:] * side[:-1] < 0)
    level = [
        [(across[column], up[row + 1]), (across[column + 1], up[row + 1])]
        for row, column in zip(rows, columns, strict=True)
    ]
    return upright + level
