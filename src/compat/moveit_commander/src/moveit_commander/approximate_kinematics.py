# SPDX-License-Identifier: BSD-3-Clause
"""Approximate inverse kinematics: joint values that minimise the pose error of a link without an exact solution."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from moveit_commander.chain_jacobian import jacobian, link_pose
from moveit_commander.joints import Joint

STEPS = 200
DAMPING = 0.02  # damping near singularities [m]
MAX_STEP = 0.3  # [rad or m]
STANDSTILL = 1e-6


def nearest_values(
    chain: Sequence[Joint],
    free: Sequence[Joint],
    start: Mapping[str, float],
    complete: Callable[[Mapping[str, float]], Mapping[str, float]],
    *,
    rotation: Rotation,
    position: Any,
) -> dict[str, float]:
    """Returns joint positions within bounds with the smallest pose error found by damped least squares.

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
    movable = [joint.name for joint in chain if joint.is_movable]
    values = {joint.name: joint.bounded(start[joint.name]) for joint in free}
    best, min_error = dict(values), math.inf
    for _ in range(STEPS):
        full_positions = complete({**start, **values})
        current_rotation, current_position = link_pose(chain, full_positions)
        rotation_error = (rotation * current_rotation.inv()).as_rotvec()
        error = np.concatenate([np.asarray(position) - current_position, rotation_error])
        if float(np.linalg.norm(error)) < min_error:
            best, min_error = dict(values), float(np.linalg.norm(error))
        full = jacobian(chain, full_positions, (0.0, 0.0, 0.0))
        columns = np.column_stack([_column(full, movable, chain, joint) for joint in free])
        step = columns.T @ np.linalg.solve(columns @ columns.T + DAMPING**2 * np.eye(6), error)
        step *= min(1.0, MAX_STEP / max(float(np.abs(step).max()), STANDSTILL))
        moved = {
            joint.name: min(max(values[joint.name] + float(change), joint.lower), joint.upper)
            if joint.kind != "continuous"
            else values[joint.name] + float(change)
            for joint, change in zip(free, step, strict=True)
        }
        if max(abs(moved[name] - values[name]) for name in moved) < STANDSTILL:
            break
        values = moved
    return best


def _column(full: Any, movable: Sequence[str], chain: Sequence[Joint], joint: Joint) -> Any:
    """Returns the Jacobian column of a joint, including the chain's joints that mimic it, shape (6,)."""
    factors = {
        item.name: item.multiplier if item.leader == joint.name else 1.0
        for item in chain
        if joint.name in (item.name, item.leader)
    }
    return sum(
        (factor * full[:, movable.index(name)] for name, factor in factors.items() if name in movable), np.zeros(6)
    )


def rotation_and_position(pose: Sequence[float]) -> tuple[Rotation, Any]:
    """Returns the rotation and position [m] of a pose [x, y, z, qx, qy, qz, qw]."""
    return Rotation.from_quat(pose[3:]), np.array(pose[:3])
