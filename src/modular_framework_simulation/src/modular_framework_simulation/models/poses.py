# SPDX-License-Identifier: BSD-3-Clause
"""Rigid transforms of the simulated world, fast enough for thousands of compositions per second."""

from __future__ import annotations

import math
from dataclasses import dataclass

from modular_framework_urdf.rotations import (
    Quaternion,
    Vector3,
    multiply_quaternions,
    quaternion_from_rpy,
    rotate_vector,
)

_IDENTITY_ROTATION: Quaternion = (0.0, 0.0, 0.0, 1.0)
_ORIGIN: Vector3 = (0.0, 0.0, 0.0)


def normalised_quaternion(quaternion: Quaternion) -> Quaternion:
    """Returns the normalised quaternion; the identity for all zeros, as in an unset message.

    Raises:
        ValueError: An element is not finite, or the length is neither 0 nor within 10 % of 1.
    """
    norm = math.sqrt(sum(value * value for value in quaternion))
    if norm == 0.0:
        return _IDENTITY_ROTATION
    if not math.isfinite(norm) or not 0.9 < norm < 1.1:
        raise ValueError(f"quaternion {list(quaternion)} has length {norm:.4g}; expected 1")
    x, y, z, w = quaternion
    return (x / norm, y / norm, z / norm, w / norm)


@dataclass(frozen=True, slots=True)
class Pose:
    """Rigid transform: the pose of a child frame in its parent frame.

    Attributes:
        position: Origin of the child frame in the parent frame, x, y, z [m].
        quaternion: Orientation of the child frame, unit quaternion xyzw.
    """

    position: Vector3 = _ORIGIN
    quaternion: Quaternion = _IDENTITY_ROTATION

    @staticmethod
    def from_xyz_rpy(xyz: Vector3, rpy: Vector3) -> Pose:
        """Returns the pose with a position [m] and roll, pitch, yaw [rad]."""
        return Pose(xyz, quaternion_from_rpy(*rpy))

    def __matmul__(self, other: Pose) -> Pose:
        """Returns the pose of the child frame of `other` in the parent frame of this pose."""
        x, y, z = rotate_vector(self.quaternion, other.position)
        px, py, pz = self.position
        return Pose((px + x, py + y, pz + z), multiply_quaternions(self.quaternion, other.quaternion))

    def inverse(self) -> Pose:
        """Returns the pose of the parent frame in the child frame."""
        x, y, z, w = self.quaternion
        conjugate = (-x, -y, -z, w)
        px, py, pz = rotate_vector(conjugate, self.position)
        return Pose((-px, -py, -pz), conjugate)

    def distance_to(self, other: Pose) -> tuple[float, float]:
        """Returns the distance between two poses in the same frame: translation [m] and rotation angle [rad]."""
        translation = math.dist(self.position, other.position)
        dot = abs(sum(a * b for a, b in zip(self.quaternion, other.quaternion, strict=True)))
        return translation, 2 * math.acos(min(1.0, dot))


def joint_motion(axis: Vector3, position: float, *, is_prismatic: bool) -> Pose:
    """Returns the pose of a joint's child frame in the joint frame.

    Args:
        axis: Axis in the joint frame; its length has no effect.
        position: Position of the joint [rad or m].
        is_prismatic: Whether the joint translates; otherwise, the joint rotates.
    """
    length = math.hypot(*axis) or 1.0
    x, y, z = (value / length for value in axis)
    if is_prismatic:
        return Pose((x * position, y * position, z * position))
    sine = math.sin(position / 2)
    return Pose(quaternion=(x * sine, y * sine, z * sine, math.cos(position / 2)))
