"""Simulate a cart-pole until interrupted."""

import argparse

from upright.commands.parser import Parser
from upright.commands.ros2.fields import add_fields, add_ros_arguments, given, ros_arguments
from upright.nodes.settings import SimulatorSettings

EXAMPLES = """\
examples:
  upright ros2 simulate --plant mujoco --noise gaussian-0.1
  upright ros2 simulate --no-lock-step   by the wall clock, as a real cart
ROS arguments may follow --ros-args, such as --ros-args -r effort:=/cart/effort.
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright ros2 simulate`."""
    add_fields(parser, SimulatorSettings)
    add_ros_arguments(parser)


def run(options: argparse.Namespace) -> int:
    """Carry out `upright ros2 simulate`."""
    from upright.plants.ros2.plant import require_rclpy

    require_rclpy()
    from upright.nodes import simulator

    return simulator.main(given(options, SimulatorSettings), ros_arguments(options))
