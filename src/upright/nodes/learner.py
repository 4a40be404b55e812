"""The learner: balances a cart over ROS 2 topics, with an agent or a saved policy."""

import signal
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from rclpy.node import Node
from std_msgs.msg import Int64

from upright.core.parameters import Parameters
from upright.core.trials import Result
from upright.nodes.diagnostics import Diagnostics, PeriodsHealth
from upright.nodes.parameters import declare
from upright.nodes.settings import LearnerSettings
from upright.plants.ros2.cart import Cart
from upright.plants.ros2.node import QOS, ParameterValues, new_node
from upright.plants.ros2.periods import Periods
from upright.plants.ros2.plant import Ros2
from upright.plants.ros2.settings import HIDDEN
from upright.plants.ros2.topics import Waiting
from upright.policies.files import load_policy, save_policy
from upright.policies.going_on import describe_going_on, describe_total
from upright.studies.case import make_case
from upright.studies.learned import case_from, check_learned, learned_policy
from upright.studies.playing import case_for, play_run
from upright.studies.run import make_run
from upright.studies.watching import print_trial, watch
from upright.support.exit_status import FAILED, exit_status
from upright.support.files import require_apart
from upright.support.terminal import visible
from upright.support.words import count


def balance(node: Node, settings: LearnerSettings) -> bool:
    """Train an agent, or play a policy, on the cart; return whether a trial succeeded.

    Raises
    ------
    UprightError
        If a setting has an impossible value, there is no cart, the cart reports a fault, or
        measurements stop arriving.
    KeyboardInterrupt
        If interrupted; the cart is stopped.
    """
    read = [("policy", settings.policy), ("from_policy", settings.from_policy)]
    require_apart([("save", settings.save)], read)
    policy = load_policy(settings.policy, settings.agent or None) if settings.policy else None
    start = None
    if settings.from_policy:
        start = load_policy(settings.from_policy, settings.agent or None)
    task = _task(settings)
    if policy:
        policy = replace(policy, greedy=policy.greedy or settings.greedy)
        case = case_for(policy, **task)
    elif start:
        case = case_from(start, **task)
        print(visible(describe_going_on(start), "\n"), flush=True)
    else:
        case = make_case(settings.agent or "reinforce", settings.settings, **task)
    if settings.save:
        check_learned(settings.save, case)
    stop = np.zeros(1, np.bool_)
    cart = _cart(node, settings, case.spec.task().parameters, stop)
    progress = node.create_publisher(Int64, "~/trial_steps", QOS)
    Diagnostics(node, "control periods", PeriodsHealth(cart.periods))

    def work(lengths: np.ndarray, stop: np.ndarray) -> tuple[Any, Result | None]:
        if policy:
            return policy, play_run(policy, case, settings.seed, cart, lengths, stop)
        return make_run(case, settings.seed, 0, lengths, stop, plant=cart, policy=start)

    def show(number: int, length: int) -> None:
        print_trial(case, number, length)
        progress.publish(Int64(data=length))

    memory, result = watch(case, work, show, stop)
    print(_by_its_clock(cart.periods))
    if not policy:
        learned = learned_policy(case, settings.seed, 0, memory, result, start)
        if start:
            print(visible(describe_total(learned), "\n"))
        if settings.save:
            save_policy(settings.save, learned)
    return result.success


def _task(settings: LearnerSettings) -> dict[str, Any]:
    """Return what the learner is told of the task, by name; the cart has noise of its own."""
    hidden = settings.velocities == HIDDEN
    return {
        "steps": settings.steps,
        "trials": settings.trials,
        "plant": Ros2(settings.watchdog, settings.patience),
        "noise": "none",
        "condition": "no-velocities" if hidden else "nominal",
        "parameters": settings.parameters(),
    }


def _cart(node: Node, settings: LearnerSettings, parameters: Parameters, stop: np.ndarray) -> Cart:
    """Return the cart, once it is found."""
    waiting = Waiting(settings.watchdog, settings.patience, settings.reset_patience)

    def say(text: str) -> None:
        print(text, flush=True)

    return Cart(node, waiting, parameters, stop, settings, say=say)


def _by_its_clock(periods: Periods) -> str:
    """Return how long the last trial lasted by the cart's clock, and what was wrong with that."""
    parts = [
        f"by the cart's clock the last trial lasted {periods.seconds:,.1f} s, with a measurement "
        f"every {1e3 * periods.interval:.3g} ms"
    ]
    if periods.missed:
        parts.append(f"{count(periods.missed, 'control period')} passed without a new command")
    if periods.jumps:
        most = max(periods.jumps, key=abs)
        parts.append(
            f"the clock was set {count(len(periods.jumps), 'time')}, by up to {most:,.1f} s"
        )
    return "; ".join(parts)


def main(values: ParameterValues | None = None, arguments: Sequence[str] | None = None) -> int:
    """Run the learner until it is done, and return the exit status.

    Parameters
    ----------
    values
        Settings by name; ROS arguments can set others.
    arguments
        ROS arguments; those of the command line by default.
    """
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # stops the cart, as SIGINT does

    def work() -> int:
        with new_node("learner", values or {}, arguments) as node:
            return 0 if balance(node, declare(node, LearnerSettings())) else FAILED

    return exit_status(work)
