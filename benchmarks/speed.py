"""Measures how fast upright is, compared with the same arithmetic in C.

Each measurement is repeated in turns (Python, C, Python, C, ...), so that a drift of the machine's
speed affects both alike, and the medians are reported. Before anything is timed, both sides must
reach the same result: bit for bit if C is compiled without contraction, otherwise up to rounding.
Times are nanoseconds per step of one cart-pole.
"""

import argparse
import copy
import ctypes
import itertools
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import gymnasium
import numba
import numpy as np
from numpy.typing import NDArray

from upright.core.cartpole import step
from upright.core.compiled import compiled
from upright.core.loops import compiled_run
from upright.core.many import step_many
from upright.core.parameters import Parameters, State
from upright.core.task import Task
from upright.plants.equations import equations
from upright.studies.case import make_case
from upright.studies.random_streams import random_numbers
from upright.studies.run import make_run
from upright.support.files import write_file

FOLDER = Path(__file__).parent
COMPILERS = {
    "checked": ("gcc", "-O3", "-march=native", "-ffp-contract=off"),
    "plain": ("gcc", "-O3", "-march=native"),
    "fast": ("gcc", "-O3", "-march=native", "-ffast-math"),
}
"""The C programs: one that rounds exactly as Python does, the usual one, and the fastest."""
MARKS = ("<!-- table -->", "<!-- end of table -->")
"""Marks that enclose the table in a page."""
MANY = 16_384
"""Number of cart-poles that are stepped at once."""
EPISODE = 500
"""Steps after which the cart-poles are reset, so that none spins ever faster."""
CHECKED_STEPS = 100
"""Steps after which programs that round differently are compared: the plant is unstable, so the
difference grows."""
SEED = 1
PARAMETERS = Parameters()

Array = NDArray[np.float64]
Outcome = tuple[float, Array]
"""Time per step of one cart-pole [ns], and numbers by which results are compared."""
Program = Callable[[int], Outcome]
"""Makes the given number of steps."""


# ---- The C side ----------------------------------------------------------------------------------


class CParameters(ctypes.Structure):
    """`Parameters` of cartpole.h."""

    _fields_ = [(name, ctypes.c_double) for name in Parameters._fields]


class CQMemory(ctypes.Structure):
    """`QMemory` of cartpole.h."""

    _fields_ = [
        ("table", ctypes.c_void_p),
        ("table_length", ctypes.c_int64),
        ("edges", ctypes.c_void_p * 4),
        ("edge_counts", ctypes.c_int64 * 4),
        ("move_entries", ctypes.c_void_p),
        ("move_boxes", ctypes.c_void_p),
        ("replay_size", ctypes.c_int64),
        ("moves", ctypes.c_int64),
        ("mirrored", ctypes.c_bool),
    ]


class CReinforceMemory(ctypes.Structure):
    """`ReinforceMemory` of reference.c."""

    _fields_ = [
        ("weights", ctypes.c_void_p),
        ("scales", ctypes.c_void_p),
        ("logit_scale", ctypes.c_double),
        ("inputs", ctypes.c_void_p),
        ("actions", ctypes.c_void_p),
        ("probabilities", ctypes.c_void_p),
        ("kept_steps", ctypes.c_int64),
        ("length", ctypes.c_int64),
    ]


C_PARAMETERS = CParameters(*PARAMETERS[: len(CParameters._fields_)])


def load(name: str) -> ctypes.CDLL:
    """Compile reference.c as COMPILERS says and return the library."""
    build = FOLDER / "build"
    build.mkdir(exist_ok=True)
    library, unlinked = build / f"reference-{name}.so", build / f"reference-{name}.o"
    source = str(FOLDER / "reference.c")
    # In two steps: gcc, told -ffast-math while it links, changes the rounding of the whole process.
    subprocess.run([*COMPILERS[name], "-fPIC", "-c", source, "-o", str(unlinked)], check=True)
    subprocess.run(["gcc", "-shared", str(unlinked), "-o", str(library), "-lm"], check=True)
    loaded = ctypes.CDLL(str(library))
    pointers = {"plant": 3, "many": 3, "many_libm": 3}
    trials = {"trial_linear": 3, "trial_q": 3, "trial_reinforce": 4}
    for function, count in (pointers | trials).items():
        getattr(loaded, function).argtypes = [ctypes.c_void_p] * count + [ctypes.c_int64]
        getattr(loaded, function).restype = ctypes.c_int64 if function in trials else None
    return loaded


def address(array: NDArray[Any]) -> int:
    """Return where an array's numbers lie, one after the other; the caller keeps them alive."""
    assert array.flags.c_contiguous
    return array.ctypes.data


# ---- The plant -----------------------------------------------------------------------------------

START = State(0.01, -0.02, 0.03, -0.04)


@compiled
def push_by_rule(parameters: Parameters, weights: Array, state: State, steps: int) -> State:
    """Return the state after this many steps, pushing to the right where w · state > 0."""
    for _ in range(steps):
        total = weights[0] * state.x + weights[1] * state.x_dot
        total += weights[2] * state.theta + weights[3] * state.theta_dot
        state = step(parameters, state, parameters.force if total > 0.0 else -parameters.force)
    return state


def plant_in_python(weights: Array) -> Program:
    """Return the program that moves one cart-pole by the package's equations."""

    def program(steps: int) -> Outcome:
        began = time.perf_counter_ns()
        state = push_by_rule(PARAMETERS, weights, START, steps)
        return (time.perf_counter_ns() - began) / steps, np.array(state)

    return program


def plant_in_c(library: ctypes.CDLL, weights: Array) -> Program:
    """Return the program that does so in C."""

    def program(steps: int) -> Outcome:
        state = np.array(START)
        c_weights, c_state = address(weights), address(state)
        began = time.perf_counter_ns()
        library.plant(ctypes.byref(C_PARAMETERS), c_weights, c_state, steps)
        return (time.perf_counter_ns() - began) / steps, state

    return program


# ---- Many plants ---------------------------------------------------------------------------------


@cache
def states_of_many(number: int) -> Array:
    """Return memory for many states, the same for all programs: where it lies matters."""
    return np.empty((4, number))


@cache
def forces_of_many(number: int) -> Array:
    """Return two rows of pushes [N], to be used in turns."""
    return PARAMETERS.force * np.random.default_rng(SEED).choice([-1.0, 1.0], (2, number))


def steps_of_many(bind: Callable[[Array, Array], Callable[[], object]]) -> Program:
    """Return the program that moves many cart-poles, each pushed to and fro.

    ``bind(states, forces)`` returns a function of nothing that makes one step, in place; for ctypes
    takes longer to find where an array lies than to call with it. A step of the program is one
    step of all cart-poles.
    """
    rng = np.random.default_rng(SEED)
    start = rng.uniform(-0.05, 0.05, (4, MANY))
    forces = forces_of_many(MANY)
    states = states_of_many(MANY)
    moves = bind(states, forces[0]), bind(states, forces[1])

    def program(steps: int) -> Outcome:
        began = time.perf_counter_ns()
        for number in range(steps):
            if number % EPISODE == 0:
                states[:] = start
            moves[number % 2]()
        return (time.perf_counter_ns() - began) / (steps * MANY), states.copy()

    return program


def many_in_python() -> Program:
    """Return the program that calls the package's `step_many`."""
    return steps_of_many(lambda states, forces: partial(step_many, PARAMETERS, states, forces))


def many_in_c(library: ctypes.CDLL, function: str) -> Program:
    """Return the program that calls `many` or `many_libm` of reference.c."""
    move, parameters = getattr(library, function), ctypes.byref(C_PARAMETERS)
    return steps_of_many(
        lambda states, forces: partial(move, parameters, address(states), address(forces), MANY)
    )


def move_in_numpy(states: Array, forces: Array) -> None:
    """Advance many cart-poles as one would write it in NumPy; shapes as for `step_many`."""
    p = PARAMETERS
    x, x_dot, theta, theta_dot = states
    total_mass, moment = p.cart_mass + p.pole_mass, p.pole_mass * p.half_length
    sine, cosine = np.sin(theta), np.cos(theta)
    drive = (forces + moment * theta_dot**2 * sine - p.cart_friction * np.sign(x_dot)) / total_mass
    theta_acceleration = (
        p.gravity * sine - cosine * drive - p.pole_friction / moment * theta_dot
    ) / (p.half_length * (4.0 / 3.0 - p.pole_mass / total_mass * cosine**2))
    x_acceleration = drive - moment / total_mass * theta_acceleration * cosine
    x += p.time_step * x_dot
    x_dot += p.time_step * x_acceleration
    theta += p.time_step * theta_dot
    theta_dot += p.time_step * theta_acceleration


# ---- Trials --------------------------------------------------------------------------------------


class Trained(NamedTuple):
    """An agent that balances through long trials, and the trial it is measured in."""

    agent: Any
    """Its memory, of the type that the agent's own module defines."""
    run: int
    """Numbers the stream of random numbers of the trial."""


def one_trial(steps: int) -> Task:
    """Return the task of a single trial of this many steps."""
    return Task(steps=steps, trials=1)


def trained(name: str, steps: int) -> Trained:
    """Return the first agent of its kind that learns within a run and then lasts long enough.

    Random search learns nothing: it draws its policy when the trial begins, and the first stream
    that draws one good enough is returned.
    """
    for run in itertools.count():
        agent, result = make_run(make_case(name), SEED, run)
        if result and result.success:
            candidate = Trained(agent, run)
            # Four times as long: where C rounds otherwise, its trial runs another way.
            if trial_of(copy.deepcopy(candidate), 4 * steps)[1] == 4 * steps:
                return candidate
    raise AssertionError("itertools.count never ends")


def trial_of(trained: Trained, steps: int) -> tuple[float, int]:
    """Let an agent balance; return the time that took [ns] and how many steps it lasted."""
    plant, rng, task = equations(PARAMETERS), random_numbers(SEED, trained.run), one_trial(steps)
    lengths, stop = np.zeros(1, np.int64), np.zeros(1, np.bool_)
    began = time.perf_counter_ns()
    compiled_run(trained.agent, plant, task, rng, lengths, stop)
    return time.perf_counter_ns() - began, int(lengths[0])


def trial_in_python(trained: Trained, outcome: Callable[[Any], Array]) -> Program:
    """Return the program that lets an agent balance in the package's loop."""

    def program(steps: int) -> Outcome:
        after = copy.deepcopy(trained)  # every repetition starts from the same memory
        elapsed, length = trial_of(after, steps)
        assert length == steps, "only a trial without a fall, and so without learning, is timed"
        return elapsed / steps, outcome(after.agent)

    return program


def start_of(trained: Trained) -> tuple[Array, np.random.Generator]:
    """Return the state in which the trial starts, and the generator as it is then."""
    rng = random_numbers(SEED, trained.run)
    return np.array(one_trial(1).start) * (2.0 * rng.random(4) - 1.0), rng


def timed_trial(steps: int, trial: Callable[..., int], *arguments: Any) -> float:
    """Call a trial in C; return its time per step [ns]."""
    began = time.perf_counter_ns()
    length = trial(ctypes.byref(C_PARAMETERS), *arguments, steps)
    elapsed = time.perf_counter_ns() - began
    assert length == steps
    return elapsed / steps


def linear_weights(trained: Trained) -> Array:
    """Return the policy that random search draws from this stream."""
    after = copy.deepcopy(trained)
    trial_of(after, 1)
    return np.array(after.agent.weights)


def linear_in_c(library: ctypes.CDLL, trained: Trained) -> Program:
    """Return the program that lets the linear policy balance in C."""
    weights = linear_weights(trained)

    def program(steps: int) -> Outcome:
        state, _ = start_of(trained)
        return timed_trial(steps, library.trial_linear, address(weights), address(state)), weights

    return program


def q_outcome(agent: Any) -> Array:
    """Return what a trial changes in the memory of Q-learning: the kept moves, and how many."""
    return np.concatenate([agent.move_entries, agent.move_boxes, agent.moves]).astype(np.float64)


def q_in_c(library: ctypes.CDLL, trained: Trained) -> Program:
    """Return the program that lets Q-learning balance in C."""

    def program(steps: int) -> Outcome:
        agent = copy.deepcopy(trained.agent)
        assert agent.replay_passes > 0, "reference.c knows the default settings"
        edges = [np.array(each) for each in agent.boxes.edges]
        memory = CQMemory(
            address(agent.table),
            len(agent.table),
            (ctypes.c_void_p * 4)(*map(address, edges)),
            (ctypes.c_int64 * 4)(*map(len, edges)),
            address(agent.move_entries),
            address(agent.move_boxes),
            len(agent.move_boxes),
            int(agent.moves[0]),
            agent.mirrored,
        )
        state, _ = start_of(trained)
        elapsed = timed_trial(steps, library.trial_q, ctypes.byref(memory), address(state))
        agent.moves[0] = memory.moves
        return elapsed, q_outcome(agent)

    return program


def reinforce_outcome(agent: Any) -> Array:
    """Return the trial that REINFORCE remembers: its last inputs, pushes and probabilities."""
    episodes = agent.episodes
    newest = episodes.newest[0]
    return np.column_stack(
        [episodes.inputs[newest], episodes.actions[newest], episodes.probabilities[newest]]
    )


def pcg64_state(rng: np.random.Generator) -> NDArray[np.uint64]:
    """Return the state and the increment of NumPy's generator, low words first."""
    state = rng.bit_generator.state["state"]
    words = [state[name] >> shift & (2**64 - 1) for name in ("state", "inc") for shift in (0, 64)]
    return np.array(words, np.uint64)


def reinforce_in_c(library: ctypes.CDLL, trained: Trained) -> Program:
    """Return the program that lets REINFORCE balance in C, with the same random numbers."""

    def program(steps: int) -> Outcome:
        agent = copy.deepcopy(trained.agent)
        agent.begin_trial(None)
        episodes = agent.episodes
        newest = episodes.newest[0]
        memory = CReinforceMemory(
            address(agent.adam.weights),
            address(agent.scales),
            agent.logit_scale,
            address(episodes.inputs[newest]),
            address(episodes.actions[newest]),
            address(episodes.probabilities[newest]),
            episodes.actions.shape[1],
            0,
        )
        state, rng = start_of(trained)
        words = pcg64_state(rng)
        elapsed = timed_trial(
            steps,
            library.trial_reinforce,
            ctypes.byref(memory),
            address(words),
            address(state),
        )
        return elapsed, reinforce_outcome(agent)

    return program


# ---- What one would write without the package ----------------------------------------------------


def gymnasium_alone(weights: Array) -> Program:
    """Return the program that balances Gymnasium's CartPole by a linear policy in NumPy."""
    env = gymnasium.make("CartPole-v1").unwrapped

    def program(steps: int) -> Outcome:
        observation, _ = env.reset(seed=SEED)
        began = time.perf_counter_ns()
        for _ in range(steps):
            action = int(weights @ observation > 0.0)
            observation, _, terminated, _, _ = env.step(action)
            if terminated:
                observation, _ = env.reset()
        return (time.perf_counter_ns() - began) / steps, observation

    return program


def gymnasium_many() -> Program:
    """Return the program that moves many of Gymnasium's cart-poles; the fallen start again."""
    envs = gymnasium.make_vec("CartPole-v1", MANY, vectorization_mode="vector_entry_point")
    actions = np.random.default_rng(SEED).integers(0, 2, (2, MANY))

    def program(steps: int) -> Outcome:
        envs.reset(seed=SEED)
        began = time.perf_counter_ns()
        for number in range(steps):
            observations, *_ = envs.step(actions[number % 2])
        return (time.perf_counter_ns() - began) / (steps * MANY), observations

    return program


# ---- Comparing -----------------------------------------------------------------------------------


class Comparison(NamedTuple):
    """A line of the table."""

    what: str
    python: Program
    c: Callable[[ctypes.CDLL], Program]
    steps: int
    """Of one repetition; enough for a tenth of a second."""
    same: str
    """How the two ends agree: "exactly" if C rounds alike, "nearly", or "not": another plant."""


def comparisons(scale: float) -> Iterator[Comparison]:
    """Yield the lines of the table, the numbers of steps multiplied by `scale`."""

    def steps(count: int) -> int:
        return max(int(count * scale), CHECKED_STEPS)

    linear = trained("random-search", steps(3_000_000))
    q_learning = trained("q-learning", steps(1_000_000))
    reinforce = trained("reinforce", steps(1_000_000))
    weights = linear_weights(linear)

    def one_plant(library: ctypes.CDLL) -> Program:
        return plant_in_c(library, weights)

    def many_plants(library: ctypes.CDLL) -> Program:
        return many_in_c(library, "many")

    def linear_trial(library: ctypes.CDLL) -> Program:
        return linear_in_c(library, linear)

    yield Comparison(
        "one cart-pole, a linear rule",
        plant_in_python(weights),
        one_plant,
        steps(3_000_000),
        "exactly",
    )
    yield Comparison(
        f"{MANY:,} cart-poles at once",
        many_in_python(),
        many_plants,
        steps(20_000),
        "exactly",
    )
    yield Comparison(
        f"{MANY:,} cart-poles at once; C with libm's sine and cosine",
        many_in_python(),
        lambda library: many_in_c(library, "many_libm"),
        steps(5_000),
        "nearly",
    )
    yield Comparison(
        "a trial of `random-search` (linear policy)",
        trial_in_python(linear, lambda agent: np.array(agent.weights)),
        linear_trial,
        steps(3_000_000),
        "exactly",
    )
    yield Comparison(
        "a trial of `q-learning`",
        trial_in_python(q_learning, q_outcome),
        lambda library: q_in_c(library, q_learning),
        steps(1_000_000),
        "exactly",
    )
    yield Comparison(
        "a trial of `reinforce` (network 4-8-16-1)",
        trial_in_python(reinforce, reinforce_outcome),
        lambda library: reinforce_in_c(library, reinforce),
        steps(1_000_000),
        "exactly",
    )
    yield Comparison(
        f"without the package: NumPy, {MANY:,} cart-poles at once",
        steps_of_many(lambda states, forces: partial(move_in_numpy, states, forces)),
        many_plants,
        steps(500),
        "nearly",
    )
    yield Comparison(
        f"without the package: Gymnasium's vector environment, {MANY:,} cart-poles",
        gymnasium_many(),
        many_plants,
        steps(500),
        "not",
    )
    yield Comparison(
        "without the package: Gymnasium's environment, a linear policy in NumPy",
        gymnasium_alone(weights),
        linear_trial,
        steps(50_000),
        "not",
    )


def check(comparison: Comparison, libraries: dict[str, ctypes.CDLL]) -> None:
    """Assert that Python and C compute the same; this also compiles what they call."""
    if comparison.same == "exactly":
        steps = comparison.steps
        ends = comparison.python(steps)[1], comparison.c(libraries["checked"])(steps)[1]
        np.testing.assert_array_equal(*ends, err_msg=comparison.what)
    python = comparison.python(CHECKED_STEPS)[1]
    if comparison.same != "not":
        for library in libraries.values():
            c = comparison.c(library)(CHECKED_STEPS)[1]
            np.testing.assert_allclose(python, c, rtol=0, atol=1e-6, err_msg=comparison.what)


class Measurement(NamedTuple):
    """Medians of one line's repetitions."""

    python: float
    """Time per step [ns]."""
    c: dict[str, float]
    """Time per step [ns] of each C program."""
    ratios: dict[str, float]
    """Python's time by C's, of neighbours in time."""


def measure(
    comparison: Comparison, libraries: dict[str, ctypes.CDLL], repetitions: int
) -> Measurement:
    """Time both sides in turns."""
    programs = {name: comparison.c(libraries[name]) for name in ("plain", "checked", "fast")}
    times: dict[str, list[float]] = {"python": [], "plain": [], "checked": [], "fast": []}
    for _ in range(repetitions):
        times["python"].append(comparison.python(comparison.steps)[0])
        for name, program in programs.items():
            times[name].append(program(comparison.steps)[0])
    return Measurement(
        python=median(times["python"]),
        c={name: median(times[name]) for name in programs},
        ratios={
            name: median(a / b for a, b in zip(times["python"], times[name], strict=True))
            for name in programs
        },
    )


# ---- The table -----------------------------------------------------------------------------------


def machine() -> str:
    """Return a line that names the processor and the versions."""
    cpu = Path("/proc/cpuinfo")
    models = [
        line.split(":")[1].strip()
        for line in (cpu.read_text().splitlines() if cpu.exists() else [])
        if line.startswith("model name")
    ]
    gcc = subprocess.run(["gcc", "-dumpfullversion"], capture_output=True, text=True, check=True)
    versions = {
        "Python": platform.python_version(),
        "NumPy": np.__version__,
        "Numba": numba.__version__,
        "Gymnasium": gymnasium.__version__,
        "gcc": gcc.stdout.strip(),
    }
    named = [models[0] if models else platform.machine(), f"{platform.system()}"]
    return ", ".join(named + [f"{name} {version}" for name, version in versions.items()])


def table(lines: dict[str, Measurement]) -> str:
    """Return the Markdown table."""
    head = "what | ns per step | in C [ns] | **ratio** | ratio, same rounding | ratio, fast-math"
    rows = [head.split(" | "), ["---"] + ["---:"] * 5]
    for what, line in lines.items():
        ratios = [f"{line.ratios[name]:.2f}" for name in ("plain", "checked", "fast")]
        rows.append([what, f"{line.python:.3g}", f"{line.c['plain']:.3g}", *ratios])
    return "\n".join("| " + " | ".join(row) + " |" for row in rows) + "\n"


def make_parser(description: str | None, page: str) -> argparse.ArgumentParser:
    """Return a parser for a script whose table goes into a page or to the terminal."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help=f"write the table into this page, between its two marks, as in {page} "
        "(default: to the terminal)",
    )
    return parser


def put(text: str, path: Path | None) -> None:
    """Write the table into a page, in place of the one between its two marks, or print it."""
    if path is None:
        print(text, end="")
        return
    page = path.read_text(encoding="utf-8")
    before, _, rest = page.partition(MARKS[0])
    _, _, after = rest.partition(MARKS[1])
    write_file(path, f"{before}{MARKS[0]}\n{text}{MARKS[1]}{after}")


def main() -> None:
    """Measure, and write the table."""
    parser = make_parser(__doc__, "docs/performance.md")
    parser.add_argument(
        "--repetitions",
        type=int,
        default=7,
        metavar="COUNT",
        help="how often each side is timed; medians are reported (default: %(default)s)",
    )
    parser.add_argument(
        "--scale",
        type=float,
        default=1.0,
        help="multiply the length of every measurement, e.g. 0.01 for a quick look that proves "
        "nothing (default: %(default)s, about a minute and a half)",
    )
    arguments = parser.parse_args()
    libraries = {name: load(name) for name in COMPILERS}
    lines = {}
    for comparison in comparisons(arguments.scale):
        print(comparison.what, file=sys.stderr)
        check(comparison, libraries)
        lines[comparison.what] = measure(comparison, libraries, arguments.repetitions)
    text = f"{table(lines)}\n{machine()}; one thread.\n"
    put(text, arguments.output)


if __name__ == "__main__":
    main()
