# SPDX-License-Identifier: BSD-3-Clause
"""Listens to TF, also when the clock goes back: a world that begins again does not mix with the one before."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import rospy
import tf2_ros
import yaml
from scipy.spatial.transform import Rotation
from tf2_msgs.msg import TFMessage

from modular_framework_ros.calls import wait_until

Array = npt.NDArray[np.float64]

CLOCK_JUMP_S = 1.0
"""A transform that is so much older than the one before it is from after the clock went back."""
LATE_TRANSFORM_S = 0.1
"""A transform that is so much older than what is asked for will do, if there is no newer one."""


class Transforms:
    """The transforms of TF as matrices.

    Subscribers: ``/tf``, ``/tf_static`` (tf2_msgs/TFMessage).
    """

    def __init__(self) -> None:
        """Listens to nothing yet, see :meth:`connect`."""
        self._buffer: Any = None
        self._latest = rospy.Time()

    def connect(self) -> None:
        """Starts to listen."""
        self._buffer = tf2_ros.Buffer(debug=False)
        self._subscribers = [
            rospy.Subscriber("/tf", TFMessage, self._hear, queue_size=100),
            rospy.Subscriber("/tf_static", TFMessage, self._hear_static, queue_size=100),
        ]

    @property
    def frames(self) -> list[str]:
        """Names of the frames that have a parent."""
        return sorted(yaml.safe_load(self._buffer.all_frames_as_yaml()) or [])

    def stamps(self, frame: str, others: Sequence[str], stamp: rospy.Time, timeout_s: float) -> dict[str, rospy.Time]:
        """Returns when the transform from each of other frames to a frame is known: at a time, or a little before.

        Where time stands still, a joint that is published now and then has no transform of now.

        Args:
            frame: Where the transforms lead.
            others: Where they begin; one of which nothing is known near that time is left out.
            stamp: The time.
            timeout_s: Longest wait for transforms of that very time [s of real time].
        """
        known = [other for other in others if self._can(frame, other, rospy.Time(0))] or list(others)
        wait_until(lambda: all(self._can(frame, other, stamp) for other in known), timeout_s)
        found = {}
        for other in others:
            if self._can(frame, other, stamp):
                found[other] = stamp
            elif self._can(frame, other, rospy.Time(0)):
                latest = self._buffer.get_latest_common_time(frame, other)
                if abs((stamp - latest).to_sec()) <= LATE_TRANSFORM_S:
                    found[other] = latest
        return found

    def matrix(self, frame: str, other: str, stamp: rospy.Time) -> Array:
        """Returns the transform (4, 4) from another frame to a frame at a time that :meth:`stamps` returned."""
        found = self._buffer.lookup_transform_core(frame, other, stamp).transform
        matrix = np.eye(4)
        turn, at = found.rotation, found.translation
        matrix[:3, :3] = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
        matrix[:3, 3] = at.x, at.y, at.z
        return matrix

    def _can(self, frame: str, other: str, stamp: rospy.Time) -> bool:
        return bool(self._buffer.can_transform_core(frame, other, stamp)[0])

    def _hear(self, message: TFMessage) -> None:
        for transform in message.transforms:
            if (self._latest - transform.header.stamp).to_sec() > CLOCK_JUMP_S:
                self._buffer.clear()  # leaves static transforms as they are
            self._latest = transform.header.stamp
            self._buffer.set_transform(transform, "tf")

    def _hear_static(self, message: TFMessage) -> None:
        for transform in message.transforms:
            self._buffer.set_transform_static(transform, "tf_static")
