"""Both sides at once: a simulator in a process of its own, and a learner whose trials are shown."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from subprocess import PIPE, Popen

from upright.nodes import learner
from upright.nodes.settings import SimulatorSettings
from upright.plants.ros2.node import ParameterValues
from upright.support.exit_status import BAD_USE
from upright.support.processes import end_process


@contextmanager
def start_simulator(given: ParameterValues) -> Iterator[bool]:
    """Start a simulator with these settings, and end it; give whether it serves."""
    call = f"main({dict(given)!r}, [], {os.getpid()})"
    code = f"from upright.nodes.simulator import main; raise SystemExit({call})"
    with Popen([sys.executable, "-c", code], stdout=PIPE, text=True) as process:
        try:
            assert process.stdout
            line = process.stdout.readline()  # it tells when it serves
            print(line, end="", flush=True)
            yield bool(line)
        finally:
            end_process(process)


def main(simulated: ParameterValues, learning: ParameterValues) -> int:
    """Run both sides, in a ROS domain of their own unless ROS_DOMAIN_ID names one.

    Parameters
    ----------
    simulated, learning
        Settings of the simulator and of the learner, by name.

    Returns
    -------
    int
        The learner's exit status, or that of bad use if the simulator did not start.

    Raises
    ------
    UprightError
        If a setting of the simulator has an impossible value.
    """
    SimulatorSettings(**simulated)
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    with start_simulator(simulated) as serves:
        return learner.main(learning, []) if serves else BAD_USE
