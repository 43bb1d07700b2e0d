# SPDX-License-Identifier: BSD-3-Clause
"""Reads the cameras of a model: <sensor> elements of type camera or depth with a ROS plugin of Gazebo."""

from __future__ import annotations

import math

from modular_framework_simulation.sensors.cameras import OPTICAL_IN_BODY, Camera, CameraTopics, Pinhole
from modular_framework_simulation.sensors.sensor_xml import SensorXml, prefixed_frame, resolved_topic

TYPES = ("camera", "depth", "depth_camera", "rgbd_camera")
PLUGINS = ("gazebo_ros_camera", "gazebo_ros_openni_kinect", "gazebo_ros_depth_camera")
DEPTH_PLUGINS = PLUGINS[1:]

_DEFAULT_RATE_HZ = 30.0


def read_camera(xml: SensorXml, seed: int) -> Camera:
    """Reads a <sensor> of a type in `TYPES`.

    Args:
        xml: The <sensor> with its plugin.
        seed: Random seed of the simulation, for noise.

    Raises:
        ValueError: A value is unsupported or invalid.
    """
    sensor, plugin = xml.sensor, xml.plugin
    with_depth = xml.file in DEPTH_PLUGINS or (plugin is None and sensor.node.attributes.get("type") != "camera")
    depth_range = (0.0, math.inf)
    if plugin is None:
        topics = _topics_below(xml.require_topic(", ".join(PLUGINS)), with_depth)
        frame, plugin_rate = xml.link, 0.0
    else:
        sensor_name = sensor.node.attributes.get("name", "camera")
        namespace = xml.namespace()
        base = resolved_topic(namespace, plugin.text("cameraName", sensor_name)).lstrip("/")
        topics = _plugin_topics(xml, base, with_depth)
        frame = prefixed_frame(namespace, plugin.text("frameName")) if plugin.text("frameName") else xml.link
        plugin_rate = plugin.number("updateRate", 0.0, 0.0)
        if with_depth:
            depth_range = (plugin.number("pointCloudCutoff", 0.4), plugin.number("pointCloudCutoffMax", 5.0))
    pinhole = Pinhole(
        width=int(sensor.number("camera/image/width", 320)),
        height=int(sensor.number("camera/image/height", 240)),
        horizontal_fov=sensor.number("camera/horizontal_fov", 1.047),
        near=sensor.number("camera/clip/near", 0.1),
        far=sensor.number("camera/clip/far", 100.0),
    )
    rate = plugin_rate or sensor.number("update_rate", 0.0, 0.0) or _DEFAULT_RATE_HZ
    if sensor.text("camera/image/format", "R8G8B8") == "R8G8B8":
        sensor.find("camera/image")
    body_in_parent = xml.pose @ sensor.pose("camera/pose")
    parent = f"{xml.model.name}::{xml.link}"
    in_parent = body_in_parent @ OPTICAL_IN_BODY
    noise = sensor.noise("camera/noise")
    return Camera(
        name=xml.name,
        frame_id=frame,
        parent=parent,
        optical_in_parent=in_parent,
        rate_hz=rate,
        topics=topics,
        pinhole=pinhole,
        depth_range=depth_range,
        noise=noise,
        seed=seed,
    )


def _topics_below(base: str, with_depth: bool) -> CameraTopics:
    if not with_depth:
        return CameraTopics(base, f"{base.rpartition('/')[0]}/camera_info".lstrip("/"))
    return CameraTopics(
        f"{base}/image", f"{base}/camera_info", f"{base}/depth_image", f"{base}/camera_info", f"{base}/points"
    )


def _plugin_topics(xml: SensorXml, base: str, with_depth: bool) -> CameraTopics:
    plugin = xml.plugin
    assert plugin is not None

    def topic(key: str, default: str) -> str:
        return resolved_topic(base, plugin.text(key, default)).lstrip("/")

    image, info = topic("imageTopicName", "image_raw"), topic("cameraInfoTopicName", "camera_info")
    if not with_depth:
        return CameraTopics(image, info)
    return CameraTopics(
        image,
        info,
        topic("depthImageTopicName", "depth/image_raw"),
        topic("depthImageCameraInfoTopicName", "depth/camera_info"),
        topic("pointCloudTopicName", "points"),
    )
