"""Shared by several tests: plants and agents in plain Python, and access to an agent's memory."""

import importlib
import itertools
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from upright.core.cartpole import Integrator, step
from upright.core.parameters import Parameters, State
from upright.core.task import Task, TaskSpec
from upright.core.trials import Result
from upright.plants.equations import equations
from upright.plants.settings import RunContext
from upright.reports.statistics import Row
from upright.studies.store import Store

ROOT = Path(__file__).parents[1]
"""The root folder of the project."""

UPRIGHT = State(0.0, 0.0, 0.0, 0.0)
LYING = State(0.0, 0.0, 1.0, 0.0)
HARD_START = State(2.0, 1.0, 0.2, 1.0)
"""Half-widths of a start from which no agent balances every time, so that trials differ."""


class RecordingPlant:
    """The equations, with a record of starts, forces and states."""

    def __init__(self, parameters: Parameters | None = None) -> None:
        self.inner = equations(parameters)
        self.starts: list[State] = []
        self.forces: list[list[float]] = []
        self.states: list[list[State]] = []

    def reset(self, state: State) -> State:
        self.starts.append(state)
        self.forces.append([])
        self.states.append([])
        return self.inner.reset(state)

    def step(self, force: float) -> State:
        after = self.inner.step(force)
        self.forces[-1].append(force)
        self.states[-1].append(after)
        return after

    def has_fallen(self, state: State) -> bool:
        return self.inner.has_fallen(state)

    def close(self) -> None:
        self.inner.close()


class ScriptedPlant:
    """A plant that falls at a given step of each trial, whatever the force."""

    def __init__(self, *falls: int) -> None:
        self.falls = iter(falls)
        self.fall = 0
        self.steps = 0

    def reset(self, state: State) -> State:
        self.fall, self.steps = next(self.falls), 0
        return state

    def step(self, force: float) -> State:
        self.steps += 1
        return LYING if self.steps == self.fall else UPRIGHT

    def has_fallen(self, state: State) -> bool:
        return state == LYING

    def close(self) -> None: ...


class LinearAgent:
    """A fixed linear policy in plain Python, with a record of every call."""

    def __init__(self, *weights: float) -> None:
        self.weights = weights
        self.begun = 0
        self.moves: list[list[tuple[State, bool, State, bool]]] = []
        self.ends: list[bool] = []

    def begin_trial(self, rng: np.random.Generator) -> None:
        self.begun += 1
        self.moves.append([])

    def act(self, observation: State, rng: np.random.Generator) -> bool:
        return sum(w * o for w, o in zip(self.weights, observation, strict=True)) > 0

    def learn(self, before: State, action: bool, after: State, fallen: bool) -> None:
        self.moves[-1].append((before, action, after, fallen))

    def end_trial(self, fallen: bool) -> None:
        self.ends.append(fallen)


def make_context(task: Task | None = None, spec: TaskSpec | None = None) -> RunContext:
    """Return the context of a run that is never stopped, from which plants are made."""
    spec = spec or TaskSpec()
    return RunContext(task or spec.task(), spec, 0, np.zeros(1, np.bool_))


def make_task(noise: str = "none", start: str = "random", **names: Any) -> Task:
    """Return in numbers the task with these named parts."""
    return TaskSpec(noise, start, **names).task()


class GuessingLearner:
    """A learner that only knows Gymnasium; it draws new weights for every episode."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def train(self, env: Any) -> None:
        while True:
            weights = self.rng.uniform(-1.0, 1.0, 4) * (1.0, 1.0, 10.0, 1.0)
            observation, _ = env.reset()
            over = False
            while not over:
                action = int(observation @ weights > 0.0)
                observation, _, fallen, truncated, _ = env.step(action)
                over = fallen or truncated


COMMAND = [
    sys.executable,
    "-c",
    # A shell starts background jobs with SIGINT ignored, and their children inherit that.
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    "from upright.commands import main; main()",
]
"""The command `upright`, in a process of its own."""


LEARNED_ON = {
    "noise": "none",
    "start": "random",
    "condition": "nominal",
    "steps": 2000,
    "trials": 1000,
    "parameters": {},
    "seed": 0,
    "run": 0,
}
"""What a policy learned in tests states about its task."""
GOOD_WEIGHTS = (1.0, 1.5, 20.0, 3.0)
"""Weights of a policy that balances indefinitely."""
POOR_WEIGHTS = (0.0, 0.0, 1.0, 0.0)
"""Weights of a policy that falls after a while."""


LEANING = State(0.01, 0.2, 0.03, -0.1)
"""Start state of the trajectories that compare simulators."""
PUSHES = {
    "free": [0.0] * 50,
    "constant": [10.0] * 35,
    "bang-bang": [-10.0 if step // 5 % 2 == 0 else 10.0 for step in range(50)],
}
"""Forces [N] along those trajectories. None leaves the track; the last two tip the pole over."""


def trajectory(plant: Any, forces: Iterable[float]) -> np.ndarray:
    """Return the states of a plant pushed from LEANING, shape (steps, 4)."""
    plant.reset(LEANING)
    return np.array([plant.step(force) for force in forces])


class FinePlant:
    """The equations by RK4 with 200 substeps per time step, which makes errors negligible."""

    def __init__(self, parameters: Parameters) -> None:
        self.fine = parameters._replace(time_step=parameters.time_step / 200)

    def reset(self, state: State) -> State:
        self.state = state
        return state

    def step(self, force: float) -> State:
        for _ in range(200):
            self.state = step(self.fine, self.state, force, Integrator.RK4)
        return self.state


def energy(p, state):
    """Return the kinetic plus potential energy of cart and pole [J]."""
    moment = p.pole_mass * p.half_length
    return (
        0.5 * (p.cart_mass + p.pole_mass) * state.x_dot**2
        + moment * math.cos(state.theta) * state.x_dot * state.theta_dot
        + 0.5 * 4 / 3 * moment * p.half_length * state.theta_dot**2
        + moment * p.gravity * math.cos(state.theta)
    )


_numbers = itertools.count()


def new_module_name() -> str:
    """Return a name that no other module has."""
    return f"outside_{next(_numbers)}"


def forget(name: str) -> None:
    """Forget a module, as a new process would."""
    sys.modules.pop(name, None)
    importlib.invalidate_caches()


def arrays(memory: Any) -> Iterator[np.ndarray]:
    """Yield every array in an agent's memory."""
    for value in memory:
        if isinstance(value, np.ndarray):
            yield value
        elif isinstance(value, tuple):
            yield from arrays(value)


def recorded_rows(path: Path) -> list[Row]:
    """Return the rows of a table written as JSON."""
    return [Row.from_data(values) for values in json.loads(path.read_text())]


def python(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run Python code in a separate process, with these environment variables added."""
    return subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


_domains = itertools.count(os.getpid())
_LOCKS = Path(tempfile.gettempdir())
RESTS = 30.0
"""How long a ROS domain is not used again: a killed node still counts in it for 20 s [s]."""


@contextmanager
def ros_domain() -> Iterator[dict[str, str]]:
    """Claim a ROS domain of this machine that no process of tests uses, or has used just now.

    Yields
    ------
    dict
        The environment variables of nodes in this domain.
    """
    import fcntl  # only where ROS 2 is

    for number in _domains:
        domain = str(1 + number % 100)
        with open(_LOCKS / f"upright-ros-domain-{domain}", "a+") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            lock.seek(0)
            if time.time() - float(lock.read() or 0) < RESTS:
                continue
            try:
                yield {"ROS_DOMAIN_ID": domain, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
            finally:
                lock.truncate(0)
                lock.write(str(time.time()))
            return


def write_results(path: Path, key: str, first: int, last: int, barrier: Any) -> None:
    """Write runs `first` to `last - 1` into a store, at the same moment as other processes.

    It stands here because a new process imports it by name.
    """
    barrier.wait()
    with Store(path) as store:
        for run in range(first, last):
            store.add(key, 1, Result(run, True, np.array([run, run + 1]), 0.5))


SIZES: dict[str, tuple[str, ...]] = {
    "varied-plant": ("",),
    "friction": ("100", "0.5"),
    "stick-slip": ("12",),
    "tilt": ("2", "-1.5"),
    "delay": ("1", "3"),
    "left-force": ("5", "12.5"),
    "lag": ("0.03",),
    "dead-zone": ("1.5",),
    "saturation": ("8",),
    "wind": ("0.7", "-1"),
    "gust": ("4", "5,gust-every=0.2,gust-for=0.1"),
    "angle-bias": ("0.3",),
    "position-bias": ("-0.1",),
    "encoder": ("1024", "360"),
    "no-velocities": ("",),
    "velocity-differences": ("",),
    "measurement-delay": ("1", "2"),
    "dropped": ("0.1",),
    "at-STEP.PARAMETER": ("at-20.half_length=0.8", "at-30.force=-7"),
    "each-run.PARAMETER": ("each-run.force=8:12",),
    "each-episode.PARAMETER": (
        "each-episode.gravity=8:11",
        "each-episode.pole_friction=1e-6:1e-4:log",
    ),
}
"""Some sizes of every term of a condition; whole terms where the name has places to fill."""
OF_A_RUN = ("varied-plant", "each-run.PARAMETER")
"""Terms that are about runs, which environments do not have."""


def task_texts(without: tuple[str, ...] = ()) -> Any:
    """Return a Hypothesis strategy for a noise and a condition, of random terms."""
    from hypothesis import strategies as st

    def text(name: str, size: str) -> str:
        return size if "." in name else f"{name}={size}" if size else name

    sizes = {
        "actuator": ("0.1",),
        "sensor": ("0.1",),
        "others": ("0.07",),
        "gaussian": ("0.1", "0.4"),
    }

    def some(terms: dict[str, tuple[str, ...]], most: int) -> Any:
        one = [
            st.sampled_from(values).map(lambda size, n=name: text(n, size))
            for name, values in terms.items()
        ]
        chosen = st.lists(st.sampled_from(range(len(one))), unique=True, max_size=most)
        return chosen.flatmap(lambda numbers: st.tuples(*(one[k] for k in numbers)))

    conditions = {name: values for name, values in SIZES.items() if name not in without}
    return st.tuples(
        some(sizes, 2).map(lambda parts: ",".join(parts) or "none"),
        some(conditions, 6)
        .filter(lambda parts: not {"no-velocities", "velocity-differences"} <= set(parts))
        .map(lambda parts: ",".join(parts) or "nominal"),
    )
