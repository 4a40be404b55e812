"""The columns of runs and trials as data: their names, kinds and meanings. Data only.

Frames of pandas and files of `upright show --each` have these columns, and docs/data.md shows them.
"""

from typing import NamedTuple

from upright.core.parameters import Parameters
from upright.support.settings import describe_settings

KINDS = {
    "text": "category",
    "truth": "bool",
    "integer": "int64",
    "number": "float64",
    "time": "datetime64[us, UTC]",
}
"""Kinds of values, and the data type of each in a frame."""


class Column(NamedTuple):
    """A column of a table of runs or trials."""

    kind: str
    """One of KINDS."""
    text: str
    """What it holds, with its unit."""


IDENTITY = {
    "case": Column(
        "integer",
        "Number of the case in its store: an agent with its settings on a task. The same agent has "
        "another number once its code, or the code of the plant, has changed.",
    ),
    "agent": Column("text", "Name of the agent."),
    "settings": Column("text", "Name of the agent's settings, and those that were changed."),
    "noise": Column("text", "Noise case."),
    "start": Column("text", "Where trials start."),
    "condition": Column("text", "What else differs from the published task."),
    "max_steps": Column("integer", "N: a trial that lasts this many steps succeeds [steps]."),
    "max_trials": Column("integer", "A run ends after at most this many trials."),
    **{name: Column("number", text) for name, text in describe_settings(Parameters).items()},
    "plant": Column("text", "Name of the plant."),
    "plant_settings": Column("text", "Name of the plant's settings, and those that were changed."),
    "language": Column("text", "Language that made the run: Python or MATLAB."),
    "seed": Column("integer", "Seed of the study."),
    "run": Column("integer", "Number of the run within its case and seed, from 0."),
}
"""Columns that say which run it is; a row for a trial has them too."""
RESULT = {
    "success": Column("truth", "Whether its last trial lasted N steps."),
    "trials": Column("integer", "Number of its trials; the successful one counts."),
    "steps": Column("integer", "Steps of all its trials together [steps]."),
    "longest_trial": Column("integer", "Length of its longest trial [steps]."),
    "seconds": Column("number", "Computing time [s]."),
}
"""Columns of what came out of a run."""
ORIGIN = {
    "ended": Column("time", "When the run ended (UTC)."),
    "version": Column("text", "Version of Upright that made the run; unknown up to 0.2."),
    "environment": Column(
        "integer",
        "Number, in its store, of the environment that made the run (upright show --each "
        "environment); 0 if it was not recorded.",
    ),
}
"""Columns of when and with what a run was made, which stores know."""
TRIAL = {
    "trial": Column("integer", "Number of the trial within its run, from 1."),
    "steps": Column("integer", "How long it lasted [steps]."),
    "fallen": Column("truth", "Whether it ended in a fall; if not, it succeeded."),
}
"""Columns of a trial."""
COLUMNS = {"run": IDENTITY | RESULT | ORIGIN, "trial": IDENTITY | TRIAL}
"""All columns of a table with a row for each run, or for each trial, in order."""
