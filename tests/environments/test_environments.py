import copy
import itertools
import pickle
import warnings

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
from gymnasium.error import InvalidAction, ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from helpers import GOOD_WEIGHTS, make_task, python

from upright.core.cartpole import INTEGRATORS, step
from upright.core.conditions import NOISES, STARTS, Noise
from upright.core.many import PART
from upright.core.parameters import Parameters, State
from upright.core.trials import trial
from upright.environments.cartpole_env import CartPoleEnv, LaneStream
from upright.environments.vector_env import CartPoleVectorEnv
from upright.errors import UprightError
from upright.plants.equations import equations

OTHER_PLANT = {"pole_mass": 0.2, "half_length": 1, "angle_limit": 0.08}


@pytest.fixture(autouse=True)
def _no_display(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


# ------------------------------------------------------------------------------- registration


@pytest.mark.parametrize("order", ["upright, gymnasium", "gymnasium, upright"])
def test_importing_the_package_registers_the_environments(order):
    code = f"import {order}; print(gymnasium.make('{NAMES[0]}').reset(seed=1)[0].shape)"
    assert python(code).stdout == "(4,)\n"


def test_looking_for_gymnasium_does_not_import_it():
    """Some programs check whether it is installed first."""
    look = "import importlib.util, upright; importlib.util.find_spec('gymnasium')"
    result = python(f"{look}; import gymnasium; gymnasium.make('{NAMES[0]}').reset()")
    assert result.returncode == 0, result.stderr


def test_gymnasium_imports_the_package_by_name():
    result = python(f"import gymnasium; print(gymnasium.make('upright:{NAMES[1]}').action_space)")
    assert result.stdout == "Box(-10.0, 10.0, (1,), float32)\n"


def test_importing_the_package_imports_neither_gymnasium_nor_numba():
    result = python("import sys, upright; print({'gymnasium', 'numba'} & set(sys.modules))")
    assert result.stdout == "set()\n"


@pytest.mark.parametrize("name", NAMES)
def test_an_episode_is_a_trial_unless_asked_otherwise(name):
    assert make(name).spec.max_episode_steps == 60_000
    assert make_many(2, name).rules.steps == 60_000
    assert make_many(2, name, max_episode_steps=-1).rules.steps > 10**12


# -------------------------------------------------------------------------------- environment

ARGUMENTS = ("name", "noise", "start", "reward", "dtype", "parameters", "integrator")
VARIANTS = [
    dict(zip(ARGUMENTS, values, strict=True))
    for values in (
        *itertools.product(NAMES, NOISES, ["random"], ["survival"], ["float32"], [None], ["euler"]),
        (NAMES[0], "none", "zero", "failure", "float64", OTHER_PLANT, "rk4"),
        (NAMES[1], "all-10", "wide", "failure", "float64", Parameters(force=0.1), "euler"),
    )
]


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda v: "-".join(map(str, v.values())))
def test_the_gymnasium_checker_passes(variant):
    env = make(**variant, render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*infinity")  # nothing bounds a velocity
        warnings.filterwarnings("ignore", ".*symmetric and normalized")  # the force is in N
        check_env(env.unwrapped)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_the_integrator_moves_the_plant(integrator):
    env = make(integrator=integrator, dtype="float64").unwrapped
    state = State(0.1, 0.2, 0.05, 0.4)
    env.reset(seed=1, options={"state": state})
    for action in (1, 0, 0):
        force = 10.0 if action else -10.0
        state = step(Parameters(), state, force, int(INTEGRATORS[integrator]))
        np.testing.assert_array_equal(env.step(action)[0], state)


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("start", STARTS)
def test_an_episode_is_what_the_trial_loop_makes_of_the_same_numbers(noise, start):
    """An agent sees the same and lasts as long in the loop and in the environment."""
    agent, task = Watching(), make_task(noise, start, steps=400)
    env = make(noise=noise, start=start, dtype="float64").unwrapped
    rng = np.random.Generator(LaneStream(11))
    steps, fallen = trial(agent, equations(), task, rng)
    observation, _ = env.reset(seed=11)
    for seen in [*agent.seen[1:], agent.last]:
        observation, _, over, _, _ = env.step(int(np.dot(GOOD_WEIGHTS, observation) > 0))
        np.testing.assert_array_equal(observation, seen)
    assert len(agent.seen) == steps
    assert over == fallen


def test_without_noise_the_observation_is_the_state():
    env = make(noise="none", dtype="float64")
    state = [0.1, -0.2, 0.05, 0.3]
    observation, info = env.reset(seed=2, options={"state": state})
    assert info == {}
    np.testing.assert_array_equal(observation, state)
    observation, *_, info = env.step(1)
    assert info == {}
    np.testing.assert_array_equal(observation, step(Parameters(), State(*state), 10.0))


@pytest.mark.parametrize("noise", [name for name in NOISES if name != "none"])
def test_info_has_the_true_state_under_noise(noise):
    env = make(noise=noise, dtype="float64")
    state = [0.1, -0.2, 0.05, 0.3]
    observation, info = env.reset(seed=2, options={"state": state})
    np.testing.assert_array_equal(info["state"], state)
    for action in (1, 0, 1, 1):
        before = State(*info["state"].tolist())
        observation, *_, info = env.step(action)
        pushed = step(Parameters(), before, 10.0 if action else -10.0)
        force = env.unwrapped._force
        np.testing.assert_array_equal(info["state"], step(Parameters(), before, force))
        assert (force == (10.0 if action else -10.0)) == (not noise.startswith("actuator"))
        assert (observation[2] == pushed.theta) == noise.startswith("actuator")
        assert np.allclose(observation, info["state"], atol=0.1)


def test_rewards_and_termination():
    for reward, each, last in (("survival", 1.0, 1.0), ("failure", 0.0, -1.0)):
        env = make(reward=reward)
        env.reset(seed=1)
        rewards, over = [], False
        while not over:
            _, value, over, cut, _ = env.step(1)
            assert cut is False
            rewards.append(value)
        assert rewards == [each] * (len(rewards) - 1) + [last]
        with pytest.raises(ResetNeeded, match=r"the pole has fallen; call reset\(\)"):
            env.unwrapped.step(1)
        env.reset()
        env.step(1)


def test_the_force_is_what_the_action_says():
    pushes, forces = make(), make(NAMES[1])
    for env in (pushes, forces):
        env.reset(seed=4)
    for action, force in ((1, 10.0), (0, -10.0), (1, 10.0)):
        ours, *_ = pushes.step(action)
        theirs, *_ = forces.step(np.array([force], np.float32))
        np.testing.assert_array_equal(ours, theirs)


def test_the_largest_force_is_allowed_whatever_its_rounding():
    env = make(NAMES[1], parameters={"force": 0.1})
    env.reset(seed=1)
    env.step(env.action_space.high)
    envs = make_many(3, NAMES[1], parameters={"force": 0.1})
    envs.reset(seed=1)
    envs.step(envs.action_space.low)


def test_the_same_seed_gives_the_same_episodes():
    def episodes(seed):
        env = make(noise="all-5")
        seen = [env.reset(seed=seed)[0], env.reset()[0]]
        return np.array([*seen, *(env.step(i % 2)[0] for i in range(20))])

    np.testing.assert_array_equal(episodes(3), episodes(3))
    assert (episodes(3)[:2] != episodes(4)[:2]).all()
    unseeded = make(), make()
    assert (unseeded[0].reset()[0] != unseeded[1].reset()[0]).all()
    assert unseeded[0].unwrapped.np_random_seed != unseeded[1].unwrapped.np_random_seed


def test_any_numpy_generator_can_be_used():
    env = make(noise="all-5").unwrapped
    env.np_random = np.random.default_rng(5)
    first = env.reset()[0], env.step(1)[0]
    env.np_random = np.random.default_rng(5)
    again = env.reset()[0], env.step(1)[0]
    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_continues_identically(clone):
    env = make(noise="gaussian-0.2", render_mode="human")
    env.reset(seed=1)
    env.step(1)
    other = clone(env.unwrapped)
    for action in (0, 1, 1, 0):
        ours, theirs = env.step(action), other.step(action)
        np.testing.assert_array_equal(ours[0], theirs[0])
        np.testing.assert_array_equal(ours[4]["state"], theirs[4]["state"])
    other.close()
    env.close()


def test_rendering_one():
    env = make(noise="gaussian-0.2", render_mode="rgb_array")
    env.reset(seed=1)
    first = env.render()
    env.step(1)
    second = env.render()
    assert first.dtype == np.uint8
    assert first.shape == second.shape
    assert (first != second).any()
    text = make(render_mode="ansi")
    text.reset(seed=1)
    text.step(1)
    assert "step 1, 0.0 s" in text.render()
    assert "+10.0 N" in text.render()


def test_a_window_opens_with_the_first_episode_and_closes():
    env = make(render_mode="human")
    assert env.unwrapped._window is None
    env.reset(seed=1)
    assert env.unwrapped._window.is_open
    assert env.render() is None
    window = env.unwrapped._window
    env.close()
    env.close()
    assert not window.is_open


@pytest.mark.parametrize("make_one", [make, lambda **options: make_many(2, **options)])
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"noise": "loud"}, "noise is 'loud'; it must be one of none"),
        ({"noise": 0.1}, "noise is 0.1; it must be one of none"),
        ({"noise": Noise(angle=-1.0)}, r"noise\.angle is -1\.0"),
        ({"noise": Noise(angle_offset=float("nan"))}, r"noise\.angle_offset is nan"),
        ({"start": "nowhere"}, "start is 'nowhere'"),
        ({"start": None}, "start is None; it must be one of random, zero, wide"),
        ({"start": State(-1.0, 0.0, 0.0, 0.0)}, r"start\.x is -1\.0"),
        ({"reward": "gold"}, "reward is 'gold'; it must be one of survival, failure"),
        ({"dtype": "int8"}, "dtype is 'int8'; it must be one of float32, float64"),
        ({"parameters": {"pole_mass": 0}}, "pole_mass is 0; it must be a number, at least 1e-12"),
        ({"parameters": {"time_step": -0.02}}, "time_step is -0.02"),
        ({"parameters": {"time_step": float("inf")}}, "time_step is inf"),
        ({"parameters": {"mass": 1.0}}, "parameter is 'mass'; it must be one of gravity"),
        ({"parameters": Parameters(cart_mass=-1.0)}, "cart_mass is -1.0"),
        ({"parameters": {"integrator": 2}}, "parameter is 'integrator'; it must be one of gravity"),
        ({"integrator": 9}, "integrator is 9; it must be one of euler, semi-implicit, rk4"),
    ],
)
def test_impossible_arguments_are_refused(make_one, options, message):
    with pytest.raises(UprightError, match=message):
        make_one(**options)


@pytest.mark.parametrize("mode", ["4k", "human-like"])
def test_unknown_render_modes_are_refused(mode):
    for make_one in (CartPoleEnv, CartPoleVectorEnv):
        with pytest.raises(UprightError, match=f"render_mode is '{mode}'; it must be one of"):
            make_one(render_mode=mode)


@pytest.mark.parametrize("action", [2, -1, 0.5, "left", None, np.array([0, 1]), float("nan")])
def test_invalid_actions_are_refused_and_change_nothing(action):
    env, other = make().unwrapped, make().unwrapped
    env.reset(seed=1)
    other.reset(seed=1)
    with pytest.raises(InvalidAction, match=r"it must be in Discrete\(2\): 1 pushes right, 0"):
        env.step(action)
    np.testing.assert_array_equal(env.step(1)[0], other.step(1)[0])


@pytest.mark.parametrize("action", [[10.1], [-11], [float("nan")], [0.0, 1.0], 3.0, "left", [None]])
def test_invalid_forces_are_refused(action):
    env = make(NAMES[1]).unwrapped
    env.reset(seed=1)
    with pytest.raises(InvalidAction, match=r"it must be in Box\(-10.0, 10.0, \(1,\), float32\)"):
        env.step(action)


WRONG_STATES = [
    ([0.0, 0.0, float("nan"), 0.0], "four finite numbers"),
    ([0.0, float("inf"), 0.0, 0.0], "four finite numbers"),
    ([0.0, 0.0, 0.0], "four finite numbers"),
    ("here", "four numbers"),
    ([0.0, 0.0, 1.0, 0.0], "the pole has fallen"),
    ([-2.5, 0.0, 0.0, 0.0], "the pole has fallen"),
]


@pytest.mark.parametrize(("state", "message"), WRONG_STATES)
def test_impossible_states_are_refused(state, message):
    for env in (make(), make_many(3)):
        with pytest.raises(UprightError, match=f"state is .*; .*{message}"):
            env.reset(options={"state": state})


def test_states_of_another_shape_are_refused():
    with pytest.raises(UprightError, match="it must be four numbers"):
        make().reset(options={"state": np.zeros((2, 4))})
    with pytest.raises(UprightError, match=r"is \(2, 4\); it must be \(4,\) or \(3, 4\)"):
        make_many(3).reset(options={"state": np.zeros((2, 4))})


def test_unknown_options_are_refused():
    for env in (make(), make_many(3)):
        with pytest.raises(UprightError, match="option is 'low'; it must be one of state"):
            env.reset(options={"low": -0.1})


def test_methods_fail_before_the_first_reset():
    env, envs = CartPoleEnv(render_mode="ansi"), CartPoleVectorEnv(2, render_mode="ansi")
    for attempt in (
        lambda: env.step(1),
        env.render,
        lambda: envs.step(np.array([0, 1])),
        envs.render,
        lambda: envs.reset(options={"reset_mask": np.array([True, False])}),
    ):
        with pytest.raises(ResetNeeded, match="reset"):
            attempt()


# ------------------------------------------------------------------------- vector environment


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize(
    ("name", "options"),
    [
        (NAMES[0], {"start": "wide"}),
        (
            NAMES[1],
            {
                "dtype": "float64",
                "reward": "failure",
                "parameters": OTHER_PLANT,
                "integrator": "rk4",
            },
        ),
    ],
)
def test_a_vector_environment_equals_as_many_single_ones_step_for_step(mode, noise, name, options):
    count, options = 6, options | {"noise": noise, "max_episode_steps": 25}
    ours = make_many(count, name, autoreset_mode=mode, **options)
    theirs = gymnasium.make_vec(
        name,
        count,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": AutoresetMode(mode)},
        **options,
    )
    seeds = [3, 1, 4, 1, 5, 9]
    for seed in (7, seeds, None):
        mine, yours = ours.reset(seed=seed), theirs.reset(seed=seed)
        np.testing.assert_array_equal(mine[0], yours[0])
        assert_alike(mine[1], yours[1])
    assert ours.np_random_seed == theirs.np_random_seed
    rng, ends, cuts = np.random.default_rng(2), 0, 0
    for number in range(120):
        actions = act(ours, rng, count)
        mine, yours = ours.step(actions), theirs.step(actions)
        assert_steps_alike(mine, yours)
        ended = mine[2] | mine[3]
        ends, cuts = ends + mine[2].sum(), cuts + mine[3].sum()
        if (mode == "Disabled" and ended.any()) or number % 50 == 49:
            mask = ended if ended.any() else np.arange(count) < 2
            mine = ours.reset(options={"reset_mask": mask})
            yours = theirs.reset(options={"reset_mask": mask})
            np.testing.assert_array_equal(mine[0], yours[0])
            assert_alike(mine[1], yours[1])
    assert ends >= 3
    assert cuts >= 3


@pytest.mark.parametrize("count", [1, PART - 1, PART, PART + 1, 3 * PART + 17])
def test_every_lane_matches_an_environment_of_its_own(count):
    """Lanes at the seams of parts and of vectors of the processor."""
    envs = make_many(count, noise="gaussian-0.2")
    observations, _ = envs.reset(seed=100)
    rng = np.random.default_rng(3)
    actions = [rng.integers(0, 2, count) for _ in range(60)]
    seen = [observations, *(envs.step(each)[0] for each in actions)]
    for lane in {0, 1, count // 2, max(0, count - 9), count - 1} & set(range(count)):
        env = make(noise="gaussian-0.2")
        expected, over = [env.reset(seed=100 + lane)[0]], False
        for each in actions:
            if over:
                expected.append(env.reset()[0])
                over = False
            else:
                observation, _, over, _, _ = env.step(int(each[lane]))
                expected.append(observation)
        np.testing.assert_array_equal([block[lane] for block in seen], expected)


def test_lanes_beyond_small_angles_match_environments_of_their_own():
    """With wide limits, the loop takes another branch of sine and cosine."""
    plant = {"angle_limit": 3.0, "position_limit": 50.0}
    envs, env = make_many(PART, parameters=plant), make(parameters=plant)
    pushes = np.ones(PART, int)
    seen = [envs.reset(seed=1)[0][0], *(envs.step(pushes)[0][0] for _ in range(25))]
    expected = [env.reset(seed=1)[0], *(env.step(1)[0] for _ in range(25))]
    np.testing.assert_array_equal(seen, expected)
    assert 1 < abs(seen[-1][2]) < 3


def test_no_noise_is_drawn_for_a_lane_that_starts_over():
    """In the step that begins an episode, a lane's stream is used for the start alone."""
    for noise in NOISES:
        envs = make_many(3, noise=noise, max_episode_steps=1)
        envs.reset(seed=1)
        envs.step(np.ones(3, int))
        envs.step(np.ones(3, int))
        env = make(noise=noise)
        env.reset(seed=1)
        env.step(1)
        env.reset()
        words = env.unwrapped.np_random.bit_generator.state["state"]["state"]
        assert tuple(envs._batch.words[:, 0].tolist()) == words


def test_the_stream_of_a_lane_is_numpys():
    envs = make_many(2, start="zero")
    envs.reset(seed=[8, 9])
    for lane, seed in enumerate((8, 9)):
        ours = np.random.Generator(np.random.SFC64(seed))
        ours.random(4)
        state = ours.bit_generator.state["state"]["state"]
        np.testing.assert_array_equal(envs._batch.words[:, lane], state)


def test_states_can_be_chosen_for_all_or_for_each():
    envs = make_many(3, dtype="float64")
    observations, _ = envs.reset(seed=1, options={"state": [0.1, 0.2, 0.03, 0.4]})
    np.testing.assert_array_equal(observations, [[0.1, 0.2, 0.03, 0.4]] * 3)
    states = np.arange(12).reshape(3, 4) / 100
    observations, _ = envs.reset(options={"state": states})
    np.testing.assert_array_equal(observations, states)
    mask = np.array([False, True, False])
    observations, _ = envs.reset(options={"state": -states, "reset_mask": mask})
    np.testing.assert_array_equal(observations, np.where(mask[:, None], -states, states))


def test_returned_arrays_are_never_changed_later():
    envs = make_many(5, noise="all-5", autoreset_mode="SameStep", start="wide")
    rng = np.random.default_rng(0)
    kept = [(each := envs.reset(seed=1), copy.deepcopy(each))]
    for _ in range(60):
        kept.append((each := envs.step(rng.integers(0, 2, 5)), copy.deepcopy(each)))
    for now, then in kept:
        assert len(now) == len(then)
        for mine, yours in zip(now[:-1], then[:-1], strict=True):
            np.testing.assert_array_equal(mine, yours)
        assert_alike(now[-1], then[-1])


@pytest.mark.parametrize("kind", [np.int32, np.uint8, np.bool_, list])
def test_actions_of_any_integer_type_are_accepted(kind):
    envs, others = make_many(4), make_many(4)
    envs.reset(seed=1)
    others.reset(seed=1)
    actions = np.array([0, 1, 1, 0])
    other = actions.tolist() if kind is list else actions.astype(kind)
    assert_steps_alike(others.step(other), envs.step(actions))


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        ([0, 1, 2], r"action 2 is .*2.*; it must be in Discrete\(2\)"),
        ([0, -1, 0], r"action 1 is .*-1"),
        ([0, 1], r"shape \(2,\)"),
        ([0.0, 1.0, 1.0], "type float64"),
        (1, r"shape \(\)"),
        (["left"] * 3, "type <U4"),
    ],
)
def test_invalid_batches_are_refused_and_change_nothing(actions, message):
    envs, others = make_many(3), make_many(3)
    envs.reset(seed=1)
    others.reset(seed=1)
    with pytest.raises(InvalidAction, match=message):
        envs.step(np.array(actions))
    assert_steps_alike(envs.step(np.array([0, 1, 0])), others.step(np.array([0, 1, 0])))


def test_invalid_batches_of_forces_are_refused():
    envs = make_many(2, NAMES[1])
    envs.reset(seed=1)
    for forces in ([[0.0], [np.nan]], [[10.5], [0.0]], [0.0, 0.0]):
        with pytest.raises(InvalidAction):
            envs.step(np.array(forces, np.float32))


def test_without_autoreset_an_ended_episode_must_be_reset():
    envs = make_many(3, autoreset_mode="Disabled", max_episode_steps=2)
    envs.reset(seed=1)
    for _ in range(2):
        *_, cuts, _ = envs.step(np.array([0, 1, 0]))
    assert cuts.all()
    with pytest.raises(ResetNeeded, match=r"environments \[0, 1, 2\] … have ended"):
        envs.step(np.array([0, 1, 0]))
    envs.reset(options={"reset_mask": cuts})
    envs.step(np.array([0, 1, 0]))


@pytest.mark.parametrize(
    "mask", [[True], [0, 1, 1], np.zeros(3, bool), np.ones((3, 1), bool), "all"]
)
def test_invalid_masks_are_refused(mask):
    envs = make_many(3)
    envs.reset(seed=1)
    with pytest.raises(UprightError, match=r"(?s)reset_mask is .*; it must be 3 bools"):
        envs.reset(options={"reset_mask": mask})


@pytest.mark.parametrize("seed", [[1, 2], -1, [1, -2, 3], [1, 2.5, 3]])
def test_invalid_seeds_are_refused(seed):
    with pytest.raises(UprightError, match="seed"):
        make_many(3).reset(seed=seed)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"num_envs": 0}, "num_envs is 0"),
        ({"num_envs": 2, "max_episode_steps": 0}, "max_episode_steps is 0"),
        ({"num_envs": 2, "autoreset_mode": "Sometimes"}, "must be one of NextStep, SameStep, Dis"),
    ],
)
def test_impossible_vector_environments_are_refused(options, message):
    with pytest.raises(UprightError, match=message):
        CartPoleVectorEnv(**options)


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda envs: pickle.loads(pickle.dumps(envs))])
def test_a_copy_of_a_vector_environment_continues_identically(clone):
    envs = make_many(4, noise="all-10")
    envs.reset(seed=1)
    envs.step(np.array([0, 1, 1, 0]))
    others = clone(envs)
    for _ in range(30):
        assert_steps_alike(envs.step(np.array([0, 1, 0, 1])), others.step(np.array([0, 1, 0, 1])))


def test_rendering_many():
    envs = make_many(2, render_mode="rgb_array", start="wide")
    envs.reset(seed=1)
    first, second = envs.render()
    assert first.shape == second.shape
    assert (first != second).any()
    texts = make_many(2, render_mode="ansi")
    texts.reset(seed=1)
    assert [text.partition("\n")[0] for text in texts.render()] == ["cart 0", "cart 1"]


def test_gymnasium_wrappers_can_be_used():
    envs = gymnasium.wrappers.vector.RecordEpisodeStatistics(make_many(8, noise="sensor-5"))
    envs.reset(seed=1)
    lengths = []
    for _ in range(200):
        *_, infos = envs.step(np.ones(8, int))
        if "episode" in infos:
            lengths += infos["episode"]["l"][infos["_episode"]].tolist()
    assert 5 < np.mean(lengths) < 15  # pushed to one side, the pole falls within ten steps
