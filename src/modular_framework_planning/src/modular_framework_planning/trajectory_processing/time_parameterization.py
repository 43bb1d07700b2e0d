# SPDX-License-Identifier: BSD-3-Clause
"""Gives a path its fastest timing within velocity and acceleration limits, sampled for a controller.

The fastest timing has jumps in acceleration, which the polynomials a controller puts between two points cannot follow
without swinging over the limits. So the motion is averaged over a short time window: averages of what is within limits
are within limits, and the acceleration becomes continuous. Points are set where its slope jumps, so that the
controller's quintics follow it exactly on straight pieces and nearly so in rounded corners.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.blended_path import free_blends
from modular_framework_planning.trajectory_processing.compiled_timing import (
    SAMPLES_PER_SEGMENT,
    largest_blends,
    largest_shares,
    spread_times,
    timed_points,
)
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

WINDOW_S = 0.04  # over which the fastest motion is averaged
LONGEST_PERIOD_S, SHORTEST_PERIOD_S = 0.02, 0.004  # between two points, unless longer ones are asked for
MARGIN = 1.0e-3  # share of the limits kept free for what happens between the checked samples


def point_times(wanted: Array, end: float, longest_period_s: float = LONGEST_PERIOD_S) -> Array:
    """Returns times from 0 to `end`: the wanted ones, where not too near to each other, and evenly between."""
    return spread_times(np.ascontiguousarray(wanted, dtype=float), float(end), longest_period_s, SHORTEST_PERIOD_S)


def overrun(trajectory: Trajectory, velocity: Array, acceleration: Array) -> float:
    """Returns how many times slower the curve through the points must run to keep the limits; 1 where it keeps them."""
    fastest, hardest = largest_shares(
        trajectory.times, trajectory.coefficients, velocity, acceleration, SAMPLES_PER_SEGMENT
    )
    return max(1.0, fastest, float(np.sqrt(hardest)))


def _sections(vertices: Array, blends: Array) -> list[tuple[Array, Array]]:
    """Cuts the polyline at the corners where the motion stops; returns vertices and corner distances of each part."""
    stops = [0, *(number + 1 for number, blend in enumerate(blends) if blend <= 0.0), len(vertices) - 1]
    return [(vertices[low : high + 1], blends[low : high - 1]) for low, high in zip(stops[:-1], stops[1:], strict=True)]


def parameterize(
    joint_names: tuple[str, ...],
    vertices: Array,
    blends: Array,
    velocity: Array,
    acceleration: Array,
    longest_period_s: float = LONGEST_PERIOD_S,
) -> Trajectory:
    """Times a polyline with blended corners.

    Args:
        joint_names: columns of `vertices`.
        vertices: shape (n, joints), neighbours differ.
        blends: corner distances of shape (n - 2,); 0 stops at the corner.
        velocity: limits of shape (joints,), scaling already applied [rad/s or m/s].
        acceleration: limits of shape (joints,), scaling already applied [rad/s^2 or m/s^2].
        longest_period_s: between two points [s].

    Returns:
        Points whose curve (see Trajectory) keeps the limits; it leaves the path by no more than the averaging of
        curves does, acceleration times window squared by 24.

    Raises:
        PlanningError: a limit is not above 0.
    """
    if not (
        np.isfinite(velocity).all()
        and np.isfinite(acceleration).all()
        and (velocity > 0).all()
        and (acceleration > 0).all()
    ):
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"velocity limits {velocity.tolist()} and acceleration "
            f"limits {acceleration.tolist()}: all must be finite and above 0",
        )
    if len(vertices) < 2:
        still = np.zeros_like(vertices)
        return Trajectory(joint_names, np.zeros(1), vertices.copy(), still, still.copy())
    kept = 1.0 - MARGIN
    vertices, blends, velocity, acceleration = (
        np.ascontiguousarray(item, dtype=float) for item in (vertices, blends, velocity * kept, acceleration * kept)
    )
    periods = WINDOW_S, float(longest_period_s), SHORTEST_PERIOD_S
    parts = [timed_points(*section, velocity, acceleration, *periods) for section in _sections(vertices, blends)]
    return joined([Trajectory(joint_names, times, *values) for times, values in parts])


def joined(parts: Sequence[Trajectory]) -> Trajectory:
    """Returns one trajectory of several that follow each other, from rest to rest each."""
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
    """Compiles the loops of this module, or loads them: the first motion then waits for nothing."""
    limits = np.ones(2)
    vertices = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    motion = parameterize(("a", "b"), vertices, np.array([0.1]), limits, limits)
    motion.chords()
    motion.curve(0.1)
    point_times(motion.times, motion.duration_s)
    overrun(motion.slowed(2.0), limits, limits)
    free_blends(vertices, largest_blends(vertices, 0.1), lambda samples: len(samples) > 0)
