"""Measures how fast learning in Gazebo is, directly and over ROS 2, and what limits it."""

import os
import sys
import time
from functools import partial
from statistics import median

import numpy as np
from ros2 import CONDITIONS, ROUND_TRIPS, agent_alone, learn, measured, table
from speed import machine, make_parser, put

from upright.core.parameters import Parameters, State
from upright.core.trials import Result
from upright.plants.gazebo.installation import find_gazebo
from upright.plants.gazebo.plant import Gazebo
from upright.plants.gazebo.server import RESET, STEP, Server
from upright.plants.settings import count_steps
from upright.studies.case import make_case
from upright.studies.run import make_run

OVER_ROS = "DART, 1 ms, over ROS 2"
ENGINES = {"DART, 1 ms": Gazebo(), "ODE, 1 ms": Gazebo("ode"), "DART, 2 ms": Gazebo("dart", 0.002)}


def learn_directly(settings: Gazebo, steps: int, rounds: int) -> list[Result]:
    """Learn in lock-step with a server, with a different seed in each round."""
    case = make_case("reinforce", steps=steps, plant=settings)
    results = []
    for seed in range(rounds):
        _, result = make_run(case, seed, 0)
        assert result
        print(f"{settings}, seed {seed}: {result.seconds:.1f} s", file=sys.stderr)
        results.append(result)
    return results


def physics_alone(settings: Gazebo, periods: int = 2_000) -> float:
    """Return how long Gazebo takes for the physics of a control step [µs]."""
    stop = np.zeros(1, np.bool_)
    server = Server(Parameters(), settings.engine, settings.physics_step, False, stop)
    server.ask(RESET, 0, State(0.0, 0.0, 0.01, 0.0))
    steps = count_steps(settings.physics_step, Parameters().time_step)
    times = []
    for _ in range(10):
        began = time.perf_counter()
        server.ask(STEP, steps * periods // 10, State(0.0, 0.0, 0.0, 0.0))
        times.append(time.perf_counter() - began)
    server.close()
    return median(times) * 10 / periods * 1e6


def main() -> None:
    """Measure, and write the tables."""
    parser = make_parser(__doc__, "docs/gazebo.md")
    parser.add_argument("--steps", type=int, default=20_000, help="N (default 20,000)")
    parser.add_argument("--rounds", type=int, default=3, help="runs each (default 3)")
    arguments = parser.parse_args()
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    found = {}
    for condition, load in CONDITIONS.items():
        for name, settings in ENGINES.items():
            with load():
                make = partial(learn_directly, settings, arguments.steps, arguments.rounds)
                found[name, condition] = measured(make)
        with load():
            make = partial(learn, arguments.steps, arguments.rounds, "gazebo")
            found[OVER_ROS, condition] = measured(make)
    total, over_ros = (1e6 / found[name, "quiet"].rate for name in ("DART, 1 ms", OVER_ROS))
    physics, agent = physics_alone(Gazebo()), agent_alone()
    rest = total - physics - agent
    text = (
        f"{table(found, 'engine and time step')}\n\n"
        f"Of the {total:.0f} µs of a control step with DART at 1 ms, Gazebo's 20 physics steps "
        f"take {physics:.0f} µs, the agent and the loop {agent:.0f} µs, "
        f"and the socket and waking the processes {rest:.0f} µs. Over ROS 2, a control step takes "
        f"{over_ros:.0f} µs: {physics / over_ros:.0%} for the physics, {agent / over_ros:.0%} for "
        f"the agent and the loop, {rest / over_ros:.0%} for the socket, and the remaining "
        f"{(over_ros - total) / over_ros:.0%} for two messages, that is for DDS, rclpy and three "
        "processes that wake each other.\n\n"
        f"The agent is `reinforce` with default settings, noise-free, N = {arguments.steps:,}. "
        f"Rates are medians of {arguments.rounds} runs and include learning. The simulator is "
        f"Gazebo {find_gazebo().version}. {ROUND_TRIPS}\n"
        f"{machine()}.\n"
    )
    put(text, arguments.output)


if __name__ == "__main__":
    main()
