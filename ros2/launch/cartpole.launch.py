"""Launch a simulated cart-pole, a learner that balances it and, optionally, RViz.

The launch shuts down when the learner ends, or if the simulator fails.
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
    "plant": "plant of the simulator: equations, mujoco or gazebo",
    "gui": "true: open the plant's own window (gazebo only)",
    "noise": "noise case, which disturbs forces and measurements",
    "lock_step": "true: each command moves the cart by one period; false: it moves in real time",
    "agent": "agent that learns: one of `upright agents`, or module:name",
    "policy": "saved policy to play in place of an agent; FILE.npz or FILE.json",
    "seed": "seed of all random numbers",
}
"""Parameters of the nodes that are also arguments of the launch file, with their descriptions."""
NODES = {"simulator": SimulatorSettings(), "learner": LearnerSettings()}
"""The package's own nodes, with their default parameters."""


def start(context: LaunchContext) -> list[Node]:
    """Return the package's own nodes, with the parameters given as arguments."""
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
    """Return the launch description: the arguments and the nodes."""
    # Measurements are stamped with simulated time, which starts again with each simulator.
    clock = {"use_sim_time": True}
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "config",
                default_value=str(SHARE / "config" / "cartpole.yaml"),
                description="file of parameters for both nodes; launch arguments override them",
            ),
            *(
                DeclareLaunchArgument(
                    name, default_value="", description=f"{meaning}; default: as in config"
                )
                for name, meaning in ARGUMENTS.items()
            ),
            DeclareLaunchArgument(
                "rviz", default_value="false", description="true: show the cart in RViz"
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
