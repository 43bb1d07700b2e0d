# SPDX-License-Identifier: BSD-3-Clause
"""Times the joint positions of straight lines: as fast as the joints can, with a stop only at sharp corners."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.time_parameterization import parameterize
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

SHARPEST_TURN = 0.3  # [rad] between two steps in joint space; at a sharper one the motion stops
CHECK_STEP = 0.01  # [rad or m] between the checked states of the curve
SAME_POSITION = 1.0e-7  # [rad or m]


def time_line(
    joints: tuple[str, ...], rows: Array, velocity: Array, acceleration: Array, is_free: Callable[[Array], bool]
) -> Trajectory:
    """Times dense joint positions.

    Args:
        joints: columns of `rows`.
        rows: as straight_line returns them, shape (n, joints).
        velocity: limits of shape (joints,) [rad/s or m/s].
        acceleration: limits of shape (joints,) [rad/s^2 or m/s^2].
        is_free: whether a curve, shape (m, joints), may be run along; asked about the rounded motion.

    Raises:
        PlanningError: not even the motion that stops at every row is free.
    """
    vertices = rows[np.concatenate([[True], np.abs(np.diff(rows, axis=0)).max(axis=1) > SAME_POSITION])]
    for sharpest in (SHARPEST_TURN, 0.0):
        trajectory = parameterize(joints, vertices, corner_distances(vertices, sharpest), velocity, acceleration)
        if is_free(trajectory.curve(CHECK_STEP)):
            return trajectory
    raise PlanningError(
        ErrorCode.INVALID_MOTION_PLAN,
        "the timed motion along the lines touches something; keep the lines further away from it",
    )


def corner_distances(vertices: Array, sharpest: float) -> Array:
    """Returns how far before and after each inner vertex the motion may leave the polyline; 0 means: stop there."""
    spans = np.diff(vertices, axis=0)
    lengths = np.linalg.norm(spans, axis=1)
    cosines = np.einsum("ij,ij->i", spans[:-1], spans[1:]) / np.maximum(lengths[:-1] * lengths[1:], 1e-300)
    nearer = 0.5 * np.minimum(lengths[:-1], lengths[1:])
    return np.where(cosines >= np.cos(sharpest), nearer, 0.0) if sharpest > 0.0 else np.zeros(len(nearer))
