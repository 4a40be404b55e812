"""A simulated cart-pole, a learner that balances it, and a picture of it in RViz.

The launch ends with the learner, or with the simulator should it fail.
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import Parameter

from upright.nodes.settings import LearnerSettings, SimulatorSettings
from upright.plants.urdf import text
from upright.support.settings import values_of

SHARE = Path(__file__).parents[1]
ARGUMENTS = {
    "plant": "the body: equations, mujoco or gazebo",
    "gui": "true: the plant's own window is opened; gazebo has one",
    "noise": "noise case: what disturbs forces and measurements",
    "lock_step": "true: each command moves the cart by one period; false: the wall clock does",
    "agent": "who learns: one of `upright agents`, or module:name",
    "policy": "a saved policy that balances in place of an agent; FILE.npz or FILE.json",
    "seed": "of all random numbers",
}
"""Parameters of the nodes that can be given here."""
NODES = {"simulator": SimulatorSettings(), "learner": LearnerSettings()}
"""The package's own nodes, and which parameters they have."""


def start(context: LaunchContext) -> list[Node]:
    """Return the package's own nodes, with the parameters that were given."""
    nodes = []
    for name, settings in NODES.items():
        given = [
            Parameter(key, LaunchConfiguration(key), value_type=type(default))
            for key, default in values_of(settings).items()
            if key in ARGUMENTS and LaunchConfiguration(key).perform(context)
        ]
        nodes.append(
            Node(
                package="upright_ros",
                executable=name,
                parameters=[LaunchConfiguration("config"), *given],
                output="screen",
                on_exit=Shutdown(reason=f"the {name} has ended"),
            )
        )
    return nodes


def generate_launch_description() -> LaunchDescription:
    """Return what is launched, and the arguments."""
    # Measurements bear simulated time, which begins anew with each simulator.
    clock = {"use_sim_time": True}
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "config",
                default_value=str(SHARE / "config" / "cartpole.yaml"),
                description="parameters of both nodes; the arguments that are given go before them",
            ),
            *(
                DeclareLaunchArgument(
                    name, default_value="", description=f"{meaning}; as in config unless given"
                )
                for name, meaning in ARGUMENTS.items()
            ),
            DeclareLaunchArgument(
                "rviz", default_value="false", description="whether RViz shows the cart"
            ),
            OpaqueFunction(function=start),
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                parameters=[{"robot_description": text()}, clock],
            ),
            Node(
                package="rviz2",
                executable="rviz2",
                arguments=["-d", str(SHARE / "rviz" / "cartpole.rviz")],
                parameters=[clock],
                condition=IfCondition(LaunchConfiguration("rviz")),
            ),
        ]
    )
