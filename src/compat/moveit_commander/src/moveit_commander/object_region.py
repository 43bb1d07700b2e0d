# SPDX-License-Identifier: BSD-3-Clause
"""Tells whether a collision object lies within a box."""
from __future__ import annotations

from dataclasses import dataclass

from geometry_msgs.msg import Point, Pose
from moveit_msgs.msg import CollisionObject

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Region:
    """A box along the axes of a frame, bounds included [m]."""

    low: Vector
    high: Vector

    def holds(self, point: Vector) -> bool:
        return all(low <= value <= high for low, value, high in zip(self.low, point, self.high, strict=True))


def inside(item: CollisionObject, region: Region) -> bool:
    """Whether the origin of every shape of an object is in the region; an object without shapes goes by its pose."""
    shapes = [*item.primitive_poses, *item.mesh_poses, *item.plane_poses]
    points = [placed(item.pose, pose.position) for pose in shapes]
    at = item.pose.position
    return all(region.holds(point) for point in points or [(at.x, at.y, at.z)])


def placed(pose: Pose, point: Point) -> Vector:
    """The point in the frame the pose is given in."""
    turn, at = pose.orientation, pose.position
    x, y, z, w = turn.x, turn.y, turn.z, turn.w
    if not any((x, y, z, w)):
        w = 1.0
    # v' = v + 2 w (u x v) + 2 u x (u x v), with the quaternion's vector part u
    cross = (y * point.z - z * point.y, z * point.x - x * point.z, x * point.y - y * point.x)
    twice = (y * cross[2] - z * cross[1], z * cross[0] - x * cross[2], x * cross[1] - y * cross[0])
    moved = [value + 2.0 * (w * first + second)
             for value, first, second in zip((point.x, point.y, point.z), cross, twice, strict=True)]
    return at.x + moved[0], at.y + moved[1], at.z + moved[2]
