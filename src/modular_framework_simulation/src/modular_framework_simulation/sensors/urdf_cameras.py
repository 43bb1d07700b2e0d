# SPDX-License-Identifier: BSD-3-Clause
"""Reads the cameras of a robot's URDF.

They are `<gazebo reference="link"><sensor type="depth|camera">` with one of Gazebo's plugins for ROS, whose parameters
name the topics.
"""

from __future__ import annotations

import math

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.sensors.cameras import OPTICAL_IN_BODY, Camera, CameraTopics, Pinhole
from modular_framework_urdf import xml_text
from modular_framework_urdf.xml_text import Element

_DEPTH_PLUGINS = ("openni_kinect", "depth_camera")
_COLOUR_PLUGINS = ("gazebo_ros_camera",)
_SENSOR_TYPES = ("camera", "depth", "rgbd_camera")


def read_urdf_cameras(text: str, robot: str) -> tuple[list[Camera], list[str]]:
    """Reads the cameras of a robot.

    Args:
        text: URDF that the simulation has read before.
        robot: Name of the robot in the world.

    Returns:
        The usable cameras, and one sentence for each that is not usable.
    """
    root = xml_text.parse(text, "robot_description")
    links = {link.get("name") for link in root.findall("link")}
    cameras: list[Camera] = []
    faults = []
    for gazebo in root.findall("gazebo"):
        for sensor in gazebo.findall("sensor"):
            if sensor.get("type") not in _SENSOR_TYPES:
                continue
            where = f"robot_description:{sensor.sourceline}: <sensor name='{sensor.get('name', '')}'>"
            try:
                link = gazebo.get("reference", "")
                if link not in links:
                    raise ValueError(f"<gazebo reference='{link}'>: there is no such link; name one of the robot")
                cameras.append(_camera(sensor, f"{robot}::{link}"))
            except ValueError as error:
                faults.append(f"{where}: {error}; this camera is not simulated")
    return cameras, faults


def _camera(sensor: Element, parent: str) -> Camera:
    plugin = sensor.find("plugin")
    file = plugin.get("filename", "") if plugin is not None else ""
    kinect = any(name in file for name in _DEPTH_PLUGINS)
    if not kinect and not any(name in file for name in _COLOUR_PLUGINS):
        allowed = ", ".join((*_COLOUR_PLUGINS, *_DEPTH_PLUGINS))
        raise ValueError(f"got the plugin '{file}'; allowed: one whose file name has one of {allowed}")
    name = _text(plugin, "cameraName") or sensor.get("name", "camera")
    namespace = f"{_text(plugin, 'robotNamespace').rstrip('/')}/{name}".lstrip("/")

    def topic(key: str, default: str) -> str:
        return f"{namespace}/{_text(plugin, key) or default}"

    topics = CameraTopics(topic("imageTopicName", "image_raw"), topic("cameraInfoTopicName", "camera_info"))
    depth_range = (0.0, math.inf)
    if kinect:
        topics = CameraTopics(
            topics.image,
            topics.image_info,
            topic("depthImageTopicName", "depth/image_raw"),
            topic("depthImageCameraInfoTopicName", "depth/camera_info"),
            topic("pointCloudTopicName", "points"),
        )
        depth_range = (_number(plugin, "pointCloudCutoff", 0.4), _number(plugin, "pointCloudCutoffMax", 5.0))
    pinhole = Pinhole(
        width=int(_number(sensor, "camera/image/width", 320)),
        height=int(_number(sensor, "camera/image/height", 240)),
        horizontal_fov=_number(sensor, "camera/horizontal_fov", 1.047),
        near=_number(sensor, "camera/clip/near", 0.1),
        far=_number(sensor, "camera/clip/far", 100.0),
    )
    body_in_parent = _pose(sensor, "pose") @ _pose(sensor, "camera/pose")
    rate = _number(plugin, "updateRate", 0.0) or _number(sensor, "update_rate", 0.0) or 30.0
    frame = _text(plugin, "frameName") or parent.rpartition("::")[2]
    return Camera(namespace, frame, parent, body_in_parent @ OPTICAL_IN_BODY, rate, topics, pinhole, depth_range)


def _text(element: Element, path: str) -> str:
    return (element.findtext(path) or "").strip()


def _number(element: Element, path: str, default: float) -> float:
    text = _text(element, path)
    try:
        return float(text) if text else default
    except ValueError:
        raise ValueError(f"<{path}>: got '{text}'; expected a number") from None


def _pose(element: Element, path: str) -> Pose:
    text = _text(element, path) or "0 0 0 0 0 0"
    try:
        x, y, z, roll, pitch, yaw = (float(word) for word in text.split())
    except ValueError:
        raise ValueError(f"<{path}>: got '{text}'; expected six numbers: x y z roll pitch yaw") from None
    return Pose.from_xyz_rpy((x, y, z), (roll, pitch, yaw))
