# SPDX-License-Identifier: BSD-3-Clause
"""What the overhead camera sees and the scene does not know becomes an obstacle, as with octomap:=true."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rospy
from gazebo_msgs.srv import SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import PlanningSceneComponents
from moveit_msgs.srv import GetPlanningScene

from modular_framework_planning.octomap.encoding import read_stream
from modular_framework_testing.ros_session import until
from modular_framework_urdf.rotations import rotate_vector

LAUNCH = """<launch>
  <include file="$(find ur5_ezgripper_robot)/launch/ur5_upload.launch"/>
  <include file="$(find modular_framework_simulation)/launch/simulation.launch">
    <arg name="world_file" value="$(find modular_framework_description)/worlds/ur5_setup.world"/>
    <arg name="model_path" value="$(find modular_framework_description)/models"/>
    <arg name="sensors_file" value="$(find modular_framework_api)/config/sensors_config.yaml"/>
  </include>
  <node pkg="modular_framework_core" type="robot_controllers_spawner" name="spawner"
        args="ur5_ezgripper_robot ur5_ezgripper_controller_simulation.yaml"/>
  <node pkg="robot_state_publisher" type="robot_state_publisher" name="robot_state_publisher"/>
  <node pkg="modular_framework_core" type="sensors_tf2_broadcaster" name="sensors_tf2_broadcaster"
        args="$(find modular_framework_api)/config/sensors_config.yaml"/>
  <include file="$(find ur5_ezgripper_moveit_config)/launch/move_group.launch"/>
  <rosparam command="load" ns="move_group" file="$(find modular_framework_api)/config/sensor_plugins.yaml"/>
</launch>"""
SIZE, CENTRE, VOXEL = 0.3, np.array([-0.5, 0.7, 1.3]), 0.05
# It can be seen but not touched, so that the planning scene does not know it.
GHOST = f"""<sdf version="1.6"><model name="ghost"><static>1</static><link name="link"><visual name="v"><geometry><box>
  <size>{SIZE} {SIZE} {SIZE}</size></box></geometry></visual></link></model></sdf>"""
WANTED = PlanningSceneComponents(components=PlanningSceneComponents.OCTOMAP)


@pytest.fixture(scope="module")
def framework(ros_session: Any) -> Iterator[Any]:
    launch = ros_session.launch(LAUNCH)
    for service in ("/gazebo/spawn_sdf_model", "/get_planning_scene"):
        rospy.wait_for_service(service, 90.0)
    yield launch
    launch.stop()


def occupied() -> np.ndarray:
    """Centres of the occupied voxels of the scene in the world [m], (n, 3)."""
    found = rospy.ServiceProxy("/get_planning_scene", GetPlanningScene)(WANTED).scene.world.octomap
    tree, at, turn = found.octomap, found.origin.position, found.origin.orientation
    if not tree.data:
        return np.empty((0, 3))
    assert tree.resolution == VOXEL
    voxels = read_stream(np.array(tree.data, np.int8).tobytes(), tree.resolution, tree.binary)
    quaternion = (turn.x, turn.y, turn.z, turn.w)
    turned = [rotate_vector(quaternion, (x, y, z)) for x, y, z in voxels.occupied_centers().tolist()]
    return np.array(turned).reshape(-1, 3) + (at.x, at.y, at.z)


def test_a_box_that_only_the_camera_knows_becomes_an_obstacle(framework: Any) -> None:
    spawn = rospy.ServiceProxy("/gazebo/spawn_sdf_model", SpawnModel)
    assert spawn("ghost", GHOST, "", Pose(Point(*CENTRE), Quaternion(0, 0, 0, 1)), "world").success

    def upper_side() -> int:
        """Voxels at the upper side of the box; none may be above it."""
        offsets = occupied() - CENTRE
        column = offsets[(np.abs(offsets[:, :2]) < SIZE / 2 - VOXEL).all(axis=1)]
        assert (column[:, 2] < SIZE / 2 + VOXEL).all()
        return int((np.abs(column[:, 2] - SIZE / 2) < VOXEL).sum())

    cells = (SIZE / VOXEL - 2) ** 2
    until(lambda: upper_side() >= 0.8 * cells, f"{cells:g} voxels at the upper side of the box", timeout_s=120.0)
