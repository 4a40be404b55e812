"""Phase portraits: how cart and pole move while a policy balances."""

from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from upright.core.contracts import Plant
from upright.core.task import Task
from upright.plants.equations import equations
from upright.policies.policy import Policy
from upright.reports.names import agent_name, noise_name
from upright.reports.plots.style import INK, WIDTH, entitle, in_lines, mark_limits, styled
from upright.studies.playing import case_for, record
from upright.studies.run import make_plant

PORTRAIT_STEPS = 500
"""Number of steps in a phase portrait: 10 seconds."""
WINDOW = 17
"""Number of steps around each state that a portrait is smoothed over."""
ARROWS = 12
"""Number of arrows along a portrait."""
ZOOM = 0.2
"""Portraits that stay within this part of the limits are enlarged."""
PALE = "#c4c4c4"
COLOURS = ListedColormap(colormaps["viridis_r"](np.linspace(0.12, 1, 256)))
"""Of time, without the yellow end, which is hard to see on white."""


def trajectory(policy: Policy, task: Task, seed: int = 0, plant: Plant | None = None) -> np.ndarray:
    """Play a policy for one trial, and return all states, shape (steps + 1, 4).

    The plant is the equations unless another is given, as for a task that changes it.
    """
    plant = plant or equations(task.parameters)
    moments, _ = record(policy, plant, task, np.random.default_rng(seed))
    return np.array([moment.state for moment in moments])


def smoothed(states: np.ndarray) -> np.ndarray:
    """Return states without the zigzag of single pushes: by a parabola fitted around each state.

    Unlike a running average, a parabola keeps the height of peaks (A. Savitzky, M. Golay, Anal.
    Chem. 36, 1964).

    Parameters
    ----------
    states
        Shape (number, values).
    """
    from scipy.signal import savgol_filter

    half = WINDOW // 2
    # Mirrored at its two ends, so that the smooth path has the same ends.
    longer = np.pad(states, ((half, half), (0, 0)), mode="reflect", reflect_type="odd")
    return np.asarray(savgol_filter(longer, WINDOW, 2, axis=0)[half:-half])


def arrow_places(points: np.ndarray, count: int = ARROWS) -> list[int]:
    """Return where to draw arrows: indices of points at equal distances along their path."""
    spread = np.ptp(points, axis=0)
    scaled = points / np.where(spread > 0, spread, 1)
    along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(scaled, axis=0).T))])
    goals = (np.arange(count) + 0.5) / count * along[-1]
    places = np.searchsorted(along, goals, side="right") - 1
    return sorted({int(place) for place in places if place < len(points) - 1})


class Body(NamedTuple):
    """What a portrait shows: the cart or the pole."""

    title: str
    column: int
    """Which value of a state is its position; the next is its velocity."""
    limit: float
    """Where a trial ends, in the units shown."""
    unit: float
    """How many of the units shown a unit of SI is."""
    symbol: str
    """Of the unit shown."""
    labels: tuple[str, str]
    """Of the two axes."""


@styled()
def plot_phases(policy: Policy) -> Figure:
    """Draw the phase portraits of cart and pole over some seconds of balancing with a policy.

    A push changes the velocities by a jerk in every step, so that the states themselves, drawn thin
    and pale, zigzag. The coloured line is their average over some steps around each moment, with
    arrows in the direction of motion.
    """
    case = case_for(policy, steps=PORTRAIT_STEPS)
    plant, task = make_plant(case, policy.seed, policy.run, np.zeros(1, np.bool_))
    states = trajectory(policy, task, plant=plant)
    step, parameters = task.parameters.time_step, task.parameters
    seconds = np.arange(len(states)) * step
    position, angle = parameters.position_limit, np.degrees(parameters.angle_limit)
    bodies = (
        Body("Cart", 0, position, 1.0, "m", ("position [m]", "velocity [m/s]")),
        Body("Pole", 2, angle, 180 / np.pi, "°", ("angle [°]", "angular velocity [°/s]")),
    )
    figure = Figure((WIDTH, 4.4), layout="constrained")
    panels = figure.subplots(1, 2)
    for axes, body in zip(panels, bodies, strict=True):
        line = _draw_portrait(axes, states, seconds, body)
    figure.colorbar(line, ax=list(panels), label="time [s]", pad=0.02, aspect=30)
    title = f"{agent_name(policy.agent)}, {noise_name(policy.learned_on.noise)}"
    ending = "balanced for" if len(states) > task.steps else "fallen after"
    title = in_lines(f"{title}: {ending} {seconds[-1]:.3g} s", int(WIDTH / 0.09))
    figure.suptitle(title, x=0.01, ha="left")
    learned = f"policy of seed {policy.seed}, run {policy.run}"
    for axes, body, note in zip(panels, bodies, (learned, ""), strict=True):
        limits = f"limits ±{body.limit:.3g} {body.symbol}".replace(" °", "°")
        entitle(axes, body.title, ["; ".join(filter(None, (limits, note)))])
    handles, labels = panels[1].get_legend_handles_labels()
    handles.append(Line2D([], [], color=COLOURS(0.5)))
    labels.append(f"smoothed over {WINDOW} steps ({WINDOW * step:.2g} s)")
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def _draw_portrait(
    axes: Axes, states: np.ndarray, seconds: np.ndarray, body: Body
) -> LineCollection:
    points = states[:, body.column : body.column + 2] * body.unit
    smooth = smoothed(points)
    axes.plot(*points.T, color=PALE, lw=0.5, zorder=1, label="every step")
    pieces = list(np.stack([smooth[:-1], smooth[1:]], axis=1))
    line = LineCollection(pieces, cmap=COLOURS, lw=1.6, capstyle="round")
    line.set_array(seconds[:-1])
    line.set_clim(0, seconds[-1])
    axes.add_collection(line)
    shape = {"arrowstyle": "-|>", "color": INK, "lw": 0, "mutation_scale": 11}
    for index in arrow_places(smooth):
        tail, head = smooth[max(0, index - 2)], smooth[index + 1]
        axes.annotate("", head, tail, arrowprops={**shape, "shrinkA": 0, "shrinkB": 0})
    axes.plot(*points[0], "o", color="white", mec=INK, ms=7, label="start", zorder=5)
    axes.plot(*points[-1], "s", color=INK, ms=6, label="end", zorder=5)
    widest, fastest = np.abs(points).max(axis=0)
    width = 1.12 * body.limit if widest > ZOOM * body.limit else 1.25 * widest
    axes.set(xlim=(-width, width), ylim=(-1.1 * fastest, 1.1 * fastest))
    axes.set(xlabel=body.labels[0], ylabel=body.labels[1])
    mark_limits(axes, body.limit)
    return line
