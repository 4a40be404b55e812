"""The cart-pole in MuJoCo.

Joints, masses and friction are those of the URDF; the force on the cart is constant over a control
period, in which MuJoCo makes one or more steps. MuJoCo's cart friction grows with the cart's speed
until it reaches the friction of the equations, which jumps with the sign of the speed; otherwise
the physics is the same. A URDF or MJCF of the user's own can take the place of this model.

The plant is compiled as the equations are: the compiled loop calls MuJoCo's C functions by address,
and reads and writes the state in MuJoCo's memory. MuJoCo's own reset of diverged simulations is
disabled: a diverged state counts as fallen, and MuJoCo's warning goes to standard error.
"""

import ctypes
import math
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, NoReturn

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from upright.core.cartpole import has_fallen
from upright.core.compiled import COMPILES, compiled, inlined
from upright.core.conditions import condition_of
from upright.core.contracts import Plant
from upright.core.parameters import LARGEST, Parameters, State, check_parameters
from upright.core.rig import largest_push, make_rig
from upright.core.task import Task
from upright.errors import UprightError, require, require_module, require_one_of
from upright.plants import own_model
from upright.plants.settings import (
    LONGEST_STEP,
    MOST_STEPS,
    SHORTEST_STEP,
    RunContext,
    count_steps,
    refuse_breakaway,
)
from upright.plants.urdf import text
from upright.support.terminal import visible

INTEGRATORS = ("euler", "implicit", "implicitfast", "rk4")
"""MuJoCo's names of its integrators."""


@dataclass(frozen=True)
class Mujoco:
    """Settings of the plant in MuJoCo."""

    physics_step: float = 0.0
    """MuJoCo's time step [s]; the time between two pushes must be a multiple of it. 0 is one step a
    push; with a model of your own, the longest such step that is not above the model's."""
    integrator: str = ""
    """MuJoCo's integrator: euler, implicit, implicitfast or rk4; all but rk4 are of order 1. If
    empty, it is rk4, or that of a model of your own."""
    model: str = ""
    """A file with a model of your own, URDF or MJCF. The settings below are found in it unless they
    are given."""
    cart_joint: str = ""
    """Name of the slide joint that the cart moves along."""
    pole_joint: str = ""
    """Name of the hinge between cart and pole."""
    zero: str = ""
    """Angle of the pole's joint [°] at which the pole is upright, such as 180."""
    sign: int = 0
    """1 if the pole leans to positive positions of the cart as its joint's angle grows, -1 if as it
    falls, 0 to find out."""
    force_limit: float = 0.0
    """Largest force on the cart [N], which is then that of a push unless the parameter force says
    otherwise; 0 for that of the model."""

    FILES: ClassVar = ("model",)
    ADDED: ClassVar = ("model", "cart_joint", "pole_joint", "zero", "sign", "force_limit")

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        for name in ("model", "zero"):  # a path and a number will do too
            object.__setattr__(self, name, str(getattr(self, name)))
        if self.physics_step != 0:
            require("physics_step", self.physics_step, SHORTEST_STEP, LONGEST_STEP)
        if self.integrator:
            require_one_of("integrator", self.integrator, INTEGRATORS)
        if self.sign not in (-1, 0, 1):
            raise UprightError(f"sign is {self.sign!r}; it must be 1, -1 or 0")
        if self.zero:
            _require_angle("zero", self.zero)
        require("force_limit", self.force_limit, 0, LARGEST)
        for name, value in self._wishes._asdict().items():
            if value and not self.model:
                why = "it is about a model of your own: --plant-set model=FILE"
                raise UprightError(f"{name} is {value!r}; {why}")

    name: ClassVar[str] = "mujoco"
    alone: ClassVar[bool] = False

    @property
    def _wishes(self) -> own_model.Wishes:
        return own_model.Wishes(
            self.cart_joint, self.pole_joint, self.zero, self.sign, self.force_limit
        )

    def make(self, context: RunContext) -> tuple[Plant, Task]:
        """Return the plant with the parameters of the task, and the task.

        A model of the user's own may state the force of a push, and limits.
        """
        plant = self.plant(context.task.parameters)
        rig = make_rig(condition_of(context.spec.condition), plant.parameters)
        if rig is not None and (largest := largest_push(rig)) > plant.parameters.force:
            self.check(plant.parameters._replace(force=largest))
        return plant, context.task._replace(parameters=plant.parameters, rig=rig)

    def version(self) -> str:
        """Return the version of MuJoCo, and a digest of a model of the user's own."""
        mujoco = _mujoco()
        version = f"mujoco-{mujoco.__version__}"
        if not self.model:
            return version
        return f"{version}-{own_model.digest(mujoco, own_model.load(mujoco, self.model))}"

    def check(self, parameters: Parameters) -> None:
        """Raise what `plant` would raise of a model of the user's own."""
        if self.model:
            self.plant(parameters)

    def found(self, parameters: Parameters | None = None) -> dict[str, str]:
        """Return in words what was found in a model of the user's own; empty if there is none."""
        if not self.model:
            return {}
        mujoco = _mujoco()
        model = own_model.load(mujoco, self.model)
        body = own_model.find(mujoco, model, self.model, self._wishes)
        on_it = own_model.parameters_on(body, parameters or Parameters(), self.model)
        steps = self._substeps(on_it.time_step, model.opt.timestep)
        told = own_model.describe(body, on_it)
        return told | {"physics step": f"{on_it.time_step / steps:g} s, {steps} a push"}

    def plant(self, parameters: Parameters | None = None) -> "MujocoPlant":
        """Return the plant, at rest and upright.

        Raises
        ------
        UprightError
            If MuJoCo is missing, a parameter is impossible, or the time step is not a multiple of
            the physics step; or if a model of the user's own cannot be read, its cart-pole cannot
            be found, or a parameter is not for it.
        """
        mujoco = _mujoco()
        parameters = check_parameters(parameters or Parameters())
        cart, pole = own_model.Joint(0, 0), own_model.Joint(1, 1)
        if self.model:
            model = own_model.load(mujoco, self.model)
            body = own_model.find(mujoco, model, self.model, self._wishes)
            cart, pole = body.cart, body.pole
            parameters = own_model.parameters_on(body, parameters, self.model)
            substeps = self._substeps(parameters.time_step, model.opt.timestep)
        else:
            substeps = self._substeps(parameters.time_step, parameters.time_step)
            model = _published_model(mujoco, parameters)
        model.opt.timestep = parameters.time_step / substeps
        if self.integrator:
            number = getattr(mujoco.mjtIntegrator, f"mjINT_{self.integrator.upper()}")
            model.opt.integrator = number
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        data = mujoco.MjData(model)
        library = _library(Path(mujoco.__file__).parent)
        return MujocoPlant(
            parameters=parameters,
            substeps=substeps,
            cart=cart,
            pole=pole,
            position=_OwningArray.view(data.qpos, model, data),
            velocity=_OwningArray.view(data.qvel, model, data),
            force=_OwningArray.view(data.qfrc_applied, model, data),
            model=model._address,
            data=data._address,
            mj_step=_address(library.mj_step),
            mj_reset=_address(library.mj_resetData),
        )

    def _substeps(self, time_step: float, longest: float) -> int:
        """Return the number of MuJoCo's steps between two pushes, none longer than the longest."""
        if self.physics_step:
            return count_steps(self.physics_step, time_step)
        steps = max(1, math.ceil(time_step / longest - 1e-9))
        require("the number of physics steps between two pushes", steps, 1, MOST_STEPS, whole=True)
        return steps


def _require_angle(name: str, text: str) -> None:
    try:
        value = float(text)
    except ValueError:
        raise UprightError(f"{name} is {text!r}; it must be an angle in degrees") from None
    require(name, value, -360, 360)


def _published_model(mujoco: Any, parameters: Parameters) -> Any:
    """Return MuJoCo's model of the URDF of this package."""
    refuse_breakaway(parameters, "MuJoCo")
    try:
        model = mujoco.MjModel.from_xml_string(text(parameters))
    except (ValueError, OverflowError) as error:
        why = " ".join(str(error).split())
        raise UprightError(f"MuJoCo refuses these parameters of the plant: {why}") from None
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.opt.gravity = (-parameters.gravity_along, 0.0, -parameters.gravity)
    return model


def _mujoco() -> Any:
    mujoco = require_module("mujoco", "this plant needs MuJoCo", "mujoco")
    if mujoco.get_mju_user_warning() is None:  # it would write MUJOCO_LOG.TXT
        mujoco.set_mju_user_warning(_warn)
    return mujoco


@cache
def _warn(text: str) -> None:
    """Show a warning of MuJoCo, once."""
    print(f"upright: MuJoCo warns: {visible(text)}", file=sys.stderr)


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


def _call_plainly(function: int, model: int, data: int) -> None:
    """Do the same in plain Python."""
    ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(function)(model, data)


_call: Any = intrinsic(_call_at) if COMPILES else _call_plainly
"""Calls a C function of model and data. All addresses are arguments, because compiled code that is
cached on disk must not contain any."""


class MujocoPlant(NamedTuple):
    """The plant in MuJoCo. It holds addresses, so only the process that made it can use it."""

    parameters: Parameters
    substeps: int
    """Number of MuJoCo's steps in a time step."""
    cart: own_model.Joint
    """The joint of x."""
    pole: own_model.Joint
    """The joint of theta."""
    position: np.ndarray
    """MuJoCo's array of the positions of joints [m or rad]."""
    velocity: np.ndarray
    """MuJoCo's array of the velocities of joints [m/s or rad/s]."""
    force: np.ndarray
    """MuJoCo's array of the forces at joints [N or N m]; only that on the cart is not 0."""
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
        cart, pole = self.cart, self.pole
        self.position[cart.position] = cart.zero + cart.sign * state.x
        self.velocity[cart.velocity] = cart.sign * state.x_dot
        self.position[pole.position] = pole.zero + pole.sign * state.theta
        self.velocity[pole.velocity] = pole.sign * state.theta_dot
        return state

    @compiled
    def step(self, force: float) -> State:
        """Apply a force [N] for one time step and return the next state."""
        cart, pole = self.cart, self.pole
        self.force[cart.velocity] = cart.sign * force
        for _ in range(self.substeps):
            _call(self.mj_step, self.model, self.data)
        return State(
            cart.sign * (self.position[cart.position] - cart.zero),
            cart.sign * self.velocity[cart.velocity],
            pole.sign * (self.position[pole.position] - pole.zero),
            pole.sign * self.velocity[pole.velocity],
        )

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
