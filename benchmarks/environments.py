"""Measures how fast the vector environment is, compared with other cart-poles.

All are stepped in turns, in one process, 4,096 environments at a time: the package's with and
without noise, Gymnasium's own, gymnax and EnvPool if they are installed, and the same in C. There
are two measurements: with random pushes, where one episode in twenty ends with each step and the
next begins, and with the pushes of a policy that balances, where no episode ever ends. Only the
steps are timed; medians are reported.
"""

import ctypes
import sys
import time
from collections.abc import Callable
from statistics import median
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from numpy.typing import NDArray
from speed import C_PARAMETERS, address, load, machine, make_parser, put

SEED = 1
ROUND = 25
"""Steps of one contender before it is the next contender's turn."""
BALANCING = np.array([1.0, 1.5, 20.0, 3.0])
"""A linear policy that balances."""
PEERS = ("gymnax", "envpool")

Array = NDArray[Any]
Step = Callable[[Array], Array]
"""Makes a step with the given actions and returns the observations, shape (n, 4)."""


class Contender(NamedTuple):
    """A vector environment, or the same in C."""

    name: str
    step: Step
    first: Array
    """The first observations."""


# ---- Contenders ----------------------------------------------------------------------------------


def ours(count: int, **options: Any) -> gymnasium.vector.VectorEnv[Any, Any, Any]:
    """Return the package's vector environment."""
    return gymnasium.make_vec(
        "upright/CartPole-v0", count, vectorization_mode="vector_entry_point", **options
    )


def of_gymnasium(name: str, envs: gymnasium.vector.VectorEnv[Any, Any, Any]) -> Contender:
    """Return a contender with Gymnasium's interface."""
    first, _ = envs.reset(seed=SEED)
    return Contender(name, lambda actions: envs.step(actions)[0], first)


class CLanes(ctypes.Structure):
    """`Lanes` of reference.c."""

    _fields_ = [
        ("states", ctypes.c_void_p),
        ("words", ctypes.c_void_p),
        ("steps", ctypes.c_void_p),
        ("ended", ctypes.c_void_p),
        ("n", ctypes.c_int64),
        ("limit", ctypes.c_int64),
    ]


def in_c(count: int, library: ctypes.CDLL) -> Contender:
    """Return the same in C, with the same start states as the package's environment."""
    envs = ours(count).unwrapped
    first, _ = envs.reset(seed=SEED)
    batch = envs._batch
    memory = CLanes(
        *map(address, (batch.states, batch.words, batch.steps, batch.ended)),
        count,
        envs.rules.steps,
    )
    outcome = envs._new_outcome()
    results = [ctypes.c_void_p(address(array)) for array in outcome[:4]]
    vector_step, parameters = library.vector_step, ctypes.byref(C_PARAMETERS)

    def step(actions: Array) -> Array:
        assert envs is not None, "it owns the memory"
        vector_step(
            parameters, ctypes.byref(memory), ctypes.c_void_p(actions.ctypes.data), *results
        )
        return outcome.observations.T

    return Contender("C", step, first)


def of_gymnax(count: int) -> Contender:
    """Return gymnax's cart-pole, compiled by JAX; the next episode begins in the same step."""
    import gymnax
    import jax

    env, parameters = gymnax.make("CartPole-v1")
    reset = jax.jit(jax.vmap(env.reset, in_axes=(0, None)))
    many = jax.vmap(env.step, in_axes=(0, 0, 0, None))

    @jax.jit
    def step_many(key: Any, state: Any, actions: Any) -> Any:
        key, other = jax.random.split(key)
        observations, state, *rest = many(
            jax.random.split(other, count), state, actions, parameters
        )
        return key, observations, state, rest

    key = jax.random.PRNGKey(SEED)
    first, state = reset(jax.random.split(key, count), parameters)
    memory = [key, state]

    def step(actions: Array) -> Array:
        memory[0], observations, memory[1], rest = step_many(*memory, actions)
        jax.block_until_ready((observations, rest))
        return observations  # type: ignore[no-any-return]

    return Contender("gymnax", step, np.asarray(first))


def of_envpool(count: int) -> Contender:
    """Return EnvPool's cart-pole, with its default number of threads."""
    import envpool

    envs = envpool.make("CartPole-v1", env_type="gymnasium", num_envs=count, seed=SEED)
    first, _ = envs.reset()
    return Contender("EnvPool", lambda actions: envs.step(actions)[0], first)


def contenders(count: int, library: ctypes.CDLL) -> list[Contender]:
    """Return all contenders that are installed; name the others on standard error."""
    installed = [of_gymnasium("upright", ours(count)), in_c(count, library)]
    for noise in ("actuator-10", "sensor-10", "gaussian-0.2"):
        installed.append(of_gymnasium(f"upright, {noise}", ours(count, noise=noise)))
    installed.append(of_gymnasium("upright, same step", ours(count, autoreset_mode="SameStep")))
    installed.append(of_gymnasium("upright, float64", ours(count, dtype="float64")))
    own = gymnasium.make_vec("CartPole-v1", count, vectorization_mode="vector_entry_point")
    installed.append(of_gymnasium("Gymnasium", own))
    for name, make in zip(PEERS, (of_gymnax, of_envpool), strict=True):
        try:
            installed.append(make(count))
        except ImportError:
            print(f"{name} is not installed and is left out", file=sys.stderr)
    return installed


# ---- Comparing -----------------------------------------------------------------------------------


def check(count: int, library: ctypes.CDLL) -> None:
    """Assert that C, which rounds as Python does, makes the same observations over restarts."""
    mine, theirs = of_gymnasium("upright", ours(count)), in_c(count, library)
    rng = np.random.default_rng(SEED)
    for _ in range(200):
        actions = rng.integers(0, 2, count)
        np.testing.assert_array_equal(mine.step(actions), theirs.step(actions))


def measure(count: int, rounds: int, library: ctypes.CDLL, *, balances: bool) -> dict[str, Array]:
    """Return the time per step and environment [ns] of every contender in each round."""
    installed = contenders(count, library)
    last = {contender.name: contender.first for contender in installed}
    times: dict[str, list[float]] = {contender.name: [] for contender in installed}
    rng = np.random.default_rng(SEED)
    for _ in range(rounds):
        for contender in installed:
            observed, elapsed = last[contender.name], 0
            for _ in range(ROUND):
                if balances:
                    actions = (np.asarray(observed) @ BALANCING > 0).astype(np.int64)
                else:
                    actions = rng.integers(0, 2, count)
                began = time.perf_counter_ns()
                observed = contender.step(actions)
                elapsed += time.perf_counter_ns() - began
            last[contender.name] = observed
            times[contender.name].append(elapsed / ROUND / count)
    return {name: np.array(values) for name, values in times.items()}


def table(falling: dict[str, Array], balancing: dict[str, Array]) -> str:
    """Return the Markdown table; a ratio is the median over the rounds."""
    head = ["environment", "falling [ns]", "× upright", "balancing [ns]", "× upright"]
    rows = [head, ["---"] + ["---:"] * 4]
    for name in falling:
        cells = [name]
        for times in (falling, balancing):
            ratio = median(times[name] / times["upright"])
            cells += [f"{median(times[name]):.3g}", f"{ratio:.2f}"]
        rows.append(cells)
    return "\n".join("| " + " | ".join(row) + " |" for row in rows) + "\n"


def python_share(count: int, rounds: int) -> float:
    """Return the fraction of a step that is spent outside the compiled loop."""
    envs = ours(count).unwrapped
    envs.reset(seed=SEED)
    rng = np.random.default_rng(SEED)
    envs.step(rng.integers(0, 2, count))
    compiled_loop, inside = envs._step, 0

    def timed_loop(*arguments: Any) -> int:
        nonlocal inside
        began = time.perf_counter_ns()
        restarts: int = compiled_loop(*arguments)
        inside = time.perf_counter_ns() - began
        return restarts

    envs._step = timed_loop
    shares = []
    for _ in range(rounds * ROUND):
        actions = rng.integers(0, 2, count)
        began = time.perf_counter_ns()
        envs.step(actions)
        shares.append(1 - inside / (time.perf_counter_ns() - began))
    return median(shares)


def one_at_a_time(rounds: int) -> str:
    """Return a sentence about single environments without wrappers, stepped in turns."""
    envs = {
        "upright": gymnasium.make("upright/CartPole-v0").unwrapped,
        "with noise": gymnasium.make("upright/CartPole-v0", noise="gaussian-0.2").unwrapped,
        "Gymnasium's": gymnasium.make("CartPole-v1").unwrapped,
    }
    times: dict[str, list[float]] = {name: [] for name in envs}
    for _ in range(rounds):
        for name, env in envs.items():
            env.reset(seed=SEED)
            began = time.perf_counter_ns()
            for number in range(20 * ROUND):
                if env.step(number % 2)[2]:
                    env.reset()
            times[name].append((time.perf_counter_ns() - began) / (20 * ROUND))
    ours_, noisy, theirs = (np.array(values) for values in times.values())
    return (
        f"A single environment without wrappers takes {median(ours_) / 1000:.1f} µs per step, and "
        f"{median(noisy) / 1000:.1f} µs under Gaussian noise; Gymnasium's takes "
        f"{median(theirs / ours_):.2f} and {median(theirs / noisy):.2f} times as long."
    )


def main() -> None:
    """Measure, and write the table."""
    parser = make_parser(__doc__, "docs/environment.md")
    parser.add_argument("--count", type=int, default=4096, help="environments (default 4096)")
    parser.add_argument("--rounds", type=int, default=60, help="turns of each (default 60)")
    arguments = parser.parse_args()
    check(arguments.count, load("checked"))
    falling, balancing = (
        measure(arguments.count, arguments.rounds, load("plain"), balances=balances)
        for balances in (False, True)
    )
    share = python_share(arguments.count, arguments.rounds)
    text = (
        f"{table(falling, balancing)}\nTimes are per step and environment, with "
        f"{arguments.count:,} environments. Python takes {100 * share:.0f} % of upright's step. "
        f"{one_at_a_time(arguments.rounds)}\n"
        f"{machine()}.\n"
    )
    put(text, arguments.output)


if __name__ == "__main__":
    main()
