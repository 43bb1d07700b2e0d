# SPDX-License-Identifier: BSD-3-Clause
"""Rigid transforms of the simulated world, small enough to be composed thousands of times a second."""

from __future__ import annotations

import math
from dataclasses import dataclass

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

_IDENTITY_ROTATION: Quaternion = (0.0, 0.0, 0.0, 1.0)
_ORIGIN: Vector3 = (0.0, 0.0, 0.0)


def quaternion_from_rpy(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Returns the xyzw quaternion of rotations about the fixed x, then y, then z axis [rad]."""
    sr, cr = math.sin(roll / 2), math.cos(roll / 2)
    sp, cp = math.sin(pitch / 2), math.cos(pitch / 2)
    sy, cy = math.sin(yaw / 2), math.cos(yaw / 2)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def rpy_from_quaternion(quaternion: Quaternion) -> Vector3:
    """Returns roll, pitch and yaw [rad] of an xyzw quaternion, pitch within [-pi/2, pi/2]."""
    x, y, z, w = quaternion
    sin_pitch = max(-1.0, min(1.0, 2 * (w * y - z * x)))
    if abs(sin_pitch) > 1 - 1e-9:
        return (0.0, math.copysign(math.pi / 2, sin_pitch), -2 * math.copysign(1.0, sin_pitch) * math.atan2(x, w))
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return (roll, math.asin(sin_pitch), yaw)


def normalised_quaternion(quaternion: Quaternion) -> Quaternion:
    """Returns the quaternion at unit length; all zeros (an unset message) is the identity.

    Raises:
        ValueError: An element is not finite, or the length is neither zero nor within 10 % of one.
    """
    norm = math.sqrt(sum(value * value for value in quaternion))
    if norm == 0.0:
        return _IDENTITY_ROTATION
    if not math.isfinite(norm) or not 0.9 < norm < 1.1:
        raise ValueError(f"quaternion {list(quaternion)} has length {norm:.4g}; expected 1")
    x, y, z, w = quaternion
    return (x / norm, y / norm, z / norm, w / norm)


def multiply_quaternions(a: Quaternion, b: Quaternion) -> Quaternion:
    """Returns the xyzw quaternion of rotation b followed by rotation a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def rotate_vector(quaternion: Quaternion, vector: Vector3) -> Vector3:
    """Returns the vector turned by a unit xyzw quaternion."""
    x, y, z, w = quaternion
    vx, vy, vz = vector
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )


@dataclass(frozen=True, slots=True)
class Pose:
    """A rigid transform: the pose of a child frame in its parent frame.

    Attributes:
        position: Origin of the child frame [m].
        quaternion: Unit rotation, xyzw.
    """

    position: Vector3 = _ORIGIN
    quaternion: Quaternion = _IDENTITY_ROTATION

    @staticmethod
    def from_xyz_rpy(xyz: Vector3, rpy: Vector3) -> Pose:
        """Builds a pose from a position [m] and roll, pitch, yaw [rad]."""
        return Pose(xyz, quaternion_from_rpy(*rpy))

    def __matmul__(self, other: Pose) -> Pose:
        """Returns the pose of other's child frame in this pose's parent frame."""
        x, y, z = rotate_vector(self.quaternion, other.position)
        px, py, pz = self.position
        return Pose((px + x, py + y, pz + z), multiply_quaternions(self.quaternion, other.quaternion))

    def inverse(self) -> Pose:
        """Returns the pose of the parent frame in the child frame."""
        x, y, z, w = self.quaternion
        back = (-x, -y, -z, w)
        px, py, pz = rotate_vector(back, self.position)
        return Pose((-px, -py, -pz), back)

    def distance_to(self, other: Pose) -> tuple[float, float]:
        """Returns how far apart two poses of one frame are: translation [m] and rotation angle [rad]."""
        translation = math.dist(self.position, other.position)
        dot = abs(sum(a * b for a, b in zip(self.quaternion, other.quaternion, strict=True)))
        return translation, 2 * math.acos(min(1.0, dot))
