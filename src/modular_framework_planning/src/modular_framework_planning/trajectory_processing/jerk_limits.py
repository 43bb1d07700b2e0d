# SPDX-License-Identifier: BSD-3-Clause
"""Jerk-limited trajectories: slowed or averaged."""

from __future__ import annotations

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.time_parameterization import (
    MARGIN,
    point_times,
    required_slowdown,
)
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

MAX_DEVIATION = 2.0e-3  # maximum deviation of an averaged curve from its path [rad or m]


def required_jerk_slowdown(trajectory: Trajectory, velocity: Array, acceleration: Array, jerk: Array) -> float:
    """Returns the factor by which the trajectory must be slowed to satisfy all limits, at least 1.

    Args:
        trajectory: Trajectory of the joints.
        velocity: Velocity limits, shape (joints,) [rad/s or m/s].
        acceleration: Acceleration limits, shape (joints,) [rad/s^2 or m/s^2].
        jerk: Jerk limits, shape (joints,) [rad/s^3 or m/s^3].
    """
    if len(trajectory.times) < 2:
        return 1.0
    fraction = float((_max_jerks(trajectory) / jerk).max())
    return max(required_slowdown(trajectory, velocity, acceleration), fraction ** (1.0 / 3.0))


def _max_jerks(trajectory: Trajectory) -> Array:
    """Returns the maximum jerk of each joint, at the ends and the extremum of each parabola, shape (joints,)."""
    c3, c4, c5 = np.moveaxis(trajectory.coefficients, 1, 0)[3:]
    spans = np.diff(trajectory.times)[:, None]
    extrema = np.clip(-0.2 * c4 / np.where(c5 == 0.0, np.inf, c5), 0.0, spans)
    return np.max(
        [np.abs(6.0 * c3 + t * (24.0 * c4 + t * 60.0 * c5)) for t in (0.0 * spans, extrema, spans)], axis=(0, 1)
    )


def slowed_to_limits(trajectory: Trajectory, velocity: Array, acceleration: Array, jerk: Array) -> Trajectory:
    """Returns the trajectory, slowed uniformly until it satisfies all limits.

    Args:
        trajectory: Trajectory to slow.
        velocity: Limits (n,) [rad/s or m/s].
        acceleration: Limits (n,) [rad/s^2 or m/s^2].
        jerk: Limits (n,) [rad/s^3 or m/s^3].
    """
    usable = 1.0 - MARGIN
    return trajectory.with_slowdown(
        required_jerk_slowdown(trajectory, velocity * usable, acceleration * usable, jerk * usable)
    )


def _integrals(trajectory: Trajectory, times: Array) -> Array:
    """Returns the integrals of the positions from time 0; the joints are at rest before and after the motion."""
    powers = np.arange(1.0, 7.0)
    coefficients = trajectory.coefficients / powers[:, None]
    spans = np.diff(trajectory.times)
    piece_integrals = np.einsum("npj,np->nj", coefficients, spans[:, None] ** powers)
    areas = np.concatenate([np.zeros_like(piece_integrals[:1]), np.cumsum(piece_integrals, axis=0)])
    clipped = np.clip(times, 0.0, trajectory.duration_s)
    segment = np.clip(np.searchsorted(trajectory.times, clipped, side="right") - 1, 0, len(spans) - 1)
    offsets = (clipped - trajectory.times[segment])[:, None]
    area = areas[segment] + np.einsum("npj,np->nj", coefficients[segment], offsets**powers)
    return area + (times - clipped)[:, None] * trajectory.sample(clipped).positions


def averaged_curve(trajectory: Trajectory, velocity: Array, acceleration: Array, jerk: Array) -> Trajectory:
    """Returns the moving average of the trajectory over a window that satisfies the jerk limits.

    The window w is the maximum of 2 a / j over the joints. Averaging makes a curve deviate from its path by a w^2 / 24.
    Slowing the trajectory by a factor k first reduces the deviation by k^6; k is chosen for MAX_DEVIATION.

    Args:
        trajectory: Trajectory of the joints.
        velocity: Velocity limits, shape (joints,) [rad/s or m/s].
        acceleration: Acceleration limits, shape (joints,) [rad/s^2 or m/s^2].
        jerk: Jerk limits, shape (joints,) [rad/s^3 or m/s^3].
    """
    if len(trajectory.times) < 2:
        return trajectory
    max_acceleration = np.abs(trajectory.sample(trajectory.sample_times()).accelerations).max(axis=0)
    window = float((2.0 * max_acceleration / jerk).max())
    deviation = float(max_acceleration.max()) * window * window / 24.0
    factor = max(1.0, (deviation / MAX_DEVIATION) ** (1.0 / 6.0))
    slower = trajectory.with_slowdown(factor)
    window = max(window / factor**2, 1e-3)
    times = point_times(np.array([window]), slower.duration_s + window)
    before, after = slower.sample(times - window), slower.sample(times)
    positions = (_integrals(slower, times) - _integrals(slower, times - window)) / window
    velocities, accelerations = ((after[order] - before[order]) / window for order in (0, 1))
    positions[0], positions[-1] = trajectory.positions[0], trajectory.positions[-1]
    return slowed_to_limits(
        Trajectory(trajectory.joint_names, times, positions, velocities, accelerations), velocity, acceleration, jerk
    )
