# SPDX-License-Identifier: BSD-3-Clause
"""Cameras are found in sensors_config.yaml, in both of its layouts, and in a URDF; faults name what is wrong."""

from __future__ import annotations

import math
from typing import Any

import pytest

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.sensors.camera_config import read_cameras
from modular_framework_simulation.sensors.cameras import CameraTopics
from modular_framework_simulation.sensors.noise import NO_NOISE, Noise
from modular_framework_simulation.sensors.robot_visuals import read_robot_visuals
from modular_framework_simulation.sensors.sensor_reader import read_robot_sensors
from modular_framework_urdf.rotations import rotate_vector

OVERHEAD: dict[str, Any] = {
    "fixed_kinect": {
        "frame_id": "simulated_kinect2",
        "origin_frame_id": "world",
        "frame_x": -0.1645,
        "frame_y": 0.375,
        "frame_z": 2.72,
        "frame_roll": 3.14159265359,
        "frame_pitch": 0,
        "frame_yaw": -1.57079632679,
    },
    "pointcloud_topic_name": "simulated_kinect2/pointcloud",
    "depth_image_topic_name": "simulated_kinect2/depth_image",
    "rgb_image_topic_name": "simulated_kinect2/rgb_image",
}


def locate(frame: str) -> str | None:
    """Knows the world and one link."""
    return {"world": "world", "tool": "robot::tool"}.get(frame)


def changed(**keys: Any) -> dict[str, Any]:
    """The overhead camera with other keys in its section; a key without a value is left out."""
    section = {key: value for key, value in (OVERHEAD["fixed_kinect"] | keys).items() if value is not None}
    return OVERHEAD | {"fixed_kinect": section}


def test_the_overhead_camera_looks_down_under_the_topics_of_the_file() -> None:
    cameras, faults = read_cameras(OVERHEAD, "sensors", locate)
    assert not faults
    (camera,) = cameras
    info = "simulated_kinect2/camera_info"
    topics = (
        "simulated_kinect2/rgb_image",
        info,
        "simulated_kinect2/depth_image",
        info,
        "simulated_kinect2/pointcloud",
    )
    assert camera.topics == CameraTopics(*topics)
    assert (camera.frame_id, camera.parent) == ("simulated_kinect2", "world")
    assert rotate_vector(camera.optical_in_parent.quaternion, (0, 0, 1)) == pytest.approx((0, 0, -1), abs=1e-6)


def test_a_frame_without_topics_is_no_camera() -> None:
    torque_sensor = OVERHEAD["fixed_kinect"] | {"frame_id": "torque_sensor"}
    cameras, faults = read_cameras(OVERHEAD | {"torque_sensor": torque_sensor}, "sensors", locate)
    assert ([camera.name for camera in cameras], faults) == (["fixed_kinect"], [])


def test_the_later_layout_and_settings_of_a_camera_are_read() -> None:
    section = {
        "frame_id": "eye",
        "data_topics": {"pointcloud_topic": "eye/cloud"},
        "initial_pose": {
            "reference_frame": "tool",
            "position": {"x": 0.1, "y": 0.0, "z": 0.2},
            "orientation": {"r": 0.0, "p": 0.0, "y": math.pi / 2},
        },
        "camera": {"width": 320, "height": 200, "horizontal_fov": 0.8, "near": 0.1, "far": 3.0, "rate": 5},
    }
    (camera,), faults = read_cameras({"eye": section}, "sensors", locate)
    assert not faults
    assert (camera.parent, camera.topics, camera.rate_hz) == ("robot::tool", CameraTopics(points="eye/cloud"), 5.0)
    assert camera.optical_in_parent.distance_to(Pose.from_xyz_rpy((0.1, 0, 0.2), (0, 0, math.pi / 2)))[1] < 1e-9
    assert (camera.pinhole.width, camera.pinhole.height, camera.pinhole.far) == (320, 200, 3.0)


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"frame_x": None}, "sensors/fixed_kinect/frame_x: got None; expected a number"),
        ({"frame_z": "high"}, "frame_z: got 'high'; expected a number"),
        ({"frame_z": math.nan}, "frame_z: got nan; expected a number"),
        ({"origin_frame_id": "moon"}, "origin_frame_id: got 'moon'; allowed: world, or a link"),
        ({"initial_pose": "above_table"}, "initial_pose: got 'above_table'"),
        ({"camera": {"zoom": 2}}, "camera: unknown key 'zoom'; allowed: width"),
        ({"camera": 3}, "camera: got 3; expected a mapping"),
        ({"camera": {"rate": 0}}, "camera/rate: got 0 Hz; allowed: more than 0"),
        ({"camera": {"noise_stddev": -1}}, "camera/noise_stddev: got -1; allowed: 0 or more"),
        ({"data_topics": {"rgb_topic": 3}}, "rgb_topic: got 3; expected a name"),
    ],
)
def test_a_fault_names_the_key_what_was_found_and_what_is_allowed(keys: dict[str, Any], text: str) -> None:
    cameras, faults = read_cameras(changed(**keys), "sensors", locate)
    assert cameras == []
    assert len(faults) == 1
    assert text in faults[0]


def urdf(sensor: str, reference: str = "head") -> str:
    """A robot with a sensor on its head."""
    return f"""<robot name="r"><material name="blue"><color rgba="0 0 1 1"/></material>
      <link name="head"><visual><origin xyz="0 0 1"/><geometry><box size="1 2 3"/></geometry><material name="blue"/>
      </visual><visual><geometry><mesh filename="package://nowhere/head.stl"/></geometry></visual></link>
      <gazebo reference="{reference}">{sensor}</gazebo></robot>"""


KINECT = """<sensor type="depth" name="eye"><update_rate>15</update_rate><pose>0 0 0.5 0 0 0</pose><camera>
  <horizontal_fov>1.2</horizontal_fov><image><width>64</width><height>48</height></image>
  <clip><near>0.2</near><far>6</far></clip></camera>
  <plugin name="k" filename="libgazebo_ros_openni_kinect.so"><cameraName>kinect</cameraName>
  <depthImageTopicName>depth/raw</depthImageTopicName><frameName>eye_optical</frameName>
  <pointCloudCutoffMax>4.0</pointCloudCutoffMax></plugin></sensor>"""
COLOUR = """<sensor type="camera" name="eye"><plugin name="k" filename="libgazebo_ros_camera.so">
  <robotNamespace>/robot/</robotNamespace><updateRate>5.0</updateRate></plugin></sensor>"""


def cameras_of(text: str) -> tuple[list[Any], list[str]]:
    """The cameras of a robot, and what is wrong with the others."""
    sensors = read_robot_sensors(text, "r", str)
    return list(sensors.found), list(sensors.faults.values())


def test_a_kinect_of_a_urdf_publishes_under_the_names_of_its_plugin() -> None:
    (camera,), faults = cameras_of(urdf(KINECT))
    assert not faults
    names = ("image_raw", "camera_info", "depth/raw", "depth/camera_info", "points")
    assert camera.topics == CameraTopics(*(f"kinect/{name}" for name in names))
    assert (camera.parent, camera.frame_id, camera.rate_hz) == ("r::head", "eye_optical", 15.0)
    assert (camera.pinhole.width, camera.pinhole.far, camera.depth_range) == (64, 6.0, (0.4, 4.0))
    # the sensor looks along the x axis of its link, with z upwards
    assert camera.optical_in_parent.position == pytest.approx((0, 0, 0.5))
    assert rotate_vector(camera.optical_in_parent.quaternion, (0, 0, 1)) == pytest.approx((1, 0, 0), abs=1e-9)
    assert rotate_vector(camera.optical_in_parent.quaternion, (0, -1, 0)) == pytest.approx((0, 0, 1), abs=1e-9)


def test_a_camera_of_a_urdf_has_no_depth() -> None:
    (camera,), faults = cameras_of(urdf(COLOUR))
    assert not faults
    assert camera.topics == CameraTopics("robot/eye/image_raw", "robot/eye/camera_info")
    assert camera.rate_hz == 5.0


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (
            urdf(KINECT, "tail"),
            "robot_description:4: <sensor name='eye'>: <gazebo reference='tail'>: the robot has no such link",
        ),
        (urdf(KINECT.replace("openni_kinect", "prosilica")), "got the plugin 'libgazebo_ros_prosilica.so'; allowed"),
        (urdf(KINECT.replace("1.2", "wide")), "<camera/horizontal_fov>: got 'wide'; expected a number"),
        (urdf(KINECT.replace("0 0 0.5 0", "0 0 0.5")), "<pose>: got '0 0 0.5 0 0'; expected six numbers"),
        (urdf(KINECT.replace("<near>0.2", "<near>9")), "near: got 9 m; allowed: more than 0, less than 6"),
    ],
)
def test_a_fault_of_a_urdf_names_line_and_reason(text: str, found: str) -> None:
    cameras, faults = cameras_of(text)
    assert cameras == []
    assert len(faults) == 1
    assert found in faults[0]


def test_visuals_of_a_robot_have_their_material_and_what_is_missing_is_named() -> None:
    lines: list[str] = []

    def find_package(name: str) -> str:
        raise LookupError(name)

    visuals = read_robot_visuals(urdf(KINECT), find_package, lines.append)
    (box,) = visuals["head"]
    assert (box.colour, box.pose.position) == ((0.0, 0.0, 1.0, 1.0), (0.0, 0.0, 1.0))
    assert len(lines) == 1
    assert "a visual of link 'head' is not drawn" in lines[0]


def test_noise_of_a_camera_is_off_unless_its_section_has_a_deviation() -> None:
    (plain,), _ = read_cameras(changed(), "sensors", locate, seed=3)
    (noisy,), _ = read_cameras(changed(camera={"noise_stddev": 0.02}), "sensors", locate, seed=3)
    assert (plain.noise, noisy.noise, noisy.seed) == (NO_NOISE, Noise(stddev=0.02), 3)
