"""Simulate a cart on ROS 2's topics, balance one, or record what passes.

The learner balances any cart that has these topics; docs/ros2.md describes them.
"""

from typing import Any

from upright.support.registry import Registry

SUBCOMMANDS: Registry[Any] = Registry(
    "command",
    {
        "simulate": "upright.commands.ros2.simulate",
        "learn": "upright.commands.ros2.learn",
        "demo": "upright.commands.ros2.demo",
        "record": "upright.commands.ros2.record",
    },
)
"""The commands below this one."""

EXAMPLES = """\
examples:
  upright ros2 demo                      both sides at once: watch it learn
  upright ros2 simulate                  a cart-pole that waits for commands
  upright ros2 learn reinforce           in another terminal: the agent that learns to balance it
"""
