# SPDX-License-Identifier: BSD-3-Clause
"""Tests whether a collision object lies within a box."""

from __future__ import annotations

from dataclasses import dataclass

from geometry_msgs.msg import Point, Pose
from moveit_msgs.msg import CollisionObject
from scipy.spatial.transform import Rotation

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Region:
    """A closed box aligned with the axes of a frame [m]."""

    low: Vector
    high: Vector

    def contains(self, point: Vector) -> bool:
        """Returns whether a point is within the box."""
        return all(low <= value <= high for low, value, high in zip(self.low, point, self.high, strict=True))


def inside(collision_object: CollisionObject, region: Region) -> bool:
    """Returns whether all shape origins of an object, or its own origin without shapes, lie in the region."""
    shapes = [*collision_object.primitive_poses, *collision_object.mesh_poses, *collision_object.plane_poses]
    points = [transform_point(collision_object.pose, pose.position) for pose in shapes]
    origin = collision_object.pose.position
    return all(region.contains(point) for point in points or [(origin.x, origin.y, origin.z)])


def transform_point(pose: Pose, point: Point) -> Vector:
    """Transforms a point from the frame of a pose to the parent frame of the pose."""
    orientation = pose.orientation
    quaternion = [orientation.x, orientation.y, orientation.z, orientation.w]
    rotation = Rotation.from_quat(quaternion if any(quaternion) else [0.0, 0.0, 0.0, 1.0])
    x, y, z = rotation.apply([point.x, point.y, point.z]) + [pose.position.x, pose.position.y, pose.position.z]
    return float(x), float(y), float(z)
