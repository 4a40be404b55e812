"""Measures how fast learning over ROS 2 is, in lock-step and in real time.

In lock-step, an agent learns on a simulator in another process until a trial succeeds; it must make
the same trials as on the equations without ROS 2. In real time, a policy pushes 50 times a second,
and the simulator measures how late periods end and commands arrive.

Rates depend on what else the machine does. So they are measured on a quiet machine and with all of
its cores busy, and beside each rate stands its ratio to a fixed piece of work in the same run.
"""

import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from speed import machine, make_parser, put
from std_msgs.msg import Float64MultiArray

from upright.core import loops
from upright.core.conditions import Noise
from upright.core.noise import disturb, measure
from upright.core.parameters import Parameters, State
from upright.core.trials import Result
from upright.plants.equations import equations
from upright.plants.ros2.messages import Joints, read_numbers
from upright.plants.ros2.plant import Ros2
from upright.plants.urdf import HINGE, SLIDER
from upright.studies.case import make_case
from upright.studies.random_streams import random_numbers
from upright.studies.run import make_run
from upright.support.processes import share_core

COMMAND = [sys.executable, "-m", "upright"]
REAL_TIME = 1 / Parameters().time_step
"""Control steps per second in real time."""


@contextmanager
def simulator(*options: str) -> Iterator[list[str]]:
    """Run a simulator within the block; yield a list that holds its log once it has ended."""
    log: list[str] = []
    command = [*COMMAND, "ros2", "simulate", *options]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdout
        if not process.stdout.readline():
            raise SystemExit(process.communicate()[1])
        try:
            yield log
        finally:
            process.terminate()
            log.append(process.communicate()[1])


@contextmanager
def busy_cores() -> Iterator[None]:
    """Keep every core busy with a process of its own within the block."""
    loop, processes = [sys.executable, "-c", "while True: pass"], []
    for number in range(os.cpu_count() or 1):
        with share_core(number):  # or they would all move to a core that is less busy
            processes.append(subprocess.Popen(loop))
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


CONDITIONS: dict[str, Callable[[], AbstractContextManager[None]]] = {
    "quiet": nullcontext,
    "every core busy": busy_cores,
}
"""What else the machine does meanwhile."""


def round_trip(repetitions: int = 5_000) -> float:
    """Return how long two processes on one core take to wake each other by a socket [µs].

    It is the fixed piece of work: the least that a control step in another process takes.
    """
    here, there = socket.socketpair()
    with here, there, share_core(0):
        child = os.fork()
        if child == 0:
            while there.recv(32):
                there.send(bytes(32))
            os._exit(0)

        def ask() -> None:
            here.send(bytes(32))
            here.recv(32)

        time_of_one = alone(ask, repetitions)
        here.shutdown(socket.SHUT_WR)
        there.close()
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    return time_of_one


class Measured(NamedTuple):
    """Runs of one simulator under one condition."""

    results: list[Result]
    round_trip: float
    """How long the fixed piece of work took just before [µs]."""

    @property
    def rate(self) -> float:
        """Control steps per second."""
        return median(rates(self.results))

    @property
    def ratio(self) -> float:
        """How many fixed pieces of work a control step takes."""
        return 1e6 / self.rate / self.round_trip


def measured(make: Callable[[], list[Result]]) -> Measured:
    """Return what `make` makes, and how long the fixed piece of work takes now."""
    return Measured(round_trip=round_trip(), results=make())


def learn(steps: int, rounds: int, plant: str) -> list[Result]:
    """Learn in lock-step, with a different seed in each round."""
    case = make_case("reinforce", steps=steps, plant=Ros2())
    alone = make_case("reinforce", steps=steps)
    results = []
    with simulator("--plant", plant):
        for seed in range(rounds):
            _, result = make_run(case, seed, 0)
            _, expected = make_run(alone, seed, 0)
            assert result
            assert expected
            if plant == "equations" and result.lengths.tolist() != expected.lengths.tolist():
                raise SystemExit("the trials over ROS 2 differ from those on the equations")
            print(f"{plant}, seed {seed}: {result.seconds:.1f} s", file=sys.stderr)
            results.append(result)
    return results


def table(found: dict[tuple[str, str], Measured], head: str) -> str:
    """Return a table of rates, by what was measured and under which condition."""
    lines = [
        f"| {head} | machine | control steps per second | times real time | round trips per step |",
        "|---|---|---|---|---|",
    ]
    for (name, condition), each in found.items():
        lines.append(
            f"| {name} | {condition} | {each.rate:,.0f} | {each.rate / REAL_TIME:.0f} | "
            f"{each.ratio:.1f} |"
        )
    return "\n".join(lines)


PLANT = "the simulator's plant"
ROUND_TRIPS = (
    "A round trip is the fixed piece of work: two processes on one core wake each other by a "
    "socket, measured under the same condition in the same run."
)


def rates(runs: list[Result]) -> list[float]:
    """Return the control steps per second of each run."""
    return [result.lengths.sum() / result.seconds for result in runs]


class Part(NamedTuple):
    """A part of a control step, and the time that it takes."""

    name: str
    microseconds: float


def parts(total: float) -> list[Part]:
    """Return the parts of a control step that takes `total` [µs], each measured separately."""
    state, joints = State(0.0, 0.0, 0.01, 0.0), Joints()
    measured = JointState(name=[SLIDER, HINGE], position=[0.0, 0.0], velocity=[0.0, 0.0])
    measured.effort = [10.0, 0.0]
    command = Float64MultiArray(data=[10.0])
    answer, order = serialize_message(measured), serialize_message(command)
    plant, noise, rng = equations(), Noise(), np.random.default_rng(0)
    plant.reset(state)

    def move() -> None:
        measure(noise, plant.step(disturb(noise, 0.0, rng)), rng)
        plant.reset(state)

    def messages() -> None:
        serialize_message(command)
        read_numbers(order)
        serialize_message(measured)
        joints.read(answer)

    measured_parts = [
        Part("the agent and the loop", agent_alone()),
        Part("the plant and its noise", alone(move)),
        Part("creating and reading two messages", alone(messages)),
    ]
    rest = total - sum(part.microseconds for part in measured_parts)
    sending = "sending them (DDS), waking threads and running callbacks (rclpy)"
    return [*measured_parts, Part(sending, rest)]


def alone(work: Callable[[], Any], repetitions: int = 5_000) -> float:
    """Return how long a call of `work` takes [µs]."""
    began = time.perf_counter()
    for _ in range(repetitions):
        work()
    return (time.perf_counter() - began) / repetitions * 1e6


def agent_alone() -> float:
    """Return how long an agent and the loop take for a step of an idle plant [µs]."""
    case = make_case("reinforce", steps=500, trials=20)
    rng = random_numbers(0, 0)
    agent, lengths, stop = case.settings.agent(rng), np.zeros(20, np.int64), np.zeros(1, np.bool_)
    make = partial(loops.bound_run, agent, Idle(), stop=stop, rng=rng)
    make(task=case.spec.task()._replace(trials=0), lengths=lengths)  # compiles
    began = time.perf_counter()
    make(task=case.spec.task(), lengths=lengths)
    return (time.perf_counter() - began) / lengths.sum() * 1e6


class Idle:
    """A plant that stays where it is, and falls at the 300th step."""

    def __init__(self) -> None:
        self.state, self.steps = State(0.0, 0.0, 0.01, 0.0), 0

    def reset(self, _: State) -> State:
        """Begin to count steps."""
        self.steps = 0
        return self.state

    def step(self, _: float) -> State:
        """Count a step."""
        self.steps += 1
        return self.state

    def has_fallen(self, _: State) -> bool:
        """Whether it is time to fall."""
        return self.steps >= 300

    def close(self) -> None:
        """Do nothing."""


def table_of(step_parts: list[Part]) -> str:
    """Return a table of where the time of a control step goes."""
    total = sum(part.microseconds for part in step_parts)
    lines = ["| part of a control step | time [µs] | share |", "|---|---|---|"]
    lines += [f"| {name} | {time:.0f} | {time / total:.0%} |" for name, time in step_parts]
    return "\n".join([*lines, f"| total | {total:.0f} | |"])


def real_time(steps: int) -> str:
    """Let a policy balance in real time, and return how punctual that was."""
    with tempfile.TemporaryDirectory() as folder:
        policy = f"{folder}/policy.npz"
        upright("learn", "adaptive-lqr", "--quiet", "--save", policy)
        with simulator("--no-lock-step") as log:
            out = upright("ros2", "learn", "--policy", policy, "--steps", str(steps))
    if f"trial    1 {steps:9,d} steps" not in out:
        raise SystemExit(f"the pole fell in real time:\n{out}")
    summary = re.search(r"[\d,]+ periods, .* p99 [\d.]+ ms$", log[0], re.MULTILINE)
    if not summary:
        raise SystemExit(f"the simulator did not report how punctual it was:\n{log[0]}")
    return f"In real time, the pole stayed up for {steps / REAL_TIME:.0f} s: {summary[0]}."


def upright(*arguments: str) -> str:
    """Run the command in a separate process, and return what it printed."""
    done = subprocess.run([*COMMAND, *arguments], capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(done.stderr)
    return done.stdout


def main() -> None:
    """Measure, and write the tables."""
    parser = make_parser(__doc__, "docs/ros2.md")
    parser.add_argument("--steps", type=int, default=60_000, help="N (default 60,000)")
    parser.add_argument("--rounds", type=int, default=3, help="runs each (default 3)")
    parser.add_argument(
        "--periods", type=int, default=3_000, help="in real time (default 3,000: a minute)"
    )
    arguments = parser.parse_args()
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    found = {}
    for condition, load in CONDITIONS.items():
        for plant in ("equations", "mujoco"):
            with load():
                make = partial(learn, arguments.steps, arguments.rounds, plant)
                found[plant, condition] = measured(make)
    total = 1e6 / found["equations", "quiet"].rate
    text = (
        f"{table(found, PLANT)}\n\n{table_of(parts(total))}\n\n"
        f"{real_time(arguments.periods)}\n\n"
        f"The agent is `reinforce` with default settings, noise-free, N = {arguments.steps:,}. "
        f"Rates and times are medians of {arguments.rounds} runs and include learning. The "
        "learner and the simulator are two processes, and each message passes through DDS. "
        f"{ROUND_TRIPS}\n{machine()}.\n"
    )
    put(text, arguments.output)


if __name__ == "__main__":
    main()
