# SPDX-License-Identifier: BSD-3-Clause
"""Jacobian and forward kinematics of a joint chain from the robot's description."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from moveit_commander.joints import Joint


def jacobian(chain: Sequence[Joint], positions: Mapping[str, float], reference_point: Sequence[float]) -> Any:
    """Returns the Jacobian of a point of the last link, in the parent frame of the first joint.

    Args:
        chain: Joints from the base to the tip, including fixed joints.
        positions: Positions of the movable joints [rad or m].
        reference_point: Point in the frame of the last link [m].

    Returns:
        Array of shape (6, movable joints): linear rows [m or m/rad], then angular rows.
    """
    axes, rotation, position = _walk(chain, positions)
    point = position + rotation.apply(reference_point)
    columns = [
        np.concatenate([axis, np.zeros(3)])
        if joint.kind == "prismatic"
        else np.concatenate([np.cross(axis, point - origin), axis])
        for joint, axis, origin in axes
    ]
    return np.column_stack(columns)


def link_pose(chain: Sequence[Joint], positions: Mapping[str, float]) -> tuple[Rotation, Any]:
    """Returns the rotation and position [m] of the last link in the parent frame of the first joint."""
    _, rotation, position = _walk(chain, positions)
    return rotation, position


def _walk(chain: Sequence[Joint], positions: Mapping[str, float]) -> tuple[list[tuple[Joint, Any, Any]], Rotation, Any]:
    """Returns the axis and origin of each movable joint, and the pose of the last link, in the base frame."""
    rotation, position = Rotation.identity(), np.zeros(3)
    axes: list[tuple[Joint, Any, Any]] = []
    for joint in chain:
        position = position + rotation.apply(joint.xyz)
        rotation = rotation * Rotation.from_euler("xyz", joint.rpy)
        if not joint.is_movable:
            continue
        unit = np.asarray(joint.axis) / max(float(np.linalg.norm(joint.axis)), 1e-12)
        axis = rotation.apply(unit)
        axes.append((joint, axis, position))
        if joint.kind == "prismatic":
            position = position + axis * positions[joint.name]
        else:
            rotation = rotation * Rotation.from_rotvec(unit * positions[joint.name])
    return axes, rotation, position
