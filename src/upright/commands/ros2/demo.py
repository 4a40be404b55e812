"""Start a simulator and a learner, and show the trials.

Both run in a ROS domain of their own, unless ROS_DOMAIN_ID names one. The seed is for both.
"""

import argparse

from upright.commands.parser import Parser
from upright.commands.ros2.fields import add_fields, add_learning_agent, given
from upright.nodes.settings import TASK_PARAMETERS, LearnerSettings, SimulatorSettings
from upright.plants.ros2.settings import CartSettings
from upright.support.settings import values_of

EXAMPLES = """\
examples:
  upright ros2 demo
  upright ros2 demo adaptive-lqr --plant mujoco --noise gaussian-0.1 --seed 3
  upright ros2 demo --policy policy.npz --no-lock-step --steps 500   ten seconds by the wall clock
exit status: 0 if it balanced, 1 if not, 2 if something is not possible, 130 if it was stopped.
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright ros2 demo`."""
    add_learning_agent(parser)
    alone = ("agent", "task_parameters", "reset_patience", *values_of(CartSettings()))
    add_fields(parser, LearnerSettings, without=alone)
    add_fields(parser, SimulatorSettings, without=("seed",))


def run(options: argparse.Namespace) -> int:
    """Carry out `upright ros2 demo`."""
    from upright.plants.ros2.plant import require_rclpy

    require_rclpy()
    from upright.nodes import demo

    simulated = given(options, SimulatorSettings)
    texts = simulated.get("parameters", "").split(",")
    known = [text for text in texts if text.partition("=")[0].strip() in TASK_PARAMETERS]
    learning = given(options, LearnerSettings) | {"task_parameters": ",".join(known)}
    return demo.main(simulated, learning)
