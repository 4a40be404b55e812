"""
Launch a simulated cart-pole, a learner that balances it and, optionally, RViz.

The parameters of both nodes are arguments. The launch shuts down when the learner ends, and fails
if the learner or the simulator does.
"""

from functools import partial
from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node, PushRosNamespace
from launch_ros.parameter_descriptions import Parameter

from upright.nodes.settings import LearnerSettings, SimulatorSettings
from upright.plants.urdf import text
from upright.support.exit_status import FAILED
from upright.support.settings import describe_settings, values_of

SHARE = Path(__file__).parents[1]
NODES = {'simulator': SimulatorSettings(), 'learner': LearnerSettings()}
"""The package's own nodes, with their default parameters."""
OWN_ARGUMENTS = {
    'simulator': ('true', 'false: start no simulator; a real cart has its topics'),
    'namespace': ('', 'namespace of all nodes and topics, of TF and of the clock too'),
    'config': (
        str(SHARE / 'config' / 'cartpole.yaml'),
        'file of parameters; arguments that are not given have their values there',
    ),
    'rviz': ('false', 'true: show the cart in RViz'),
}
"""Default and description of the arguments that are not parameters of the nodes."""
IN_NAMESPACE = [(f'/{topic}', topic) for topic in ('clock', 'tf', 'tf_static')]
"""Puts topics that other packages give absolute names into the namespace, too."""


def parameter_arguments() -> dict[str, str]:
    """Return the description of each argument that is a parameter of a node, or of both."""
    descriptions: dict[str, list[str]] = {}
    for node, settings in NODES.items():
        for name, meaning in describe_settings(settings).items():
            descriptions.setdefault(name, []).append(f'{node}: {meaning}')
    return {name: '\n        '.join(parts) for name, parts in descriptions.items()}


def own_nodes(context: LaunchContext) -> list[Node]:
    """
    Return the package's own nodes, each with those of its parameters that are given.

    RuntimeError is raised if one of them is for the simulator alone, which is not started.
    """
    simulated = IfCondition(LaunchConfiguration('simulator')).evaluate(context)
    nodes = {name: values_of(NODES[name]) for name in NODES if simulated or name != 'simulator'}
    given = {name for name in parameter_arguments() if LaunchConfiguration(name).perform(context)}
    if unused := given.difference(*nodes.values()):
        raise RuntimeError(
            f'{", ".join(sorted(unused))}: given, but only the simulator has such a parameter, '
            'and simulator is false'
        )
    return [
        Node(
            package='upright_ros',
            executable=name,
            parameters=[
                LaunchConfiguration('config'),
                *(parameter(key, values[key]) for key in values if key in given),
            ],
            output='screen',
            on_exit=partial(shut_down, name),
        )
        for name, values in nodes.items()
    ]


def parameter(name: str, default: object) -> Parameter:
    """Return a parameter with the value of the argument, which is read in the default's type."""
    kind = list[float] if isinstance(default, tuple) else type(default)
    return Parameter(name, LaunchConfiguration(name), value_type=kind)


def shut_down(node: str, exited: ProcessExited, context: LaunchContext) -> Shutdown | None:
    """
    Shut down, because a node of the package has ended.

    RuntimeError is raised if it has failed: `launch` then shuts down too, and exits with status 1.
    """
    if context.is_shutdown:
        return None
    if node == 'learner' and exited.returncode == 0:
        return Shutdown(reason='the learner has ended')
    if node == 'learner' and exited.returncode == FAILED:
        raise RuntimeError('the learner has ended without a trial that succeeded')
    raise RuntimeError(f'the {node} has ended with exit status {exited.returncode}')


def generate_launch_description() -> LaunchDescription:
    """Return the launch description: the arguments and the nodes."""
    # The simulator stamps measurements with simulated time, which starts again with each.
    clock = Parameter('use_sim_time', LaunchConfiguration('simulator'), value_type=bool)
    nodes = [
        PushRosNamespace(LaunchConfiguration('namespace')),
        OpaqueFunction(function=own_nodes),
        Node(
            package='robot_state_publisher',
            executable='robot_state_publisher',
            parameters=[{'robot_description': text()}, clock],
            remappings=IN_NAMESPACE,
        ),
        Node(
            package='rviz2',
            executable='rviz2',
            arguments=['-d', str(SHARE / 'rviz' / 'cartpole.rviz')],
            parameters=[clock],
            remappings=IN_NAMESPACE,
            condition=IfCondition(LaunchConfiguration('rviz')),
        ),
    ]
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=meaning)
                for name, (default, meaning) in OWN_ARGUMENTS.items()
            ),
            *(
                DeclareLaunchArgument(name, default_value='', description=meaning)
                for name, meaning in parameter_arguments().items()
            ),
            GroupAction(nodes),
        ]
    )
