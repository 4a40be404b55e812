"""The same seed gives the same trials as before, bit for bit.

`same_trials.json` holds what earlier code did: how long every trial was, whether the run succeeded,
and digests of what was learned: of what the policy does, of its form, and of arrays of numbers that
the agent's memory must hold somewhere. Nothing in it names a field of a memory, so that memories
may be arranged anew. After an intended change of a rule, the noise or the physics, record again

    python tests/test_same_trials.py                all
    python tests/test_same_trials.py play/ mujoco/  only what begins so

and say in the commit message why figures changed. Figures of a program that is missing are kept.
"""

import hashlib
import itertools
import json
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from helpers import ROOT, ros_domain

import upright  # noqa: F401 - makes the environments known
from upright.agents import AGENTS
from upright.core.cartpole import INTEGRATORS
from upright.core.conditions import CONDITIONS, NOISES, STARTS
from upright.core.parameters import State
from upright.environments.cartpole_env import CartPoleEnv
from upright.environments.trial_protocol import RunOver, TrialProtocol
from upright.errors import UprightError
from upright.plants import PLANTS
from upright.plants.gazebo.installation import find_gazebo
from upright.studies.case import make_case
from upright.studies.learned import learned_policy
from upright.studies.playing import case_for, play_trials
from upright.studies.random_streams import twister_numbers
from upright.studies.run import make_run
from upright.support.settings import change_settings

RECORD = Path(__file__).with_name("same_trials.json")
sys.path.insert(0, str(ROOT))  # where the examples are
SEED = 7
SHORT = {"steps": 3000, "trials": 25}
Figures = dict[str, Any]


# ---- How the package is asked: only here, and in the imports -------------------------------------

COMMAND = [sys.executable, "-c", "from upright.commands import main; main()"]


def case_of(agent: str, label: str = "default", integrator: str = "", **task: Any) -> Any:
    plant = {"plant": plant_of("equations", integrator=integrator)} if integrator else {}
    return make_case(agent, label, **(SHORT | plant | task))


def plant_of(name: str, **changes: str) -> Any:
    return change_settings(PLANTS.default(name), changes)


def learned_in(case: Any, run: int = 0, twister: bool = False) -> tuple[Any, Any]:
    numbers = twister_numbers if twister else None
    return make_run(case, SEED, run, numbers=numbers)


def played(case: Any, memory: Any, episodes: int, **changes: Any) -> list[Any]:
    policy = learned_policy(case, SEED, 0, memory)
    return list(play_trials(policy, case_for(policy, **changes), episodes, SEED))


LEARNED = (
    *("model", "moments", "targets", "gains"),  # adaptive-lqr
    *("adam.mean", "adam.mean_square", "baseline.coefficients"),  # reinforce
    *("action.layer_1", "action.layer_2", "critic.layer_1", "critic.layer_2"),  # ndp
    "table",  # q-learning
    *("weights", "predictions"),  # ase-ace and random-search
    "best",  # the example of a compiled agent
)
"""Arrays of memories that hold what was learned. Their names are needed for recording alone."""


def gazebo_version() -> str:
    try:
        return find_gazebo().version
    except UprightError:
        return ""


# ---- What is recorded ----------------------------------------------------------------------------

OBSERVATIONS = [
    State(*each)
    for each in ((2 * np.random.default_rng(50).random((50, 4)) - 1) * (2.4, 2, 0.2, 2)).tolist()
]


def digest(parts: Iterable[Any]) -> str:
    """Return a digest of numbers, every bit of which counts."""
    text = ",".join(float(part).hex() for part in parts)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def numbers_in(form: Any) -> Iterator[float]:
    """Yield every number in a policy's form, in order."""
    if isinstance(form, (tuple, np.ndarray)):
        for part in form:
            yield from numbers_in(part)
    elif not isinstance(form, (str, type(None))):
        yield float(form)


def arrays_in(memory: Any, prefix: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """Yield every array of floats in a memory, with its name."""
    for name, value in memory._asdict().items() if hasattr(memory, "_asdict") else ():
        if isinstance(value, np.ndarray) and value.dtype == np.float64:
            yield prefix + name, value
        else:
            yield from arrays_in(value, f"{prefix}{name}.")


def pushes(agent: Any) -> list[float]:
    """Return what an agent does on many observations: its probabilities if it has them."""
    if hasattr(agent, "push_probability"):
        return [agent.push_probability(each) for each in OBSERVATIONS]
    rng = np.random.default_rng(0)
    return [agent.act(each, rng) for each in OBSERVATIONS]


def figures_of_run(case: Any, run: int = 0, twister: bool = False) -> Figures:
    agent, result = learned_in(case, run, twister)
    figures = {"lengths": result.lengths.tolist(), "success": bool(result.success)}
    if hasattr(agent, "act"):
        figures["pushes"] = digest(pushes(agent))
    if hasattr(agent, "policy_form"):
        figures["form"] = digest(numbers_in(agent.policy_form()))
    figures["arrays"] = {name: digest(array.flat) for name, array in arrays_in(agent)}
    return figures


def figures_of_play(agent: str, **changes: Any) -> Figures:
    steps = 20 if agent == "adaptive-lqr" else 2000  # it would learn enough
    case = case_of(agent, trials=5, steps=steps, start="zero")
    trials = played(case, learned_in(case)[0], 8, **({"steps": 2000} | changes))
    return {
        "lengths": [trial.steps for trial in trials],
        "balanced": [bool(trial.balanced) for trial in trials],
    }


class Gymnast:
    """A learner that only knows Gymnasium: every trial has other random weights."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def train(self, env: gymnasium.Env) -> None:
        while True:
            weights = self.rng.random(4).tolist()
            observation, _ = env.reset()
            over = False
            while not over:
                total = sum(w * o for w, o in zip(weights, observation.tolist(), strict=True))
                observation, _, fallen, truncated, _ = env.step(int(total > 0))
                over = fallen or truncated


def figures_of_protocol(**options: Any) -> Figures:
    """Return what the protocol counts around an environment that a user made."""
    env = TrialProtocol(CartPoleEnv(**options), **SHORT)
    env.reset(seed=SEED)
    with pytest.raises(RunOver):
        Gymnast(np.random.default_rng(SEED)).train(env)
    result = env.result()
    return {"lengths": result.lengths.tolist(), "success": bool(result.success)}


def actions_of(env: Any, steps: int) -> Iterator[Any]:
    """Yield fixed actions: shape (n,) of numbers or (n, 1) of forces; one alone for one cart."""
    rng = np.random.default_rng(SEED)
    space = env.action_space
    for step in range(steps):
        chances = rng.random(space.shape)
        right = (chances < 0.9) == (step % 2 == 0)  # to and fro, that not every pole falls soon
        if isinstance(space, gymnasium.spaces.Box):
            yield np.where(right, chances * space.high, chances * space.low).astype(space.dtype)
        else:
            yield right.astype(np.int64) if space.shape else int(right)


class Witness:
    """Hashes what an environment answers, and counts its falls."""

    def __init__(self) -> None:
        self.seen = hashlib.sha256()
        self.falls = self.cuts = 0

    def see(self, *answers: Any) -> None:
        for answer in answers:
            self.seen.update(np.ascontiguousarray(answer).tobytes())

    def see_step(self, observation: Any, reward: Any, fallen: Any, cut: Any) -> None:
        self.see(observation, np.float64(reward), np.bool_(fallen), np.bool_(cut))
        self.falls += int(np.sum(fallen))
        self.cuts += int(np.sum(cut))

    def figures(self) -> Figures:
        return {"falls": self.falls, "cuts": self.cuts, "seen": self.seen.hexdigest()[:16]}


def figures_of_environment(name: str, **options: Any) -> Figures:
    witness = Witness()
    env = gymnasium.make(f"upright/{name}-v0", max_episode_steps=40, **options)
    witness.see(env.reset(seed=SEED)[0])
    for action in actions_of(env, 600):
        observation, reward, fallen, cut, info = env.step(action)
        witness.see_step(observation, reward, fallen, cut)
        if "state" in info:
            witness.see(info["state"])
        if fallen or cut:
            witness.see(env.reset()[0])
    env.close()
    return witness.figures()


def figures_of_vector(name: str, mode: str, **options: Any) -> Figures:
    witness = Witness()
    envs = gymnasium.make_vec(
        f"upright/{name}-v0",
        5,
        max_episode_steps=40,
        vectorization_mode="vector_entry_point",
        autoreset_mode=mode,
        **options,
    )
    witness.see(envs.reset(seed=SEED)[0])
    for action in actions_of(envs, 300):
        observations, rewards, fallen, cut, info = envs.step(action)
        witness.see_step(observations, rewards, fallen, cut)
        ended = fallen | cut
        if mode == "SameStep" and ended.any():
            witness.see(info["final_obs"][ended])
        if mode == "Disabled" and ended.any():
            witness.see(envs.reset(options={"reset_mask": ended})[0])
    envs.close()
    return witness.figures()


@contextmanager
def simulator() -> Iterator[None]:
    """Run ROS 2's simulator in a process and a domain of its own."""
    with ros_domain() as own, pytest.MonkeyPatch.context() as patch:
        for name, value in own.items():
            patch.setenv(name, value)
        process = subprocess.Popen(
            [*COMMAND, "ros2", "simulate"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        try:
            line = process.stdout.readline()  # type: ignore[union-attr]
            assert line.startswith("simulating equations"), line or process.communicate()[1]
            yield
        finally:
            process.terminate()
            process.communicate(timeout=60)


def figures_over_ros2(agent: str, **task: Any) -> Figures:
    with simulator():
        return figures_of_run(case_of(agent, plant=plant_of("ros2"), **task))


# ---- All of it -----------------------------------------------------------------------------------

HARD = {"noise": "all-10", "start": "wide", "condition": "delay-2"}
NOISY = ("none", "gaussian-0.2")
FEW = {"steps": 300, "trials": 8}


def runs() -> Iterator[tuple[str, Any, int]]:
    """Yield every run on the equations: its name, its case, its number."""
    for agent in AGENTS:
        for label, noise in itertools.product(AGENTS.settings(agent), NOISES):
            yield f"noise/{agent}/{label}/{noise}", case_of(agent, label, noise=noise), 0
        yield f"hard/{agent}", case_of(agent, **HARD), 1
        for condition, noise in itertools.product(CONDITIONS, NOISY):
            case = case_of(agent, condition=condition, noise=noise)
            yield f"condition/{agent}/{condition}/{noise}", case, 0
        for start in STARTS:
            yield f"start/{agent}/{start}", case_of(agent, start=start, noise="actuator-5"), 0
        for integrator in INTEGRATORS:
            case = case_of(agent, integrator=integrator, noise="sensor-5")
            yield f"integrator/{agent}/{integrator}", case, 0
    for agent in ("examples.compiled_agent:hill_climber", "examples.plain_agent:PlainAgent"):
        for noise in NOISY:
            yield f"custom/{agent}/{noise}", case_of(agent, noise=noise), 0
        yield f"custom/{agent}/hard", case_of(agent, **HARD), 1
    for condition in ("nominal", "varied-plant", "no-velocities"):
        case = case_of("test_same_trials:Gymnast", noise="gaussian-0.2", condition=condition)
        yield f"custom/gymnast/{condition}", case, 0


def bodies() -> Iterator[tuple[str, Any]]:
    """Yield every run on a plant that moves with this process: its name and its case."""
    for agent in AGENTS:
        yield f"mujoco/{agent}", case_of(agent, plant=plant_of("mujoco"), noise="gaussian-0.1")
    for integrator, step in itertools.product(("euler", "implicit", "rk4"), ("0.02", "0.005")):
        plant = plant_of("mujoco", integrator=integrator, physics_step=step)
        yield f"mujoco/{integrator}/{step}", case_of("q-learning", plant=plant)
    for condition in ("varied-plant", "friction-100", "delay-1"):
        case = case_of("reinforce", plant=plant_of("mujoco"), condition=condition)
        yield f"mujoco/{condition}", case
    for engine in ("dart", "ode"):
        plant = plant_of("gazebo", engine=engine)
        case = case_of("adaptive-lqr", plant=plant, **FEW | HARD)
        yield f"gazebo/{engine}", case
    case = case_of("reinforce", plant=plant_of("gazebo"), condition="varied-plant", **FEW)
    yield "gazebo/varied-plant", case


def everything() -> Iterator[tuple[str, Callable[[], Figures]]]:
    """Yield all that is recorded: its name, and what computes its figures."""
    for name, case, run in runs():
        yield name, lambda case=case, run=run: figures_of_run(case, run)
    for name, case in bodies():
        yield name, lambda case=case: figures_of_run(case)
    for agent in AGENTS:
        case = case_of(agent, noise="all-5")
        yield f"twister/{agent}", lambda case=case: figures_of_run(case, 1, twister=True)
        for name, changes in {
            "as-learned": {},
            "hard": HARD,
            "varied-plant": HARD | {"condition": "varied-plant"},
            "delay-1": {"condition": "delay-1", "start": "wide"},
            "no-velocities": {"condition": "no-velocities", "start": "random"},
        }.items():
            yield (
                f"play/{agent}/{name}",
                lambda agent=agent, changes=changes: figures_of_play(agent, **changes),
            )
    for noise in NOISY:
        yield f"protocol/{noise}", lambda noise=noise: figures_of_protocol(noise=noise)
    yield from environments()
    for agent, noise in (("reinforce", "none"), ("adaptive-lqr", "all-10")):
        yield (
            f"ros2/{agent}/{noise}",
            lambda agent=agent, noise=noise: figures_over_ros2(agent, noise=noise, **FEW),
        )


def environments() -> Iterator[tuple[str, Callable[[], Figures]]]:
    """Yield the rollouts of Gymnasium's environments."""
    changed = {"half_length": 0.8, "pole_friction": 1e-4, "force": 8.0}
    options: dict[str, dict[str, Any]] = {
        **{noise: {"noise": noise} for noise in (*NOISY, "actuator-10", "all-10")},
        "changed": {"parameters": changed, "noise": "sensor-5", "start": "wide"},
        "rk4": {"integrator": "rk4", "noise": "gaussian-0.1"},
        "float64": {"dtype": "float64", "reward": "failure", "start": "zero", "noise": "all-5"},
    }
    names = ("CartPole", "ContinuousCartPole")
    for name, (label, given) in itertools.product(names, options.items()):
        yield (
            f"environment/{name}/{label}",
            lambda name=name, given=given: figures_of_environment(name, **given),
        )
        for mode in ("NextStep", "SameStep", "Disabled"):
            yield (
                f"vector/{name}/{label}/{mode}",
                lambda name=name, given=given, mode=mode: figures_of_vector(name, mode, **given),
            )


FIGURES = dict(everything())
PROGRAMS = {
    "mujoco": lambda: version("mujoco") if find_spec("mujoco") else "",
    "gazebo": gazebo_version,
    "ros2": lambda: "any" if find_spec("rclpy") else "",
}
"""Programs that some figures need, those whose names begin so, and which version is here."""


def program_of(name: str) -> str:
    """Return the program that figures of this name need, or nothing."""
    first = name.partition("/")[0]
    return first if first in PROGRAMS else ""


def for_record(figures: Figures) -> Figures:
    """Return figures as they are recorded: of the arrays those with what was learned, unnamed."""
    arrays = figures.pop("arrays", {})
    learned = [arrays[name] for name in LEARNED if name in arrays]
    return figures | ({"arrays": learned} if learned else {})


def recorded() -> dict[str, Any]:
    return json.loads(RECORD.read_text()) if RECORD.exists() else {"versions": {}, "figures": {}}


def marked(name: str) -> Any:
    """Return a name for pytest, with the marker of the program that it needs."""
    return pytest.param(name, marks=[pytest.mark.gazebo] if program_of(name) == "gazebo" else [])


@pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")  # what rclpy imports does
@pytest.mark.parametrize("name", list(map(marked, FIGURES)))
def test_trials_are_the_same(name):
    record = recorded()
    if program := program_of(name):
        wanted, here = record["versions"][program], PROGRAMS[program]()
        if here != wanted:
            pytest.skip(f"figures of {program} {wanted} are recorded; here is {here or 'none'}")
    expected, figures = record["figures"][name], FIGURES[name]()
    arrays = set(figures.pop("arrays", {}).values())
    assert set(expected.pop("arrays", [])) <= arrays
    assert figures == expected


def test_nothing_is_left_out_of_the_record():
    assert recorded()["figures"].keys() == FIGURES.keys()


def test_figures_tell_runs_apart():
    """A record of trials that all end alike would prove nothing."""
    figures = recorded()["figures"]
    for agent in AGENTS:
        own = [value for name, value in figures.items() if f"noise/{agent}/" in name]
        for kind in ("form", "arrays"):
            assert len({str(value[kind]) for value in own}) > len(own) / 2, (agent, kind)
        if agent != "adaptive-lqr":  # which succeeds at once
            assert len({str(value["lengths"]) for value in own}) > len(own) / 2, agent


def record_again(beginnings: tuple[str, ...]) -> None:
    """Write the figures of what begins so; of programs that are missing, keep those there are."""
    record = recorded()
    old, versions, figures = record["figures"], record["versions"], {}
    here = {program: find() for program, find in PROGRAMS.items()}
    for name, compute in FIGURES.items():
        program = program_of(name)
        if name.startswith(beginnings) and (not program or here[program]):
            figures[name] = for_record(compute())
            changed = " " if old.get(name) == figures[name] else "*"
            print(changed, name, figures[name], flush=True)
            if program:
                versions[program] = here[program]
        elif name in old:
            figures[name] = old[name]
        else:
            print("! not recorded:", name)
    lines = ",\n".join(f"  {json.dumps(n)}: {json.dumps(value)}" for n, value in figures.items())
    RECORD.write_text(f'{{"versions": {json.dumps(versions)}, "figures": {{\n{lines}\n}}}}\n')


if __name__ == "__main__":
    record_again(tuple(sys.argv[1:]) or ("",))
