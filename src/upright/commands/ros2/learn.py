"""Train an agent, let one go on learning from a saved policy, or play a policy, on a cart."""

import argparse

from upright.commands.parser import Parser
from upright.commands.ros2.fields import (
    add_fields,
    add_learning_agent,
    add_ros_arguments,
    given,
    ros_arguments,
)
from upright.nodes.settings import LearnerSettings
from upright.plants.ros2.settings import CartSettings
from upright.support.settings import values_of

EXAMPLES = """\
examples:
  upright ros2 learn reinforce --save policy.npz
  upright ros2 learn --policy policy.npz --steps 3000 --greedy
  upright ros2 learn --from policy.npz --save adapted.npz    go on learning on this cart
  upright ros2 learn --policy policy.npz --hinge pivot --angle-zero 3.1416    another cart
ROS arguments may follow --ros-args.
exit status: 0 if it balanced, 1 if not, 2 if something is not possible or the cart is gone, 130 if
it was stopped.
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright ros2 learn`."""
    add_learning_agent(parser)
    add_fields(parser, LearnerSettings, without=("agent", *values_of(CartSettings())))
    group = parser.add_argument_group(
        "the cart", "A reading r of a joint stands for the quantity gain × (r - zero)."
    )
    add_fields(group, CartSettings)
    add_ros_arguments(parser)


def run(options: argparse.Namespace) -> int:
    """Carry out `upright ros2 learn`."""
    from upright.plants.ros2.plant import require_rclpy

    require_rclpy()
    from upright.nodes import learner

    return learner.main(given(options, LearnerSettings), ros_arguments(options))
