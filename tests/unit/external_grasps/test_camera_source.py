# SPDX-License-Identifier: BSD-3-Clause
"""Images, camera matrix and camera pose with the same stamp become the camera view of a method."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rospy
from sensor_msgs.msg import CameraInfo

from external_grasps import ros_camera_source
from external_grasps.ros_camera_source import CameraSource
from modular_framework_core.grasp_generation import ros_fresh_messages
from modular_framework_core.grasp_generation.grasp_candidates import NoCandidatesError

sys.path.insert(0, str(Path(__file__).parents[1]))
from depth_camera import AXES, EYE, Box, image, in_world  # noqa: E402

NOW_S, TIMEOUT_S = 2.0, 0.2
COLUMNS, ROWS = 64, 48
SEEN = image([Box((0.4, 0.4, 0.1), (0.0, 0.5, 0.89))], COLUMNS, ROWS)


class TransformsFake:
    """Knows the pose of the camera at NOW_S."""

    frames: Sequence[str] = ("camera",)

    def stamps(self, _frame: str, others: Sequence[str], stamp: rospy.Time, _timeout_s: float) -> dict[str, rospy.Time]:
        return dict.fromkeys(others, stamp) if stamp.to_sec() == NOW_S else {}

    def matrix(self, *_: Any) -> np.ndarray:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = AXES, EYE
        return pose


class TimeFake:
    """Time that is never held."""

    def now(self) -> None:
        return None


class CameraFake:
    """Publishes a message with each stamp as soon as a subscriber exists.

    Attributes:
        stamps_s: Stamps of the messages [s], keyed by the last part of the topic.
        encoding: Encoding of the colour image.
    """

    stamps_s: dict[str, Sequence[float]]
    encoding = "rgb8"

    def __init__(self, topic: str, kind: type, callback: Any, **_options: Any) -> None:
        self.resolved_name = f"/{topic}"
        part = topic.rpartition("/")[2]
        for stamp_s in self.stamps_s[part]:
            message = kind(width=COLUMNS, height=ROWS)
            message.header.stamp, message.header.frame_id = rospy.Time.from_sec(stamp_s), "camera"
            if kind is CameraInfo:
                focal = COLUMNS / (2 * math.tan(math.pi / 6))
                message.K = [focal, 0.0, (COLUMNS - 1) / 2, 0.0, focal, (ROWS - 1) / 2, 0.0, 0.0, 1.0]
            elif part == "depth":
                message.encoding, message.step = "32FC1", 4 * COLUMNS
                message.data = SEEN[..., 2].astype("<f4").tobytes()
            else:
                message.encoding, message.step = self.encoding, 3 * COLUMNS
                message.data = bytes([1, 2, 3]) * (COLUMNS * ROWS)
            callback(message)

    def get_num_connections(self) -> int:
        return 1

    def unregister(self) -> None: ...


@pytest.fixture
def source(monkeypatch: pytest.MonkeyPatch) -> CameraSource:
    """A camera source with fakes of camera, transforms and time."""
    topics = {"depth_image_topic_name": "camera/depth", "rgb_image_topic_name": "camera/colour"}
    monkeypatch.setattr(ros_camera_source, "Transforms", TransformsFake)
    monkeypatch.setattr(ros_fresh_messages, "SimulatedTime", TimeFake)
    monkeypatch.setattr(ros_fresh_messages, "MAX_REAL_WAIT_S", TIMEOUT_S)
    monkeypatch.setattr(rospy, "Subscriber", CameraFake)
    monkeypatch.setattr(rospy, "get_param", topics.get)
    monkeypatch.setattr(rospy, "get_time", lambda: NOW_S)
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time.from_sec(NOW_S))
    every = dict.fromkeys(("depth", "colour", "camera_info"), (NOW_S,))
    monkeypatch.setattr(CameraFake, "stamps_s", every, raising=False)
    return CameraSource()


def test_the_points_of_a_view_are_those_that_the_camera_sees(source: CameraSource) -> None:
    view = source.take("world", TIMEOUT_S)
    assert view.colour.shape == (ROWS, COLUMNS, 3)
    assert view.colour[0, 0].tolist() == [1, 2, 3]
    assert view.points() == pytest.approx(in_world(SEEN), abs=1e-6, nan_ok=True)
    top = view.points()[np.isfinite(view.depth)]
    assert top[:, 2].max() == pytest.approx(0.94, abs=1e-6)


def test_images_of_different_instants_are_not_combined(source: CameraSource, monkeypatch: pytest.MonkeyPatch) -> None:
    stamps = {"depth": (1.9, NOW_S, 2.1), "colour": (1.9, 2.05), "camera_info": (1.9, NOW_S, 2.05, 2.1)}
    monkeypatch.setattr(CameraFake, "stamps_s", stamps)
    with pytest.raises(NoCandidatesError, match="no message arrived on topic '/camera/colour' from 1 publisher"):
        source.take("world", TIMEOUT_S)


def test_an_image_without_colours_is_refused(source: CameraSource, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(CameraFake, "encoding", "mono16")
    with pytest.raises(NoCandidatesError, match="'mono16'; allowed for colours"):
        source.take("world", TIMEOUT_S)


def test_a_camera_without_a_transform_is_named(source: CameraSource, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(CameraFake, "stamps_s", dict.fromkeys(("depth", "colour", "camera_info"), (NOW_S + 0.5,)))
    with pytest.raises(NoCandidatesError, match="in frame 'camera', which has no transform to 'world'"):
        source.take("world", TIMEOUT_S)
