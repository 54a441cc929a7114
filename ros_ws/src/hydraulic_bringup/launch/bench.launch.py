"""The bench: a plant (simulated or on CAN), and on request a recorder, an excitation or a controller.

    ros2 launch hydraulic_bringup bench.launch.py plant:=sim
    ros2 launch hydraulic_bringup bench.launch.py plant:=sim record:=/tmp/bag experiment:=chirp
    ros2 launch hydraulic_bringup bench.launch.py plant:=can bus:=my_bench.yaml record:=/tmp/bag experiment:=chirp
    ros2 launch hydraulic_bringup bench.launch.py plant:=sim enable:=true controller:=npid reference:=staircase
    ros2 launch hydraulic_bringup bench.launch.py plant:=sim namespace:=/left

The plant is configured and activated; it moves nothing until `enable` is called (or enable:=true is given, which a
plant on hardware refuses). When it ends, however it ends, so do the other nodes. What is started for which arguments
is decided in `hydraulic_bringup.launched`.
"""

from launch.actions import DeclareLaunchArgument, EmitEvent, OpaqueFunction, RegisterEventHandler, Shutdown
from launch.events import matches_action
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode, Node
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from launch_ros.substitutions import FindPackageShare
from lifecycle_msgs.msg import Transition

from hydraulic_bringup import launched
from hydraulic_node_utils.nodes import middleware
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Arguments first, then the nodes that they ask for; all of this machine alone, as the launch process itself."""
    middleware.set_up()
    arguments = launched.ARGUMENTS
    declared = [DeclareLaunchArgument(name, default_value=value, description=text) for name, value, text in arguments]
    return LaunchDescription([*declared, OpaqueFunction(function=_nodes)])


def _nodes(context, *_args, **_kwargs):
    values = {name: LaunchConfiguration(name).perform(context) for name, _, _ in launched.ARGUMENTS}
    what, beside = launched.plant(values), launched.others(values)
    shipped = [FindPackageShare("hydraulic_bringup"), "config", launched.CONFIGURATIONS[values["plant"]]]
    file = values["params"] or PathJoinSubstitution(shipped)
    ends = Shutdown(reason="the plant has ended")
    plant = LifecycleNode(**_common(what, values), parameters=[file, what.parameters], on_exit=ends)
    nodes = [Node(**_common(node, values), parameters=[node.parameters]) for node in beside]
    return [plant, *_brought_up(plant), *nodes]


def _common(node, values):
    return {
        "package": node.package,
        "executable": node.executable,
        "name": node.name,
        "namespace": launched.namespace(values),
        "remappings": launched.remappings(values),
        "output": "screen",
    }


def _brought_up(plant):
    """Configure the plant now, and activate it once that has worked."""
    configure = ChangeState(lifecycle_node_matcher=matches_action(plant), transition_id=Transition.TRANSITION_CONFIGURE)
    activate = ChangeState(lifecycle_node_matcher=matches_action(plant), transition_id=Transition.TRANSITION_ACTIVATE)
    then = OnStateTransition(
        target_lifecycle_node=plant,
        start_state="configuring",
        goal_state="inactive",
        entities=[EmitEvent(event=activate)],
    )
    return [RegisterEventHandler(then), EmitEvent(event=configure)]
