# SPDX-License-Identifier: BSD-3-Clause
"""A force-torque sensor on the wire, and a camera of the same URDF."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import PointCloud2

from modular_framework_testing.ros_session import until

INERTIA = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
ROBOT = f"""<robot name="scale"><link name="world"/>
  <link name="plate"><inertial><origin xyz="0.1 0 0"/><mass value="2"/>{INERTIA}</inertial>
    <visual><geometry><box size="0.2 0.2 0.1"/></geometry></visual></link>
  <joint name="sensor" type="fixed"><parent link="world"/><child link="plate"/><origin xyz="1 0 0.5"/></joint>
  <link name="needle"><inertial><mass value="0.01"/>{INERTIA}</inertial></link>
  <joint name="pointer" type="continuous"><parent link="world"/><child link="needle"/><axis xyz="0 0 1"/></joint>
  <gazebo><plugin name="ft" filename="libgazebo_ros_ft_sensor.so"><jointName>sensor</jointName>
    <topicName>scale/wrench</topicName><updateRate>50</updateRate></plugin></gazebo>
  <gazebo reference="world"><sensor type="depth" name="eye"><pose>0 0 0.5 0 0 0</pose><update_rate>5</update_rate>
    <plugin name="k" filename="libgazebo_ros_openni_kinect.so"><cameraName>kinect</cameraName></plugin></sensor>
  </gazebo></robot>"""
LAUNCH = """<launch>
  <param name="robot_description" textfile="{urdf}"/>
  <include file="$(find modular_framework_simulation)/launch/simulation.launch"/>
</launch>"""


@pytest.fixture(scope="module")
def simulation(ros_session: Any) -> Iterator[Any]:
    urdf = ros_session.folder / "scale.urdf"
    urdf.write_text(ROBOT)
    launch = ros_session.launch(LAUNCH.format(urdf=urdf))
    rospy.wait_for_service("/gazebo/spawn_sdf_model", 60.0)
    yield launch
    launch.stop()


def test_the_weight_is_published_at_the_rate_of_the_plugin_in_the_frame_of_the_child_link(simulation: Any) -> None:
    messages: list[WrenchStamped] = []
    subscriber = rospy.Subscriber("/scale/wrench", WrenchStamped, messages.append)
    until(lambda: len(messages) > 20, "wrenches")
    subscriber.unregister()
    last = messages[-1]
    assert last.header.frame_id == "plate"
    assert (last.wrench.force.z, last.wrench.torque.y) == pytest.approx((-2 * 9.8, 0.1 * 2 * 9.8), rel=0.01)
    stamps = [message.header.stamp.to_nsec() for message in messages]
    assert set(np.diff(stamps)) == {20_000_000}


def test_a_kinect_of_the_urdf_looks_along_the_x_axis_of_its_link(simulation: Any) -> None:
    clouds: list[PointCloud2] = []
    subscriber = rospy.Subscriber("/kinect/points", PointCloud2, clouds.append)
    until(lambda: clouds, "a cloud", timeout_s=60.0)
    subscriber.unregister()
    offsets = [field.offset for field in clouds[-1].fields]
    layout = {"names": ["x", "y", "z", "rgb"], "formats": ["<f4"] * 4, "offsets": offsets}
    points = np.frombuffer(clouds[-1].data, layout | {"itemsize": clouds[-1].point_step}).reshape(240, 320)
    assert points["z"][120, 160] == pytest.approx(0.9, abs=0.002)
    assert np.isnan(points["z"][0, 0])
