# SPDX-License-Identifier: BSD-3-Clause
"""Time parameterization of Cartesian lines given as dense joint positions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.time_parameterization import parameterize
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

MAX_BLENDED_ANGLE = 0.3  # maximum angle between two edges in joint space without a stop [rad]
CHECK_STEP = 0.01  # joint displacement between checked states [rad or m]
VERTEX_TOLERANCE = 1.0e-7  # distance below which consecutive rows are merged [rad or m]


def time_line(
    joints: tuple[str, ...], rows: Array, velocity: Array, acceleration: Array, is_free: Callable[[Array], bool]
) -> Trajectory:
    """Returns the fastest free trajectory along dense joint positions, with stops only at sharp angles if possible.

    Args:
        joints: Joint names, in the order of the columns of `rows`.
        rows: Joint positions from `straight_line`, shape (n, joints) [rad or m].
        velocity: Velocity limits, shape (joints,) [rad/s or m/s].
        acceleration: Acceleration limits, shape (joints,) [rad/s^2 or m/s^2].
        is_free: Checks that a curve of shape (m, joints) is free.

    Raises:
        PlanningError: The trajectory that stops at every row is not free either.
    """
    vertices = rows[np.concatenate([[True], np.abs(np.diff(rows, axis=0)).max(axis=1) > VERTEX_TOLERANCE])]
    for max_angle in (MAX_BLENDED_ANGLE, 0.0):
        trajectory = parameterize(joints, vertices, blend_sizes(vertices, max_angle), velocity, acceleration)
        if is_free(trajectory.curve(CHECK_STEP)):
            return trajectory
    raise PlanningError(
        ErrorCode.INVALID_MOTION_PLAN,
        "the trajectory along the lines is in collision; keep the lines farther away from obstacles",
    )


def blend_sizes(vertices: Array, max_angle: float) -> Array:
    """Returns the blend size at each inner vertex, shape (n - 2,); 0 for a stop."""
    spans = np.diff(vertices, axis=0)
    lengths = np.linalg.norm(spans, axis=1)
    cosines = np.einsum("ij,ij->i", spans[:-1], spans[1:]) / np.maximum(lengths[:-1] * lengths[1:], 1e-300)
    half_lengths = 0.5 * np.minimum(lengths[:-1], lengths[1:])
    return np.where(cosines >= np.cos(max_angle), half_lengths, 0.0) if max_angle > 0.0 else np.zeros(len(half_lengths))
