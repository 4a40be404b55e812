"""Plots of learning and of learned policies."""

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from upright.core.parameters import State
from upright.core.task import Task
from upright.core.trials import Result
from upright.errors import require_one_of
from upright.plants.equations import equations
from upright.policies.policy import Policy
from upright.reports.published import REPORT, SI_AND_WANG, figures
from upright.studies.case import Case
from upright.studies.playing import case_for, record
from upright.support.files import check_output, write_file

Learned = list[tuple[Case, list[Result]]]
"""Cases with the results of their runs."""

COLOURS = {
    "adaptive-lqr": "#2a8f4f",
    "reinforce": "#1f6fb4",
    "ndp": "#8a4fb0",
    "q-learning": "#d1701f",
    "ase-ace": "#a8862a",
    "random-search": "#7a7a7a",
}
OTHER = "#c2447a"
"""Colour of custom agents, which can be told apart only by name."""
PUBLISHED_STYLES = {REPORT: ":", SI_AND_WANG: "-."}
"""Sources whose published means are drawn, with the line style of each."""
FORMATS = (".png", ".pdf", ".svg")
"""Endings of picture files."""
GRID = 81
"""Number of points along each side of a policy map."""
PORTRAIT_STEPS = 1_000
"""Number of steps in a phase portrait: 20 seconds."""


def check_picture(path: Path | str) -> Path:
    """Return the path of a picture to be written later, after checking that it can be written.

    Raises
    ------
    UprightError
        If its ending is not one of the FORMATS, or it cannot be written.
    """
    require_one_of(f"the ending of {str(path)!r}", Path(path).suffix, FORMATS)
    return check_output(path)


def save(figure: Figure, path: Path | str) -> None:
    """Write a figure to a file, whose ending selects the format.

    Raises
    ------
    UprightError
        As for `check_picture`.
    """
    check_picture(path)
    output = io.BytesIO()
    figure.savefig(output, format=Path(path).suffix[1:], dpi=130)
    write_file(path, output.getvalue())


def name(case: Case) -> str:
    """Return the name of a case's agent and settings, for a legend."""
    return case.name if case.label == "default" else f"{case.name}, {case.label}"


def _style(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)


def plot_curve(lengths: np.ndarray, steps: int, title: str) -> Figure:
    """Draw the learning curve of one run: the length of each trial."""
    figure = Figure((7, 4), layout="constrained")
    axes = figure.subplots()
    axes.plot(np.arange(1, len(lengths) + 1), lengths, "o-", markersize=4, color="#1f6fb4")
    axes.axhline(steps, color="#2a8f4f", linestyle="--", label=f"success: {steps:,} steps")
    axes.set(title=title, xlabel="trial", ylabel="steps before the fall", yscale="log")
    axes.legend()
    _style(axes)
    return figure


def plot_curves(learned: Learned) -> Figure:
    """Draw the learning curves of studies: thin lines for runs, a thick one for their median.

    In the median, a run that has succeeded counts with N steps in all later trials.
    """
    figure = Figure((4.6 * len(learned), 4.2), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(learned), sharex=True, sharey=True))
    for axes, (case, results) in zip(panels, learned, strict=True):
        colour = COLOURS.get(case.agent, OTHER)
        longest = max((result.trials for result in results), default=1)
        filled = np.full((len(results), longest), np.nan)
        for row, result in zip(filled, results, strict=True):
            row[: result.trials] = result.lengths
            row[result.trials :] = case.spec.steps if result.success else np.nan
            trials = np.arange(1, result.trials + 1)
            axes.plot(trials, result.lengths, ".-", color=colour, alpha=0.3, lw=0.8, markersize=3)
        median = np.median(filled, axis=0)
        counts = np.arange(1, longest + 1)
        axes.plot(counts, median, ".-", color="black", lw=2, label="median run")
        axes.axhline(
            case.spec.steps, color="#2a8f4f", linestyle="--", label=f"{case.spec.steps:,} steps"
        )
        axes.set(
            title=f"{name(case)} ({case.spec.noise})", xlabel="trial", xscale="log", yscale="log"
        )
        axes.legend(loc="lower right")
        _style(axes)
    panels[0].set_ylabel("steps before the fall")
    return figure


def plot_trials(learned: Learned) -> Figure:
    """Draw, for each noise case, the fraction of runs that succeeded within a number of trials."""
    noises = list(dict.fromkeys(case.spec.noise for case, _ in learned))
    columns = min(4, len(noises) + 1)
    rows = -(-(len(noises) + 1) // columns)
    figure = Figure((3.6 * columns, 3.2 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, noise in zip(panels, noises, strict=False):
        for case, results in learned:
            if case.spec.noise == noise:
                _plot_distribution(axes, case, results)
        for source, mean in figures("reinforce", noise).items():
            if source in PUBLISHED_STYLES:
                style, label = PUBLISHED_STYLES[source], f"{source} (mean)"
                axes.axvline(mean, color="#b02a5b", linestyle=style, lw=1.2, label=label)
        axes.set(title=noise, xscale="log", ylim=(0, 1.03))
        _style(axes)
    for axes in panels[len(noises) :]:
        axes.axis("off")
    handles, labels = panels[0].get_legend_handles_labels()
    panels[len(noises)].legend(handles, labels, loc="center", frameon=False)
    figure.supxlabel("trials")
    figure.supylabel("fraction of runs that succeeded")
    return figure


def _plot_distribution(axes: Axes, case: Case, results: Sequence[Result]) -> None:
    trials = np.sort([result.trials for result in results if result.success])
    fractions = np.arange(1, len(trials) + 1) / max(1, len(results))
    axes.step(
        [1, *trials, case.spec.trials],
        [0, *fractions, fractions[-1] if len(fractions) else 0],
        where="post",
        label=name(case),
        color=COLOURS.get(case.agent),
        linestyle="-" if case.label == "default" else "--",
    )


def plot_policies(policies: Sequence[Policy]) -> Figure:
    """Draw the probability of a push to the right against the pole's angle and angular velocity.

    The cart is at rest in the middle of its track.
    """
    figure = Figure((4.6 * len(policies) + 0.8, 4.2), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(policies), sharey=True))
    angles = np.radians(np.linspace(-12, 12, GRID))
    velocities = np.radians(np.linspace(-120, 120, GRID))
    for axes, policy in zip(panels, policies, strict=True):
        pushes = [
            [policy.push_probability(State(0.0, 0.0, theta, theta_dot)) for theta in angles]
            for theta_dot in velocities
        ]
        image = axes.pcolormesh(
            np.degrees(angles), np.degrees(velocities), pushes, cmap="RdBu_r", vmin=0, vmax=1
        )
        axes.set(title=f"{policy.agent} ({policy.task['noise']})", xlabel="pole angle [°]")
    panels[0].set_ylabel("angular velocity of the pole [°/s]")
    figure.colorbar(image, ax=list(panels), label="probability of a push to the right")
    return figure


def trajectory(policy: Policy, task: Task, seed: int = 0) -> np.ndarray:
    """Play a policy for one trial, and return all states, shape (steps + 1, 4)."""
    plant = equations(task.parameters)
    scenes, _ = record(policy, plant, task, np.random.default_rng(seed))
    return np.array([scene.state for scene in scenes])


def plot_phases(policy: Policy) -> Figure:
    """Draw the phase portraits of cart and pole over some seconds of balancing with a policy."""
    task = case_for(policy, steps=PORTRAIT_STEPS).spec.task()
    states = trajectory(policy, task)
    seconds = np.arange(len(states)) * task.parameters.time_step
    figure = Figure((9.4, 4.2), layout="constrained")
    cart, pole = figure.subplots(1, 2)
    for axes, columns, unit in ((cart, (0, 1), 1.0), (pole, (2, 3), 180 / np.pi)):
        points = states[:, columns] * unit
        axes.plot(*points.T, color="black", lw=0.3, alpha=0.5)
        image = axes.scatter(*points.T, c=seconds, s=4, cmap="viridis")
        axes.plot(*points[0], "o", color="#d1701f", markersize=8, label="start")
        axes.legend()
        _style(axes)
    cart.set(title="cart", xlabel="position [m]", ylabel="velocity [m/s]")
    pole.set(title="pole", xlabel="angle [°]", ylabel="angular velocity [°/s]")
    figure.colorbar(image, ax=[cart, pole], label="time [s]")
    figure.suptitle(f"{policy.agent}, {policy.task['noise']}: {seconds[-1]:.0f} s of balance")
    return figure
