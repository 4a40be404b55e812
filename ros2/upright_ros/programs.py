"""
The programs of this package: the nodes of `upright`, which end as ROS 2 expects.

A node that is interrupted has done what it should, and `launch` reports every exit status but 0
as a death. The command `upright ros2 learn` exits with 130 then, as shells expect.
"""

from importlib import import_module

from upright.support.exit_status import INTERRUPTED


def simulator() -> int:
    """Run the simulator, and return the exit status."""
    return _run('upright.nodes.simulator')


def learner() -> int:
    """Run the learner, and return the exit status."""
    return _run('upright.nodes.learner')


def _run(module: str) -> int:
    try:
        status: int = import_module(module).main()
    except KeyboardInterrupt:  # while it is being imported, which takes seconds
        return 0
    return 0 if status == INTERRUPTED else status
