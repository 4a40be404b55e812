import math
import time

import pytest
from helpers import task_texts
from hypothesis import given
from hypothesis import strategies as st

import upright
from upright.core.conditions import (
    CONDITION_TERMS,
    CONDITIONS,
    NOISE_TERMS,
    NOISES,
    Change,
    Condition,
    Draw,
    Noise,
    condition_of,
    condition_text,
    noise_of,
    noise_text,
)
from upright.core.task import TaskSpec
from upright.core.terms import VARIABLE, Range
from upright.errors import UprightError


@pytest.mark.parametrize("name", NOISES)
def test_the_name_of_a_noise_stands_for_its_terms(name):
    assert noise_text(name) == name
    assert noise_of(name) == NOISES[name]


@pytest.mark.parametrize("name", CONDITIONS)
def test_the_name_of_a_condition_stands_for_its_terms(name):
    assert condition_text(name) == name
    assert condition_of(name) == CONDITIONS[name]


@pytest.mark.parametrize(
    ("text", "noise", "canonical"),
    [
        ("actuator=0.1,gaussian=0.5", Noise(0.1, 0, 0, math.radians(math.sqrt(0.5))), None),
        ("gaussian=0.5, actuator=10%", None, "actuator=0.1,gaussian=0.5"),
        ("sensor=0.2+actuator=0.3", Noise(0.3, 0.2), "actuator=0.3,sensor=0.2"),
        ("all=0.3", Noise(0, 0.3, 0.3), None),
        ("sensor=0.3,others=0.3", Noise(0, 0.3, 0.3), "all=0.3"),
        ("others=0.3", Noise(others=0.3), None),
        ("gaussian-0.1,actuator-5", None, "actuator=0.05,gaussian=0.1"),
        ("gaussian=0.10", NOISES["gaussian-0.1"], "gaussian-0.1"),
        ("actuator=0", Noise(), "none"),
        ("gaussian=1e-1", NOISES["gaussian-0.1"], "gaussian-0.1"),
    ],
)
def test_terms_of_noise(text, noise, canonical):
    assert noise_text(text) == (canonical or text)
    assert noise is None or noise_of(text) == noise
    assert noise_of(noise_text(text)) == noise_of(text)


@pytest.mark.parametrize(
    ("text", "condition", "canonical"),
    [
        ("delay=1,encoder=1024", Condition(delay=1, encoder=1024), None),
        ("encoder=1024, delay-1", Condition(delay=1, encoder=1024), "delay=1,encoder=1024"),
        ("delay=1.0", CONDITIONS["delay-1"], "delay-1"),
        ("friction=1,wind=0", Condition(), "nominal"),
        ("wind=-2.5,tilt=-3", Condition(wind=-2.5, tilt=math.radians(-3)), "tilt=-3,wind=-2.5"),
        ("left-force=5", Condition(left_force=5), None),
        ("saturation=0", Condition(saturation=0), None),
        ("left-force=-0,at-5.gravity=-0.0", None, "left-force=0,at-5.gravity=0"),
        ("each-run.gravity=-0:9", None, "each-run.gravity=0:9"),
        ("gust=5", Condition(gust=5), None),
        ("gust=5,gust-every=1,gust-for=0.5", Condition(gust=5, gust_every=1, gust_for=0.5), None),
        ("no-velocities+dropped=5%", None, "no-velocities,dropped=0.05"),
        (
            "at-0020.force=-10,at-3.pole_mass=0.2",
            Condition(changes=(Change(3, "pole_mass", 0.2), Change(20, "force", -10.0))),
            "at-3.pole_mass=0.2,at-20.force=-10",
        ),
        (
            "each-run.half_length=0.25:1:log,each-episode.cart_mass=0.5:2",
            Condition(
                each_run=(Draw("half_length", Range(0.25, 1, True)),),
                each_episode=(Draw("cart_mass", Range(0.5, 2)),),
            ),
            None,
        ),
    ],
)
def test_terms_of_a_condition(text, condition, canonical):
    assert condition_text(text) == (canonical or text)
    assert condition is None or condition_of(text) == condition
    assert condition_of(condition_text(text)) == condition_of(text)


@pytest.mark.parametrize(
    ("part", "text", "message"),
    [
        ("noise", "gaussan=0.1", "noise is 'gaussan'; it must be one of none, .* actuator=, "),
        ("noise", "delay=1", "noise is 'delay=1'; it belongs to the condition, not to the noise"),
        ("noise", "sensor-5,delay-1", "noise is 'delay-1'; it belongs to the condition, not to"),
        ("noise", "at-5.force=-10", "noise is 'at-5.force=-10'; it belongs to the condition"),
        ("noise", "nominal", "noise is 'nominal'; it must be one of none, "),
        ("condition", "sensor-5", "condition is 'sensor-5'; it belongs to the noise, not to the"),
        ("condition", "gaussian=1", "condition is 'gaussian=1'; it belongs to the noise"),
        ("noise", "actuator", "noise actuator has no size; write actuator=SIZE [fraction]"),
        (
            "noise",
            "actuator=5",
            "noise actuator is '5'; it must be from 0 to 1, such as 0.05 or 5%",
        ),
        ("noise", "actuator=-0.1", "noise actuator is '-0.1'; it must be from 0 to 1"),
        ("noise", "actuator=much", "noise actuator is 'much'; it must be a number [fraction]"),
        ("noise", "gaussian=nan", "noise gaussian is nan; it must be a number, at least 0"),
        ("noise", "gaussian=0.1,gaussian-0.2", "it has gaussian twice"),
        ("noise", "all=0.1,sensor=0.1", "all includes sensor"),
        ("noise", "", "noise is ''; it must be one of none"),
        ("noise", "actuator=0.1,", "noise is ''; it must be one of none"),
        ("condition", "delay=1.5", "condition delay is 1.5; it must be a whole number, at least 0"),
        ("condition", "delay=1001", "condition delay is 1001; .* and at most 1,000"),
        ("condition", "no-velocities=1", "it has no size: write no-velocities"),
        ("condition", "at-5.mass=1", "parameter in at-5.mass is 'mass'; it must be one of gravity"),
        ("condition", "at-5.time_step=1", "parameter in at-5.time_step is 'time_step'"),
        (
            "condition",
            "at-5.half_length=-1",
            "condition at-5.half_length is -1.0; .* at least 1e-12",
        ),
        ("condition", "at-5.force=0", "condition at-5.force is 0.0; .* at least 1e-12"),
        ("condition", "each-run.force=5", "each-run.force is '5'; it must be LOW:HIGH[:log]"),
        ("condition", "each-run.force=5:2", "the high end of condition each-run.force is 2.0"),
        ("condition", "each-run.force=0:2", "the low end of condition each-run.force is 0.0"),
        ("condition", "each-run.gravity=0:2:log", "the low end of .* at least 1e-12"),
        ("condition", "each-run.gravity=0:2:lin", "is '0:2:lin'; it must be LOW:HIGH[:log]"),
        ("condition", "gust-for=1", "condition has gust-every or gust-for; they need gust=FORCE"),
        ("condition", "no-velocities,velocity-differences", "choose one"),
        ("condition", "at-5.force=5,each-episode.force=1:2", "condition draws force for each"),
        ("condition", "varied-plant,each-run.pole_mass=1:2", "and draws pole_mass otherwise too"),
        ("condition", "stick-slip=0.0001", "static_friction is 0.0001; it must be 0, or at least"),
        ("condition", "stick-slip=2,at-9.cart_friction=3", "static_friction may be 2.0; it must"),
        ("condition", "stick-slip=2,each-run.cart_friction=1:3", "cart_friction, which may be 3.0"),
    ],
)
def test_impossible_terms_are_refused_by_name(part, text, message):
    pattern = message.replace("[", r"\[").replace("]", r"\]")
    with pytest.raises(UprightError, match=pattern):
        TaskSpec(**{part: text})


def test_a_text_of_many_terms_takes_no_long_time():
    text = ",".join(f"at-{step}.force={1 + step}" for step in range(3000))
    began = time.perf_counter()
    assert condition_text(text) == text
    assert time.perf_counter() - began < 5


@given(st.data())
def test_a_task_is_its_canonical_text(data):
    noise, condition = data.draw(task_texts())
    spec = TaskSpec(noise, condition=condition)
    again = TaskSpec.from_data(spec.as_data())
    assert again == spec
    assert noise_of(spec.noise) == noise_of(noise)
    assert condition_of(spec.condition) == condition_of(condition)
    shuffled = data.draw(st.permutations(condition.split(",")))
    assert TaskSpec(condition="+".join(shuffled)).condition == spec.condition


def test_every_term_is_explained():
    for term in (*NOISE_TERMS.values(), *CONDITION_TERMS.values()):
        assert term.meaning
        assert not term.meaning.endswith(".")
    assert set(VARIABLE) < set(upright.Parameters._fields)


def test_the_same_task_has_the_same_key():
    one, other = (
        upright.make_case("random-search", noise=noise, condition=condition)
        for noise, condition in (
            ("gaussian=0.2", "wind=1,delay=1"),
            ("gaussian-0.2", "delay-1,wind=1.0"),
        )
    )
    assert one.key == other.key
