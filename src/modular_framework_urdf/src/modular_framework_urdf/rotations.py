# SPDX-License-Identifier: BSD-3-Clause
"""Rotations as quaternions xyzw and as roll, pitch and yaw: turns about the fixed axes x, then y, then z [rad].

Conversions are SciPy's. Products are written out: SciPy takes ten times as long for a single one, and the simulation
composes thousands a second.
"""

from __future__ import annotations

from collections.abc import Sequence

from scipy.spatial.transform import Rotation

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


def quaternion_from_rpy(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Returns the unit quaternion of roll, pitch and yaw [rad] (REP 103)."""
    x, y, z, w = Rotation.from_euler("xyz", (roll, pitch, yaw)).as_quat().tolist()
    return x, y, z, w


def rpy_from_quaternion(quaternion: Sequence[float]) -> Vector3:
    """Returns roll, pitch and yaw [rad], pitch within [-pi/2, pi/2]; at its ends the yaw is chosen as 0.

    Raises:
        ValueError: the quaternion has no length.
    """
    roll, pitch, yaw = Rotation.from_quat(quaternion).as_euler("xyz", suppress_warnings=True).tolist()
    return roll, pitch, yaw


def multiply_quaternions(a: Sequence[float], b: Sequence[float]) -> Quaternion:
    """Returns the quaternion of rotation b followed by rotation a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def rotate_vector(quaternion: Sequence[float], vector: Sequence[float]) -> Vector3:
    """Returns the vector turned by a unit quaternion."""
    x, y, z, w = quaternion
    vx, vy, vz = vector
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )
