# SPDX-License-Identifier: BSD-3-Clause
"""Timings within jerk limits: Ruckig's along straight lines; averaged or slowed motions along curves."""

from __future__ import annotations

import numpy as np
import ruckig

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.trajectory_processing.time_parameterization import MARGIN, joined, overrun, point_times
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

MAX_DEVIATION = 2.0e-3  # [rad or m] that averaging may take a curve off its path
SHORTEST_LENGTH = 1.0e-9  # [rad or m]


def jerk_overrun(trajectory: Trajectory, velocity: Array, acceleration: Array, jerk: Array) -> float:
    """Returns how many times slower the curve must run to keep all three limits; 1 where it keeps them."""
    if len(trajectory.times) < 2:
        return 1.0
    share = float((_largest_jerks(trajectory) / jerk).max())
    return max(overrun(trajectory, velocity, acceleration), share ** (1.0 / 3.0))


def _largest_jerks(trajectory: Trajectory) -> Array:
    """Largest jerk of each joint: that of a parabola at its ends and its turning point, shape (joints,)."""
    c3, c4, c5 = np.moveaxis(trajectory.coefficients, 1, 0)[3:]
    spans = np.diff(trajectory.times)[:, None]
    turns = np.clip(-0.2 * c4 / np.where(c5 == 0.0, np.inf, c5), 0.0, spans)
    return np.max(
        [np.abs(6.0 * c3 + t * (24.0 * c4 + t * 60.0 * c5)) for t in (0.0 * spans, turns, spans)], axis=(0, 1)
    )


def slowed_to_limits(trajectory: Trajectory, velocity: Array, acceleration: Array, jerk: Array) -> Trajectory:
    """Returns the same curve, slowed evenly by as much as its worst sample needs."""
    kept = 1.0 - MARGIN
    return trajectory.slowed(jerk_overrun(trajectory, velocity * kept, acceleration * kept, jerk * kept))


def _straight_line(
    joint_names: tuple[str, ...], start: Array, end: Array, velocity: Array, acceleration: Array, jerk: Array
) -> Trajectory:
    """Ruckig's fastest motion from rest to rest along one line."""
    length = float(np.linalg.norm(end - start))
    direction = (end - start) / length
    share = np.maximum(np.abs(direction), 1e-12)
    query = ruckig.InputParameter(1)
    query.current_position, query.target_position = [0.0], [length]
    query.max_velocity, query.max_acceleration, query.max_jerk = (
        [float((limit / share).min())] for limit in (velocity, acceleration, jerk)
    )
    found = ruckig.Trajectory(1)
    result = ruckig.Ruckig(1).calculate(query, found)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise PlanningError(
            ErrorCode.INVALID_MOTION_PLAN,
            f"Ruckig found no motion over {length} rad within velocity "
            f"{query.max_velocity}, acceleration {query.max_acceleration}, jerk {query.max_jerk}: "
            f"{result}",
        )
    times = point_times(np.cumsum(found.profiles[0][0].t)[:-1], float(found.duration))
    states = np.array([[item[0] for item in found.at_time(time)] for time in times.tolist()])
    return Trajectory(
        joint_names, times, start + states[:, :1] * direction, states[:, 1:2] * direction, states[:, 2:] * direction
    )


def along_straight_lines(
    joint_names: tuple[str, ...], vertices: Array, velocity: Array, acceleration: Array, jerk: Array
) -> Trajectory:
    """Returns Ruckig's motion along a polyline with a stop at each of its vertices, shape (n, joints).

    Raises:
        PlanningError: Ruckig gave up.
    """
    kept = vertices[np.append(True, np.linalg.norm(np.diff(vertices, axis=0), axis=1) > SHORTEST_LENGTH)]
    if len(kept) < 2:
        still = np.zeros_like(kept)
        return Trajectory(joint_names, np.zeros(1), kept, still, still)
    parts = [
        slowed_to_limits(
            _straight_line(joint_names, start, end, velocity, acceleration, jerk), velocity, acceleration, jerk
        )
        for start, end in zip(kept[:-1], kept[1:], strict=True)
    ]
    return joined(parts)


def _integrals(trajectory: Trajectory, times: Array) -> Array:
    """Integrals of the positions from time 0; the motion rests before and after."""
    powers = np.arange(1.0, 7.0)
    coefficients = trajectory.coefficients / powers[:, None]
    spans = np.diff(trajectory.times)
    piece_integrals = np.einsum("npj,np->nj", coefficients, spans[:, None] ** powers)
    areas = np.concatenate([np.zeros_like(piece_integrals[:1]), np.cumsum(piece_integrals, axis=0)])
    inner = np.clip(times, 0.0, trajectory.duration_s)
    segment = np.clip(np.searchsorted(trajectory.times, inner, side="right") - 1, 0, len(spans) - 1)
    offsets = (inner - trajectory.times[segment])[:, None]
    area = areas[segment] + np.einsum("npj,np->nj", coefficients[segment], offsets**powers)
    return area + (times - inner)[:, None] * trajectory.at(inner)[0]


def averaged_curve(trajectory: Trajectory, velocity: Array, acceleration: Array, jerk: Array) -> Trajectory:
    """Returns a motion averaged over so long a window that its jerk keeps the limits.

    The window is 2 a / j for the hardest joint. Averaging takes curves off their path by a w^2 / 24, which running
    slower by k first lessens by k^6; k is chosen for MAX_DEVIATION.
    """
    if len(trajectory.times) < 2:
        return trajectory
    strongest = np.abs(trajectory.at(trajectory.sample_times())[2]).max(axis=0)
    window = float((2.0 * strongest / jerk).max())
    deviation = float(strongest.max()) * window * window / 24.0
    factor = max(1.0, (deviation / MAX_DEVIATION) ** (1.0 / 6.0))
    slower = trajectory.slowed(factor)
    window = max(window / factor**2, 1e-3)
    times = point_times(np.array([window]), slower.duration_s + window)
    before, after = slower.at(times - window), slower.at(times)
    positions = (_integrals(slower, times) - _integrals(slower, times - window)) / window
    velocities, accelerations = ((after[order] - before[order]) / window for order in (0, 1))
    positions[0], positions[-1] = trajectory.positions[0], trajectory.positions[-1]
    return slowed_to_limits(
        Trajectory(trajectory.joint_names, times, positions, velocities, accelerations), velocity, acceleration, jerk
    )
