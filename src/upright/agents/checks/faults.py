"""Report an exception in the code of a custom agent: support/faults.py, with an agent's error."""

from functools import partial

from upright.errors import AgentError
from upright.support import faults
from upright.support.faults import RAISED, own_traceback, place

__all__ = ["RAISED", "fault", "own_traceback", "place", "reporting"]

fault = partial(faults.fault, AgentError)
"""Returns the error that reports an exception, given the agent's name, what failed, and it."""
reporting = partial(faults.reporting, AgentError)
"""Reports exceptions in a context as the agent's, given its name and what fails."""
