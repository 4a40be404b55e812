"""A cart-pole of the user's own: found in a URDF or MJCF model that MuJoCo has read.

The cart is what a slide joint carries, the pole what a hinge on the cart carries. The pole is
upright where its centre of mass is highest, and positive angles lean to where the slide joint's
positions are positive. What is not clear is refused with what was found, and settings decide it.
"""

import hashlib
import math
import os
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from upright.core.parameters import Parameters, changed_parameters
from upright.errors import UprightError, require_one_of
from upright.support.words import count

OF_THE_TASK = ("force", "time_step", "position_limit", "angle_limit")
"""The parameters that belong to the task; all others are physics, and the model's own."""
URDF = re.compile(rb"(?>\s|\xef\xbb\xbf|<\?.*?\?>|<!--.*?-->)*+<robot\b", re.DOTALL)
"""How a URDF file begins; any other is MJCF."""
SLANT = 0.2
"""Largest cosine at which two axes count as being at a right angle: 12° off."""
SMALL = 1e-6
"""A centre of mass this close to an axis [m] lies on it, as that of a wheel does."""


class Joint(NamedTuple):
    """Where a coordinate of the cart-pole stands in MuJoCo's arrays, and how it is counted."""

    position: int
    """Index of the joint in MuJoCo's array of positions."""
    velocity: int
    """Index of the joint in MuJoCo's array of velocities, and of forces."""
    zero: float = 0.0
    """The joint's position [m or rad] where the coordinate is 0."""
    sign: float = 1.0
    """1 or -1: the direction in which the coordinate grows with the joint's position."""


class Wishes(NamedTuple):
    """What the user states of a model; whatever is empty or 0 is to be found."""

    cart_joint: str
    pole_joint: str
    zero: str
    """Angle of the pole's joint [°] at which the pole is upright."""
    sign: int
    force_limit: float
    """Largest force on the cart [N]."""


class CartPole(NamedTuple):
    """What was found in a model."""

    cart: Joint
    pole: Joint
    names: tuple[str, str]
    """Names of the two joints."""
    others: tuple[str, ...]
    """Names of the other joints, which move as they will."""
    masses: tuple[float, float]
    """Masses of the cart and of the pole [kg], with all that they carry."""
    length: float
    """Distance of the pole's centre of mass from its hinge [m]."""
    motor: str
    """What states the force of a push, such as "the model's motor"; empty if nothing does."""
    force_limit: float
    """Largest force on the cart [N]; infinite if none is stated."""
    position_limit: float
    """Distance from the centre to the nearer end of the track [m]; infinite if it has none."""
    angle_limit: float
    """Largest angle of the pole from upright [rad] that its joint allows."""


def load(mujoco: Any, path: str) -> Any:
    """Return the model of a file, without its motors, which would act beside the pushes.

    A URDF is one robot, whose parts do not collide with each other, as in PyBullet and Gazebo. The
    contacts of an MJCF model are left as they are.

    Raises
    ------
    UprightError
        If there is no such file, or MuJoCo cannot read it.
    """
    if os.path.exists(path) and not os.path.isfile(path):
        raise UprightError(f"model is {path!r}; it is not a file")
    try:
        content = Path(path).read_bytes()
    except (OSError, ValueError) as error:  # the latter: a path cannot be such
        why = getattr(error, "strerror", None) or error
        raise UprightError(f"model is {path!r}; it cannot be read: {why}") from None
    if b"<xacro:" in content:  # which MuJoCo would skip without a word
        raise UprightError(f"model is {path!r}; expand its macros: xacro {path} > model.urdf")
    try:
        model = mujoco.MjModel.from_xml_path(path)
    except (ValueError, OverflowError) as error:
        why = " ".join(str(error).split())
        raise UprightError(f"model is {path!r}; MuJoCo cannot read it: {why}") from None
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    if URDF.match(content):
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    return model


def digest(mujoco: Any, model: Any) -> str:
    """Return a short digest of a model as MuJoCo has read it, with all files that it includes."""
    data = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, data)
    return hashlib.sha256(data.tobytes()).hexdigest()[:12]


def find(mujoco: Any, model: Any, path: str, wishes: Wishes) -> CartPole:
    """Return the cart-pole of a model.

    Raises
    ------
    UprightError
        If it has none, or there are several things that could be meant.
    """
    return _Search(mujoco, model, path, wishes).cart_pole()


def parameters_on(body: CartPole, given: Parameters, path: str) -> Parameters:
    """Return the parameters of a task on a model.

    Where the task has the published force or limit, that of the model takes its place: the force of
    its motor, and the ends of its joints if they are nearer.

    Raises
    ------
    UprightError
        If another parameter than those of the task is changed, or one is beyond what the model
        allows.
    """
    published, changed = Parameters(), changed_parameters(given)
    if physics := [name for name in changed if name not in OF_THE_TASK]:
        raise UprightError(
            f"{', '.join(physics)} cannot be changed on a model of your own: masses, lengths, "
            f"frictions and gravity are those in {path!r}, and no condition can vary them; "
            f"parameters that can be changed are {', '.join(OF_THE_TASK)}"
        )
    for name in ("force", "position_limit", "angle_limit"):
        limit = getattr(body, f"{name.removesuffix('_limit')}_limit")
        if name in changed and changed[name] > limit:
            raise UprightError(
                f"{name} is {changed[name]:g}; it must be at most {limit:g} on {path!r}"
            )
        usual = limit if name == "force" and body.motor else min(getattr(published, name), limit)
        given = given._replace(**{name: changed.get(name, usual)})
    return given


def describe(body: CartPole, parameters: Parameters) -> dict[str, str]:
    """Return in words what was found in a model, and the task's parameters on it."""
    by = f", by {body.motor}" if body.motor and parameters.force == body.force_limit else ""
    most = f" of at most {body.force_limit:g} N" if math.isfinite(body.force_limit) else ""
    (cart, pole), (cart_mass, pole_mass) = body.names, body.masses
    way = "grows" if body.pole.sign > 0 else "falls"
    told = {
        "cart": f"joint {cart}, {cart_mass:.4g} kg",
        "pole": f"joint {pole}, {pole_mass:.4g} kg, centre of mass {body.length:.4g} m away",
        "upright": f"joint {pole} at {math.degrees(body.pole.zero):.4g}°; the pole leans to +x as "
        f"the joint's angle {way}",
        "push": f"±{parameters.force:g} N{by or most}",
        "limits": f"±{parameters.position_limit:.4g} m from {cart} = {body.cart.zero:.4g} m, "
        f"±{math.degrees(parameters.angle_limit):.4g}°",
    }
    return told | ({"other joints": ", ".join(body.others)} if body.others else {})


class _Search:
    """Looks for a cart-pole in a model, with all joints where they are at first."""

    def __init__(self, mujoco: Any, model: Any, path: str, wishes: Wishes) -> None:
        self._mujoco, self._model, self._path, self._wishes = mujoco, model, path, wishes
        self._data = mujoco.MjData(model)
        mujoco.mj_forward(model, self._data)
        kinds = mujoco.mjtJoint
        self._slides = self._of_kind(kinds.mjJNT_SLIDE)
        self._hinges = self._of_kind(kinds.mjJNT_HINGE)
        self._free = self._of_kind(kinds.mjJNT_FREE)

    def cart_pole(self) -> CartPole:
        model, data = self._model, self._data
        up = -model.opt.gravity
        if not np.linalg.norm(up) > 0.0:
            raise self._wrong("it has no gravity, against which a pole could be balanced")
        up = up / np.linalg.norm(up)
        cart = self._cart(up)
        pole = self._pole(cart, up)
        low, high = self._range(cart)
        centre = 0.5 * (low + high) if math.isfinite(high - low) else 0.0
        zero = self._upright(pole, up)
        leans = float(np.cross(data.xaxis[pole], up) @ data.xaxis[cart])
        sign = self._wishes.sign or (1 if leans > 0.0 else -1)
        carried = model.body_subtreemass[model.jnt_bodyid[[cart, pole]]]
        motor, force_limit = self._force_limit(cart)
        return CartPole(
            Joint(int(model.jnt_qposadr[cart]), int(model.jnt_dofadr[cart]), centre),
            Joint(int(model.jnt_qposadr[pole]), int(model.jnt_dofadr[pole]), zero, float(sign)),
            (self._name(cart), self._name(pole)),
            tuple(self._name(j) for j in range(model.njnt) if j not in (cart, pole)),
            (float(carried[0] - carried[1]), float(carried[1])),
            float(np.linalg.norm(self._lever(pole))),
            motor,
            force_limit,
            min(high - centre, centre - low),
            self._angle_limit(pole, zero),
        )

    # -------------------------------------------------------------------------- joints

    def _cart(self, up: np.ndarray) -> int:
        """Return the slide joint that the cart moves along."""
        if not self._slides:
            found = ", ".join(map(self._name, range(self._model.njnt))) or "no joint"
            raise self._wrong(f"it has no slide joint, along which a cart could move: {found}")
        able = [j for j in self._slides if self._poles(j, up)]
        slides = able if len(able) == 1 else self._slides
        cart = self._chosen("cart_joint", "slide joints", slides, self._slides)
        for above in self._above(cart):
            if above in self._free:
                raise self._wrong(
                    f"its cart moves freely with the joint {self._name(above)}; a cart's track "
                    "must be fixed to the world: remove this joint"
                )
        return cart

    def _pole(self, cart: int, up: np.ndarray) -> int:
        """Return the hinge of the pole."""
        below = [j for j in self._hinges if self._is_below(j, cart)]
        poles = self._poles(cart, up)
        if not poles:
            found = ", ".join(map(self._name, below)) or "none"
            raise self._wrong(
                f"its cart, joint {self._name(cart)}, carries no pole, which needs a hinge with a "
                f"level axis across the track and its mass to one side; hinges on it: {found}"
            )
        return self._chosen("pole_joint", "hinge joints on the cart", poles, poles)

    def _poles(self, cart: int, up: np.ndarray) -> list[int]:
        """Return the hinges on a cart that could be a pole's."""
        axes = self._data.xaxis
        track = axes[cart]
        return [
            j
            for j in self._hinges
            if self._is_below(j, cart)
            and abs(axes[j] @ up) < SLANT
            and abs(axes[j] @ track) < SLANT
            and abs(track @ up) < SLANT
            and np.linalg.norm(self._lever(j)) > SMALL
        ]

    def _chosen(self, setting: str, kind: str, likely: list[int], allowed: list[int]) -> int:
        """Return the joint that a setting names, or the only likely one."""
        wanted = getattr(self._wishes, setting)
        names = {self._name(j): j for j in allowed}
        if wanted:
            require_one_of(setting, wanted, names)
            return names[wanted]
        if len(likely) > 1:
            listed = ", ".join(map(self._name, likely))
            raise self._wrong(
                f"it has the {kind} {listed}; name one: --plant-set "
                f"{setting}={self._name(likely[0])}"
            )
        return likely[0]

    def _of_kind(self, kind: int) -> list[int]:
        return np.flatnonzero(self._model.jnt_type == int(kind)).tolist()

    def _name(self, joint: int) -> str:
        """Return a joint's name, or its number if it has none that is text."""
        try:
            return self._model.joint(joint).name or f"#{joint}"
        except UnicodeDecodeError:
            return f"#{joint}"

    def _above(self, joint: int) -> list[int]:
        """Return the joints between the world and the body of a joint, with those of this body."""
        model, found = self._model, list[int]()
        body = int(model.jnt_bodyid[joint])
        while body:
            first = int(model.body_jntadr[body])
            found += range(first, first + int(model.body_jntnum[body])) if first >= 0 else []
            body = int(model.body_parentid[body])
        return found

    def _is_below(self, joint: int, other: int) -> bool:
        """Whether a joint moves with another one."""
        return joint > other and other in self._above(joint)

    # -------------------------------------------------------------------------- the pole

    def _lever(self, joint: int) -> np.ndarray:
        """Return the way from a hinge's axis to the centre of mass of all it carries [m]."""
        data, axis = self._data, self._data.xaxis[joint]
        way = data.subtree_com[self._model.jnt_bodyid[joint]] - data.xanchor[joint]
        lever: np.ndarray = way - (way @ axis) * axis
        return lever

    def _upright(self, joint: int, up: np.ndarray) -> float:
        """Return the angle of a hinge [rad] at which its pole is upright."""
        if self._wishes.zero:
            return math.radians(float(self._wishes.zero))
        lever, axis = self._lever(joint), self._data.xaxis[joint]
        turn = math.atan2(float(np.cross(axis, lever) @ up), float(lever @ up))
        zero = float(self._data.qpos[self._model.jnt_qposadr[joint]]) + turn
        return round(math.remainder(zero, 2.0 * math.pi), 12)  # not some 1e-17 for a plain 0

    def _angle_limit(self, joint: int, zero: float) -> float:
        low, high = self._range(joint)
        limit = min(high - zero, zero - low)
        if limit <= 0.0:
            allowed = f"{math.degrees(low):.4g}° to {math.degrees(high):.4g}°"
            raise self._wrong(
                f"its pole is upright at {math.degrees(zero):.4g}° of the joint "
                f"{self._name(joint)}, which allows {allowed}"
            )
        return limit

    # -------------------------------------------------------------------------- limits

    def _range(self, joint: int) -> tuple[float, float]:
        if not self._model.jnt_limited[joint]:
            return -math.inf, math.inf
        low, high = map(float, self._model.jnt_range[joint])
        return low, high

    def _force_limit(self, cart: int) -> tuple[str, float]:
        """Return what states the force of a push, if anything does, and the largest force [N]."""
        if self._wishes.force_limit:
            return "force_limit", self._wishes.force_limit
        motors = self._motors(cart)
        limits = [limit for limit in motors if math.isfinite(limit)]
        if self._model.jnt_actfrclimited[cart]:
            limits.append(_to_both_sides(self._model.jnt_actfrcrange[cart]))
        if len(motors) > 1 or any(limit <= 0.0 for limit in limits):
            raise self._wrong(
                f"its cart has {count(len(motors), 'motor')}, and how hard one can push to both "
                "sides is not clear: --plant-set force_limit=10 states it in N"
            )
        is_motor = len(motors) == 1 and math.isfinite(motors[0])
        return "the model's motor" if is_motor else "", min(limits, default=math.inf)

    def _motors(self, cart: int) -> list[float]:
        """Return the largest force [N] of each motor of the cart; infinite if it has no limit."""
        model, found = self._model, []
        for i in range(model.nu):
            on_joint = model.actuator_trntype[i] == int(self._mujoco.mjtTrn.mjTRN_JOINT)
            is_motor = model.actuator_biastype[i] == int(self._mujoco.mjtBias.mjBIAS_NONE)
            if on_joint and is_motor and model.actuator_trnid[i, 0] == cart:
                gear, gain = model.actuator_gear[i, 0], model.actuator_gainprm[i, 0]
                limits = [math.inf]
                if model.actuator_ctrllimited[i]:
                    limits.append(abs(gear * gain) * _to_both_sides(model.actuator_ctrlrange[i]))
                if model.actuator_forcelimited[i]:
                    limits.append(abs(gear) * _to_both_sides(model.actuator_forcerange[i]))
                found.append(min(limits))
        return found

    def _wrong(self, what: str) -> UprightError:
        return UprightError(f"model is {self._path!r}; {what}")


def _to_both_sides(range_: np.ndarray) -> float:
    """Return how far a range reaches to that side to which it reaches less."""
    return min(-float(range_[0]), float(range_[1]))
