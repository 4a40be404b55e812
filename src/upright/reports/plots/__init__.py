"""Pictures of learning and of learned policies, drawn with Matplotlib."""

from upright.reports.names import case_name as name
from upright.reports.plots.curves import plot_curve, plot_curves
from upright.reports.plots.distributions import plot_trials
from upright.reports.plots.phases import plot_phases, trajectory
from upright.reports.plots.policies import plot_policies
from upright.reports.plots.style import FORMATS, Learned, check_picture, save
from upright.reports.plots.sweep import plot_sweep

__all__ = [
    "FORMATS",
    "Learned",
    "check_picture",
    "name",
    "plot_curve",
    "plot_curves",
    "plot_phases",
    "plot_policies",
    "plot_sweep",
    "plot_trials",
    "save",
    "trajectory",
]
