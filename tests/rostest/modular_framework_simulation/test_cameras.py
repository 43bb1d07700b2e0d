# SPDX-License-Identifier: BSD-3-Clause
"""Cameras on the wire: topics, types, frames and rate, what they show, and that they rest without a subscriber."""

from __future__ import annotations

import functools
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rospy
from gazebo_msgs.srv import SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_srvs.srv import Empty

from modular_framework_testing.ros_session import until as wait_until

LAUNCH = """<launch>
  <include file="$(find ur5_ezgripper_robot)/launch/ur5_upload.launch"/>
  <include file="$(find modular_framework_simulation)/launch/simulation.launch">
    <arg name="world_file" value="$(find modular_framework_description)/worlds/ur5_setup.world"/>
    <arg name="model_path" value="$(find modular_framework_description)/models"/>
    <arg name="sensors_file" value="$(find modular_framework_api)/config/sensors_config.yaml"/>
  </include>
</launch>"""
NAMESPACE, FRAME = "/simulated_kinect2", "simulated_kinect2"
EYE = (-0.1645, 0.375, 2.72)
CUBE = """<sdf version="1.6"><model name="cube"><static>true</static><link name="link"><visual name="v"><geometry><box>
  <size>0.4 0.4 0.4</size></box></geometry><material><ambient>0.9 0 0 1</ambient><diffuse>0.9 0 0 1</diffuse></material>
  </visual><collision name="c"><geometry><box><size>0.4 0.4 0.4</size></box></geometry></collision></link></model></sdf>
"""
CUBE_TOP_M = 1.7

until = functools.partial(wait_until, timeout_s=60.0)


@pytest.fixture(scope="module")
def simulation(ros_session: Any) -> Iterator[Any]:
    launch = ros_session.launch(LAUNCH)
    rospy.wait_for_service("/gazebo/spawn_sdf_model", 60.0)
    until(lambda: f"{NAMESPACE}/pointcloud" in dict(rospy.get_published_topics()), "topics of the camera")
    yield launch
    launch.stop()


def processes(part_of_command: str) -> list[int]:
    """The processes of this master with a text in their command line."""
    pids = [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit()]
    return [pid for pid in pids if part_of_command in command_line(pid)]


def processor_time_s(part_of_command: str) -> float:
    """Seconds of processor time that the one process with this text in its command line has used."""
    (pid,) = processes(part_of_command)
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def command_line(pid: int) -> str:
    """Arguments of a process of this master; empty for any other."""
    try:
        environment = Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
        if f"ROS_MASTER_URI={os.environ['ROS_MASTER_URI']}".encode() not in environment:
            return ""
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode()
    except OSError:
        return ""


def collect(topic: str, kind: Any, count: int) -> list[Any]:
    """The next messages of a topic."""
    messages: list[Any] = []
    subscriber = rospy.Subscriber(topic, kind, messages.append)
    until(lambda: len(messages) >= count, f"{count} messages of {topic}")
    subscriber.unregister()
    return messages


def test_a_camera_without_a_subscriber_rests(simulation: Any) -> None:
    def rests() -> bool:
        before = processor_time_s("camera_node")
        time.sleep(3.0)
        return processor_time_s("camera_node") - before < 0.15

    until(rests, "three seconds with hardly any processor time, after the start")


def test_the_topics_have_the_types_of_their_names(simulation: Any) -> None:
    types = dict(rospy.get_published_topics())
    assert types[f"{NAMESPACE}/rgb_image"] == "sensor_msgs/Image"
    assert types[f"{NAMESPACE}/depth_image"] == "sensor_msgs/Image"
    assert types[f"{NAMESPACE}/camera_info"] == "sensor_msgs/CameraInfo"
    assert types[f"{NAMESPACE}/pointcloud"] == "sensor_msgs/PointCloud2"


def test_images_show_what_is_spawned_in_the_frame_of_the_camera(simulation: Any) -> None:
    spawn = rospy.ServiceProxy("/gazebo/spawn_sdf_model", SpawnModel)
    pose = Pose(Point(EYE[0], EYE[1], CUBE_TOP_M - 0.2), Quaternion(0, 0, 0, 1))
    assert spawn("cube", CUBE, "", pose, "world").success
    rgb = collect(f"{NAMESPACE}/rgb_image", Image, 2)[-1]
    assert (rgb.header.frame_id, rgb.encoding, rgb.width, rgb.height) == (FRAME, "rgb8", 640, 480)
    assert np.frombuffer(rgb.data, np.uint8).reshape(480, 640, 3)[240, 320].argmax() == 0
    depth = collect(f"{NAMESPACE}/depth_image", Image, 2)[-1]
    assert (depth.header.frame_id, depth.encoding, depth.step) == (FRAME, "32FC1", 2560)
    metres = np.frombuffer(depth.data, np.float32).reshape(480, 640)
    assert metres[240, 320] == pytest.approx(EYE[2] - CUBE_TOP_M, abs=0.002)


def test_the_cloud_is_registered_with_the_image_and_the_intrinsics(simulation: Any) -> None:
    info = collect(f"{NAMESPACE}/camera_info", CameraInfo, 1)[-1]
    assert (info.header.frame_id, info.width, info.height) == (FRAME, 640, 480)
    cloud = collect(f"{NAMESPACE}/pointcloud", PointCloud2, 1)[-1]
    assert (cloud.header.frame_id, cloud.width, cloud.height) == (FRAME, 640, 480)
    names = {"names": [field.name for field in cloud.fields], "formats": ["<f4"] * 4, "itemsize": cloud.point_step}
    points = np.frombuffer(cloud.data, names | {"offsets": [field.offset for field in cloud.fields]}).reshape(480, 640)
    assert points.dtype.names == ("x", "y", "z", "rgb")
    for row, column in ((240, 320), (10, 10), (400, 600)):
        point = points[row, column]
        assert info.K[0] * point["x"] / point["z"] + info.K[2] == pytest.approx(column, abs=0.01)
        assert info.K[4] * point["y"] / point["z"] + info.K[5] == pytest.approx(row, abs=0.01)


def test_images_come_at_the_rate_of_the_camera_in_simulated_time(simulation: Any) -> None:
    stamps = [message.header.stamp.to_sec() for message in collect(f"{NAMESPACE}/camera_info", CameraInfo, 23)][2:]
    # one that comes late on a busy machine does not delay the others
    assert np.mean(np.diff(stamps)) == pytest.approx(0.1, rel=0.1)
    assert stamps == sorted(set(stamps))


def test_a_new_subscriber_gets_one_image_of_now_while_time_stands_still(simulation: Any) -> None:
    rospy.ServiceProxy("/gazebo/pause_physics", Empty)()
    now = rospy.wait_for_message("/clock", Clock, 60.0).clock
    try:
        for _ in range(2):
            messages = collect(f"{NAMESPACE}/rgb_image", Image, 1)
            assert [message.header.stamp for message in messages] == [now]
    finally:
        rospy.ServiceProxy("/gazebo/unpause_physics", Empty)()


def test_time_goes_on_without_the_process_that_draws_and_the_log_says_so(simulation: Any) -> None:
    (pid,) = processes("camera_node")
    os.kill(pid, signal.SIGKILL)
    until(lambda: "cameras publish no more images" in simulation.log(), "a line in the log")
    before = rospy.get_time()
    until(lambda: rospy.get_time() > before + 0.2, "simulated time")


def test_the_process_that_draws_ends_with_the_simulation(ros_session: Any, simulation: Any) -> None:
    simulation.stop()
    again = ros_session.launch(LAUNCH)
    until(lambda: processes("camera_node"), "the process that draws")
    until(lambda: "simulation is running" in again.log(), "a simulation that runs")
    again.stop()
    until(lambda: not processes("camera_node"), "the end of the process that draws", timeout_s=10.0)
