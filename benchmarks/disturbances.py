"""Measures what disturbances cost: none for those who use none.

The package's loop, in which a rig may stand between agent and plant, is timed in turns with the
same loop written without one; and with each term of a condition. A fixed linear policy balances
throughout. The figures are medians, compilation excluded.
"""

import time
from collections.abc import Callable
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from speed import machine, make_parser, put

from upright.core.compiled import compiled
from upright.core.noise import disturb, draw_start, measure
from upright.core.parameters import State
from upright.core.task import TaskSpec
from upright.core.trials import trial
from upright.plants.equations import EQUATIONS
from upright.plants.settings import RunContext

CONDITIONS = (
    "nominal",
    "tilt=1",
    "stick-slip=0.05",
    "delay=1",
    "measurement-delay=1",
    "lag=0.02",
    "dead-zone=1,saturation=8",
    "wind=0.5",
    "gust=2",
    "encoder=4096",
    "dropped=0.05",
    "at-1000.half_length=0.6",
    "each-episode.half_length=0.5:0.6",
    "delay=1,lag=0.02,gust=1,encoder=4096,dropped=0.01",
)
"""What is measured."""


class Linear(NamedTuple):
    """A linear policy that does not learn."""

    weights: np.ndarray

    @compiled
    def begin_trial(self, rng: np.random.Generator) -> None:
        """Do nothing."""

    @compiled
    def act(self, observation: State, rng: np.random.Generator) -> bool:  # noqa: ARG002
        """Push towards the side to which the weighted measurements lean."""
        w = self.weights
        x, x_dot, theta, theta_dot = observation
        return w[0] * x + w[1] * x_dot + w[2] * theta + w[3] * theta_dot > 0.0

    @compiled
    def learn(self, before: State, action: bool, after: State, fallen: bool) -> None:
        """Learn nothing."""

    @compiled
    def end_trial(self, fallen: bool) -> None:
        """Learn nothing."""


def without_rig(agent: Any, plant: Any, task: Any, rng: np.random.Generator) -> tuple[int, bool]:
    """Do what `trial` does, for a task without a rig."""
    state = plant.reset(draw_start(task.start, rng))
    observation = measure(task.noise, state, rng)
    agent.begin_trial(rng)
    fallen = False
    steps = 0
    while steps < task.steps and not fallen:
        action = agent.act(observation, rng)
        push = task.parameters.force if action else -task.parameters.force
        state = plant.step(disturb(task.noise, push, rng))
        fallen = plant.has_fallen(state)
        before, observation = observation, measure(task.noise, state, rng)
        agent.learn(before, action, observation, fallen)
        steps += 1
    agent.end_trial(fallen)
    return steps, fallen


LOOP, LOOP_WITHOUT = compiled(trial), compiled(without_rig)
AGENT = Linear(np.array([0.1, 0.4, 8.0, 1.2]))


def seconds(loop: Callable[..., tuple[int, bool]], spec: TaskSpec, steps: int) -> float:
    """Return the time of this many steps, over as many trials as they take [s]."""
    task = spec.task()
    context = RunContext(task, spec, 0, np.zeros(1, np.bool_))
    plant, task = EQUATIONS.make(context)
    rng, made, began = np.random.default_rng(1), 0, time.perf_counter()
    while made < steps:
        made += loop(AGENT, plant, task, rng)[0]
    return (time.perf_counter() - began) / made * steps


def table(steps: int, repetitions: int) -> str:
    """Return the table of measurements in Markdown."""
    lines = ["| condition | ns a step | relative to the loop without a rig |", "|---|---|---|"]
    for condition in CONDITIONS:
        spec = TaskSpec(condition=condition, steps=steps)
        plain = TaskSpec(steps=steps)
        seconds(LOOP, spec, 1), seconds(LOOP_WITHOUT, plain, 1)
        pairs = [
            (seconds(LOOP, spec, steps), seconds(LOOP_WITHOUT, plain, steps))
            for _ in range(repetitions)
        ]
        own = median(a for a, _ in pairs) / steps * 1e9
        ratio = median(a / b for a, b in pairs)
        lines.append(f"| `{condition}` | {own:.1f} | {ratio:.2f} |")
    return "\n".join(lines)


def main() -> None:
    """Measure, and print the table or write it into a page."""
    parser = make_parser(__doc__, "docs/disturbances.md")
    parser.add_argument("--steps", type=int, default=2_000_000, help="steps of a measurement")
    parser.add_argument("--repetitions", type=int, default=7, help="measurements of each kind")
    options = parser.parse_args()
    text = f"{table(options.steps, options.repetitions)}\n\n{machine()}\n"
    put(text, options.output)


if __name__ == "__main__":
    main()
