"""The learner: balances a cart over ROS 2 topics, with an agent or a saved policy."""

import signal
from collections.abc import Sequence
from typing import Any

import numpy as np
from rclpy.node import Node
from std_msgs.msg import Int64

from upright.core.trials import Result
from upright.nodes.parameters import declare
from upright.nodes.settings import LearnerSettings
from upright.plants.ros2.cart import Cart
from upright.plants.ros2.node import QOS, ParameterValues, new_node
from upright.plants.ros2.plant import Ros2
from upright.policies.files import load_policy
from upright.studies.case import make_case
from upright.studies.learned import check_learned, save_learned
from upright.studies.playing import case_for, play_run
from upright.studies.run import make_run
from upright.studies.watching import print_trial, watch
from upright.support.exit_status import FAILED, exit_status
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
    policy = load_policy(settings.policy) if settings.policy else None
    waiting = Ros2(settings.watchdog, settings.patience)
    task: dict[str, Any] = {"steps": settings.steps, "trials": settings.trials, "plant": waiting}
    task |= {"noise": "none", "condition": "nominal", "parameters": {}}  # the cart has its own
    if policy:
        case = case_for(policy, **task)
    else:
        case = make_case(settings.agent, settings.settings, **task)
    if settings.save:
        check_learned(settings.save, case)
    stop = np.zeros(1, np.bool_)
    cart = Cart(node, waiting.waiting, case.spec.task().parameters, stop)
    progress = node.create_publisher(Int64, "~/trial_steps", QOS)

    def work(lengths: np.ndarray, stop: np.ndarray) -> tuple[Any, Result | None]:
        if policy:
            return policy, play_run(policy, case, settings.seed, cart, lengths, stop)
        return make_run(case, settings.seed, 0, lengths, stop, plant=cart)

    def show(number: int, length: int) -> None:
        print_trial(case, number, length)
        progress.publish(Int64(data=length))

    memory, result = watch(case, work, show, stop)
    if cart.missed:
        print(f"{count(cart.missed, 'control period')} passed without a new command")
    if settings.save:
        save_learned(settings.save, case, settings.seed, 0, memory)
    return result.success


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
