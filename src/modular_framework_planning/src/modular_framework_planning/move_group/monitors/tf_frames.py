# SPDX-License-Identifier: BSD-3-Clause
"""Frames outside the robot that only tf knows, such as camera or map, for use in requests."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import rospy
import tf2_ros

from modular_framework_planning.errors import PlanningError
from modular_framework_planning.geometry.spatial import Transform, make_transform
from modular_framework_planning.robot_model.robot_model import RobotModel

SAME = 1.0e-9  # [m and rotation matrix entries]; smaller motions are ignored


class TfFrames:
    """Thread-safe listener to tf that remembers the last transform of each frame."""

    def __init__(self, model: RobotModel) -> None:
        self._model = model
        self._buffer: Any = None
        self._known: dict[str, Transform] = {}

    def connect(self) -> None:
        """Starts listening to tf."""
        buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(buffer)
        self._buffer = buffer

    def now(self) -> Mapping[str, Transform]:
        """Returns the frames' poses in the planning frame; an unmoved frame keeps its transform object."""
        if self._buffer is None:
            return self._known
        names = set(self._buffer._getFrameStrings())  # tf2's Python interface has no public list of frames
        model, known = self._model, self._known
        fresh = {}
        for name in names - model.frame_ids.keys() - {model.planning_frame}:
            transform, old = self._lookup(model.planning_frame, name), known.get(name)
            if transform is not None:
                fresh[name] = old if old is not None and old.isApprox(transform, SAME) else transform
        if any(known.get(name) is not transform for name, transform in fresh.items()):
            self._known = known = {**known, **fresh}
        return known

    def base(self) -> Transform | None:
        """Returns the last tf pose of the root link below a planar or floating virtual joint, or None."""
        joint = self._model.base
        if self._buffer is None or joint is None:
            return None
        return self._lookup(joint.parent_frame, joint.child_link)

    def _lookup(self, base: str, name: str) -> Transform | None:
        """Returns the last known transform of a frame, or None if the frames are not connected."""
        try:
            transform = self._buffer.lookup_transform_core(base, name, rospy.Time(0)).transform
            t, q = transform.translation, transform.rotation
            return make_transform((t.x, t.y, t.z), (q.x, q.y, q.z, q.w), f"transform of '{name}'")
        except (tf2_ros.TransformException, PlanningError):
            return None
