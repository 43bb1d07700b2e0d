# SPDX-License-Identifier: BSD-3-Clause
"""Deserialises trajectories into arrays (`TrajectoryPoints`) instead of one object per point.

The wire format equals the format of the public messages; only subscribers use these classes.
"""

from __future__ import annotations

import struct
from typing import Any

import genpy
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryActionGoal
from trajectory_msgs.msg import JointTrajectory

from modular_framework_control.trajectory.joint_trajectory import TrajectoryPoints
from modular_framework_control.trajectory.serialized_points import Buffer, read_points

_U32 = struct.Struct("<I")
_HEADER_BYTES = 12  # seq and stamp, before frame_id
_STAMP_BYTES = 8  # stamp of a goal_id, before its id


class CompactJointTrajectory(JointTrajectory):  # type: ignore[misc]
    """A trajectory_msgs/JointTrajectory whose deserialised `points` are arrays."""

    def deserialize(self, str: Buffer) -> CompactJointTrajectory:  # noqa: A002 (genpy's name)
        """Reads the message from its bytes."""
        points, rest = _without_points(str, 0)
        super().deserialize(rest)
        self.points = points
        return self


class CompactTrajectoryActionGoal(FollowJointTrajectoryActionGoal):  # type: ignore[misc]
    """A control_msgs/FollowJointTrajectoryActionGoal whose deserialised trajectory points are arrays."""

    def deserialize(self, str: Buffer) -> CompactTrajectoryActionGoal:  # noqa: A002 (genpy's name)
        """Reads the message from its bytes."""
        points, rest = _without_points(str, 2)
        super().deserialize(rest)
        self.goal.trajectory.points = points
        return self


class CompactFollowJointTrajectoryAction(FollowJointTrajectoryAction):  # type: ignore[misc]
    """The FollowJointTrajectory action for a server that receives compact goals."""

    def __init__(self, *arguments: Any, **fields: Any) -> None:
        super().__init__(*arguments, **fields)
        self.action_goal = CompactTrajectoryActionGoal()


def _without_points(data: Buffer, goal_fields: int) -> tuple[TrajectoryPoints, bytes]:
    """Returns the points of a serialised trajectory message, and the message without the points.

    Args:
        data: Serialised message.
        goal_fields: 2 if the header and the goal_id of an action goal precede the trajectory, otherwise 0.

    Raises:
        genpy.DeserializationError: If the message is truncated.
    """
    try:
        begin = 0
        for fixed_bytes in (_HEADER_BYTES, _STAMP_BYTES)[:goal_fields]:
            begin = _string_end(data, begin + fixed_bytes)
        begin = _string_end(data, begin + _HEADER_BYTES)
        (joints,) = _U32.unpack_from(data, begin)
        begin += 4
        for _ in range(joints):
            begin = _string_end(data, begin)
        points, end = read_points(data, begin, joints)
    except struct.error as error:
        raise genpy.DeserializationError(error) from error
    return points, bytes(data[:begin]) + _U32.pack(0) + bytes(data[end:])


def _string_end(data: Buffer, offset: int) -> int:
    (length,) = _U32.unpack_from(data, offset)
    return offset + 4 + int(length)
