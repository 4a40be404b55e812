"""Record what passes between a learner and a cart: measurements, commands and status.

The recorder only listens. An MCAP file holds every message, and Foxglove and rosbag2 read it; a CSV
file has a row for each measurement, with the last command and status before it.
"""

import argparse

from upright.commands.parser import WRITTEN, Parser, as_number, as_whole
from upright.commands.ros2.fields import add_ros_arguments, ros_arguments
from upright.plants.urdf import HINGE, SLIDER

EXAMPLES = """\
examples:
  upright ros2 record run.mcap               until Ctrl-C
  upright ros2 record run.mcap run.csv --trials 10
  upright ros2 record run.csv --seconds 60 --slider rail --hinge pivot
ROS arguments may follow --ros-args.
exit status: 0 if it recorded, also if it was stopped; 2 if something is not possible.
"""


def add_options(parser: Parser) -> None:
    """Add the options of `upright ros2 record`."""
    parser.add_argument(
        "files",
        nargs="+",
        metavar="FILE",
        file=WRITTEN,
        help="file to record to, which must not exist: FILE.mcap or FILE.csv",
    )
    parser.add_argument(
        "--seconds",
        type=as_number,
        metavar="VALUE",
        help="end after this time [s] (default: at Ctrl-C)",
    )
    parser.add_argument(
        "--trials", type=as_whole, metavar="N", help="end after this many trials of the learner"
    )
    for name, usual in (("slider", SLIDER), ("hinge", HINGE)):
        parser.add_argument(
            f"--{name}", default=usual, metavar="VALUE", help=f"joint in CSV (default: {usual})"
        )
    parser.add_argument(
        "--clock", action="store_true", help="record the clock too, which slows a simulator down"
    )
    add_ros_arguments(parser)


def run(options: argparse.Namespace) -> int:
    """Carry out `upright ros2 record`."""
    from upright.plants.ros2.plant import require_rclpy

    require_rclpy()
    from upright.nodes import recorder

    joints = options.slider, options.hinge
    limits = options.seconds, options.trials
    arguments = ros_arguments(options)
    return recorder.main(options.files, *limits, joints, arguments, clock=options.clock)
