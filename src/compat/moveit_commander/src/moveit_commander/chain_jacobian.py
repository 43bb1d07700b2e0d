# SPDX-License-Identifier: BSD-3-Clause
"""Kinematics of a joint chain from the robot's description: Jacobian, pose of a link, and nearest joint values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import least_squares
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


def nearest_values(
    chain: Sequence[Joint],
    free: Sequence[Joint],
    start: Mapping[str, float],
    complete: Callable[[Mapping[str, float]], Mapping[str, float]],
    *,
    rotation: Rotation,
    position: Any,
) -> dict[str, float]:
    """Minimises the pose error of a link by least squares, within the joint bounds.

    Args:
        chain: Joints from the base to the link, including fixed joints.
        free: Joints that may move, without mimic joints.
        start: Positions of the robot's joints [rad or m].
        complete: Function that adds the positions of mimic joints.
        rotation: Target rotation of the link in the base frame.
        position: Target position of the link in the base frame, shape (3,) [m].

    Returns:
        Positions of the free joints. The error sums metres and radians, as in inverse kinematics.
    """
    bounds = {
        joint.name: (-math.inf, math.inf) if joint.kind == "continuous" else (joint.lower, joint.upper)
        for joint in free
    }
    begin = {joint.name: joint.bounded(start[joint.name]) for joint in free}
    names = [name for name, (lower, upper) in bounds.items() if lower < upper]

    def pose_error(values: Any) -> Any:
        moved = complete({**start, **begin, **dict(zip(names, values, strict=True))})
        _, reached_rotation, reached_position = _walk(chain, moved)
        return np.concatenate([position - reached_position, (rotation * reached_rotation.inv()).as_rotvec()])

    found = least_squares(
        pose_error, [begin[name] for name in names], bounds=np.transpose([bounds[name] for name in names])
    )
    return begin | dict(zip(names, found.x.tolist(), strict=True))


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
