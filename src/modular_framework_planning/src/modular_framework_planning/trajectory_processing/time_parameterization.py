# SPDX-License-Identifier: BSD-3-Clause
"""Time-optimal parameterization of a path within velocity and acceleration limits, sampled for a controller.

The accelerations of a time-optimal motion jump, and the polynomials between trajectory points would overshoot the
limits at these jumps. The motion is therefore averaged over a short time window, which makes the acceleration
continuous and keeps the limits. Points are placed at jumps of the jerk, so that the controller's quintics follow
straight pieces exactly and blends closely.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.blended_path import free_blends
from modular_framework_planning.trajectory_processing.compiled_timing import (
    SAMPLES_PER_SEGMENT,
    max_blends,
    max_limit_fractions,
    spread_times,
    timed_points,
)
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

WINDOW_S = 0.04  # averaging window
MAX_PERIOD_S, MIN_PERIOD_S = 0.02, 0.004  # default bounds of the time between two points
MARGIN = 1.0e-3  # margin for values between the checked samples, as a fraction of the limits


def point_times(requested: Array, end: float, max_period_s: float = MAX_PERIOD_S) -> Array:
    """Returns times from 0 to `end` that include the requested times; see `spread_times`.

    Args:
        requested: Requested times, in any order [s].
        end: Last time [s].
        max_period_s: Maximum time between two points [s].
    """
    return spread_times(np.ascontiguousarray(requested, dtype=float), float(end), max_period_s, MIN_PERIOD_S)


def required_slowdown(trajectory: Trajectory, velocity: Array, acceleration: Array) -> float:
    """Returns the factor by which the trajectory must be slowed to satisfy the limits, at least 1.

    Args:
        trajectory: Trajectory of the joints.
        velocity: Velocity limits, shape (joints,) [rad/s or m/s].
        acceleration: Acceleration limits, shape (joints,) [rad/s^2 or m/s^2].
    """
    velocity_fraction, acceleration_fraction = max_limit_fractions(
        trajectory.times, trajectory.coefficients, velocity, acceleration, SAMPLES_PER_SEGMENT
    )
    return max(1.0, velocity_fraction, float(np.sqrt(acceleration_fraction)))


def _sections(vertices: Array, blends: Array) -> list[tuple[Array, Array]]:
    """Splits the polyline at the vertices without blend; returns the vertices and blend sizes of each part."""
    stops = [0, *(index + 1 for index, blend in enumerate(blends) if blend <= 0.0), len(vertices) - 1]
    return [(vertices[low : high + 1], blends[low : high - 1]) for low, high in zip(stops[:-1], stops[1:], strict=True)]


def parameterize(
    joint_names: tuple[str, ...],
    vertices: Array,
    blends: Array,
    velocity: Array,
    acceleration: Array,
    *,
    max_period_s: float = MAX_PERIOD_S,
) -> Trajectory:
    """Returns the time-optimal trajectory along a polyline with blends.

    The curve of the trajectory satisfies the limits. In blends, averaging makes the curve leave the path by at most
    acceleration * window^2 / 24.

    Args:
        joint_names: Joint names, in the order of the columns of `vertices`.
        vertices: Polyline without repeated vertices, shape (n, joints) [rad or m].
        blends: Blend sizes at the inner vertices, shape (n - 2,); 0 for a stop.
        velocity: Scaled velocity limits, shape (joints,) [rad/s or m/s].
        acceleration: Scaled acceleration limits, shape (joints,) [rad/s^2 or m/s^2].
        max_period_s: Maximum time between two points [s].

    Raises:
        PlanningError: A limit is not above 0.
    """
    if not (
        np.isfinite(velocity).all()
        and np.isfinite(acceleration).all()
        and (velocity > 0).all()
        and (acceleration > 0).all()
    ):
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"velocity limits are {velocity.tolist()} and acceleration "
            f"limits are {acceleration.tolist()}; all must be finite and above 0",
        )
    if len(vertices) < 2:
        still = np.zeros_like(vertices)
        return Trajectory(joint_names, np.zeros(1), vertices.copy(), still, still.copy())
    usable = 1.0 - MARGIN
    vertices, blends, velocity, acceleration = (
        np.ascontiguousarray(item, dtype=float) for item in (vertices, blends, velocity * usable, acceleration * usable)
    )
    periods = WINDOW_S, float(max_period_s), MIN_PERIOD_S
    parts = [timed_points(*section, velocity, acceleration, *periods) for section in _sections(vertices, blends)]
    return join_trajectories([Trajectory(joint_names, times, *values) for times, values in parts])


def join_trajectories(parts: Sequence[Trajectory]) -> Trajectory:
    """Returns the concatenation of trajectories that start and end at rest."""
    ends = np.cumsum([0.0, *(part.duration_s for part in parts)])
    times = np.concatenate(
        [parts[0].times, *(part.times[1:] + end for part, end in zip(parts[1:], ends[1:-1], strict=True))]
    )
    columns = [
        np.concatenate([getattr(parts[0], name), *(getattr(part, name)[1:] for part in parts[1:])])
        for name in ("positions", "velocities", "accelerations")
    ]
    return Trajectory(parts[0].joint_names, np.round(times, 9), *columns)


def warm_up() -> None:
    """Compiles the loops of this module or loads them from the cache, so that the first motion is not delayed."""
    limits = np.ones(2)
    vertices = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    motion = parameterize(("a", "b"), vertices, np.array([0.1]), limits, limits)
    motion.chords()
    motion.curve(0.1)
    point_times(motion.times, motion.duration_s)
    required_slowdown(motion.with_slowdown(2.0), limits, limits)
    free_blends(vertices, max_blends(vertices, 0.1), lambda samples: len(samples) > 0)
