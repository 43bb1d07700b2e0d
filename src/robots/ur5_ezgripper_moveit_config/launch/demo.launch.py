# SPDX-License-Identifier: BSD-3-Clause
"""UR5 with EZGripper (mock, simulated or real hardware), move_group and RViz, in the form of MoveIt 2's tutorial."""

import os

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare
from moveit_configs_utils import MoveItConfigsBuilder


def generate_launch_description() -> LaunchDescription:
    """Returns the launch description; `launch_py --show-args` lists the arguments."""
    # Arguments of the robot's xacro file.
    launch_arguments = {
        "robot_ip": LaunchConfiguration("robot_ip"),
        "gripper_port": LaunchConfiguration("gripper_port"),
        "use_fake_hardware": LaunchConfiguration("use_fake_hardware"),
        "sim_gazebo": LaunchConfiguration("sim_gazebo"),
        "initial_z": "0.86",
    }
    hardware_args = [
        DeclareLaunchArgument(
            "use_fake_hardware",
            default_value="true",
            choices=["true", "false"],
            description="Mock hardware that follows its commands exactly; false for the real robot",
        ),
        DeclareLaunchArgument(
            "sim_gazebo",
            default_value="false",
            choices=["true", "false"],
            description="Use the simulated robot, regardless of use_fake_hardware",
        ),
        DeclareLaunchArgument("robot_ip", default_value="192.168.56.101", description="Address of the arm"),
        DeclareLaunchArgument("gripper_port", default_value="/dev/ttyUSB0", description="Serial device of the gripper"),
    ]

    # Robot description and parameters of move_group.
    moveit_config = (
        MoveItConfigsBuilder("ur5_with_ezgripper", package_name="ur5_ezgripper_moveit_config")
        .robot_description(mappings=launch_arguments)
        .trajectory_execution(file_path="config/moveit_controllers.yaml")
        .planning_scene_monitor(publish_robot_description=True, publish_robot_description_semantic=True)
        .planning_pipelines(pipelines=["ompl", "stomp", "pilz_industrial_motion_planner"])
        .to_moveit_configs()
    )

    # Planning and execution.
    run_move_group_node = Node(
        package="moveit_ros_move_group",
        executable="move_group",
        output="screen",
        parameters=[moveit_config.to_dict()],
    )

    # RViz with a configuration of this package.
    rviz_config_arg = DeclareLaunchArgument(
        "rviz_config",
        default_value="moveit.rviz",
        description="RViz configuration file",
    )
    use_rviz_arg = DeclareLaunchArgument(
        "use_rviz", default_value="true", choices=["true", "false"], description="Whether to start RViz"
    )
    rviz_base = LaunchConfiguration("rviz_config")
    rviz_config = PathJoinSubstitution([FindPackageShare("ur5_ezgripper_moveit_config"), "launch", rviz_base])

    rviz_node = Node(
        package="rviz2",
        executable="rviz2",
        name="rviz2",
        output="log",
        arguments=["-d", rviz_config],
        parameters=[
            moveit_config.robot_description,
            moveit_config.robot_description_semantic,
            moveit_config.robot_description_kinematics,
            moveit_config.planning_pipelines,
            moveit_config.joint_limits,
        ],
        condition=IfCondition(LaunchConfiguration("use_rviz")),
    )

    # Pose of the robot in map; the root link of the robot is world.
    static_tf = Node(
        package="tf2_ros",
        executable="static_transform_publisher",
        name="static_transform_publisher",
        output="log",
        arguments=["--frame-id", "map", "--child-frame-id", "world"],
    )

    # Frames of the links, from the joint states.
    robot_state_publisher = Node(
        package="robot_state_publisher",
        executable="robot_state_publisher",
        name="robot_state_publisher",
        respawn=True,
        output="both",
        parameters=[moveit_config.robot_description],
    )

    # Hardware, selected by sim_gazebo and use_fake_hardware, and its controllers.
    ros2_controllers_path = os.path.join(
        get_package_share_directory("ur5_ezgripper_moveit_config"),
        "config",
        "ros2_controllers.yaml",
    )
    ros2_control_node = Node(
        package="controller_manager",
        executable="ros2_control_node",
        parameters=[ros2_controllers_path],
        remappings=[
            ("/controller_manager/robot_description", "/robot_description"),
        ],
        output="both",
    )

    joint_state_broadcaster_spawner = Node(
        package="controller_manager",
        executable="spawner",
        arguments=[
            "joint_state_broadcaster",
            "--controller-manager",
            "/controller_manager",
        ],
    )

    arm_controller_spawner = Node(
        package="controller_manager",
        executable="spawner",
        arguments=["arm_trajectory_controller", "-c", "/controller_manager"],
    )

    hand_controller_spawner = Node(
        package="controller_manager",
        executable="spawner",
        arguments=["ezgripper_controller", "-c", "/controller_manager"],
    )

    return LaunchDescription(
        [
            *hardware_args,
            rviz_config_arg,
            use_rviz_arg,
            rviz_node,
            static_tf,
            robot_state_publisher,
            run_move_group_node,
            ros2_control_node,
            joint_state_broadcaster_spawner,
            arm_controller_spawner,
            hand_controller_spawner,
        ]
    )
