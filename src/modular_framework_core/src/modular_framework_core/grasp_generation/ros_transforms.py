# SPDX-License-Identifier: BSD-3-Clause
"""Receives TF and discards old transforms when the clock jumps back, as after a reset of the world."""

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
"""Backward jump of transform stamps that indicates a reset of the clock."""
LATE_TRANSFORM_S = 0.1
"""Maximum age of the latest transform relative to the requested time."""


class Transforms:
    """The transforms of TF as matrices.

    Subscribers: ``/tf``, ``/tf_static`` (tf2_msgs/TFMessage).
    """

    def __init__(self) -> None:
        """Creates the buffer without subscriptions; :meth:`connect` subscribes to TF."""
        self._buffer: Any = None
        self._latest = rospy.Time()

    def connect(self) -> None:
        """Subscribes to TF."""
        self._buffer = tf2_ros.Buffer(debug=False)
        self._subscribers = [
            rospy.Subscriber("/tf", TFMessage, self._on_transforms, queue_size=100),
            rospy.Subscriber("/tf_static", TFMessage, self._on_static_transforms, queue_size=100),
        ]

    @property
    def frames(self) -> list[str]:
        """Names of the frames that have a parent."""
        return sorted(yaml.safe_load(self._buffer.all_frames_as_yaml()) or [])

    def stamps(self, frame: str, sources: Sequence[str], stamp: rospy.Time, timeout_s: float) -> dict[str, rospy.Time]:
        """Returns the time at which each source frame has a transform: the requested time, or slightly earlier.

        While time is held, joints with a low publication rate have no transform at the current time.

        Args:
            frame: Target frame.
            sources: Source frames; frames without a transform near this time are omitted.
            stamp: Requested time.
            timeout_s: Maximum wait for transforms at this time [s of real time].
        """
        known_sources = [source for source in sources if self._is_known(frame, source, rospy.Time(0))] or list(sources)
        wait_until(lambda: all(self._is_known(frame, source, stamp) for source in known_sources), timeout_s)
        stamp_of_source = {}
        for source in sources:
            if self._is_known(frame, source, stamp):
                stamp_of_source[source] = stamp
            elif self._is_known(frame, source, rospy.Time(0)):
                latest = self._buffer.get_latest_common_time(frame, source)
                if abs((stamp - latest).to_sec()) <= LATE_TRANSFORM_S:
                    stamp_of_source[source] = latest
        return stamp_of_source

    def matrix(self, frame: str, source: str, stamp: rospy.Time) -> Array:
        """Returns a transform, shape (4, 4).

        Args:
            frame: Target frame.
            source: Source frame.
            stamp: Time returned by :meth:`stamps`.
        """
        transform = self._buffer.lookup_transform_core(frame, source, stamp).transform
        matrix = np.eye(4)
        rotation, translation = transform.rotation, transform.translation
        matrix[:3, :3] = Rotation.from_quat([rotation.x, rotation.y, rotation.z, rotation.w]).as_matrix()
        matrix[:3, 3] = translation.x, translation.y, translation.z
        return matrix

    def _is_known(self, frame: str, source: str, stamp: rospy.Time) -> bool:
        return bool(self._buffer.can_transform_core(frame, source, stamp)[0])

    def _on_transforms(self, message: TFMessage) -> None:
        for transform in message.transforms:
            if (self._latest - transform.header.stamp).to_sec() > CLOCK_JUMP_S:
                self._buffer.clear()  # keeps static transforms
            self._latest = transform.header.stamp
            self._buffer.set_transform(transform, "tf")

    def _on_static_transforms(self, message: TFMessage) -> None:
        for transform in message.transforms:
            self._buffer.set_transform_static(transform, "tf_static")
