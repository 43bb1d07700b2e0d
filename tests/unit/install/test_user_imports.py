# SPDX-License-Identifier: BSD-3-Clause
"""What a user's scripts and RViz expect to find in the workspace."""

from __future__ import annotations

import subprocess
import sys

import pytest

MODULES = (
    "tf",
    "tf.transformations",
    "tf2_ros",
    "tf2_geometry_msgs",
    "actionlib",
    "smach_ros",
    "moveit_commander",
    "moveit_ros_planning_interface._moveit_move_group_interface",
    "moveit_ros_planning_interface._moveit_planning_scene_interface",
    "moveit_ros_planning_interface._moveit_robot_interface",
    "moveit_ros_planning_interface._moveit_roscpp_initializer",
)


@pytest.mark.parametrize("module", MODULES)
def test_a_script_of_a_user_imports_the_public_modules(module: str) -> None:
    answer = subprocess.run([sys.executable, "-c", f"import {module}"], capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr


def test_tf_turns_angles_into_quaternions() -> None:
    from tf.transformations import euler_from_quaternion, quaternion_from_euler

    assert euler_from_quaternion(quaternion_from_euler(0.1, 0.2, 0.3)) == pytest.approx((0.1, 0.2, 0.3))


@pytest.mark.parametrize("package", ["joint_state_publisher", "joint_state_publisher_gui", "media_export"])
def test_a_package_that_launch_files_and_rviz_look_for_is_there(package: str) -> None:
    answer = subprocess.run(["rospack", "find", package], capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr


def test_rospack_lists_the_media_folders_rviz_asks_for() -> None:
    answer = subprocess.run(
        ["rospack", "plugins", "--attrib=ogre_media_path", "media_export"], capture_output=True, text=True, check=False
    )
    assert (answer.returncode, answer.stderr) == (0, "")
