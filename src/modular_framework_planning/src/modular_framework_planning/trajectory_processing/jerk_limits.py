# SPDX-License-Identifier: BSD-3-Clause
"""Jerk-limited trajectories: Ruckig's along straight lines; slowed or averaged trajectories along curves."""

from __future__ import annotations

import numpy as np
import ruckig

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.time_parameterization import (
    MARGIN,
    join_trajectories,
    point_times,
    required_slowdown,
)
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

MAX_DEVIATION = 2.0e-3  # maximum deviation of an averaged curve from its path [rad or m]
MIN_LENGTH = 1.0e-9  # [rad or m]


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


def _straight_line(
    joint_names: tuple[str, ...], start: Array, end: Array, *, velocity: Array, acceleration: Array, jerk: Array
) -> Trajectory:
    """Returns Ruckig's fastest motion from rest to rest along a line."""
    length = float(np.linalg.norm(end - start))
    direction = (end - start) / length
    fraction = np.maximum(np.abs(direction), 1e-12)
    query = ruckig.InputParameter(1)
    query.current_position, query.target_position = [0.0], [length]
    query.max_velocity, query.max_acceleration, query.max_jerk = (
        [float((limit / fraction).min())] for limit in (velocity, acceleration, jerk)
    )
    profile = ruckig.Trajectory(1)
    result = ruckig.Ruckig(1).calculate(query, profile)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"Ruckig found no motion over {length} rad within velocity "
            f"{query.max_velocity}, acceleration {query.max_acceleration} and jerk {query.max_jerk}: "
            f"{result}",
        )
    times = point_times(np.cumsum(profile.profiles[0][0].t)[:-1], float(profile.duration))
    states = np.array([[item[0] for item in profile.at_time(time)] for time in times.tolist()])
    return Trajectory(
        joint_names, times, start + states[:, :1] * direction, states[:, 1:2] * direction, states[:, 2:] * direction
    )


def along_straight_lines(
    joint_names: tuple[str, ...], vertices: Array, velocity: Array, acceleration: Array, jerk: Array
) -> Trajectory:
    """Returns Ruckig's motion along a polyline, with a stop at each vertex.

    Args:
        joint_names: Joint names, in the order of the columns.
        vertices: Polyline, shape (n, joints) [rad or m].
        velocity: Velocity limits, shape (joints,) [rad/s or m/s].
        acceleration: Acceleration limits, shape (joints,) [rad/s^2 or m/s^2].
        jerk: Jerk limits, shape (joints,) [rad/s^3 or m/s^3].

    Raises:
        PlanningError: Ruckig found no motion.
    """
    distinct = vertices[np.append(True, np.linalg.norm(np.diff(vertices, axis=0), axis=1) > MIN_LENGTH)]
    if len(distinct) < 2:
        still = np.zeros_like(distinct)
        return Trajectory(joint_names, np.zeros(1), distinct, still, still)
    parts = [
        slowed_to_limits(
            _straight_line(joint_names, start, end, velocity=velocity, acceleration=acceleration, jerk=jerk),
            velocity,
            acceleration,
            jerk,
        )
        for start, end in zip(distinct[:-1], distinct[1:], strict=True)
    ]
    return join_trajectories(parts)


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
