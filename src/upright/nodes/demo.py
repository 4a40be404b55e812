"""Both sides at once: a simulator in a separate process, and a learner that prints its trials."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from subprocess import PIPE, Popen

from upright.nodes import learner
from upright.plants.ros2.node import ParameterValues
from upright.support.exit_status import BAD_USE
from upright.support.processes import end_process


@contextmanager
def start_simulator(settings: ParameterValues) -> Iterator[bool]:
    """Run a simulator with these settings within the block; yield whether it started."""
    call = f"main({dict(settings)!r}, [], {os.getpid()})"
    code = f"from upright.nodes.simulator import main; raise SystemExit({call})"
    with Popen([sys.executable, "-c", code], stdout=PIPE, encoding=sys.stdout.encoding) as process:
        try:
            assert process.stdout
            line = process.stdout.readline()  # the simulator prints a line once it is ready
            print(line, end="", flush=True)
            yield bool(line)
        finally:
            end_process(process)


def main(simulated: ParameterValues, learning: ParameterValues) -> int:
    """Run both sides, in a separate ROS domain unless ROS_DOMAIN_ID names one.

    Parameters
    ----------
    simulated, learning
        Settings of the simulator and of the learner, by name.

    Returns
    -------
    int
        The learner's exit status, or BAD_USE if the simulator did not start.
    """
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    with start_simulator(simulated) as started:
        return learner.main(learning, []) if started else BAD_USE
