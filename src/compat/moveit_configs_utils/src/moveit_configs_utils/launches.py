# SPDX-License-Identifier: BSD-3-Clause
"""Launch descriptions made of a MoveIt configuration: move_group, RViz, controllers, and a demonstration of all.

Names, arguments and defaults are those of MoveIt 2; what ROS 1 has not is refused by name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from launch import LaunchContext, LaunchDescription, LaunchError
from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription, OpaqueFunction
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue, evaluate_value

from modular_framework_urdf.srdf_reader import read_srdf
from moveit_configs_utils.launch_utils import DeclareBooleanLaunchArg, DeclareRefusedLaunchArg, add_debuggable_node
from moveit_configs_utils.moveit_configs import MoveItConfigs

BROADCASTER = "joint_state_broadcaster"
NO_WAREHOUSE = "there is no warehouse database; states and scenes are kept in files (.scene, SRDF)"
TRAJECTORY, GRIPPER = "FollowJointTrajectory", "GripperCommand"
MOCK_CONTROLLERS = {
    TRAJECTORY: "joint_trajectory_controller/JointTrajectoryController",
    GRIPPER: "position_controllers/GripperActionController",
}
"""By the type of an entry of `controller_list`: the controller that a robot without a controller file gets."""


def generate_rsp_launch(moveit_config: MoveItConfigs) -> LaunchDescription:
    """Returns a launch description of robot_state_publisher; argument publish_frequency [1/s]."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("publish_frequency", default_value="15.0", description="rate of moving frames [1/s]"),
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                respawn=True,
                output="screen",
                parameters=[
                    moveit_config.robot_description,
                    {"publish_frequency": ParameterValue(LaunchConfiguration("publish_frequency"), value_type=float)},
                ],
            ),
        ]
    )


def generate_moveit_rviz_launch(moveit_config: MoveItConfigs) -> LaunchDescription:
    """Returns a launch description of RViz with the marker for goals; arguments debug, rviz_config."""
    ld = LaunchDescription([DeclareBooleanLaunchArg("debug", default_value=False)])
    ld.add_action(
        DeclareLaunchArgument("rviz_config", default_value=_rviz_file(moveit_config), description="RViz configuration")
    )
    add_debuggable_node(
        ld,
        package="rviz2",
        executable="rviz2",
        output="log",
        respawn=False,
        arguments=["-d", LaunchConfiguration("rviz_config")],
        parameters=[
            moveit_config.robot_description,
            moveit_config.robot_description_semantic,
            moveit_config.planning_pipelines,
            moveit_config.robot_description_kinematics,
            moveit_config.joint_limits,
        ],
    )
    return ld


def _rviz_file(moveit_config: MoveItConfigs) -> str:
    """Returns the RViz file of the config package, where MoveIt 2 or MoveIt 1 puts it."""
    places = [_package(moveit_config) / folder / "moveit.rviz" for folder in ("config", "launch")]
    return str(next((path for path in places if path.is_file()), places[0]))


def _package(moveit_config: MoveItConfigs) -> Path:
    if moveit_config.package_path is None:
        raise LaunchError("these MoveItConfigs name no package; make them with MoveItConfigsBuilder")
    return moveit_config.package_path


def generate_setup_assistant_launch(moveit_config: MoveItConfigs) -> LaunchDescription:
    """Refused: there is no window of the Setup Assistant.

    Raises:
        LaunchError: Always; it says what to use.
    """
    raise LaunchError(
        "generate_setup_assistant_launch is not offered: there is no Setup Assistant's window; edit "
        f"{_package(moveit_config)}, or make the packages of a robot with create_robot"
    )


def generate_static_virtual_joint_tfs_launch(moveit_config: MoveItConfigs) -> LaunchDescription:
    """Returns a launch description with a static transform for each virtual joint between two frames."""

    def transforms(context: LaunchContext) -> list[Node]:
        nodes: list[Node] = []
        for name, value in moveit_config.robot_description_semantic.items():
            text = evaluate_value(context, value, str, name)
            joints = [each for each in read_srdf(text, name).virtual_joints if each.parent_frame != each.child_link]
            for joint in joints:
                nodes.append(
                    Node(
                        package="tf2_ros",
                        executable="static_transform_publisher",
                        name=f"static_transform_publisher{len(nodes)}",
                        output="log",
                        arguments=["--frame-id", joint.parent_frame, "--child-frame-id", joint.child_link],
                    )
                )
        return nodes

    return LaunchDescription([OpaqueFunction(function=transforms)])


def _controller_names(moveit_config: MoveItConfigs) -> list[str]:
    manager = moveit_config.trajectory_execution.get("moveit_simple_controller_manager", {})
    return list(manager.get("controller_names", ()))


def generate_spawn_controllers_launch(moveit_config: MoveItConfigs) -> LaunchDescription:
    """Returns a launch description that starts the controllers of the configuration, and joint states."""
    ld = LaunchDescription()
    for controller in [*_controller_names(moveit_config), BROADCASTER]:
        ld.add_action(Node(package="controller_manager", executable="spawner", arguments=[controller], output="screen"))
    return ld


def generate_warehouse_db_launch(moveit_config: MoveItConfigs) -> LaunchDescription:
    """Refused: there is no warehouse database.

    Raises:
        LaunchError: Always; it says what to use.
    """
    del moveit_config
    raise LaunchError(f"generate_warehouse_db_launch is not offered: {NO_WAREHOUSE}")


def generate_move_group_launch(moveit_config: MoveItConfigs) -> LaunchDescription:
    """Returns a launch description of move_group.

    Arguments: debug (publish each request for a plan), allow_trajectory_execution, publish_monitored_planning_scene,
    capabilities, disable_capabilities. monitor_dynamics can only be false.
    """
    capabilities = moveit_config.move_group_capabilities
    ld = LaunchDescription(
        [
            DeclareBooleanLaunchArg("debug", default_value=False),
            DeclareBooleanLaunchArg("allow_trajectory_execution", default_value=True),
            DeclareBooleanLaunchArg("publish_monitored_planning_scene", default_value=True),
            DeclareLaunchArgument("capabilities", default_value=str(capabilities["capabilities"])),
            DeclareLaunchArgument("disable_capabilities", default_value=str(capabilities["disable_capabilities"])),
            DeclareRefusedLaunchArg("monitor_dynamics", reason="states have no efforts"),
        ]
    )
    publish = LaunchConfiguration("publish_monitored_planning_scene")
    settings = {
        "allow_trajectory_execution": LaunchConfiguration("allow_trajectory_execution"),
        "capabilities": ParameterValue(LaunchConfiguration("capabilities"), value_type=str),
        "disable_capabilities": ParameterValue(LaunchConfiguration("disable_capabilities"), value_type=str),
        "planning_scene_monitor": {
            "publish_planning_scene": publish,
            "publish_geometry_updates": publish,
            "publish_state_updates": publish,
            "publish_transforms_updates": publish,
            "publish_robot_description_semantic": True,
        },
    }
    add_debuggable_node(
        ld,
        package="moveit_ros_move_group",
        executable="move_group",
        output="screen",
        parameters=[moveit_config.to_dict(), settings],
        extra_debug_args=["--debug"],
    )
    return ld


def generate_demo_launch(moveit_config: MoveItConfigs, launch_package_path: Path | None = None) -> LaunchDescription:
    """Returns a launch description that needs nothing else to plan and move: mock hardware, move_group and RViz.

    The hardware is what the `<ros2_control>` tags of the robot description name, and mock hardware without such tags;
    controllers are those of config/ros2_controllers.yaml, without that file one for each entry of `controller_list`.
    With MoveIt 1's fake controllers a joint_state_publisher shows where they are. Launch files of the config package
    (rsp.launch.py, move_group.launch.py, moveit_rviz.launch.py, static_virtual_joint_tfs.launch.py,
    spawn_controllers.launch.py) take the place of those of this module.

    Args:
        moveit_config: The configuration.
        launch_package_path: Folder of the package with those launch files; that of the configuration when not given.

    Returns:
        The description; arguments use_rviz, debug, and those of its parts. db can only be false.
    """
    folder = (launch_package_path or _package(moveit_config)) / "launch"
    ld = LaunchDescription(
        [
            DeclareRefusedLaunchArg("db", reason=NO_WAREHOUSE),
            DeclareBooleanLaunchArg("debug", default_value=False, description="publish each request for a plan"),
            DeclareBooleanLaunchArg("use_rviz", default_value=True, description="whether to start RViz"),
        ]
    )

    def add(name: str, generate: Callable[[MoveItConfigs], LaunchDescription], **options: Any) -> None:
        path = folder / f"{name}.launch.py"
        source = PythonLaunchDescriptionSource(str(path))
        part = IncludeLaunchDescription(source) if path.is_file() else generate(moveit_config)
        ld.add_action(GroupAction([part], scoped=False, **options))

    add("static_virtual_joint_tfs", generate_static_virtual_joint_tfs_launch)
    add("rsp", generate_rsp_launch)
    add("move_group", generate_move_group_launch)
    add("moveit_rviz", generate_moveit_rviz_launch, condition=IfCondition(LaunchConfiguration("use_rviz")))
    if "fake" in str(moveit_config.trajectory_execution.get("moveit_controller_manager", "")).lower():
        ld.add_action(_joint_states_of_fake_controllers())
        return ld
    ld.add_action(
        Node(
            package="controller_manager",
            executable="ros2_control_node",
            parameters=[_controllers(moveit_config)],
            remappings=[("/controller_manager/robot_description", "/robot_description")],
            output="screen",
        )
    )
    add("spawn_controllers", generate_spawn_controllers_launch)
    return ld


def _joint_states_of_fake_controllers() -> Node:
    return Node(
        package="joint_state_publisher",
        executable="joint_state_publisher",
        parameters=[{"source_list": ["move_group/fake_controller_joint_states"]}],
    )


def _controllers(moveit_config: MoveItConfigs) -> Path | Mapping[str, Any]:
    """Returns the controller file of a config package, or controllers made of those that execute motions."""
    path = _package(moveit_config) / "config" / "ros2_controllers.yaml"
    if path.is_file():
        return path
    made: dict[str, Any] = {BROADCASTER: {"type": "joint_state_broadcaster/JointStateBroadcaster"}}
    for entry in moveit_config.trajectory_execution.get("controller_list", ()):
        joints, kind = list(entry.get("joints", ())), str(entry.get("type", ""))
        if kind not in MOCK_CONTROLLERS or not joints:
            raise LaunchError(
                f"{path} is missing, and controller '{entry.get('name')}' of the configuration has type '{kind}' and "
                f"joints {joints}; allowed without that file: {', '.join(MOCK_CONTROLLERS)} with joints; add the file"
            )
        which = {"joint": joints[0]} if kind == GRIPPER else {"joints": joints}
        made[str(entry["name"])] = {"type": MOCK_CONTROLLERS[kind], **which}
    return made
