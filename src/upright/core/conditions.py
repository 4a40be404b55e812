"""Noise cases, starts and conditions by name, and lengths of trials and runs. Data only."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from upright.core.parameters import LARGEST, State, lowest
from upright.core.terms import (
    FRACTION,
    RANGE,
    Range,
    Size,
    Term,
    canonical_text,
    form_of,
    parse_terms,
)
from upright.errors import UprightError, require

PUBLISHED_NOISES = (
    "none",
    "actuator-5",
    "actuator-10",
    "sensor-5",
    "sensor-10",
    "gaussian-0.1",
    "gaussian-0.2",
)
"""The seven published noise cases, in the order of the tables."""


STEPS, TRIALS, RUNS = 60_000, 1_000, 20
"""The report's protocol, the default everywhere: steps of a success, trials per run, and runs."""
STRICT_STEPS, STRICT_RUNS = 600_000, 100
"""Si & Wang's stricter protocol, which the leaderboard uses too."""


class Noise(NamedTuple):
    """Sizes of the disturbances; a size of zero disturbs nothing and draws no random number.

    Examples
    --------
    An environment with more noise on the measured angle than any named case:

    >>> env = upright.CartPoleEnv(noise=upright.Noise(angle=0.2))
    """

    actuator: float = 0.0
    """p: the acting force is F (1 + u), with u uniform in ±p."""
    angle: float = 0.0
    """p: the measured angle is theta (1 + u), with u uniform in ±p."""
    others: float = 0.0
    """p: the same for the measured x, x_dot and theta_dot, each with its own u."""
    angle_offset: float = 0.0
    """sigma [rad]: the measured angle is theta + n, with n normal of this standard deviation."""
    hides_velocities: bool = False
    """Whether the velocities are not measured: the agent reads 0 in their place."""


SI_WANG = "Si & Wang 2001"
NOISE_TERMS = {
    "actuator": Term(
        "the acting force is F (1 + u), u uniform in ± this part", FRACTION, source=SI_WANG
    ),
    "sensor": Term(
        "the measured angle is θ (1 + u), u uniform in ± this part", FRACTION, source=SI_WANG
    ),
    "others": Term("the same for the position and both velocities, each with its own u", FRACTION),
    "all": Term("sensor and others together", FRACTION),
    "gaussian": Term(
        "the measured angle is θ + n, n normal with this variance",
        "degrees²",
        high=1e4,
        source=SI_WANG,
    ),
}
"""Every term of --noise, in canonical order."""
_NAMED_NOISES = {
    "none": "",
    "actuator-5": "actuator=0.05",
    "actuator-10": "actuator=0.1",
    "sensor-5": "sensor=0.05",
    "sensor-10": "sensor=0.1",
    "gaussian-0.1": "gaussian=0.1",
    "gaussian-0.2": "gaussian=0.2",
    "all-5": "all=0.05",
    "all-10": "all=0.1",
}


def noise_of(text: str) -> Noise:
    """Return the noise that a text describes: the name of a case, or terms.

    Raises
    ------
    UprightError
        If it has an unknown name, or an impossible size.

    Examples
    --------
    >>> from upright.core.conditions import noise_of
    >>> noise_of("actuator=10%,gaussian=0.5").actuator
    0.1
    """
    return _noise(_noise_sizes(text))


def noise_text(text: str) -> str:
    """Return the canonical text of a noise: the name of a case, or terms.

    Raises
    ------
    UprightError
        As for `noise_of`.

    Examples
    --------
    >>> from upright.core.conditions import noise_text
    >>> noise_text("gaussian=0.5, actuator=10%"), noise_text("gaussian=0.10")
    ('actuator=0.1,gaussian=0.5', 'gaussian-0.1')
    """
    sizes = {name: size for name, size in _noise_sizes(text).items() if size}
    if "sensor" in sizes and sizes["sensor"] == sizes.get("others"):
        sizes["all"] = sizes.pop("sensor")
        del sizes["others"]
    return canonical_text(dict(sorted(sizes.items(), key=_noise_rank)), _NAMED_NOISES)


def _noise_rank(item: tuple[str, Size]) -> int:
    return list(NOISE_TERMS).index(item[0])


def _noise_sizes(text: str) -> dict[str, Size]:
    """Return the terms of a noise with their sizes."""
    sizes = parse_terms("noise", text, NOISE_TERMS, _NAMED_NOISES, _of_conditions)
    for part in ("sensor", "others"):
        if "all" in sizes and part in sizes:
            raise UprightError(f"noise is {text!r}; all includes {part}")
    return sizes


def _of_conditions(name: str) -> str:
    """Return the advice about what is no noise, but belongs to a condition; or nothing."""
    is_one = _NAMED_CONDITIONS.get(name) or form_of(name, CONDITION_TERMS)
    return "it belongs to the condition, not to the noise" if is_one else ""


def _noise(sizes: Mapping[str, Any]) -> Noise:
    """Return the noise that has these terms."""
    every = sizes.get("all", 0.0)
    return Noise(
        actuator=sizes.get("actuator", 0.0),
        angle=sizes.get("sensor", every),
        others=sizes.get("others", every),
        angle_offset=math.radians(math.sqrt(sizes.get("gaussian", 0.0))),
    )


NOISES = {name: noise_of(name) for name in _NAMED_NOISES}
"""Every named noise case. The first seven are the published ones; the last two go beyond them.

Examples
--------
>>> list(upright.NOISES)[:3]
['none', 'actuator-5', 'actuator-10']
>>> upright.NOISES["sensor-5"].angle
0.05
"""

STARTS = {
    "random": State(0.05, 0.05, 0.05, 0.05),
    "zero": State(0.0, 0.0, 0.0, 0.0),
    "wide": State(0.05, 0.05, math.radians(6), 0.05),
}
"""Half-widths of the uniform start state, by name: Gymnasium's convention, Si & Wang's exact zero,
and one in which the pole leans up to 6°.

Examples
--------
>>> upright.STARTS["random"]
State(x=0.05, x_dot=0.05, theta=0.05, theta_dot=0.05)
"""


class Change(NamedTuple):
    """A parameter of the plant that changes once in a run."""

    step: int
    """Number of steps of the run, over all its trials, after which it changes."""
    parameter: str
    """Name of the parameter."""
    value: float
    """Its value from then on. A force below zero pushes the other way."""


class Draw(NamedTuple):
    """A parameter of the plant that is drawn at random."""

    parameter: str
    """Name of the parameter."""
    range: Range
    """Where it is drawn from."""


class Condition(NamedTuple):
    """How a task differs from the published one, besides its noise. In SI units."""

    varies_plant: bool = False
    """Whether every run has its own plant, drawn by `draw_plant`."""
    friction: float = 1.0
    """Factor on both frictions."""
    delay: int = 0
    """How many steps pass before a push acts."""
    hides_velocities: bool = False
    """Whether the agent reads 0 for both velocities."""
    stick_slip: float = 0.0
    """Friction that holds a cart at rest [N]; 0: none."""
    tilt: float = 0.0
    """Angle by which the track rises to the right [rad]."""
    left_force: float | None = None
    """Magnitude of a push to the left [N]; None: as to the right."""
    lag: float = 0.0
    """Time constant with which the force follows the push [s]; 0: at once."""
    dead_zone: float = 0.0
    """Part of a push that is lost [N]."""
    saturation: float = math.inf
    """Largest force of the motor [N]."""
    wind: float = 0.0
    """Steady force on the cart [N]."""
    gust: float = 0.0
    """Force of a gust on the cart [N], to either side; 0: no gusts."""
    gust_every: float = 2.0
    """Mean time from the end of a gust to the next [s]."""
    gust_for: float = 0.2
    """Duration of a gust [s]."""
    angle_bias: float = 0.0
    """Added to the measured angle [rad]."""
    position_bias: float = 0.0
    """Added to the measured position [m]."""
    encoder: int = 0
    """Counts per turn of the pole and per metre of the track; 0: no encoders."""
    takes_differences: bool = False
    """Whether velocities are differences of two measurements, over the time step."""
    measurement_delay: int = 0
    """How many steps a measurement is late."""
    dropped: float = 0.0
    """Probability that a measurement is lost; the agent then reads the previous one again."""
    changes: tuple[Change, ...] = ()
    """How the plant changes in a run."""
    each_run: tuple[Draw, ...] = ()
    """What is drawn anew for every run."""
    each_episode: tuple[Draw, ...] = ()
    """What is drawn anew for every trial, or episode."""

    @property
    def changes_plant(self) -> bool:
        """Whether the plant changes within a run, other than by the force of a push."""
        names = {each.parameter for each in self.changes}
        names |= {each.parameter for each in self.each_episode}
        return bool(names - {"force"})


USUAL = Condition()
"""The condition of the published task."""
CONDITION_TERMS = {
    "varied-plant": Term("every run has its own plant: pole 0.25 to 2 m, masses half to twice", ""),
    "friction": Term("factor on both frictions", "times"),
    "stick-slip": Term(
        "a cart at rest stays until more than this pushes it",
        "N",
        source="Armstrong-Hélouvry, Dupont & Canudas de Wit 1994",
    ),
    "tilt": Term("the track rises to the right by this angle", "degrees", -89.0, 89.0),
    "delay": Term("a push acts this many steps later", "steps", 0, 1000, whole=True),
    "left-force": Term("a push to the left has this force", "N"),
    "lag": Term("the force follows the push with this time constant", "s", high=1e3),
    "dead-zone": Term("this much of a push is lost, in either direction", "N"),
    "saturation": Term("the motor has at most this force", "N"),
    "wind": Term("steady force on the cart, to the right", "N", -LARGEST),
    "gust": Term("gusts push the cart with this force, left or right by chance", "N"),
    "gust-every": Term("mean time between gusts; 2 s if not given", "s", 1e-3),
    "gust-for": Term("duration of a gust; 0.2 s if not given", "s", 1e-3, 1e6),
    "angle-bias": Term("the angle is measured too large by this", "degrees", -180.0, 180.0),
    "position-bias": Term("the position is measured too large by this", "m", -LARGEST),
    "encoder": Term(
        "encoders count this many steps in a turn of the pole, and in a metre of the track",
        "counts",
        1,
        10**9,
        whole=True,
    ),
    "no-velocities": Term("both velocities read 0", ""),
    "velocity-differences": Term("velocities are differences of two measurements", ""),
    "measurement-delay": Term(
        "measurements are this many steps late", "steps", 0, 1000, whole=True
    ),
    "dropped": Term(
        "each measurement is lost with this probability; the last one is read again", FRACTION
    ),
    "at-STEP.PARAMETER": Term(
        "after STEP steps of a run, PARAMETER has this value; a force below 0 flips the pushes",
        "its unit",
        -LARGEST,
    ),
    "each-run.PARAMETER": Term("PARAMETER is drawn for each run, uniform or log-uniform", RANGE),
    "each-episode.PARAMETER": Term(
        "PARAMETER is drawn for each trial or episode",
        RANGE,
        source="Tobin et al. 2017, domain randomization",
    ),
}
"""Every term of --condition, in canonical order."""
_NAMED_CONDITIONS = {
    "nominal": "",
    "varied-plant": "varied-plant",
    "friction-100": "friction=100",
    "delay-1": "delay=1",
    "delay-2": "delay=2",
    "no-velocities": "no-velocities",
}
_FIELDS = {
    "varied-plant": "varies_plant",
    "no-velocities": "hides_velocities",
    "velocity-differences": "takes_differences",
}
"""The fields of a `Condition` whose names are not those of their terms."""
_IN_DEGREES = ("tilt", "angle-bias")


def condition_of(text: str) -> Condition:
    """Return the condition that a text describes: the name of a case, or terms.

    Raises
    ------
    UprightError
        If it has an unknown name, or an impossible size, or terms that exclude each other.

    Examples
    --------
    >>> from upright.core.conditions import condition_of
    >>> condition_of("delay=1,encoder=1024").encoder
    1024
    """
    return _checked(_condition(_condition_sizes(text)))


def condition_text(text: str) -> str:
    """Return the canonical text of a condition: the name of a case, or terms.

    Raises
    ------
    UprightError
        As for `condition_of`.

    Examples
    --------
    >>> from upright.core.conditions import condition_text
    >>> condition_text("encoder=1024, delay-1"), condition_text("delay=1,wind=0")
    ('delay=1,encoder=1024', 'delay-1')
    """
    sizes = _condition_sizes(text)
    _checked(_condition(sizes))
    matters = {name: size for name, size in sizes.items() if _condition({name: size}) != USUAL}
    return canonical_text(matters, _NAMED_CONDITIONS)


def _condition_sizes(text: str) -> dict[str, Size]:
    return parse_terms("condition", text, CONDITION_TERMS, _NAMED_CONDITIONS, _of_noises)


def _of_noises(name: str) -> str:
    """Return the advice about what is no condition, but belongs to a noise; or nothing."""
    is_one = _NAMED_NOISES.get(name) or form_of(name, NOISE_TERMS)
    return "it belongs to the noise, not to the condition" if is_one else ""


def _condition(sizes: Mapping[str, Any]) -> Condition:
    """Return the condition that has these terms."""
    values: dict[str, Any] = {}
    drawn: dict[str, list[Draw]] = {"each-run": [], "each-episode": []}
    changes = []
    for name, size in sizes.items():
        prefix, _, parameter = name.partition(".")
        if prefix in drawn:
            drawn[prefix].append(Draw(parameter, size))
        elif parameter:
            changes.append(_change(int(prefix.removeprefix("at-")), parameter, size))
        else:
            value = math.radians(size) if name in _IN_DEGREES else size
            values[_FIELDS.get(name, name.replace("-", "_"))] = value
    return Condition(
        **values,
        changes=tuple(changes),
        each_run=tuple(drawn["each-run"]),
        each_episode=tuple(drawn["each-episode"]),
    )


def _change(step: int, parameter: str, value: Any) -> Change:
    """Return a change of a parameter, or raise an error if it cannot have this value."""
    size = abs(value) if parameter == "force" else value
    require(f"condition at-{step}.{parameter}", size, lowest(parameter), LARGEST)
    return Change(step, parameter, float(value))


def _checked(condition: Condition) -> Condition:
    """Return a condition, or raise UprightError if it has terms that exclude each other."""
    if not condition.gust and condition[:] != condition._replace(
        gust_every=USUAL.gust_every, gust_for=USUAL.gust_for
    ):
        raise UprightError("condition has gust-every or gust-for; they need gust=FORCE")
    if condition.hides_velocities and condition.takes_differences:
        raise UprightError("condition has no-velocities and velocity-differences; choose one")
    changed = {each.parameter for each in condition.changes}
    by_run = {each.parameter for each in condition.each_run}
    by_episode = {each.parameter for each in condition.each_episode}
    for name in by_episode & (changed | by_run):
        raise UprightError(f"condition draws {name} for each episode, and sets it otherwise too")
    varied = {"half_length", "cart_mass", "pole_mass"} if condition.varies_plant else set()
    for name in varied & (by_run | by_episode):
        raise UprightError(f"condition has varied-plant, and draws {name} otherwise too")
    return condition


CONDITIONS = {name: condition_of(name) for name in _NAMED_CONDITIONS}
"""Every named condition; all but the first go beyond the published task.

Examples
--------
>>> upright.CONDITIONS["delay-2"].delay
2
"""
