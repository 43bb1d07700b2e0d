# SPDX-License-Identifier: BSD-3-Clause
"""Conversion of poses between messages and transforms."""

from __future__ import annotations

from geometry_msgs.msg import Pose, PoseStamped

from modular_framework_planning.geometry.spatial import Transform, make_transform, pose_of
from modular_framework_planning.planning_scene.planning_scene import PlanningScene


def transform_from_pose(pose: Pose, field_name: str) -> Transform:
    """Reads a pose; raises GeometryError."""
    p, q = pose.position, pose.orientation
    return make_transform((p.x, p.y, p.z), (q.x, q.y, q.z, q.w), field_name)


def pose_message(transform: Transform) -> Pose:
    """Returns a pose as a message."""
    position, quaternion = pose_of(transform)
    pose = Pose()
    pose.position.x, pose.position.y, pose.position.z = (float(v) for v in position)
    pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = (float(v) for v in quaternion)
    return pose


def stamped_in_scene(scene: PlanningScene, stamped: PoseStamped, field_name: str) -> Transform:
    """Returns a stamped pose in the planning frame.

    Args:
        scene: Scene with the poses of frames.
        stamped: Pose message.
        field_name: Name of the message field, for error messages.

    Raises:
        PlanningError: The frame is unknown, or the pose is invalid.
    """
    return scene.frame_transform(stamped.header.frame_id) * transform_from_pose(stamped.pose, field_name)
