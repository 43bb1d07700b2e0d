# SPDX-License-Identifier: BSD-3-Clause
"""Converts messages to lists of numbers or bytes, and back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from io import BytesIO
from typing import Any

import rospy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Transform, Vector3

from modular_framework_urdf import rotations
from modular_framework_urdf.rotations import quaternion_from_rpy
from moveit_commander.exception import MoveItCommanderException


def msg_to_string(msg: Any) -> bytes:
    """Returns the serialized message."""
    buffer = BytesIO()
    msg.serialize(buffer)
    return buffer.getvalue()


def msg_from_string(msg: Any, data: bytes) -> None:
    """Fills a message from its serialized form."""
    msg.deserialize(data)


def rpy_from_quaternion(quaternion: Sequence[float]) -> list[float]:
    """Returns the rotations about the fixed axes x, y, z [rad] of a quaternion (xyzw); the yaw is 0 at pitch +-pi/2."""
    if not math.hypot(*quaternion) >= 1e-9:  # also refuses NaN
        raise MoveItCommanderException(f"quaternion {list(quaternion)} has zero length; a unit quaternion is needed")
    return list(rotations.rpy_from_quaternion(quaternion))


def pose_to_list(pose_msg: Pose) -> list[float]:
    """Returns [x, y, z, qx, qy, qz, qw] of a pose [m]."""
    position, turn = pose_msg.position, pose_msg.orientation
    return [position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w]


def list_to_pose(pose_list: Sequence[float]) -> Pose:
    """Returns a pose from [x, y, z, roll, pitch, yaw] or [x, y, z, qx, qy, qz, qw] [m, rad]."""
    values = [float(value) for value in pose_list]
    if len(values) == 6:
        values = [*values[:3], *quaternion_from_rpy(*values[3:])]
    elif len(values) != 7:
        raise MoveItCommanderException(
            f"a pose list has {len(values)} numbers; 6 (x, y, z, roll, pitch, yaw) or "
            "7 (x, y, z, qx, qy, qz, qw) are needed"
        )
    return Pose(Point(*values[:3]), Quaternion(*values[3:]))


def list_to_pose_stamped(pose_list: Sequence[float], target_frame: str) -> PoseStamped:
    """Returns a pose as in list_to_pose, in a frame and stamped with the current time."""
    message = PoseStamped(pose=list_to_pose(pose_list))
    message.header.frame_id = target_frame
    message.header.stamp = rospy.Time.now()
    return message


def transform_to_list(trf_msg: Transform) -> list[float]:
    """Returns [x, y, z, qx, qy, qz, qw] of a transform [m]."""
    shift, turn = trf_msg.translation, trf_msg.rotation
    return [shift.x, shift.y, shift.z, turn.x, turn.y, turn.z, turn.w]


def list_to_transform(trf_list: Sequence[float]) -> Transform:
    """Returns a transform from [x, y, z, qx, qy, qz, qw] [m]."""
    if len(trf_list) != 7:
        raise MoveItCommanderException(
            f"a transform list has {len(trf_list)} numbers; 7 (x, y, z, qx, qy, qz, qw) are needed"
        )
    values = [float(value) for value in trf_list]
    return Transform(Vector3(*values[:3]), Quaternion(*values[3:]))
