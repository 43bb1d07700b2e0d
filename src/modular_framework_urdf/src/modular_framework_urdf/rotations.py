# SPDX-License-Identifier: BSD-3-Clause
"""Rotations as quaternions xyzw and as roll, pitch and yaw: rotations about the fixed axes x, then y, then z [rad].

Implemented without SciPy: its import delays the start of every node by 0.3 s, and its single rotations take ten times
as long. The simulation composes thousands of rotations per second. Tested against SciPy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

POLE_RAD = 1e-7  # distance of the pitch from +-pi/2 below which roll and yaw are not distinguishable


def quaternion_from_rpy(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Returns the unit quaternion (x, y, z, w) of roll, pitch and yaw (REP 103).

    Args:
        roll: Angle about x [rad].
        pitch: Angle about y [rad].
        yaw: Angle about z [rad].
    """
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def quaternion_from_matrix(rows: Sequence[Sequence[float]]) -> Quaternion:
    """Returns the unit quaternion of the rows of a rotation matrix; its largest component is positive.

    Divides by the largest component only (Shepperd, 1978), which keeps the precision for every rotation.
    """
    trace = rows[0][0] + rows[1][1] + rows[2][2]
    diagonal = [rows[0][0], rows[1][1], rows[2][2]]
    vector = [rows[2][1] - rows[1][2], rows[0][2] - rows[2][0], rows[1][0] - rows[0][1]]
    if trace >= max(diagonal):
        x, y, z, w = *vector, 1.0 + trace
    else:
        largest = diagonal.index(max(diagonal))
        row = [rows[i][largest] + rows[largest][i] for i in range(3)]
        row[largest] = 1.0 - trace + 2.0 * diagonal[largest]
        x, y, z, w = *row, vector[largest]
    norm = math.hypot(x, y, z, w)
    return (x / norm, y / norm, z / norm, w / norm)


def matrix_from_rpy(roll: float, pitch: float, yaw: float) -> tuple[Vector3, Vector3, Vector3]:
    """Returns the rows of the rotation matrix of roll, pitch and yaw (REP 103).

    Args:
        roll: Angle about x [rad].
        pitch: Angle about y [rad].
        yaw: Angle about z [rad].
    """
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )


def rpy_from_quaternion(quaternion: Sequence[float]) -> Vector3:
    """Returns roll, pitch and yaw [rad], with pitch in [-pi/2, pi/2]. At the limits of the pitch, the yaw is 0.

    Computes sum and difference of roll and yaw first (Bernardes and Viollet, 2022), which keeps the precision near the
    limits of the pitch.

    Raises:
        ValueError: The norm of the quaternion is 0.
    """
    x, y, z, w = quaternion
    if not math.hypot(x, y, z, w) > 0.0:
        raise ValueError(f"({x}, {y}, {z}, {w}) is not a rotation; the norm of a quaternion must be above 0")
    upper, lower = math.hypot(w + y, z - x), math.hypot(w - y, x + z)
    pitch = 2 * math.atan2(upper, lower) - math.pi / 2
    half_sum, half_difference = math.atan2(x + z, w - y), math.atan2(z - x, w + y)
    if math.pi / 2 - abs(pitch) < POLE_RAD:
        roll, yaw = (-2 * half_difference if pitch > 0.0 else 2 * half_sum), 0.0
    else:
        roll, yaw = half_sum - half_difference, half_sum + half_difference
    return math.remainder(roll, 2 * math.pi), pitch, math.remainder(yaw, 2 * math.pi)


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
    """Returns a vector rotated by a unit quaternion."""
    x, y, z, w = quaternion
    vx, vy, vz = vector
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )
