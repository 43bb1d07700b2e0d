# SPDX-License-Identifier: BSD-3-Clause
"""Launch descriptions of a MoveIt configuration: move_group, RViz, controllers, and a demonstration.

Names, arguments and defaults follow MoveIt 2; features without a counterpart on ROS 1 raise errors.
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
NO_WAREHOUSE = "there is no warehouse database; store states and scenes in files (.scene, SRDF)"
TRAJECTORY, GRIPPER = "FollowJointTrajectory", "GripperCommand"
MOCK_CONTROLLERS = {
    TRAJECTORY: "joint_trajectory_controller/JointTrajectoryController",
    GRIPPER: "position_controllers/GripperActionController",
}
"""Default controllers of a robot without a controller file, by type of the entry in `controller_list`."""


def generate_rsp_launch(moveit_config: MoveItConfigs) -> LaunchDescription:
    """Returns a launch description of robot_state_publisher; its argument is publish_frequency [Hz]."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("publish_frequency", default_value="15.0", description="rate of moving frames [Hz]"),
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
    """Returns a launch description of RViz with the goal marker; its arguments are debug and rviz_config."""
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
    """Returns the RViz file of the config package, in the folder of MoveIt 2 or MoveIt 1."""
    places = [_package(moveit_config) / folder / "moveit.rviz" for folder in ("config", "launch")]
    return str(next((path for path in places if path.is_file()), places[0]))


def _package(moveit_config: MoveItConfigs) -> Path:
    if moveit_config.package_path is None:
        raise LaunchError("these MoveItConfigs have no package; create them with MoveItConfigsBuilder")
    return moveit_config.package_path


def generate_setup_assistant_launch(moveit_config: MoveItConfigs) -> LaunchDescription:
    """Raises an error, because the Setup Assistant's window is not supported.

    Raises:
        LaunchError: Always, with the alternative.
    """
    raise LaunchError(
        "generate_setup_assistant_launch is not supported: there is no window of the Setup Assistant; edit "
        f"{_package(moveit_config)}, or create the packages of a robot with create_robot"
    )


def generate_static_virtual_joint_tfs_launch(moveit_config: MoveItConfigs) -> LaunchDescription:
    """Returns a launch description with a static transform per virtual joint between different frames."""

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
    """Returns a launch description that starts the controllers of the configuration and a joint state publisher."""
    ld = LaunchDescription()
    for controller in [*_controller_names(moveit_config), BROADCASTER]:
        ld.add_action(Node(package="controller_manager", executable="spawner", arguments=[controller], output="screen"))
    return ld


def generate_warehouse_db_launch(moveit_config: MoveItConfigs) -> LaunchDescription:
    """Raises an error, because the warehouse database is not supported.

    Raises:
        LaunchError: Always, with the alternative.
    """
    del moveit_config
    raise LaunchError(f"generate_warehouse_db_launch is not supported: {NO_WAREHOUSE}")


def generate_move_group_launch(moveit_config: MoveItConfigs) -> LaunchDescription:
    """Returns a launch description of move_group.

    Its arguments are debug (publish each planning request), allow_trajectory_execution,
    publish_monitored_planning_scene, capabilities and disable_capabilities; monitor_dynamics must be false.
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
    """Returns a complete launch description for planning and execution: mock hardware, move_group and RViz.

    The `<ros2_control>` tags of the robot description define the hardware, with mock hardware as the default.
    The controllers are in config/ros2_controllers.yaml; without this file, each entry of `controller_list` gets a
    controller. With MoveIt 1's fake controllers, a joint_state_publisher publishes their positions. Launch files of the
    config package (rsp.launch.py, move_group.launch.py, moveit_rviz.launch.py, static_virtual_joint_tfs.launch.py,
    spawn_controllers.launch.py) replace the launch descriptions of this module.

    Args:
        moveit_config: The configuration.
        launch_package_path: Folder of the package with the launch files; by default, the config package.

    Returns:
        The description with the arguments use_rviz, debug and the arguments of its parts; db must be false.
    """
    folder = (launch_package_path or _package(moveit_config)) / "launch"
    ld = LaunchDescription(
        [
            DeclareRefusedLaunchArg("db", reason=NO_WAREHOUSE),
            DeclareBooleanLaunchArg("debug", default_value=False, description="publish each planning request"),
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
    """Returns the controller file of a config package, or default controllers for its controller list."""
    path = _package(moveit_config) / "config" / "ros2_controllers.yaml"
    if path.is_file():
        return path
    made: dict[str, Any] = {BROADCASTER: {"type": "joint_state_broadcaster/JointStateBroadcaster"}}
    for entry in moveit_config.trajectory_execution.get("controller_list", ()):
        joints, kind = list(entry.get("joints", ())), str(entry.get("type", ""))
        if kind not in MOCK_CONTROLLERS or not joints:
            raise LaunchError(
                f"{path} is missing, and controller '{entry.get('name')}' of the configuration has type '{kind}' and "
                f"joints {joints}; allowed without this file: {', '.join(MOCK_CONTROLLERS)} with joints; add the file"
            )
        which = {"joint": joints[0]} if kind == GRIPPER else {"joints": joints}
        made[str(entry["name"])] = {"type": MOCK_CONTROLLERS[kind], **which}
    return made
