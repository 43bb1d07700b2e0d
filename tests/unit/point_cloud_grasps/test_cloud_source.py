# SPDX-License-Identifier: BSD-3-Clause
"""A cloud shows the world of now: where time is held, none of the world before it began again is taken."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import rospy
from sensor_msgs.msg import PointCloud2, PointField

from modular_framework_core.grasp_generation import ros_fresh_messages
from modular_framework_core.grasp_generation.grasp_candidates import NoCandidatesError
from point_cloud_grasps import ros_cloud_source
from point_cloud_grasps.ros_cloud_source import CloudSource

NOW_S, OLD_S = 0.51, 6.5
TIMEOUT_S = 0.2


def cloud(stamp_s: float) -> PointCloud2:
    """A cloud of one point, whose x is its stamp."""
    message = PointCloud2(height=1, width=1, point_step=12, row_step=12)
    message.header.stamp, message.header.frame_id = rospy.Time.from_sec(stamp_s), "camera"
    message.fields = [PointField(axis, 4 * place, PointField.FLOAT32, 1) for place, axis in enumerate("xyz")]
    message.data = np.array([stamp_s, 0.0, 1.0], np.float32).tobytes()
    return message


class TransformsFake:
    """Knows that every frame is the planning frame."""

    frames: Sequence[str] = ()

    def stamps(self, _frame: str, others: Sequence[str], stamp: rospy.Time, _timeout_s: float) -> dict[str, rospy.Time]:
        return dict.fromkeys(others, stamp)

    def matrix(self, *_: Any) -> np.ndarray:
        return np.eye(4)


class TimeFake:
    """Holds time at NOW_S, or not."""

    held = True

    @property
    def enabled(self) -> bool:
        return self.held

    def now(self) -> rospy.Time | None:
        return rospy.Time.from_sec(NOW_S) if self.held else None


class CameraFake:
    """Publishes clouds as soon as somebody subscribes."""

    stamps_s: Sequence[float] = ()
    resolved_name = "/points"

    def __init__(self, _topic: str, _kind: Any, callback: Any, **_options: Any) -> None:
        for stamp_s in self.stamps_s:
            callback(cloud(stamp_s))

    def get_num_connections(self) -> int:
        return 1

    def unregister(self) -> None: ...


@pytest.fixture
def source(monkeypatch: pytest.MonkeyPatch) -> CloudSource:
    """A source whose camera, transforms and time are fakes."""
    monkeypatch.setattr(ros_cloud_source, "Transforms", TransformsFake)
    monkeypatch.setattr(ros_fresh_messages, "SimulatedTime", TimeFake)
    monkeypatch.setattr(rospy, "Subscriber", CameraFake)
    monkeypatch.setattr(rospy, "resolve_name", lambda name: name)
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time.from_sec(NOW_S))
    monkeypatch.setattr(ros_fresh_messages, "MAX_REAL_WAIT_S", 5.0)
    return CloudSource()


@pytest.mark.parametrize("stamps_s", [(OLD_S, NOW_S), (0.3, NOW_S, OLD_S), (NOW_S,)])
def test_with_held_time_the_cloud_of_that_very_time_is_taken(
    source: CloudSource, monkeypatch: pytest.MonkeyPatch, stamps_s: Sequence[float]
) -> None:
    monkeypatch.setattr(CameraFake, "stamps_s", stamps_s)
    assert source.take("/points", "world", TIMEOUT_S).points[0, 0] == pytest.approx(NOW_S)


def test_without_a_hold_the_first_cloud_that_is_not_older_than_the_request_is_taken(
    source: CloudSource, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(TimeFake, "held", False)
    monkeypatch.setattr(CameraFake, "stamps_s", (0.3, 0.6, 0.7))
    assert source.take("/points", "world", TIMEOUT_S).points[0, 0] == pytest.approx(0.6)


def test_the_limit_counts_the_time_of_the_simulation_and_not_that_of_a_busy_machine(
    source: CloudSource, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(TimeFake, "held", False)
    calls: list[float] = []

    def slow_clock() -> float:
        calls.append(NOW_S + 0.01 * len(calls))  # 10 ms of simulated time for each look
        return calls[-1]

    monkeypatch.setattr(rospy, "get_time", slow_clock)
    with pytest.raises(NoCandidatesError, match="no point cloud arrived on topic '/points' within 0.2 s"):
        source.take("/points", "world", TIMEOUT_S)
    assert calls[-1] - calls[0] > TIMEOUT_S
