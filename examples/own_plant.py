"""A plant of your own: a cart-pole whose motor takes time to build up its force.

    upright learn adaptive-lqr --plant examples.own_plant:SlowMotor
    upright table --plant examples.own_plant:compiled_motor --noises none --steps 2000

A plant is a class whose constructor takes the parameters of the task. `reset` puts it into a state,
`step` applies a force for one time step, and both return the state that it is then in. The first
class is plain Python; the second is the same, compiled, and as fast as the package's own plants.
"""

from typing import Any, NamedTuple

import numpy as np

import upright
from upright import Parameters, State, compiled

LAG = 0.03
"""Time in which the motor comes within 37 % of the force that is asked for [s]."""


class SlowMotor:
    """The equations of the published cart-pole, pushed by a motor with a lag."""

    def __init__(self, parameters: Parameters) -> None:
        self.equations = upright.equations(parameters)
        self.keeps = np.exp(-parameters.time_step / LAG)
        self.force = 0.0

    def reset(self, state: State) -> State:
        """Put the cart-pole into a state, with the motor off, and return the state."""
        self.force = 0.0
        return self.equations.reset(state)

    def step(self, force: float) -> State:
        """Ask for a force [N] for one time step, and return the next state."""
        self.force = force + self.keeps * (self.force - force)
        return self.equations.step(self.force)


class CompiledMotor(NamedTuple):
    """The same, compiled: what changes is in arrays, and it has all four methods of a plant."""

    equations: Any
    keeps: float
    force: np.ndarray
    """The force of the motor [N], shape (1,)."""

    @compiled
    def reset(self, state):
        """Put the cart-pole into a state, with the motor off, and return the state."""
        self.force[0] = 0.0
        return self.equations.reset(state)

    @compiled
    def step(self, force):
        """Ask for a force [N] for one time step, and return the next state."""
        self.force[0] = force + self.keeps * (self.force[0] - force)
        return self.equations.step(self.force[0])

    @compiled
    def has_fallen(self, state):
        """Whether the pole or the cart has left its limits."""
        return self.equations.has_fallen(state)

    def close(self):
        """Do nothing: it holds nothing that must be released."""


def compiled_motor(parameters: Parameters) -> CompiledMotor:
    """Create a new plant for a run."""
    lag = SlowMotor(parameters)
    return CompiledMotor(lag.equations, float(lag.keeps), np.zeros(1))
