"""Episodes that differ: parameters and conditions, one at a time or many at once."""

import copy
import math
import pickle
from itertools import chain

import gymnasium
import numpy as np
import pytest
from environment_helpers import (
    MODES,
    NAMES,
    Watching,
    act,
    assert_alike,
    assert_steps_alike,
    make,
    make_many,
)
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from helpers import GOOD_WEIGHTS, OF_A_RUN, SIZES, task_texts
from hypothesis import example, given, settings
from hypothesis import strategies as st

from upright.core.conditions import STARTS, Noise
from upright.core.parameters import Parameters, State
from upright.core.task import TaskSpec
from upright.core.trials import run, trial
from upright.environments.cartpole_env import CartPoleEnv, LaneStream
from upright.environments.trial_protocol import run_learner
from upright.environments.vector_env import CartPoleVectorEnv
from upright.errors import UprightError
from upright.plants.equations import EQUATIONS
from upright.plants.settings import RunContext

LANES = 3
SEED = 5


def number(low, high):
    return st.floats(low, high, allow_subnormal=False)


# ---- Strategies ----------------------------------------------------------------------------------

RANGES = {
    "gravity": (1.0, 20.0),
    "cart_mass": (0.1, 5.0),
    "pole_mass": (0.01, 1.0),
    "half_length": (0.1, 2.0),
    "cart_friction": (0.0005, 0.5),
    "pole_friction": (0.000002, 0.1),
    "force": (1.0, 30.0),
    "time_step": (0.005, 0.1),
    "position_limit": (0.3, 3.0),
    "angle_limit": (0.11, 1.0),
    "gravity_along": (0.1, 2.0),
    "static_friction": (0.5, 2.0),
}
"""Where tests take parameters from; no start of theirs is beyond these limits."""
texts = task_texts(without=OF_A_RUN)
"""A noise and a condition."""
DRAWN = [name for name in RANGES if not any(f".{name}=" in size for size in chain(*SIZES.values()))]
"""Parameters that no condition of these tests sets."""


@st.composite
def ranges(draw, names=tuple(DRAWN)):
    """Return parameters with a range within that of the table, some of them logarithmic."""
    chosen = draw(st.lists(st.sampled_from(names), unique=True, max_size=4))
    found = {}
    for name in chosen:
        low, high = sorted(draw(number(*RANGES[name])) for _ in range(2))
        found[name] = (low, high, *draw(st.sampled_from([[], ["log"]])))
    return found


@st.composite
def per_lane(draw):
    """Return parameters for a reset: numbers, and arrays with one for each lane."""
    chosen = draw(st.lists(st.sampled_from(list(RANGES)), unique=True, max_size=4))
    return {
        name: np.array(draw(st.lists(number(*RANGES[name]), min_size=LANES, max_size=LANES)))
        if draw(st.booleans())
        else draw(number(*RANGES[name]))
        for name in chosen
    }


# ---- One is as many ------------------------------------------------------------------------------


def of_lane(parameters, i):
    return {name: float(np.broadcast_to(v, LANES)[i]) for name, v in parameters.items()}


def reset_singles(theirs, seeds, parameters, lanes):
    """Reset the environments that `theirs` steps, each with parameters of its own."""
    infos = {}
    for i in np.flatnonzero(lanes):
        options = {"parameters": of_lane(parameters, i)}
        theirs._env_obs[i], info = theirs.envs[i].reset(seed=seeds and seeds[i], options=options)
        infos = theirs._add_info(infos, info, i)
    for flags in (theirs._terminations, theirs._truncations, theirs._autoreset_envs):
        flags[lanes] = False
    return np.array(theirs._env_obs), infos


def assert_many_are_as_many_single_ones(name, mode, parameters, **arguments):
    """Compare every number of 60 steps, with resets of all, of some and of those that ended."""
    ours = make_many(LANES, name, autoreset_mode=mode, max_episode_steps=20, **arguments)
    theirs = gymnasium.make_vec(
        name,
        LANES,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": AutoresetMode(mode)},
        max_episode_steps=20,
        **arguments,
    )

    def reset_both(seeds, lanes, given):
        mine = ours.reset(seed=seeds, options={"parameters": given, "reset_mask": lanes})
        yours = reset_singles(theirs, seeds, given, lanes)
        np.testing.assert_array_equal(mine[0], yours[0])
        assert_alike(mine[1], yours[1])

    rng, every = np.random.default_rng(2), np.ones(LANES, bool)
    theirs.reset(seed=1)
    reset_both([SEED, SEED + 1, SEED + 2], every, parameters)
    for step in range(60):
        actions = act(ours, rng, LANES)
        mine, yours = ours.step(actions), theirs.step(actions)
        assert_steps_alike(mine, yours)
        ended = mine[2] | mine[3]
        if mode == "Disabled" and ended.any():
            reset_both(None, ended, {} if step % 2 else parameters)
        elif step == 35:
            reset_both(None, np.arange(LANES) == 1, parameters)
        elif step == 45:
            reset_both([7, 8, 9], every, {})


@pytest.mark.slow
@settings(max_examples=20)
@example("NextStep", ("all-10", "nominal"), {}, {}, "euler")
@given(
    mode=st.sampled_from(MODES),
    texts=texts,
    randomise=ranges(),
    parameters=per_lane(),
    integrator=st.sampled_from(["euler", "semi-implicit", "rk4"]),
)
def test_many_are_as_many_single_ones_bit_for_bit(mode, texts, randomise, parameters, integrator):
    assert_many_are_as_many_single_ones(
        NAMES[0],
        mode,
        parameters,
        noise=texts[0],
        condition=texts[1],
        randomise=randomise,
        integrator=integrator,
    )


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_many_with_continuous_actions_are_as_many_single_ones(mode):
    assert_many_are_as_many_single_ones(
        NAMES[1],
        mode,
        {"half_length": np.array([0.2, 0.5, 1.0])},
        noise="all-10",
        condition="delay=1,gust=5,at-20.force=5",
        randomise={"cart_mass": (0.5, 2, "log"), "angle_limit": (0.1, 0.2)},
    )


@settings(max_examples=30)
@given(texts=texts, start=st.sampled_from(list(STARTS)))
def test_an_environment_is_the_loop_under_every_condition(texts, start):
    """Three trials of a run: the same measurements, drawn from the same numbers."""
    noise, condition = texts
    spec = TaskSpec(noise=noise, condition=condition, start=start, steps=40)
    plant, task = EQUATIONS.make(RunContext(spec.task(), spec, 0, np.zeros(1, np.bool_)))
    rng = np.random.Generator(LaneStream(SEED))
    env = CartPoleEnv(noise, start, dtype="float64", condition=condition)
    env.reset(seed=SEED)
    env.np_random = np.random.Generator(LaneStream(SEED))  # as it was before the first reset
    for _ in range(3):
        agent = Watching()
        steps, fallen = trial(agent, plant, task, rng)
        observation, _ = env.reset()
        seen, over = [observation], False
        for _ in range(steps):
            observation, _, over, _, _ = env.step(int(np.dot(GOOD_WEIGHTS, observation) > 0))
            seen.append(observation)
        np.testing.assert_array_equal(seen, [*agent.seen, agent.last])
        assert over == fallen


@pytest.mark.parametrize("condition", ["delay-2", "at-20.half_length=0.2,lag=0.1,dropped=0.5"])
@pytest.mark.parametrize("drawn", ["", ",each-episode.cart_mass=0.5:2:log"])
def test_a_learner_has_the_condition_of_its_task(condition, drawn):
    """One that always pushes to the right falls when such an agent does in the loop."""

    class Learner:
        def train(self, env):
            while True:
                env.reset()
                while not env.step(1)[2]:
                    pass

    class Pusher(Watching):
        def act(self, observation, rng):
            return True

    spec = TaskSpec(noise="actuator-10", condition=condition + drawn, start="wide", trials=8)
    found = []
    for loop, agent in ((run_learner, Learner()), (run, Pusher())):
        plant, task = EQUATIONS.make(RunContext(spec.task(), spec, 0, np.zeros(1, np.bool_)))
        lengths = np.zeros(8, np.int64)
        loop(agent, plant, task, np.random.default_rng(SEED), lengths, np.zeros(1, np.bool_))
        found.append(lengths.tolist())
    assert found[0] == found[1]
    assert len(set(found[0])) > 1


# ---- Parameters ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", Parameters._fields)
def test_every_parameter_can_be_given_and_holds_for_one_episode(name):
    value = RANGES[name][0]
    whole = Parameters()._replace(**{name: value})
    env, other, usual = CartPoleEnv(), CartPoleEnv(parameters=whole), CartPoleEnv()
    for each in (other, usual):
        each.reset(seed=1)
    _, info = env.reset(seed=1, options={"parameters": {name: value}})
    assert info == {"parameters": {name: value}}
    env.reset(seed=1, options={"parameters": whole})
    for action in (1, 1, 0, 1):
        ours, theirs = env.step(action), other.step(action)
        np.testing.assert_array_equal(ours[0], theirs[0])
        assert ours[1:4] == theirs[1:4]
        assert ours[4]["parameters"] == whole._asdict()
        if ours[2]:
            break
    _, info = env.reset(seed=1)
    assert info == {}
    for action in (1, 1, 0, 1):
        np.testing.assert_array_equal(env.step(action)[0], usual.step(action)[0])


def test_drawn_parameters_are_uniform_or_log_uniform_and_come_before_the_start():
    randomise = {"half_length": (0.25, 1.0), "cart_mass": (0.5, 2.0, "log")}
    envs = CartPoleVectorEnv(4000, randomise=randomise, dtype="float64")
    observations, infos = envs.reset(seed=0)
    lengths, masses = (infos["parameters"][name] for name in randomise)
    assert (lengths.min() >= 0.25) & (lengths.max() <= 1.0)
    assert (masses.min() >= 0.5) & (masses.max() <= 2.0)
    assert abs(np.mean(lengths) - 0.625) < 0.015
    assert abs(np.mean(np.log(masses))) < 0.03
    u = np.random.Generator(np.random.SFC64(7)).random(3)
    assert masses[7] == pytest.approx(0.5 * 4.0 ** u[0], rel=1e-12)
    assert lengths[7] == 0.25 + u[1] * 0.75
    assert observations[7, 0] == 0.05 * (2.0 * u[2] - 1.0)


def test_randomise_draws_what_the_condition_draws():
    drawn = CartPoleEnv(randomise={"half_length": [0.25, 1, "log"], "cart_mass": (0.5, 2)})
    named = CartPoleEnv(
        condition="each-episode.cart_mass=0.5:2,each-episode.half_length=0.25:1:log"
    )
    mixed = CartPoleEnv(
        condition="each-episode.half_length=0.25:1:log", randomise={"cart_mass": (0.5, 2)}
    )
    (first, info), *others = (env.reset(seed=3) for env in (drawn, named, mixed))
    for observation, other in others:
        np.testing.assert_array_equal(observation, first)
        assert other == info


def test_limits_and_time_steps_of_lanes_are_their_own():
    envs = CartPoleVectorEnv(3, start="zero", dtype="float64")
    parameters = {"angle_limit": np.array([0.05, 0.2, 0.2]), "time_step": [0.02, 0.02, 0.001]}
    envs.reset(seed=0, options={"parameters": parameters})
    for _ in range(5):
        observations, _, terminations, _, infos = envs.step(np.ones(3, int))
    assert terminations.tolist() == [True, False, False]
    assert abs(observations[2, 2]) < abs(observations[1, 2])
    np.testing.assert_array_equal(infos["parameters"]["time_step"], parameters["time_step"])
    *_, infos = envs.step(np.ones(3, int))
    assert infos["_parameters"].tolist() == [False, True, True], "the next episode has none"


def test_environments_without_varied_parameters_have_no_plants_of_their_own():
    """What is not used must not slow down what is."""
    envs = CartPoleVectorEnv(2, noise="all-5")
    envs.reset(seed=1)
    assert envs._batch.plants is envs._batch.rig is None
    envs.reset(options={"parameters": {"force": 5.0}})
    assert envs._batch.plants is not None
    envs.step(np.ones(2, int))
    envs.reset(options={"reset_mask": np.array([True, False])})
    assert envs._batch.plants is not None
    envs.reset()
    assert envs._batch.plants is None
    envs.step(np.ones(2, int))


def test_a_motor_whose_force_varies_follows_continuous_actions_in_proportion():
    half, usual = (CartPoleEnv(continuous=True, dtype="float64", start="zero") for _ in range(2))
    half.reset(options={"parameters": {"force": 5.0}})
    usual.reset()
    ours, theirs = half.step(np.array([10.0], np.float32)), usual.step(np.array([5.0], np.float32))
    np.testing.assert_array_equal(ours[0], theirs[0])


def test_a_run_of_an_environment_begins_when_it_is_seeded():
    env = CartPoleEnv(condition="at-3.half_length=1.0", start="zero")

    def lengths(steps):
        return [env.step(k % 2)[4]["parameters"]["half_length"] for k in range(steps)]

    env.reset(seed=1)
    assert lengths(4) == [0.5, 0.5, 1.0, 1.0]
    assert env.reset()[1]["parameters"] == {"half_length": 1.0}
    assert env.reset(seed=1)[1]["parameters"] == {"half_length": 0.5}


IMPOSSIBLE = [
    ({"parameters": {"half_length": 0}}, "half_length is 0"),
    (
        {"parameters": {"half_length": math.nan}},
        "half_length is nan; it must be a number, at least 1e-12",
    ),
    ({"parameters": {"half_length": "long"}}, "half_length is 'long'; it must be a number"),
    ({"parameters": {"half_length": [1.0, 2.0]}}, r"half_length is \[1.0, 2.0\]; it must be a num"),
    ({"parameters": {"length": 1.0}}, "parameter is 'length'; it must be one of gravity"),
    ({"parameters": 3}, "parameters is 3; it must be a dictionary"),
    ({"parameters": {"static_friction": 0.1, "cart_friction": 0.2}}, "static_friction is 0.1"),
    ({"parameters": {"angle_limit": 0.04}}, "start is 'random', with theta up to 0.05"),
    ({"parameters": {"angle_limit": 0.3}, "state": [0, 0, 0.4, 0]}, "the pole has fallen in it"),
    ({"state": [0, 0, 0, 1e10]}, "finite numbers, of at most 1,000,000,000"),
]


@pytest.mark.parametrize(("options", "message"), IMPOSSIBLE)
def test_impossible_resets_are_refused_and_change_nothing(options, message):
    for env, other in ((make(), make()), (make_many(3), make_many(3))):
        for each in (env, other):
            each.reset(seed=1)
        with pytest.raises(UprightError, match=message):
            env.reset(seed=2, options=options)
        np.testing.assert_array_equal(env.reset()[0], other.reset()[0])


def test_a_state_may_be_beyond_the_usual_limits_where_the_episode_has_wider_ones():
    options = {"parameters": {"angle_limit": 0.5}, "state": [0.0, 0.0, 0.4, 0.0]}
    for env in (make(), make_many(3)):
        env.reset(options=options)


def test_what_is_given_for_environments_that_are_not_reset_does_not_matter():
    envs = make_many(3)
    envs.reset(seed=1)
    values = np.array([math.nan, 0.7, -1.0])
    mask = np.array([False, True, False])
    _, infos = envs.reset(options={"parameters": {"half_length": values}, "reset_mask": mask})
    assert infos["_parameters"].tolist() == mask.tolist()
    assert infos["parameters"]["half_length"][1] == 0.7


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"randomise": {"half_length": 1.0}}, r"randomise has half_length: 1.0; it must be \(low"),
        ({"randomise": {"half_length": (1.0, 0.5)}}, r"\(1.0, 0.5\); it must be \(low, high\)"),
        ({"randomise": {"half_length": (0.5, 1.0, "exp")}}, "it must be"),
        ({"randomise": {"gravity": (0, 1, "log")}}, "with low at least 1e-12"),
        (
            {"randomise": {"half_length": (0, 1)}},
            "half_length is 0; it must be a number, at least 1e-12",
        ),
        ({"randomise": {"half_length": (1, math.inf)}}, "half_length is inf"),
        ({"randomise": {"length": (1, 2)}}, "parameter in randomise is 'length'; it must be one"),
        ({"randomise": [1, 2]}, r"randomise is \[1, 2\]; it must be a dictionary"),
        ({"randomise": {"angle_limit": (0.03, 0.2)}}, "start is 'random'.*angle_limit is 0.03"),
        (
            {"randomise": {"force": (5, 15)}, "condition": "at-9.force=-10"},
            "randomise has force, which the condition sets too",
        ),
        (
            {"randomise": {"static_friction": (0, 0.2)}},
            "static_friction may be 0; .* cart_friction, which may be 0.0005",
        ),
        (
            {"randomise": {"static_friction": (0.1, 0.2), "cart_friction": (0, 0.15)}},
            "static_friction may be 0.1; .* cart_friction, which may be 0.15",
        ),
        ({"condition": "varied-plant"}, "condition is 'varied-plant'; an environment has no runs"),
        ({"condition": "each-run.force=5:15"}, "an environment has no runs"),
        ({"condition": "dely=1"}, "condition is 'dely'.*did you mean"),
        ({"start": "wide", "parameters": {"angle_limit": math.radians(5)}}, "such as random or ze"),
        ({"parameters": {"angle_limit": math.radians(2)}}, "angle_limit at least 0.05"),
        ({"start": State(3, 0, 0, 0)}, "with x up to 3.0, but position_limit is 2.4"),
        ({"start": [0.1, 0.1]}, "start is .*; it must have the parts x, x_dot, theta, theta_dot"),
        ({"start": {"angle": 0.1}}, "part of start is 'angle'; it must be one of x, x_dot"),
        ({"start": ["a", 0, 0, 0]}, "start.x is 'a'; it must be a number"),
        ({"noise": [0.1] * 9}, "noise is .*; it must have the parts actuator"),
        ({"noise": {"loud": 0.1}}, "part of noise is 'loud'"),
        ({"noise": [0.1, 0.1, 0.1, 0.1, 1]}, "noise.hides_velocities is 1; it must be True or Fa"),
        ({"parameters": [9.8, -1]}, "cart_mass is -1"),
        ({"parameters": [1.0] * 99}, "parameters is .*; it must have the parts gravity"),
    ],
)
def test_impossible_arguments_are_refused(arguments, message):
    for kind in (CartPoleEnv, CartPoleVectorEnv):
        with pytest.raises(UprightError, match=message):
            kind(**arguments)


# ---- Spaces --------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(
    parameters=st.fixed_dictionaries(
        {}, optional={name: number(0.01 * low, 10 * high) for name, (low, high) in RANGES.items()}
    ).filter(lambda given: "static_friction" not in given or given["static_friction"] > 5.0),
    noise=st.builds(Noise, *[number(0, 10)] * 4, st.booleans()),
    dtype=st.sampled_from(["float32", "float64"]),
    speed=number(-1e6, 1e6),
)
def test_every_observation_is_in_the_space(parameters, noise, dtype, speed):
    envs = CartPoleVectorEnv(
        4, noise=noise, start="zero", parameters=parameters, dtype=dtype, autoreset_mode="SameStep"
    )
    env = CartPoleEnv(noise, "zero", parameters, dtype=dtype)
    for options in ({}, {"state": [0.0, -speed, 0.0, speed]}):
        assert envs.reset(seed=1, options=options)[0] in envs.observation_space
        assert env.reset(seed=1, options=options)[0] in env.observation_space
        over = False
        for k in range(12):
            observations, *_, infos = envs.step(np.array([0, 1, k % 2, 1]))
            assert observations in envs.observation_space
            for last in infos.get("final_obs", []):
                assert last in envs.single_observation_space
            if not over:
                observation, _, over, _, _ = env.step(k % 2)
                assert observation in env.observation_space


# ---- What Gymnasium does with environments -------------------------------------------------------

CUSTOM = {
    "noise": Noise(angle_offset=0.1),
    "start": State(0.1, 0, 0.05, 0.0),
    "parameters": Parameters(force=8.0),
    "condition": "delay=1,encoder=1024",
    "randomise": {"half_length": (0.25, 1.0, "log"), "pole_mass": (0.1, 0.2)},
}


def test_custom_arguments_survive_json():
    env = make(**CUSTOM)
    again = gymnasium.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.rules == env.unwrapped.rules
    for ours, theirs in zip(env.reset(seed=1), again.reset(seed=1), strict=True):
        np.testing.assert_equal(ours, theirs)
    envs = make_many(2, **CUSTOM)
    many = gymnasium.make_vec(EnvSpec.from_json(envs.spec.to_json()))
    assert isinstance(many.unwrapped, CartPoleVectorEnv)
    assert many.unwrapped.rules == envs.rules
    np.testing.assert_equal(many.reset(seed=1), envs.reset(seed=1))


@pytest.mark.parametrize("form", [list, lambda given: given._asdict()])
def test_lists_and_dictionaries_are_accepted(form):
    given = {name: CUSTOM[name] for name in ("noise", "start", "parameters")}
    env = CartPoleEnv(**{name: form(value) for name, value in given.items()})
    assert env.rules == CartPoleEnv(**given).rules


@pytest.mark.filterwarnings("ignore:.*infinity")  # nothing bounds a measurement
def test_the_gymnasium_checker_passes(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    check_env(make(**CUSTOM, render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_copies_continue_identically(clone):
    """What the rig and the plants share must be shared in a copy too."""
    arguments = CUSTOM | {"condition": "gust=5,at-3.half_length=1,delay=2", "randomise": {}}
    env, envs = CartPoleEnv(**arguments), CartPoleVectorEnv(2, **arguments)
    for each in (env, envs):
        each.reset(seed=1)
    other, others = clone(env), clone(envs)
    for action in (0, 1, 1, 0, 1):
        np.testing.assert_equal(env.step(action), other.step(action))
        actions = np.array([action, 1])
        assert_steps_alike(envs.step(actions), others.step(actions))
    assert np.shares_memory(others._batch.plants.present, others._batch.rig.present)


def test_the_random_numbers_of_lanes_can_be_read_and_set():
    envs = make_many(3, noise="all-5")
    assert len(envs.np_random) == 3, "before the first reset, as in SyncVectorEnv"
    assert None not in envs.np_random_seed
    before = envs.np_random
    first = envs.reset()[0]
    np.testing.assert_array_equal(envs.reset()[0] == first, False)
    before[0].random()
    envs.np_random = before
    assert envs.np_random_seed == (-1, -1, -1)
    again = envs.reset()[0]
    assert (again[0] != first[0]).all(), "it had drawn a number before it was assigned"
    np.testing.assert_array_equal(again[1:], first[1:])
    envs.np_random = [np.random.Generator(np.random.SFC64(4 + i)) for i in range(3)]
    np.testing.assert_array_equal(envs.reset()[0], make_many(3, noise="all-5").reset(seed=4)[0])


def test_drawing_from_what_was_read_changes_nothing():
    envs, others = make_many(2), make_many(2)
    for each in (envs, others):
        each.reset(seed=1)
    envs.np_random[0].random()
    np.testing.assert_array_equal(envs.reset()[0], others.reset()[0])


@pytest.mark.parametrize(
    "kind", [np.random.default_rng, lambda seed: [np.random.default_rng(seed)] * 3]
)
def test_other_random_numbers_are_refused(kind):
    envs = make_many(3)
    with pytest.raises(UprightError, match=r"np_random is .*; it must be 3 generators such as"):
        envs.np_random = kind(1)
