# SPDX-License-Identifier: BSD-3-Clause
"""Sensors of a world file, of a robot and of spawned models on the wire: types, frames, rates, resets, and deletion."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rospy
from gazebo_msgs.msg import ContactsState
from gazebo_msgs.srv import DeleteModel, SpawnModel
from geometry_msgs.msg import Pose, WrenchStamped
from sensor_msgs.msg import Image, Imu, LaserScan
from std_srvs.srv import Empty

from modular_framework_testing.ros_session import until

INERTIA = "<inertia ixx='0.01' iyy='0.01' izz='0.01' ixy='0' ixz='0' iyz='0'/>"
ROBOT = f"""<robot name="mast"><link name="world"/>
  <link name="head"><inertial><mass value="1"/>{INERTIA}</inertial></link>
  <joint name="neck" type="continuous"><parent link="world"/><child link="head"/><origin xyz="0 0 0.5"/>
    <axis xyz="0 0 1"/></joint>
  <gazebo reference="head"><sensor name="scan" type="gpu_ray"><update_rate>20</update_rate><ray><scan><horizontal>
    <samples>3</samples><min_angle>-1</min_angle><max_angle>1</max_angle></horizontal></scan>
    <range><min>0.1</min><max>5</max></range></ray><plugin name="l" filename="libgazebo_ros_gpu_laser.so">
    <topicName>/scan</topicName><frameName>head</frameName></plugin></sensor></gazebo></robot>"""
BOX = """<geometry><box><size>0.2 0.2 0.2</size></box></geometry>"""
MASS = """<inertial><mass>2</mass><inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia></inertial>"""
WORLD = f"""<sdf version="1.6"><world name="w"><model name="floor"><static>true</static><link name="link">
  <collision name="c"><geometry><plane><normal>0 0 1</normal></plane></geometry></collision></link></model>
  <model name="wall"><static>true</static><pose>2.1 0 0.5 0 0 0</pose><link name="link"><collision name="c">{BOX}
  </collision></link></model><model name="crate"><pose>0 1 0.1 0 0 0</pose><link name="link">{MASS}
  <collision name="shell">{BOX}</collision><sensor name="bump" type="contact"><update_rate>50</update_rate><contact>
  <collision>shell</collision></contact><plugin name="b" filename="libgazebo_ros_bumper.so"/></sensor>
  <sensor name="imu" type="imu"><update_rate>100</update_rate><plugin name="i" filename="libgazebo_ros_imu_sensor.so">
  <frameName>link</frameName><updateRateHZ>50</updateRateHZ></plugin></sensor></link>
  <model name="lid"><pose>0 0 0.2 0 0 0</pose><link name="top">{MASS}</link></model>
  <joint name="bolt" type="fixed"><parent>link</parent><child>lid::top</child><sensor name="load" type="force_torque">
  <topic>lid_wrench</topic><update_rate>25</update_rate></sensor></joint></model></world></sdf>"""
EYE = """<sdf version="1.6"><model name="eye"><static>1</static><link name="link"><sensor name="camera" type="camera">
  <update_rate>10</update_rate><camera><image><width>32</width><height>24</height></image>
  <noise><type>gaussian</type><stddev>0.1</stddev></noise></camera><plugin name="p" filename="libgazebo_ros_camera.so">
  <cameraName>eye</cameraName></plugin></sensor></link></model></sdf>"""
LAUNCH = """<launch>
  <param name="seed" value="3"/>
  <param name="robot_description" textfile="{folder}/mast.urdf"/>
  <include file="$(find modular_framework_simulation)/launch/simulation.launch">
    <arg name="world_file" value="{folder}/w.world"/>
  </include>
</launch>"""


@pytest.fixture(scope="module")
def simulation(ros_session: Any) -> Iterator[Any]:
    (ros_session.folder / "mast.urdf").write_text(ROBOT)
    (ros_session.folder / "w.world").write_text(WORLD)
    launch = ros_session.launch(LAUNCH.format(folder=ros_session.folder))
    rospy.wait_for_service("/gazebo/spawn_sdf_model", 60.0)
    yield launch
    launch.stop()


def collect(topic: str, kind: Any, count: int) -> list[Any]:
    """The next messages of a topic."""
    messages: list[Any] = []
    subscriber = rospy.Subscriber(topic, kind, messages.append)
    until(lambda: len(messages) >= count, f"{count} messages of {topic}")
    subscriber.unregister()
    return messages


def periods_ns(messages: list[Any]) -> set[int]:
    """The times between messages."""
    return set(np.diff([message.header.stamp.to_nsec() for message in messages]))


def test_a_laser_of_the_robot_measures_the_wall_in_front_of_it(simulation: Any) -> None:
    scans = collect("/scan", LaserScan, 5)
    scan = scans[-1]
    assert (scan.header.frame_id, scan.angle_min, scan.angle_increment) == ("head", -1.0, 1.0)
    assert scan.ranges == pytest.approx([np.inf, 2.0, np.inf], abs=1e-3)
    assert periods_ns(scans) == {50_000_000}


def test_an_imu_a_bumper_and_a_force_sensor_of_the_world_file_weigh_the_crate(simulation: Any) -> None:
    until(lambda: rospy.get_time() > 4.0, "the crate to lie still for long")
    readings = collect("/crate/imu_data", Imu, 5)
    acceleration = readings[-1].linear_acceleration
    assert (acceleration.x, acceleration.y, acceleration.z) == pytest.approx((0.0, 0.0, 9.8), abs=0.02)
    assert readings[-1].header.frame_id == "link"
    assert periods_ns(readings) == {20_000_000}
    contacts = collect("/bumper_states", ContactsState, 5)[-1]
    (state,) = contacts.states
    assert (state.collision1_name, state.collision2_name) == ("crate::link::shell", "floor::link::c")
    assert state.total_wrench.force.z == pytest.approx(4 * 9.8, rel=0.01)
    assert len(state.wrenches) == len(state.contact_positions) == len(state.contact_normals) == len(state.depths)
    wrench = collect("/lid_wrench", WrenchStamped, 3)[-1]
    assert wrench.wrench.force.z == pytest.approx(-2 * 9.8, rel=0.01)


def test_sensors_go_on_after_resets(simulation: Any) -> None:
    rospy.ServiceProxy("/gazebo/reset_world", Empty)()
    assert collect("/crate/imu_data", Imu, 3)
    before = rospy.Time.now()
    rospy.ServiceProxy("/gazebo/reset_simulation", Empty)()
    stamps = [message.header.stamp for message in collect("/scan", LaserScan, 3)]
    assert stamps[0] < before
    assert stamps == sorted(stamps)


def test_a_noisy_camera_of_a_spawned_model_appears_and_goes_with_it(simulation: Any) -> None:
    assert rospy.ServiceProxy("/gazebo/spawn_sdf_model", SpawnModel)("eye", EYE, "", Pose(), "world").success
    images = collect("/eye/image_raw", Image, 2)
    pixels = np.frombuffer(images[-1].data, np.uint8).reshape(24, 32, 3)
    assert images[-1].header.frame_id == "link"
    assert (pixels.std(axis=(0, 1)) > 10).all()  # without noise the sky has one colour
    assert rospy.ServiceProxy("/gazebo/delete_model", DeleteModel)("eye").success
    until(lambda: "/eye/image_raw" not in dict(rospy.get_published_topics()), "the end of the topic")
