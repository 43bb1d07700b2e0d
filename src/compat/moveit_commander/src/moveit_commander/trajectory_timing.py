# SPDX-License-Identifier: BSD-3-Clause
"""Retimes a path with fixed waypoints, so that the controller's interpolation stays within the joint limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from moveit_commander.exception import MoveItCommanderException

ALGORITHMS = (
    "iterative_time_parameterization",
    "iterative_spline_parameterization",
    "time_optimal_trajectory_generation",
)
GRID_POINTS = 20  # per segment between two waypoints
MIN_DISTANCE = 1e-6  # [rad or m]; closer waypoints are merged
SAMPLES = 64  # per segment; the peak of a cubic exceeds the largest sample by at most 0.2 %
MARGIN = 2e-3  # safety margin, as a fraction of the limits
BOUND_TOLERANCE = 1e-4  # [rad or m]


@dataclass(frozen=True, slots=True, eq=False)
class Limits:
    """Joint limits, each of shape (joints,) [rad or m, per s, per s^2]."""

    lower: Any
    upper: Any
    velocity: Any
    acceleration: Any


def unwound(points: Any, continuous: Any) -> Any:
    """Returns waypoints whose continuous joints never jump by 2 pi, as in MoveIt; the first waypoint is unchanged.

    Args:
        points: Waypoints, shape (n, joints) [rad or m].
        continuous: Whether each joint is continuous, shape (joints,).
    """
    array = np.asarray(points, dtype=float)
    steps = np.diff(array, axis=0)
    turns = np.where(np.asarray(continuous), np.round(steps / (2.0 * np.pi)), 0.0)
    return array - 2.0 * np.pi * np.concatenate([np.zeros_like(array[:1]), np.cumsum(turns, axis=0)])


def distinct(points: Any) -> Any:
    """Returns the indices of the waypoints that differ from their predecessor."""
    array = np.asarray(points, dtype=float)
    moved = np.linalg.norm(np.diff(array, axis=0), axis=1) > MIN_DISTANCE
    return np.concatenate([[0], 1 + np.flatnonzero(moved)])


@dataclass(frozen=True, slots=True, eq=False)
class Timing:
    """Times of waypoints [s], shape (n,), with velocities and accelerations, shape (n, joints)."""

    times: Any
    velocities: Any
    accelerations: Any


def retime(points: Any, limits: Limits) -> Timing:
    """Returns fast times for waypoints; the motion starts and ends at rest. Times are rounded to nanoseconds.

    TOPP-RA computes the times of a cubic spline through the waypoints. Controllers interpolate with quintics instead,
    which have continuous accelerations. Therefore the motion is slowed uniformly until the quintics satisfy the limits.
    If the spline exceeds a bound, or takes longer than a motion that stops at all waypoints, a monotone spline is used.
    If the monotone spline has the same problem, the motion stops at all waypoints.

    Args:
        points: Waypoints, shape (n >= 2, joints) [rad or m], each different from its predecessor.
        limits: Joint limits; position bounds are widened to include all waypoints.

    Raises:
        MoveItCommanderException: A velocity or acceleration limit is not above 0.
    """
    points = np.asarray(points, dtype=float)
    if not (min(limits.velocity.min(), limits.acceleration.min()) > 0.0):
        raise MoveItCommanderException(
            f"retime_trajectory: velocity limits {limits.velocity.tolist()} and acceleration limits "
            f"{limits.acceleration.tolist()}; all must be above 0"
        )
    slowest = _timing_with_stops(points, limits)
    return _spline_timing(False, points, limits, slowest) or _spline_timing(True, points, limits, slowest) or slowest


def _timing_with_stops(points: Any, limits: Limits) -> Timing:
    """Returns the timing that stops at each waypoint; peaks: v = 15/8 d/T, a = 10/sqrt(3) d/T^2."""
    spans = np.abs(np.diff(points, axis=0))
    durations = np.maximum(
        1.875 * spans / limits.velocity, np.sqrt(10.0 / np.sqrt(3.0) * spans / limits.acceleration)
    ).max(axis=1)
    times = np.concatenate([[0.0], np.cumsum(durations * (1.0 + MARGIN))])
    return Timing(np.round(times, 9), np.zeros_like(points), np.zeros_like(points))


def _spline_timing(is_monotone: bool, points: Any, limits: Limits, slowest: Timing) -> Timing | None:
    """Returns the timing of a spline, or None if it exceeds the bounds or is not faster than the slowest timing."""
    from scipy.interpolate import BPoly

    timing = _time_optimal_timing(is_monotone, points, limits)
    if timing is None:
        return None
    times, velocities, accelerations = timing.times, timing.velocities, timing.accelerations
    curve = BPoly.from_derivatives(times, np.stack([points, velocities, accelerations], axis=1))
    samples = np.linspace(times[:-1], times[1:], SAMPLES, axis=1)
    positions = curve(samples)
    lower, upper = np.minimum(limits.lower, points.min(axis=0)), np.maximum(limits.upper, points.max(axis=0))
    if (positions < lower - BOUND_TOLERANCE).any() or (positions > upper + BOUND_TOLERANCE).any():
        return None
    velocity_ratio = np.abs(curve(samples, 1) / limits.velocity).max()
    acceleration_ratio = np.abs(curve(samples, 2) / limits.acceleration).max()
    factor = max(1.0, velocity_ratio, np.sqrt(acceleration_ratio)) * (1.0 + MARGIN)
    times = np.round(times * factor, 9)
    return Timing(times, velocities / factor, accelerations / factor**2) if times[-1] < slowest.times[-1] else None


def _time_optimal_timing(is_monotone: bool, points: Any, limits: Limits) -> Timing | None:
    """Returns the time-optimal timing of a spline through the waypoints, or None if TOPP-RA fails."""
    from scipy.interpolate import PchipInterpolator
    from toppra import SplineInterpolator
    from toppra.algorithm import TOPPRA
    from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint
    from toppra.simplepath import SimplePath

    knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    path = (
        SimplePath(knots, points, PchipInterpolator(knots, points, axis=0)(knots, 1))
        if is_monotone
        else SplineInterpolator(knots, points)
    )
    grid = np.concatenate(
        [
            *(
                np.linspace(low, high, GRID_POINTS, endpoint=False)
                for low, high in zip(knots[:-1], knots[1:], strict=True)
            ),
            knots[-1:],
        ]
    )
    constraints = [
        JointVelocityConstraint(np.column_stack([-limits.velocity, limits.velocity])),
        JointAccelerationConstraint(np.column_stack([-limits.acceleration, limits.acceleration])),
    ]
    _, speeds, _ = TOPPRA(constraints, path, gridpoints=grid, solver_wrapper="seidel").compute_parameterization(
        0.0, 0.0
    )
    if speeds is None or not np.isfinite(speeds).all() or (speeds[1:-1] <= 0.0).any():
        return None
    steps = 2.0 * np.diff(grid) / (speeds[:-1] + speeds[1:])
    times = np.concatenate([[0.0], np.cumsum(steps)])
    path_accelerations = np.diff(speeds) / steps  # constant between two grid points
    knot_indices = np.arange(len(knots)) * GRID_POINTS
    tangents, curvatures = path(knots, 1), path(knots, 2)
    knot_accelerations = path_accelerations[np.minimum(knot_indices, len(path_accelerations) - 1)]
    accelerations = tangents * knot_accelerations[:, None] + curvatures * (speeds[knot_indices] ** 2)[:, None]
    return Timing(times[knot_indices], tangents * speeds[knot_indices, None], accelerations)
