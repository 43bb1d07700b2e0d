# SPDX-License-Identifier: BSD-3-Clause
"""Reads the cameras of a `sensors_config.yaml` from parameters.

A section is a camera if it has `data_topics`, or if the topics at the top level of the file are in a namespace with the
name of its `frame_id`. The frame `frame_id` is the optical frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from modular_framework_simulation.models.poses import Pose, normalised_quaternion
from modular_framework_simulation.sensors.cameras import Camera, CameraTopics, Pinhole
from modular_framework_simulation.sensors.noise import Noise

FrameLocator = Callable[[str], str | None]
"""Function that returns the entity of a frame, "world" or "model::link"; None for an unknown frame."""

DEFAULT_RATE_HZ = 10.0

_TOP_LEVEL_TOPICS = {
    "rgb": "rgb_image_topic_name",
    "depth": "depth_image_topic_name",
    "points": "pointcloud_topic_name",
}
_SECTION_TOPICS = {"rgb": "rgb_topic", "depth": "depth_map_topic", "points": "pointcloud_topic"}
_CAMERA_KEYS = ("width", "height", "horizontal_fov", "near", "far", "rate", "noise_stddev")


class _Fault(ValueError):
    """A value of a section is invalid."""


def read_cameras(
    settings: Mapping[str, Any], location: str, locate: FrameLocator, seed: int = 0
) -> tuple[list[Camera], list[str]]:
    """Reads the cameras.

    Args:
        settings: Contents of the file.
        location: Location of the settings for messages.
        locate: Function that finds the entity of a frame.
        seed: Random seed of the simulation, for noise.

    Returns:
        The valid cameras, and one sentence per invalid camera.
    """
    cameras, faults = [], []
    for name, section in settings.items():
        if not isinstance(section, Mapping):
            continue
        try:
            topics = _topics(settings, section)
            if topics is not None:
                cameras.append(replace(_camera(name, section, topics, locate), seed=seed))
        except ValueError as error:
            faults.append(f"{location}/{name}/{error}; this camera is not simulated")
    return cameras, faults


def _camera(name: str, section: Mapping[str, Any], topics: CameraTopics, locate: FrameLocator) -> Camera:
    origin, pose = _placement(section)
    parent = locate(origin)
    if parent is None:
        raise _Fault(f"origin_frame_id: got '{origin}'; allowed: world, or a link of the simulated robot")
    given = _mapping(section, "camera")
    unknown = sorted(set(given) - set(_CAMERA_KEYS))
    if unknown:
        raise _Fault(f"camera: unknown key '{unknown[0]}'; allowed: {', '.join(_CAMERA_KEYS)}")
    values = {key: _number(given, key, "camera/") for key in given}
    rate, stddev = values.pop("rate", DEFAULT_RATE_HZ), values.pop("noise_stddev", 0.0)
    if stddev < 0.0:
        raise _Fault(f"camera/noise_stddev: got {stddev:g}; allowed: 0 or more")
    pinhole = Pinhole(int(values.pop("width", 640)), int(values.pop("height", 480)), **values)
    try:
        frame = _text(section, "frame_id")
        return Camera(
            name=name,
            frame_id=frame,
            parent=parent,
            optical_in_parent=pose,
            rate_hz=rate,
            topics=topics,
            pinhole=pinhole,
            noise=Noise(stddev=stddev),
        )
    except ValueError as error:
        raise _Fault(f"camera/{error}") from error


def _topics(settings: Mapping[str, Any], section: Mapping[str, Any]) -> CameraTopics | None:
    if "data_topics" in section:
        given = _mapping(section, "data_topics")
        names = {kind: _text(given, key) for kind, key in _SECTION_TOPICS.items() if key in given}
    else:
        namespace = str(section.get("frame_id", "")).strip("/")
        named = {kind: _text(settings, key) for kind, key in _TOP_LEVEL_TOPICS.items() if key in settings}
        names = {kind: topic for kind, topic in named.items() if topic.strip("/").startswith(f"{namespace}/")}
    if not any(names.values()):
        return None
    rgb, depth = names.get("rgb", ""), names.get("depth", "")
    return CameraTopics(rgb, _info_topic(rgb), depth, _info_topic(depth), names.get("points", ""))


def _info_topic(topic: str) -> str:
    """Returns the name of an image's camera_info, which is in the same namespace."""
    return f"{topic.rpartition('/')[0]}/camera_info" if topic else ""


def _placement(section: Mapping[str, Any]) -> tuple[str, Pose]:
    """Returns the reference frame of a sensor's pose, and the pose."""
    if "initial_pose" not in section:
        x, y, z, roll, pitch, yaw = (
            _number(section, f"frame_{key}") for key in ("x", "y", "z", "roll", "pitch", "yaw")
        )
        return _text(section, "origin_frame_id").strip("/"), Pose.from_xyz_rpy((x, y, z), (roll, pitch, yaw))
    if not isinstance(section["initial_pose"], Mapping):
        raise _Fault(
            f"initial_pose: got '{section['initial_pose']}'; expected reference_frame, position and orientation, "
            "because the simulation does not know named poses"
        )
    pose = _mapping(section, "initial_pose")
    position, orientation = _mapping(pose, "position"), _mapping(pose, "orientation")
    x, y, z = (_number(position, key, "initial_pose/position/") for key in "xyz")
    location = "initial_pose/orientation/"
    frame = _text(pose, "reference_frame").strip("/")
    if "w" in orientation:
        a, b, c, w = (_number(orientation, key, location) for key in "xyzw")
        return frame, Pose((x, y, z), normalised_quaternion((a, b, c, w)))
    roll, pitch, yaw = (_number(orientation, key, location) for key in "rpy")
    return frame, Pose.from_xyz_rpy((x, y, z), (roll, pitch, yaw))


def _mapping(section: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = section.get(key, {})
    if not isinstance(value, Mapping):
        raise _Fault(f"{key}: got {value!r}; expected a mapping of keys to values")
    return value


def _text(section: Mapping[str, Any], key: str) -> str:
    value = section.get(key)
    if not isinstance(value, str) or not value:
        raise _Fault(f"{key}: got {value!r}; expected a name")
    return value


def _number(section: Mapping[str, Any], key: str, location: str = "") -> float:
    value = section.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise _Fault(f"{location}{key}: got {value!r}; expected a number")
    return float(value)
