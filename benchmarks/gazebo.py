"""Measures how fast learning in Gazebo is, directly and over ROS 2, and what limits it."""

import os
import sys
import time
from statistics import median

import numpy as np
from ros2 import REAL_TIME, agent_alone, learn, rates
from speed import machine, make_parser, put

from upright.core.parameters import Parameters, State
from upright.core.trials import Result
from upright.plants.gazebo.installation import find_gazebo
from upright.plants.gazebo.plant import Gazebo
from upright.plants.gazebo.server import RESET, STEP, Server
from upright.plants.settings import count_steps
from upright.studies.case import make_case
from upright.studies.run import make_run

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
    lines = ["| | control steps per second | times real time |", "|---|---|---|"]
    results = {
        name: learn_directly(settings, arguments.steps, arguments.rounds)
        for name, settings in ENGINES.items()
    }
    results["DART, 1 ms, over ROS 2"] = learn(arguments.steps, arguments.rounds, "gazebo")
    for name, runs in results.items():
        rate = median(rates(runs))
        lines.append(f"| {name} | {rate:,.0f} | {rate / REAL_TIME:.0f} |")
    total = 1e6 / median(rates(results["DART, 1 ms"]))
    physics, agent = physics_alone(Gazebo()), agent_alone()
    rest = total - physics - agent
    text = (
        "\n".join(lines) + f"\n\nOf the {total:.0f} µs of a control step with DART at 1 ms, "
        f"Gazebo's 20 physics steps take {physics:.0f} µs, the agent and the loop {agent:.0f} µs, "
        f"and the socket and waking the processes {rest:.0f} µs.\n\n"
        f"The agent is `reinforce` with default settings, noise-free, N = {arguments.steps:,}. "
        f"Rates are medians of {arguments.rounds} runs and include learning. The simulator is "
        f"Gazebo {find_gazebo().version}.\n"
        f"{machine()}.\n"
    )
    put(text, arguments.output)


if __name__ == "__main__":
    main()
