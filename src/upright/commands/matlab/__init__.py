"""Run the MATLAB twin in GNU Octave or MATLAB.

It is Q-learning and REINFORCE in MATLAB code; docs/matlab.md is its manual.
"""

from typing import Any

from upright.support.registry import Registry

SUBCOMMANDS: Registry[Any] = Registry(
    "command",
    {
        "table": "upright.commands.matlab.table",
        "path": "upright.commands.matlab.path",
    },
)
"""The commands below this one."""

EXAMPLES = """\
examples:
  upright matlab table --runs 100        the seven noise cases, learned in MATLAB code
  upright matlab path                    the folder to add to MATLAB's or Octave's path
"""
