# SPDX-License-Identifier: BSD-3-Clause
"""Tracks the pose of a robot's root link in the fixed frame."""

from __future__ import annotations

from typing import Any

import rospy
import tf2_ros

from modular_framework_simulation.models.poses import Pose, normalised_quaternion


class BasePose:
    """Listens to transforms if the fixed frame is not the robot's root link.

    Args:
        fixed_frame: Name of the frame that is drawn at the origin.
    """

    def __init__(self, fixed_frame: str) -> None:
        self._fixed_frame = fixed_frame
        self._buffer: Any = None
        self._listener: Any = None
        self._last = Pose()

    def find(self, root: str) -> Pose:
        """Returns the pose of a root link in the fixed frame; without a transform, the last known pose."""
        if root == self._fixed_frame:
            return Pose()
        if self._listener is None:
            self._buffer = tf2_ros.Buffer(debug=False)
            self._listener = tf2_ros.TransformListener(self._buffer)
        try:
            transform = self._buffer.lookup_transform(self._fixed_frame, root, rospy.Time(0)).transform
        except tf2_ros.TransformException:
            return self._last
        p, q = transform.translation, transform.rotation
        self._last = Pose((p.x, p.y, p.z), normalised_quaternion((q.x, q.y, q.z, q.w)))
        return self._last

    def close(self) -> None:
        """Stops listening; may be called twice."""
        if self._listener is not None:
            self._listener.unregister()
            self._listener = self._buffer = None
