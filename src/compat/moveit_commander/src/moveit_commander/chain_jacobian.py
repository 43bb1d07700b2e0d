# SPDX-License-Identifier: BSD-3-Clause
"""Jacobian and end of a chain of joints, from the robot's description alone."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from moveit_commander.robot_model import Joint


def _rotation(axis: Sequence[float], angle: float) -> Any:
    """Rotation matrix about an axis by an angle [rad] (Rodrigues)."""
    unit = np.asarray(axis, dtype=float)
    unit = unit / max(float(np.linalg.norm(unit)), 1e-12)
    skew = np.array([[0.0, -unit[2], unit[1]], [unit[2], 0.0, -unit[0]], [-unit[1], unit[0], 0.0]])
    return np.eye(3) + math.sin(angle) * skew + (1.0 - math.cos(angle)) * (skew @ skew)


def _origin_rotation(rpy: Sequence[float]) -> Any:
    return _rotation((0, 0, 1), rpy[2]) @ _rotation((0, 1, 0), rpy[1]) @ _rotation((1, 0, 0), rpy[0])


def jacobian(chain: Sequence[Joint], positions: Mapping[str, float], reference_point: Sequence[float]) -> Any:
    """Velocity of a point of the last link per joint velocity, in the frame of the first joint's parent link.

    Args:
        chain: joints from the base to the tip, fixed ones included.
        positions: of the movable ones [rad or m].
        reference_point: the point in the frame of the last link [m].

    Returns:
        Array of shape (6, movable joints): linear [m/s], then angular [rad/s].
    """
    axes, turn, place = _walk(chain, positions)
    point = place + turn @ np.asarray(reference_point, dtype=float)
    columns = [np.concatenate([axis, np.zeros(3)]) if joint.kind == "prismatic"
               else np.concatenate([np.cross(axis, point - origin), axis]) for joint, axis, origin in axes]
    return np.column_stack(columns)


def link_pose(chain: Sequence[Joint], positions: Mapping[str, float]) -> tuple[Any, Any]:
    """Rotation matrix and position [m] of the last link in the frame of the first joint's parent link."""
    _, turn, place = _walk(chain, positions)
    return turn, place


def _walk(chain: Sequence[Joint], positions: Mapping[str, float]) -> tuple[list[tuple[Joint, Any, Any]], Any, Any]:
    """Each movable joint with its axis and origin, then rotation and position of the last link; in the base's frame."""
    turn, place = np.eye(3), np.zeros(3)
    axes: list[tuple[Joint, Any, Any]] = []
    for joint in chain:
        place = place + turn @ np.asarray(joint.xyz)
        turn = turn @ _origin_rotation(joint.rpy)
        if not joint.movable:
            continue
        axis = turn @ (np.asarray(joint.axis) / max(float(np.linalg.norm(joint.axis)), 1e-12))
        axes.append((joint, axis, place))
        if joint.kind == "prismatic":
            place = place + axis * positions[joint.name]
        else:
            turn = turn @ _rotation(joint.axis, positions[joint.name])
    return axes, turn, place
