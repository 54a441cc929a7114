"""The bench: a plant (simulated or on CAN), and on request a recorder, an excitation or a controller.

    ros2 launch hydraulic_bringup bench.launch.py plant:=sim
    ros2 launch hydraulic_bringup bench.launch.py plant:=sim record:=/tmp/bag experiment:=chirp
    ros2 launch hydraulic_bringup bench.launch.py plant:=can bus:=my_bench.yaml record:=/tmp/bag experiment:=chirp
    ros2 launch hydraulic_bringup bench.launch.py plant:=sim enable:=true controller:=npid reference:=staircase

The plant is configured and activated; it moves nothing until `enable` is called (or enable:=true is given, which a
plant on hardware refuses).
"""

from launch.actions import DeclareLaunchArgument, EmitEvent, OpaqueFunction, RegisterEventHandler
from launch.events import matches_action
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode, Node
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from launch_ros.substitutions import FindPackageShare
from lifecycle_msgs.msg import Transition

from hydraulic_node_utils.nodes import middleware
from launch import LaunchDescription

CONTROLLERS = ("npid", "pid", "pole_placement")
PLANTS = {"sim": ("hydraulic_sim", "simulator"), "can": ("hydraulic_can_driver", "can_driver")}
CONFIGURATIONS = {"sim": "bench.yaml", "can": "can.yaml"}

ARGUMENTS = (
    ("plant", "sim", "what serves the topics: sim (simulated actuator) or can (CAN driver)"),
    ("model", "moog_mcr_m_1002_bench", "model file or preset of the simulated actuator"),
    ("bus", "bench", "bus file, or a shipped one, of the CAN driver"),
    ("interface", "", "python-can interface of the CAN driver; empty: that of the bus file"),
    ("channel", "", "channel of that interface, such as can0; empty: that of the bus file"),
    ("params", "", "parameter file (default: config/bench.yaml or config/can.yaml of this package)"),
    ("enable", "false", "let commands through as soon as the plant is active; refused by a plant on hardware"),
    ("record", "", "folder of a new bag; empty: nothing is recorded"),
    ("experiment", "", "excitation plan (file or shipped name) to play; empty: none"),
    ("controller", "", "law that closes the loop: npid, pid or pole_placement; empty: none"),
    ("gains", "", "parameter file of the controller; empty: the shipped one of its law"),
    ("reference", "", "trajectory to play: step, staircase, sine, …; empty: none"),
    ("estimate", "false", "run the estimator beside the plant, with the same model"),
)


def generate_launch_description() -> LaunchDescription:
    """Arguments first, then the nodes that they ask for; all of this machine alone, as the launch process itself."""
    middleware.set_up()
    declared = [DeclareLaunchArgument(name, default_value=value, description=text) for name, value, text in ARGUMENTS]
    return LaunchDescription([*declared, OpaqueFunction(function=_nodes)])


def _nodes(context, *_args, **_kwargs):
    value = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    if value["plant"] not in PLANTS:
        raise RuntimeError(f"plant:={value['plant']}: allowed are {', '.join(PLANTS)}")
    package, executable = PLANTS[value["plant"]]
    shipped = [FindPackageShare("hydraulic_bringup"), "config", CONFIGURATIONS[value["plant"]]]
    file = value["params"] or PathJoinSubstitution(shipped)
    settings = {"enable_on_activate": value["enable"].lower() in ("true", "1", "yes")}
    if value["plant"] == "sim":
        settings["model"] = value["model"]
    else:
        settings |= {"bus": value["bus"], "interface": value["interface"], "channel": value["channel"]}
    plant = LifecycleNode(
        package=package,
        executable=executable,
        name="plant",
        namespace="/actuator",
        parameters=[file, settings],
        output="screen",
    )
    actions = [plant, *_brought_up(plant)]
    if value["record"]:
        settings = {"output": value["record"], "stop_on_experiment_end": bool(value["experiment"])}
        actions.append(_node("hydraulic_sysid", "recorder", settings))
    if value["estimate"].lower() in ("true", "1", "yes"):
        actions.append(_node("hydraulic_sysid", "estimator", {"model": value["model"]}))
    if value["experiment"]:
        settings = {"plan": value["experiment"], "autostart": True, "listeners": 2 if value["record"] else 1}
        actions.append(_node("hydraulic_sysid", "excitation", settings))
    return [*actions, *_closed_loop(value)]


def _closed_loop(value):
    """The controller, and what it is to follow."""
    law = value["controller"]
    if not law:
        if value["reference"] or value["gains"]:
            raise RuntimeError("reference and gains are for a controller: name one with controller:=")
        return []
    if law not in CONTROLLERS:
        raise RuntimeError(f"controller:={law}: allowed are {', '.join(CONTROLLERS)}")
    if value["experiment"]:
        raise RuntimeError("experiment and controller cannot both command the plant: give one of them")
    settings = {"gains": value["gains"] or law, "controller": law, "autostart": True}
    actions = [_node("hydraulic_control", "controller", settings)]
    if value["reference"]:
        actions.append(_node("hydraulic_control", "reference", {"kind": value["reference"], "autostart": True}))
    return actions


def _node(package, executable, settings):
    return Node(
        package=package,
        executable=executable,
        name=executable,
        namespace="/actuator",
        parameters=[settings],
        output="screen",
    )


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
