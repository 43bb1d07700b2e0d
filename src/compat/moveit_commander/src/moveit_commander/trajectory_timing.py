# SPDX-License-Identifier: BSD-3-Clause
"""Retimes a path: its waypoints stay, and its velocities and accelerations are within the joint limits."""

from __future__ import annotations

from typing import Any

import numpy as np

from moveit_commander.exception import MoveItCommanderException

ALGORITHMS = (
    "iterative_time_parameterization",
    "iterative_spline_parameterization",
    "time_optimal_trajectory_generation",
)
GRID_POINTS = 20  # between two waypoints
SAME_POINT = 1e-6  # [rad or m] waypoints nearer to each other than this are one


def unwound(points: Any, continuous: Any) -> Any:
    """Returns waypoints in which joints without ends never jump by a turn, as in MoveIt; the first one stays.

    Args:
        points: shape (n, joints) [rad or m].
        continuous: which joints have no ends, shape (joints,).
    """
    array = np.asarray(points, dtype=float)
    steps = np.diff(array, axis=0)
    turns = np.where(np.asarray(continuous), np.round(steps / (2.0 * np.pi)), 0.0)
    return array - 2.0 * np.pi * np.concatenate([np.zeros_like(array[:1]), np.cumsum(turns, axis=0)])


def distinct(points: Any) -> Any:
    """Returns the indices of the waypoints that differ from the one before."""
    array = np.asarray(points, dtype=float)
    moved = np.linalg.norm(np.diff(array, axis=0), axis=1) > SAME_POINT
    return np.concatenate([[0], 1 + np.flatnonzero(moved)])


def retime(points: Any, velocity: Any, acceleration: Any) -> tuple[Any, Any, Any]:
    """Returns the fastest timing of a spline through the waypoints (TOPP-RA), at rest at both ends.

    Args:
        points: waypoints, shape (n >= 2, joints) [rad or m], each different from the one before.
        velocity: limits of the joints, shape (joints,) [rad/s or m/s].
        acceleration: limits of the joints, shape (joints,) [rad/s^2 or m/s^2].

    Returns:
        Times of the waypoints [s], shape (n,), strictly increasing; velocities and accelerations there, shape (n,
        joints).

    Raises:
        MoveItCommanderException: no timing keeps the limits.
    """
    from toppra import SplineInterpolator
    from toppra.algorithm import TOPPRA
    from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

    points = np.asarray(points, dtype=float)
    knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    path = SplineInterpolator(knots, points)
    grid = np.concatenate(
        [
            *(
                np.linspace(low, high, GRID_POINTS, endpoint=False)
                for low, high in zip(knots[:-1], knots[1:], strict=True)
            ),
            knots[-1:],
        ]
    )
    limits = [
        JointVelocityConstraint(np.column_stack([-velocity, velocity])),
        JointAccelerationConstraint(np.column_stack([-acceleration, acceleration])),
    ]
    _, speeds, _ = TOPPRA(limits, path, gridpoints=grid, solver_wrapper="seidel").compute_parameterization(0.0, 0.0)
    if speeds is None or not np.isfinite(speeds).all() or (speeds[1:-1] <= 0.0).any():
        raise MoveItCommanderException(
            "retime_trajectory: no timing of this path keeps the joint limits; are there sharp turns or limits of 0?"
        )
    steps = 2.0 * np.diff(grid) / (speeds[:-1] + speeds[1:])
    times = np.concatenate([[0.0], np.cumsum(steps)])
    changes = np.diff(speeds) / steps  # constant between two grid points
    at = np.arange(len(knots)) * GRID_POINTS
    tangents, curvatures = path(knots, 1), path(knots, 2)
    change = changes[np.minimum(at, len(changes) - 1)]
    return times[at], tangents * speeds[at, None], tangents * change[:, None] + curvatures * (speeds[at] ** 2)[:, None]
