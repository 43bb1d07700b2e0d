# SPDX-License-Identifier: BSD-3-Clause
"""Smooth motions through waypoints with given times, which keep the velocity and acceleration limits of the joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

SAMPLES = 33  # per segment; the peak velocity of a cubic exceeds the largest sample by at most 0.1 %
MARGIN = 2e-3  # safety margin, as a fraction of the limits


@dataclass(frozen=True, slots=True, eq=False)
class SmoothTiming:
    """Times of waypoints [s], shape (n,), and velocities [rad/s or m/s], shape (n, joints)."""

    times: Array
    velocities: Array


def smooth_timing(times: Array, positions: Array, max_velocities: Array, max_accelerations: Array) -> SmoothTiming:
    """Returns times and velocities for which the controller's cubics through the waypoints keep the limits.

    The motion starts and ends at rest, and no joint overshoots a waypoint (monotone interpolation of Fritsch and
    Carlson). The given times are kept if possible; otherwise, each part of the motion between two points of rest, such
    as pauses, is slowed down uniformly.

    Args:
        times: Increasing times of the waypoints, shape (n >= 2,) [s].
        positions: Waypoints, shape (n, joints) [rad or m].
        max_velocities: Velocity limits, shape (joints,) [rad/s or m/s]; infinite for no limit.
        max_accelerations: Acceleration limits, shape (joints,) [rad/s^2 or m/s^2]; infinite for no limit.

    Raises:
        ValueError: The times do not increase.
    """
    from scipy.interpolate import CubicHermiteSpline, PchipInterpolator  # slow to import

    steps = np.diff(times)
    if (steps <= 0.0).any():
        number = int(np.argmax(steps <= 0.0)) + 1
        raise ValueError(
            f"point {number} has the time {times[number]:g} s, and the point before has {times[number - 1]:g} s; give "
            "each point a later time than the point before"
        )
    velocities = np.asarray(PchipInterpolator(times, positions, axis=0)(times, 1))
    velocities[[0, -1]] = 0.0
    excess = _excess(CubicHermiteSpline(times, positions, velocities), (max_velocities, max_accelerations))
    part = np.cumsum(~velocities.any(axis=1)) - 1  # of each waypoint; a part begins at a point of rest
    factors = np.array([excess[part[:-1] == number].max(initial=1.0) for number in range(part[-1] + 1)])
    slowed = np.concatenate([times[:1], times[0] + np.cumsum(steps * factors[part[:-1]])])
    return SmoothTiming(np.round(slowed, 9), velocities / factors[part][:, None])


def _excess(curve: Any, limits: tuple[Array, Array]) -> Array:
    """Returns the factor by which each segment must be slowed down, at least 1, shape (n - 1,).

    Args:
        curve: SciPy's cubics through the n waypoints.
        limits: Velocity and acceleration limits, each of shape (joints,).
    """
    steps = np.diff(curve.x)
    speeds = curve(curve.x[:-1] + np.linspace(0.0, 1.0, SAMPLES)[:, None] * steps, 1)
    rates, starts = curve.derivative(2).c
    ends = starts + rates * steps[:, None]
    velocity_ratio = (np.abs(speeds).max(axis=0) / limits[0]).max(axis=1)
    acceleration_ratio = (np.maximum(np.abs(starts), np.abs(ends)) / limits[1]).max(axis=1)
    ratio = np.maximum(velocity_ratio, np.sqrt(acceleration_ratio)) * (1.0 + MARGIN)
    return np.maximum(ratio, 1.0)
