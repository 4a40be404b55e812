"""The cart-pole in MuJoCo.

Joints, masses and friction are those of the URDF; the force on the cart is constant over a control
period, in which MuJoCo makes one or more steps. MuJoCo's cart friction grows with the cart's speed
until it reaches the friction of the equations, which jumps with the sign of the speed; otherwise
the physics is the same.

The plant is compiled as the equations are: the compiled loop calls MuJoCo's C functions by address,
and reads and writes the state in MuJoCo's memory. MuJoCo's own reset of diverged simulations is
disabled: a diverged state counts as fallen, and MuJoCo writes a warning to standard error and to
MUJOCO_LOG.TXT.
"""

import ctypes
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, NoReturn

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from upright.core.cartpole import has_fallen
from upright.core.compiled import compiled, inlined
from upright.core.contracts import Plant
from upright.core.parameters import Parameters, State, check_parameters
from upright.core.task import Task
from upright.errors import UprightError, require, require_module, require_one_of
from upright.plants.settings import RunContext, count_steps, refuse_breakaway
from upright.plants.urdf import text

INTEGRATORS = ("euler", "implicit", "implicitfast", "rk4")
"""MuJoCo's names of its integrators."""


@dataclass(frozen=True)
class Mujoco:
    """Settings of the plant in MuJoCo."""

    physics_step: float = Parameters().time_step
    """MuJoCo's time step [s]; the time between two pushes must be a multiple of it."""
    integrator: str = "rk4"
    """MuJoCo's integrator: euler, implicit, implicitfast or rk4; all but rk4 are of order 1."""

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        require("physics_step", self.physics_step, 0, above=True)
        require_one_of("integrator", self.integrator, INTEGRATORS)

    name: ClassVar[str] = "mujoco"
    alone: ClassVar[bool] = False

    def make(self, context: RunContext) -> tuple[Plant, Task]:
        """Return the plant with the parameters of the task, and the task."""
        return self.plant(context.task.parameters), context.task

    def version(self) -> str:
        """Return the version of MuJoCo."""
        return f"mujoco-{_mujoco().__version__}"

    def plant(self, parameters: Parameters | None = None) -> "MujocoPlant":
        """Return the plant, at rest and upright.

        Raises
        ------
        UprightError
            If MuJoCo is missing, a parameter is impossible, or the time step is not a multiple of
            the physics step.
        """
        mujoco = _mujoco()
        parameters = check_parameters(parameters or Parameters())
        refuse_breakaway(parameters, "MuJoCo")
        substeps = count_steps(self.physics_step, parameters.time_step)
        try:
            model = mujoco.MjModel.from_xml_string(text(parameters))
        except (ValueError, OverflowError) as error:
            why = " ".join(str(error).split())
            raise UprightError(f"MuJoCo refuses these parameters of the plant: {why}") from None
        model.opt.timestep = parameters.time_step / substeps
        model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{self.integrator.upper()}")
        model.opt.gravity = (-parameters.gravity_along, 0.0, -parameters.gravity)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        data = mujoco.MjData(model)
        library = _library(Path(mujoco.__file__).parent)
        return MujocoPlant(
            parameters=parameters,
            substeps=substeps,
            position=_OwningArray.view(data.qpos, model, data),
            velocity=_OwningArray.view(data.qvel, model, data),
            force=_OwningArray.view(data.qfrc_applied, model, data),
            model=model._address,
            data=data._address,
            mj_step=_address(library.mj_step),
            mj_reset=_address(library.mj_resetData),
        )


def _mujoco() -> Any:
    return require_module("mujoco", "this plant needs MuJoCo", "mujoco")


def _library(folder: Path) -> ctypes.CDLL:
    """Return MuJoCo's C library, which its Python package has already loaded."""
    return ctypes.CDLL(str(next(folder.glob("*mujoco.*"))))


def _address(function: Any) -> int:
    address = ctypes.cast(function, ctypes.c_void_p).value
    assert address is not None
    return address


class _OwningArray:
    """Owner of an array in MuJoCo's memory, which keeps that memory alive."""

    def __init__(self, array: np.ndarray, *owners: object) -> None:
        self.__array_interface__ = array.__array_interface__
        self.owners = owners

    @classmethod
    def view(cls, array: np.ndarray, *owners: object) -> np.ndarray:
        """Return a view of an array that keeps its owners alive, as MuJoCo's arrays do not."""
        return np.asarray(cls(array, *owners))


def _call_at(typing_context, function, model, data):  # type: ignore[no-untyped-def]  # noqa: ARG001
    def generate(context, builder, _signature, arguments):  # type: ignore[no-untyped-def]
        address, *structs = arguments
        kind = ir.FunctionType(ir.VoidType(), [struct.type for struct in structs])
        builder.call(builder.inttoptr(address, kind.as_pointer()), structs)
        return context.get_dummy_value()

    return types.none(types.intp, types.intp, types.intp), generate


_call: Any = intrinsic(_call_at)
"""Calls a C function of model and data. All addresses are arguments, because compiled code that is
cached on disk must not contain any."""


class MujocoPlant(NamedTuple):
    """The plant in MuJoCo. It holds addresses, so only the process that made it can use it."""

    parameters: Parameters
    substeps: int
    """Number of MuJoCo's steps in a time step."""
    position: np.ndarray
    """MuJoCo's array of x [m] and theta [rad]."""
    velocity: np.ndarray
    """MuJoCo's array of x_dot [m/s] and theta_dot [rad/s]."""
    force: np.ndarray
    """MuJoCo's array of the force on the cart [N] and the torque at the hinge, which is 0 [N m]."""
    model: int
    """Address of MuJoCo's mjModel, the description of the plant."""
    data: int
    """Address of MuJoCo's mjData, the present state and what is computed from it."""
    mj_step: int
    """Address of MuJoCo's mj_step."""
    mj_reset: int
    """Address of MuJoCo's mj_resetData."""

    @compiled
    def reset(self, state: State) -> State:
        """Put the plant into `state`; nothing of its history remains."""
        _call(self.mj_reset, self.model, self.data)
        self.position[0], self.velocity[0], self.position[1], self.velocity[1] = state
        return state

    @compiled
    def step(self, force: float) -> State:
        """Apply a force [N] for one time step and return the next state."""
        self.force[0] = force
        for _ in range(self.substeps):
            _call(self.mj_step, self.model, self.data)
        return State(self.position[0], self.velocity[0], self.position[1], self.velocity[1])

    @inlined
    def has_fallen(self, state: State) -> bool:
        """Whether the pole or the cart has left its limits."""
        return has_fallen(self.parameters, state)

    def close(self) -> None:
        """Do nothing; MuJoCo's memory is released when the plant is deleted."""

    def __reduce__(self) -> NoReturn:
        """Refuse to be pickled or deep-copied: the addresses would be invalid."""
        raise TypeError("a plant in MuJoCo cannot be pickled or copied")


SETTINGS = {"default": Mujoco()}
