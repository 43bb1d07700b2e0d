# SPDX-License-Identifier: BSD-3-Clause
"""Publisher of tf frames for the objects in the planning scene."""

from __future__ import annotations

from typing import Any

import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped

from modular_framework_planning.geometry.spatial import Transform
from modular_framework_planning.messages.poses import pose_message
from modular_framework_planning.move_group.capabilities.capability import MoveGroupCapability
from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.move_group.node_parameters import parameter


class TfPublisher(MoveGroupCapability):
    """Broadcasts a frame for each world object, attached object and subframe ("object/subframe").

    Parameters: ~planning_scene_frame_publishing_rate (10) [Hz], ~planning_scene_tf_prefix ("").
    """

    def __init__(self, context: MoveGroupContext) -> None:
        super().__init__(context)
        self._rate_hz = parameter("~planning_scene_frame_publishing_rate")
        self._prefix = parameter("~planning_scene_tf_prefix").rstrip("/")

    def connect(self) -> None:
        """Starts broadcasting."""
        self._broadcaster = tf2_ros.TransformBroadcaster()
        self._timer = rospy.Timer(rospy.Duration(1.0 / self._rate_hz), self._publish)

    def _publish(self, _: Any) -> None:
        scene = self._context.monitor.snapshot()
        frames = []
        bodies = [(body, scene.model.planning_frame) for body in scene.objects.values()]
        bodies += [(held.body, held.link) for held in scene.attached.values()]
        for body, parent in bodies:
            frames.append(self._frame(parent, body.name, body.pose))
            frames += [
                self._frame(parent, f"{body.name}/{name}", body.pose * pose) for name, pose in body.subframes.items()
            ]
        if frames:
            self._broadcaster.sendTransform(frames)

    def _frame(self, parent: str, name: str, pose: Transform) -> TransformStamped:
        message = TransformStamped(child_frame_id=f"{self._prefix}/{name}" if self._prefix else name)
        message.header.frame_id, message.header.stamp = parent, rospy.Time.now()
        written = pose_message(pose)
        t = message.transform.translation
        t.x, t.y, t.z = written.position.x, written.position.y, written.position.z
        message.transform.rotation = written.orientation
        return message
