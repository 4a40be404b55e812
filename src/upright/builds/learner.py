"""A learner as functions and one block of memory, for any machine."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numba.core.errors import NumbaError

from upright.builds.machine import Function, Machine, emit
from upright.builds.memory import Memory, narrowed
from upright.builds.numba_inside import Lowered, lower
from upright.core.compiled import explain, inlined, is_compiled
from upright.core.contracts import Agent, Plant
from upright.core.parameters import State
from upright.core.pcg64 import Pcg64, new_stream
from upright.core.task import Task
from upright.core.trials import Progress, advance, new_progress, push, start
from upright.errors import UprightError
from upright.policies.npz_file import arrays_of
from upright.studies.case import Case
from upright.studies.random_streams import random_numbers
from upright.studies.run import make_plant, new_agent


class Built(NamedTuple):
    """Functions for a machine."""

    code: bytes
    """An object file."""
    memory: Memory
    """How their memory is laid out."""
    names: tuple[str, ...]
    """Names of the functions."""


def build_learner(case: Case, machine: Machine) -> Built:
    """Return a learner on its plant.

    Its functions take a pointer to its memory:

    - ``begin(memory)`` sets the memory to that of a new learner;
    - ``seed(memory, seed, run)`` draws what a new learner draws, so that what follows is the run
      with this number of a study with this seed, both below 2³²;
    - ``advance(memory, count)`` makes up to this many steps of the run, and returns how many it
      made: fewer once the run has ended;
    - ``push_probability(memory, x, x_dot, theta, theta_dot)`` is that of a push to the right.

    Raises
    ------
    UprightError
        If the agent cannot be built: it is not compiled, or calls the C library, or draws random
        numbers when it is created and has no method `begin_run` that draws them.
    """
    agent = buildable_agent(case)
    plant, task = make_plant(case, 0, 0, np.zeros(1, np.bool_))
    rng, lengths = new_stream(0, 0), np.zeros(case.spec.trials, np.int64)
    run = {"agent": agent, "plant": plant, "task": task, "rng": rng}
    rest = {"progress": new_progress(), "lengths": lengths, "count": 0}
    with _naming(case):
        functions = {
            "seed": _seed(agent, rng),
            "advance": Function(lower(advance, run | rest), ("count",)),
            **_probability(agent),
        }
        return _built(functions, machine)


def build_agent(case: Case, machine: Machine, *, single: bool = False) -> Built:
    """Return a learner without a plant: what measures and pushes is the caller's.

    Its functions, whose names begin with ``upright_``, are ``begin``, ``seed`` and
    ``push_probability`` as above, and:

    - ``begin_trial(memory)``;
    - ``act(memory, x, x_dot, theta, theta_dot)`` returns 1 for a push to the right, else 0;
    - ``learn(memory, x, x_dot, theta, theta_dot, fallen)`` learns from that push, given what was
      measured after it;
    - ``end_trial(memory, fallen)``.

    Parameters
    ----------
    case
        The agent with its settings.
    machine
        What to build for.
    single
        Whether numbers have 32 bits: faster on some machines, and other bits than here.

    Raises
    ------
    UprightError
        As above.
    """
    agent, rng, last = buildable_agent(case), new_stream(0, 0), new_progress()
    if single:
        agent, last = narrowed((agent, last))
    state = State(0.0, 0.0, 0.0, 0.0)
    seen = {"agent": agent, "last": last, "observation": state}
    ending = {"agent": agent, "fallen": False}
    code = partial(lower, single=single)
    with _naming(case):
        functions = {
            "seed": _seed(agent, rng, code),
            "begin_trial": Function(code(_begin_trial, {"agent": agent, "rng": rng})),
            "act": Function(code(_act, seen | {"rng": rng}), ("observation",)),
            "learn": Function(code(_learn, seen | ending), ("observation", "fallen")),
            "end_trial": Function(code(_end_trial, ending), ("fallen",)),
            **_probability(agent, code),
        }
        return _built(functions, machine, "upright_")


def build_cart(case: Case, machine: Machine) -> Built:
    """Return a simulated cart-pole, to try a learner without a real one.

    Its functions, whose names begin with ``cart_``, are ``begin`` as above, and:

    - ``seed(memory, seed, run)``;
    - ``reset(memory)`` puts it at a start;
    - ``push(memory, right)`` pushes it for a time step, and returns whether it has fallen.

    What is measured then lies in its memory, as the array ``observation``.
    """
    plant, task = make_plant(case, 0, 0, np.zeros(1, np.bool_))
    rng, observation = new_stream(0, 0), np.zeros(4)
    cart = {"plant": plant, "task": task, "rng": rng, "observation": observation}
    functions = {
        "seed": Function(lower(Pcg64.seed, {"rng": rng, "seed": 0, "run": 0}), ("seed", "run")),
        "reset": Function(lower(_reset, cart)),
        "push": Function(lower(_push, cart | {"right": False}), ("right",)),
    }
    return _built(functions, machine, "cart_")


def _built(functions: Mapping[str, Function], machine: Machine, prefix: str = "") -> Built:
    memory = Memory(leaf for each in functions.values() for leaf in each.leaves())
    return Built(emit(functions, memory, machine, prefix), memory, ("begin", *functions))


@contextmanager
def _naming(case: Case) -> Iterator[None]:
    """Name the agent in what is wrong with its code."""
    try:
        yield
    except NumbaError as error:
        reason = f"it cannot be compiled: {explain(error)}"
        raise UprightError(f"agent is {case.agent!r}: {reason}") from error
    except UprightError as error:
        raise UprightError(f"agent is {case.agent!r}: {error}") from error


# ---- What can be built ---------------------------------------------------------------------------


def buildable_agent(case: Case) -> Any:
    """Return a new agent of a case, if code for another machine can make one just like it.

    Raises
    ------
    UprightError
        If it is not compiled, or its first numbers could not be drawn there.
    """
    rng = random_numbers(0, 0)
    untouched = rng.bit_generator.state
    agent = new_agent(case, rng)
    if not is_compiled(agent):
        raise UprightError(
            f"agent is {case.agent!r}: it is plain Python, and only an agent whose methods are "
            "compiled can be built (docs/own-agent.md shows how)"
        )
    if rng.bit_generator.state != untouched and not hasattr(agent, "begin_run"):
        raise UprightError(
            f"agent is {case.agent!r}: it draws random numbers when it is created; to be built, it "
            "draws them in a compiled method begin_run(rng), which its constructor calls"
        )
    if hasattr(agent, "begin_run"):
        other = new_agent(case, random_numbers(1, 0))
        other.begin_run(random_numbers(0, 0))
        pairs = zip(arrays_of(agent), arrays_of(other), strict=True)
        if not all(np.array_equal(one, two) for (_, one), (_, two) in pairs):
            raise UprightError(
                f"agent is {case.agent!r}: begin_run(rng) does not leave the agent that its "
                "constructor makes with the same random numbers"
            )
    return agent


# ---- What the functions do -----------------------------------------------------------------------


def _seed(agent: Any, rng: Pcg64, code: Callable[..., Lowered] = lower) -> Function:
    numbers = {"seed": 0, "run": 0}
    if hasattr(agent, "begin_run"):
        arguments = {"agent": agent, "rng": rng} | numbers
        return Function(code(_begin_run, arguments), tuple(numbers))
    return Function(code(Pcg64.seed, {"rng": rng} | numbers), tuple(numbers))


def _probability(agent: Any, code: Callable[..., Lowered] = lower) -> dict[str, Function]:
    if not hasattr(agent, "push_probability"):
        return {}
    arguments = {"agent": agent, "observation": State(0.0, 0.0, 0.0, 0.0)}
    return {"push_probability": Function(code(_push_probability, arguments), ("observation",))}


@inlined
def _begin_run(agent: Any, rng: Pcg64, seed: int, run: int) -> None:
    rng.seed(seed, run)
    agent.begin_run(rng)


@inlined
def _push_probability(agent: Any, observation: State) -> float:
    return float(agent.push_probability(observation))


@inlined
def _begin_trial(agent: Agent, rng: Any) -> None:
    agent.begin_trial(rng)


@inlined
def _act(agent: Agent, last: Progress, observation: State, rng: Any) -> bool:
    action = agent.act(observation, rng)
    last.action[0] = action
    _keep(last.observation, observation)
    return bool(action)


@inlined
def _learn(agent: Agent, last: Progress, observation: State, fallen: bool) -> None:
    seen = last.observation
    before = State(seen[0], seen[1], seen[2], seen[3])
    agent.learn(before, last.action[0], observation, fallen)


@inlined
def _end_trial(agent: Agent, fallen: bool) -> None:
    agent.end_trial(fallen)


@inlined
def _reset(plant: Plant, task: Task, rng: Any, observation: np.ndarray) -> None:
    _keep(observation, start(plant, task, rng))


@inlined
def _push(plant: Plant, task: Task, rng: Any, observation: np.ndarray, right: bool) -> bool:
    seen, fallen = push(plant, task, rng, right)
    _keep(observation, seen)
    return fallen


@inlined
def _keep(numbers: np.ndarray, observation: State) -> None:
    for i in range(4):
        numbers[i] = observation[i]
