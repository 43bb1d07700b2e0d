# SPDX-License-Identifier: BSD-3-Clause
"""A Panda on mock hardware with controllers of a ROS 2 file, as the demonstration of MoveIt 2 starts it."""

from pathlib import Path

from launch import LaunchDescription
from launch_ros.actions import Node
from moveit_configs_utils import MoveItConfigsBuilder

FOLDER = Path(__file__).parent


def generate_launch_description() -> LaunchDescription:
    """Returns the launch description."""
    config = (
        MoveItConfigsBuilder("panda_with_hand", package_name="panda_hand_moveit_config")
        .robot_description(file_path=str(FOLDER / "panda_on_mock_hardware.urdf.xacro"), mappings={"initial_z": "0.86"})
        .trajectory_execution(file_path="config/controllers.yaml")
        .planning_pipelines(pipelines=["ompl"])
        .to_moveit_configs()
    )
    controllers = str(FOLDER / "panda_ros2_controllers.yaml")
    names = ("joint_state_broadcaster", "arm_trajectory_controller", "hand_controller")
    return LaunchDescription(
        [
            Node(package="moveit_ros_move_group", executable="move_group", parameters=[config.to_dict()]),
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                parameters=[config.robot_description],
            ),
            Node(
                package="controller_manager",
                executable="ros2_control_node",
                parameters=[config.robot_description, controllers],
            ),
            *(Node(package="controller_manager", executable="spawner", arguments=[name]) for name in names),
        ]
    )
