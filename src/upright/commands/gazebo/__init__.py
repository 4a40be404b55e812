"""Install, check and view the robot simulator Gazebo 11."""

from typing import Any

from upright.support.registry import Registry

SUBCOMMANDS: Registry[Any] = Registry(
    "command",
    {
        "install": "upright.commands.gazebo.install",
        "doctor": "upright.commands.gazebo.doctor",
        "view": "upright.commands.gazebo.view",
    },
)
"""The commands below this one."""

EXAMPLES = """\
examples:
  upright gazebo install                 install Gazebo 11 and build the plugin that steps it
  upright gazebo doctor                  report what is installed, and what is missing
  upright learn reinforce --plant gazebo
  upright gazebo view policy.npz         in Gazebo's own window
"""
